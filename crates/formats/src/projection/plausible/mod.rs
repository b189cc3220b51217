//! Checks of a file against physics, before anything is made of it: its albedo, its reciprocity, its negative values.

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
use crate::formats::Acquisition;

/// Findings of the checks of a file against physics; `None` where a check does not apply to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plausibility {
    /// The largest directional albedo.
    pub albedo: Option<LargestAlbedo>,
    /// The difference of values that should be equal by reciprocity.
    pub reciprocity: Option<Reciprocity>,
    /// The negative values.
    pub negatives: Option<Negatives>,
    /// A remark on a lobe that looks no wider than an angle of the instrument.
    pub unresolved: Option<String>,
}

/// Checks the values of a file, where they are, against physics. Takes about a second at most: of very large files a
/// part is checked, the same one every time.
pub fn plausibility(acquisition: &Acquisition) -> Plausibility {
    Plausibility {
        albedo: LargestAlbedo::of(acquisition),
        reciprocity: Reciprocity::of(acquisition),
        negatives: Negatives::of(acquisition),
        unresolved: unresolved_lobe(acquisition),
    }
}

impl Plausibility {
    /// One line for people on each finding: an albedo above 1, reciprocity, negative values, a lobe no wider than the
    /// instrument resolves.
    pub fn remarks(&self) -> Vec<String> {
        let albedo = self.albedo.as_ref().and_then(LargestAlbedo::remark);
        let reciprocity = self.reciprocity.as_ref().map(Reciprocity::remark);
        let negatives = self.negatives.as_ref().map(Negatives::remark);
        [albedo, reciprocity, negatives, self.unresolved.clone()].into_iter().flatten().collect()
    }
}
