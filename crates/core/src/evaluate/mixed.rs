//! Rows of coefficients with their share of light, and means of such rows.

use super::reconstruct::STEEPEST;

/// Maximum number of coefficients in a row; spectra that need more are kept whole.
pub(super) const MOST_PLANES: usize = 16;
/// Presence (share of light) up to which a place counts as dark.
pub(super) const NO_LIGHT: f32 = 1e-4;
/// Row of coefficients on the stack.
pub(super) type Row = [f32; MOST_PLANES];

/// Interpolated row at a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mixed {
    pub(super) row: Row,
    /// Share of light; NaN if fully masked.
    pub(super) presence: f32,
}

impl Mixed {
    /// Row without light.
    pub(super) const NOTHING: Self = Self { row: [0.0; MOST_PLANES], presence: 0.0 };

    /// Normalises a weighted sum of rows, given the total weight of lit ones and of unmasked ones. Weights of a fit may
    /// be negative and nearly cancel.
    #[inline(always)]
    pub(super) fn settled(mut row: Row, live: f32, known: f32) -> Self {
        let mut presence = 0.0;
        if live > NO_LIGHT {
            let share = 1.0 / live;
            for value in &mut row {
                *value *= share;
            }
            presence = (live / known).clamp(0.0, 1.0);
        }
        Self { row, presence: if known > NO_LIGHT { presence } else { f32::NAN } }
    }
}

/// Rows mixed by weight and presence; masked ones are skipped. Weights of a fit may be negative. If rows are missing
/// and the remaining weights nearly cancel, the fit would extrapolate; then only positive weights count.
pub(super) struct Mixture {
    all: Sums,
    positive: Sums,
    /// Sum of the absolute weights.
    size: f32,
    /// True if a row was masked or partly dark.
    is_incomplete: bool,
}

/// Weighted sum of rows, and total weights of lit and of unmasked ones.
struct Sums {
    row: Row,
    live: f32,
    known: f32,
}

impl Sums {
    const NOTHING: Self = Self { row: [0.0; MOST_PLANES], live: 0.0, known: 0.0 };

    fn add(&mut self, mixed: &Mixed, weight: f32) {
        self.known += weight;
        if mixed.presence > 0.0 {
            let part = weight * mixed.presence;
            self.live += part;
            self.row.iter_mut().zip(mixed.row).for_each(|(sum, v)| *sum += part * v);
        }
    }
}

impl Mixture {
    pub(super) fn new() -> Self {
        Self { all: Sums::NOTHING, positive: Sums::NOTHING, size: 0.0, is_incomplete: false }
    }

    pub(super) fn add(&mut self, mixed: Mixed, weight: f32) {
        self.is_incomplete |= mixed.presence.is_nan() || mixed.presence < 1.0;
        if mixed.presence.is_nan() {
            return;
        }
        self.all.add(&mixed, weight);
        self.size += (weight * mixed.presence).abs();
        if weight > 0.0 {
            self.positive.add(&mixed, weight);
        }
    }

    pub(super) fn finish(self) -> Mixed {
        let extrapolates = self.is_incomplete && self.size > STEEPEST * self.all.live;
        let Sums { row, live, known } = if extrapolates { self.positive } else { self.all };
        Mixed::settled(row, live, known)
    }
}
