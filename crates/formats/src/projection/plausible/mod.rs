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
use crate::domain::{Note, NoteKind};
use crate::formats::Acquisition;

/// Results of the plausibility checks of a file; `None` for checks that do not apply.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plausibility {
    /// Largest directional albedo.
    pub albedo: Option<LargestAlbedo>,
    /// Difference of values that reciprocity makes equal.
    pub reciprocity: Option<Reciprocity>,
    /// Negative values.
    pub negatives: Option<Negatives>,
    /// Remark on a lobe that is no wider than an angle of the instrument.
    pub unresolved: Option<Note>,
}

/// Checks the values of a file, as stated, for physical plausibility. Takes about a second at most: of very large
/// files a part is checked, always the same one.
pub fn plausibility(acquisition: &Acquisition) -> Plausibility {
    Plausibility {
        albedo: LargestAlbedo::of(acquisition),
        reciprocity: Reciprocity::of(acquisition),
        negatives: Negatives::of(acquisition),
        unresolved: unresolved_lobe(acquisition),
    }
}

impl Plausibility {
    /// Returns a note for the user on each finding: albedo above 1, reciprocity, negative values, unresolved lobe.
    pub fn remarks(&self) -> Vec<Note> {
        let albedo = self.albedo.as_ref().and_then(LargestAlbedo::remark).map(Note::from);
        let reciprocity = self.reciprocity.as_ref().map(|reciprocity| reciprocity.remark().into());
        let negatives = self.negatives.as_ref().map(|negatives| negatives.remark().into());
        // A compression warns of it; before that, it is one of the checks.
        let unresolved = self.unresolved.clone().map(|note| Note { kind: NoteKind::Checked, ..note });
        [albedo, reciprocity, negatives, unresolved].into_iter().flatten().collect()
    }
}
