//! Physical plausibility of a file before it is processed: albedo, reciprocity, negative values, lobe width.

mod albedo;
mod negative;
mod reciprocity;
mod sides;
mod table;
#[cfg(test)]
mod tests;

pub use albedo::{Band, LargestAlbedo};
pub use negative::Negatives;
pub use reciprocity::Reciprocity;

use super::lobe_width::unresolved_lobe;
use crate::domain::{Measurement, Note, NoteKind};
use crate::formats::Acquisition;

/// Least median deviation from reciprocity of a projected measurement that is warned of: 0.3 is 30 %. Noise stays below
/// it; a cosine too many does not. Raising it warns less often.
const UNRECIPROCAL: f64 = 0.3;
/// Least share of negative values of a projected measurement that is warned of: 0.01 is 1 %. Noise around values near 0
/// has less. Raising it warns less often.
const MANY_NEGATIVE: f64 = 0.01;

/// Results of the checks of a file for physical plausibility; `None` for checks that do not apply.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plausibility {
    /// Largest directional albedo of the file.
    pub albedo: Option<LargestAlbedo>,
    /// Difference between values f(wi, wo) and f(wo, wi), which reciprocity makes equal.
    pub reciprocity: Option<Reciprocity>,
    /// Number of negative values, and magnitude of the most negative one relative to the largest value.
    pub negatives: Option<Negatives>,
    /// Remark on a lobe that is no wider than the detector aperture or the source divergence of the instrument.
    pub unresolved: Option<Note>,
}

/// Checks the values of a file, unchanged, for physical plausibility. Takes about a second at most: of very large files
/// a part is checked, always the same part.
pub fn plausibility(acquisition: &Acquisition) -> Plausibility {
    Plausibility {
        albedo: LargestAlbedo::of(acquisition),
        reciprocity: Reciprocity::of(acquisition),
        negatives: Negatives::of(acquisition),
        unresolved: unresolved_lobe(acquisition),
    }
}

/// Returns warnings about a measurement that is to be compressed with the relative error `error`: an albedo above 1 by
/// more than its error, values that are far from reciprocal, and many negative values. They have the words of the
/// [remarks](Plausibility::remarks) on a file.
pub fn implausible(measurement: &Measurement, error: f64) -> Vec<Note> {
    let albedo = LargestAlbedo::of_measurement(measurement).filter(|albedo| albedo.is_above_by_more_than(error));
    let reciprocity = Reciprocity::of_measurement(measurement);
    // Interpolation between coarse directions differs from reciprocity by itself.
    let reciprocity = reciprocity.filter(|found| found.difference > UNRECIPROCAL && !found.is_interpolated);
    // Spectra and tables of coefficients may be negative.
    let is_light = measurement.quantity.directions() > 0;
    let negatives = Negatives::among(measurement.tensor.samples()).filter(|found| found.share() > MANY_NEGATIVE);
    let negatives = negatives.filter(|_| is_light);
    let remarks = Plausibility { albedo, reciprocity, negatives, unresolved: None }.remarks();
    remarks.into_iter().map(|note| Note { kind: NoteKind::Warning, ..note }).collect()
}

impl Plausibility {
    /// Returns notes for the user: on an albedo above 1, on the deviation from reciprocity, on negative values, and on
    /// an unresolved lobe.
    pub fn remarks(&self) -> Vec<Note> {
        let albedo = self.albedo.as_ref().and_then(LargestAlbedo::remark).map(Note::from);
        let reciprocity = self.reciprocity.as_ref().map(|reciprocity| reciprocity.remark().into());
        let negatives = self.negatives.as_ref().map(|negatives| negatives.remark().into());
        // A compression warns of it; before that, it is one of the checks.
        let unresolved = self.unresolved.clone().map(|note| Note { kind: NoteKind::Checked, ..note });
        [albedo, reciprocity, negatives, unresolved].into_iter().flatten().collect()
    }
}
