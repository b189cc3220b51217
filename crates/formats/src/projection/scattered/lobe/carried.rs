//! Narrow lobe that a projection carries beside its cells, with its notes and warnings.

use crate::domain::{Lobe, LobeCentre, Note};
use crate::formats::with_digits;
use crate::notes::LobeNote;
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
    /// Returns a note on the lobe.
    pub fn note(&self) -> Note {
        let note = LobeNote::Carried {
            lobe: self.lobe.to_string(),
            samples: self.samples_within_half,
            reduced_percent: self.reduced.map(|part| 100.0 * part),
            unseen_bands: self.unseen_bands,
        };
        note.into()
    }

    /// Returns a warning if the scan does not resolve the lobe.
    pub fn warning(&self) -> Option<Note> {
        let [low, high] = self.light_range.filter(|_| !self.is_resolved)?;
        let about = if self.lobe.centre() == LobeCentre::Source { "direction back" } else { "mirror direction" };
        let (least_albedo, largest_albedo) = (with_digits(low, 3), with_digits(high, 3));
        Some(LobeNote::NotResolved { least_albedo, largest_albedo, about }.into())
    }
}
