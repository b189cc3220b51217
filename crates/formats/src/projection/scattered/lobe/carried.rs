//! Narrow lobe that a projection carries beside its cells, with its notes and warnings.

use crate::domain::{Lobe, LobeCentre};
use crate::formats::with_digits;
use serde::{Deserialize, Serialize};

/// Least number of samples within half maximum of a resolved lobe.
pub(super) const RESOLVED: u64 = 3;

/// A narrow lobe beside the cells of a projection: the measurement is the sum of both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CarriedLobe {
    /// Function of the lobe, with a colour for each wavelength of the tensor.
    pub lobe: Lobe,
    /// Full widths at half maximum along both axes at normal incidence, in degrees of outgoing directions.
    pub full_width: [f64; 2],
    /// Number of samples of all incidences within half maximum.
    pub samples_within_half: u64,
    /// True if these samples suffice to determine the width of the lobe and its light.
    pub is_resolved: bool,
    /// Smallest and largest light of a lobe that agrees with the samples: mean albedo over the measured incidences,
    /// for a colour of 1. `None` if many samples determine it.
    pub light_range: Option<[f64; 2]>,
    /// Light of the lobe itself: mean albedo over the measured incidences, for a colour of 1.
    pub light: f64,
    /// Elevations of the incidences to which the lobe was fitted, in degrees.
    pub incidences: Vec<f64>,
    /// Fraction of the light removed because more light than comes in would have been reflected; `None` if none was.
    pub reduced: Option<f64>,
    /// Number of bands without a sample of the lobe; they have the colour of their neighbours.
    pub unseen_bands: usize,
}

impl CarriedLobe {
    /// Returns a sentence for the user on the lobe.
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

    /// Returns a warning if the scan does not resolve the lobe.
    pub fn warning(&self) -> Option<String> {
        let [low, high] = self.light_range.filter(|_| !self.is_resolved)?;
        let about = if self.lobe.centre() == LobeCentre::Source { "direction back" } else { "mirror direction" };
        Some(format!(
            "a lobe narrower than the scan resolves: fewer than three samples of all incidences lie within half its \
             maximum; its albedo, the mean over incidences and bands, lies between {} and {}; measure more densely about \
             the {about}",
            with_digits(low, 3),
            with_digits(high, 3)
        ))
    }
}
