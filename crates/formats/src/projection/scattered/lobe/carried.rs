//! The lobe that a projection carries beside its cells, and what is said of it.

use crate::domain::{Lobe, LobeCentre};
use serde::Serialize;

/// Samples within half the maximum below which the scan does not resolve a lobe.
pub(super) const RESOLVED: u64 = 3;

/// A lobe beside the cells of a projection: the measurement is the sum of both.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CarriedLobe {
    /// Its function, with a colour for each wavelength of the tensor.
    pub lobe: Lobe,
    /// Full widths at half the maximum along both axes under normal incidence, in degrees of outgoing directions.
    pub full_width: [f64; 2],
    /// Samples of all incidences within half the maximum.
    pub samples_within_half: u64,
    /// Whether these are enough to tell the width of the lobe and its light.
    pub is_resolved: bool,
    /// The least and the largest mean of its albedo over the measured incidences, for a colour of 1, with which the
    /// samples agree; `None` where many samples tell it.
    pub light_range: Option<[f64; 2]>,
    /// The same of the lobe itself.
    pub light: f64,
    /// Elevations of the incidences that it was fitted to, in degrees.
    pub incidences: Vec<f64>,
    /// The part of its light that was taken from it, as more light than comes in would have been reflected.
    pub reduced: Option<f64>,
    /// Bands without a sample of it, which have the colour of their neighbours.
    pub unseen_bands: usize,
}

impl CarriedLobe {
    /// A sentence on the lobe.
    pub fn note(&self) -> String {
        let count = self.samples_within_half;
        let lie = if count == 1 { "sample lies" } else { "samples lie" };
        let reduced = self.reduced.map_or_else(String::new, |part| {
            let part = 100.0 * part;
            format!("; its light was reduced by {part:.1} %, as more light than comes in would have been reflected")
        });
        let unseen = match self.unseen_bands {
            0 => String::new(),
            bands => format!("; {bands} bands without a sample of it have the colour of their neighbours"),
        };
        format!(
            "a lobe narrower than the cells is carried beside them: {}; {count} {lie} within half its maximum{}{}",
            self.lobe, reduced, unseen
        )
    }

    /// A warning of a lobe that the scan does not resolve.
    pub fn warning(&self) -> Option<String> {
        let [low, high] = self.light_range.filter(|_| !self.is_resolved)?;
        let about = if self.lobe.centre() == LobeCentre::Source { "direction back" } else { "mirror direction" };
        Some(format!(
            "a lobe narrower than the scan resolves: fewer than three samples of all incidences lie within half its \
             maximum; its light lies between {low:.2} and {high:.2} (albedo): more samples about the {about} tell"
        ))
    }
}
