//! Coder of the quantised details of a triangle pyramid, each in the context of magnitudes already coded.

use super::model::Model;
use super::range::BitCoder;
use super::symbols::{FINE, GOLOMB_SLOTS, LEVELS, MagnitudeSlots, NONZERO, code_golomb, code_magnitude, fine};

/// Context of a detail (a child's difference from its parent triangle): magnitudes of details already coded around it,
/// in sixteenths of a quantiser step. `None` if unknown.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Surroundings {
    /// Subdivision level of the triangle whose difference from its parent is coded; 1 for children of the coarsest
    /// triangles.
    pub level: u8,
    /// Mean magnitude of the details coded for the parent of the triangle being refined, in sixteenths of a quantiser
    /// step.
    pub parent: Option<u32>,
    /// Mean magnitude of the details already coded for neighbours of the triangle being refined, in sixteenths of a
    /// quantiser step.
    pub neighbours: Option<u32>,
    /// Mean magnitude of the details already coded for the triangle being refined, in sixteenths of a quantiser step.
    pub siblings: Option<u32>,
    /// Mean magnitude of the details that the triangle being refined has in the slice (one incoming direction and
    /// spectral component) coded before, in sixteenths of a quantiser step.
    pub before: Option<u32>,
}

const BY_NEAR: usize = 0;
const BY_BOTH: usize = BY_NEAR + FINE * LEVELS;
const BY_BEFORE: usize = BY_BOTH + FINE * FINE;
const MAGNITUDE: usize = BY_BEFORE + FINE * LEVELS;
const ROOT: usize = MAGNITUDE + MagnitudeSlots::COUNT;
const SLOTS: usize = ROOT + 2 * GOLOMB_SLOTS;
const SETS: usize = LEVELS + MagnitudeSlots::SETS;

/// Coder of the details of a pyramid of triangles, with adaptive probabilities.
pub(crate) struct DetailCoder {
    model: Model,
}

impl Default for DetailCoder {
    fn default() -> Self {
        let mut model = Model::new(SLOTS, SETS);
        for (class, &nonzero) in NONZERO.iter().enumerate() {
            for level in 0..LEVELS {
                model.prior(BY_NEAR + level * FINE + class, nonzero);
                model.prior(BY_BEFORE + level * FINE + class, nonzero);
            }
            for (other, &also) in NONZERO.iter().enumerate() {
                model.prior(BY_BOTH + class * FINE + other, also.midpoint(nonzero));
            }
        }
        MagnitudeSlots::at(MAGNITUDE).set_priors(&mut model);
        Self { model }
    }
}

impl DetailCoder {
    /// Encodes or decodes the difference between the mean of one coarsest triangle and that of the one coded before it;
    /// `first` is true if there is none before.
    pub(crate) fn code_root<C: BitCoder>(&mut self, coder: &mut C, first: bool, difference: i32) -> i32 {
        let slots = ROOT + usize::from(first) * GOLOMB_SLOTS;
        let magnitude = code_golomb(coder, &mut self.model, slots, difference.unsigned_abs()) as i32;
        if magnitude != 0 && coder.even(difference < 0) { -magnitude } else { magnitude }
    }

    /// Encodes or decodes a quantised detail (a child's difference from its parent triangle), in the context of the
    /// details around it.
    #[inline]
    pub(crate) fn code<C: BitCoder>(&mut self, coder: &mut C, around: &Surroundings, detail: i32) -> i32 {
        let level = usize::from(around.level).min(LEVELS - 1);
        let mut sum = 0;
        let mut weight = 0;
        for (known, trust) in [(around.parent, 2), (around.neighbours, 3), (around.siblings, 2), (around.before, 2)] {
            if let Some(magnitude) = known {
                sum += trust * magnitude.min(1 << 20);
                weight += trust;
            }
        }
        let near = fine(sum.checked_div(weight).unwrap_or(16));
        let before = fine(around.before.or(around.neighbours).or(around.parent).unwrap_or(16));
        let contexts =
            [BY_NEAR + level * FINE + near, BY_BOTH + before * FINE + near, BY_BEFORE + level * FINE + before];
        if !self.model.code(coder, detail != 0, contexts, level) {
            return 0;
        }
        let negative = coder.even(detail < 0);
        let slots = MagnitudeSlots::at(MAGNITUDE);
        let contexts = (near, before, level);
        let magnitude = code_magnitude(coder, &mut self.model, slots, LEVELS, detail.unsigned_abs(), contexts) as i32;
        if negative { -magnitude } else { magnitude }
    }
}
