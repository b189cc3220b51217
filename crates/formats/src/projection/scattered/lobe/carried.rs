//! Narrow lobe that a projection carries beside its cells, with its notes and warnings.

use crate::domain::{Lobe, LobeCentre, Note};
use crate::formats::with_digits;
use crate::notes::LobeNote;
use serde::{Deserialize, Serialize};

/// Least number of samples within half maximum of a lobe that determine its width and its light. Raising it warns of
/// more lobes.
pub(super) const RESOLVED: u64 = 3;

/// A narrow lobe that a projection stores beside its tensor: the measurement is the sum of both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct CarriedLobe {
    /// Brightness of the lobe as a function of incoming and outgoing direction, with a factor for each wavelength of
    /// the tensor.
    pub lobe: Lobe,
    /// Full widths at half maximum of the lobe along its two axes at normal incidence, in degrees of outgoing
    /// directions.
    pub full_width: [f64; 2],
    /// Number of samples, counted over all incoming directions, that lie in the part of the lobe above half of its
    /// maximum.
    pub samples_within_half: u64,
    /// True if the samples within half maximum suffice to determine the width of the lobe and its albedo.
    pub is_resolved: bool,
    /// Smallest and largest albedo that the lobe can have in agreement with the samples; `None` if enough samples
    /// determine its albedo.
    ///
    /// The albedo is that of the lobe alone, averaged over wavelengths and measured incoming directions.
    pub light_range: Option<[f64; 2]>,
    /// Albedo of the lobe alone, averaged over wavelengths and measured incoming directions.
    pub light: f64,
    /// Polar angles of the incoming directions to which the lobe was fitted, in degrees.
    pub incidences: Vec<f64>,
    /// Fraction of the lobe's light that was removed because the surface would have reflected more light than it
    /// receives; `None` if none was removed.
    pub reduced: Option<f64>,
    /// Number of bands in which no sample shows the lobe; the lobe has the colour factor of the nearest other band
    /// there.
    pub unseen_bands: usize,
}

impl CarriedLobe {
    /// Returns a note for the user: that a narrow lobe is stored beside the tensor, with its parameters and number of
    /// samples.
    pub fn note(&self) -> Note {
        let note = LobeNote::Carried {
            lobe: self.lobe.to_string(),
            samples: self.samples_within_half,
            reduced_percent: self.reduced.map(|part| 100.0 * part),
            unseen_bands: self.unseen_bands,
        };
        note.into()
    }

    /// Returns a warning if fewer than three measured samples lie in the part of the stored lobe above half of its
    /// maximum, so that its width and its light are uncertain.
    pub fn warning(&self) -> Option<Note> {
        let [low, high] = self.light_range.filter(|_| !self.is_resolved)?;
        let about = if self.lobe.centre() == LobeCentre::Source { "direction back" } else { "mirror direction" };
        let (least_albedo, largest_albedo) = (with_digits(low, 3), with_digits(high, 3));
        Some(LobeNote::NotResolved { least_albedo, largest_albedo, about }.into())
    }
}
