//! Rows of coefficients with their share of light, and means of such rows.

use super::reconstruct::STEEPEST;

/// Maximum number of spectral coefficients of a pair of directions. Spectra that need more are stored sample by sample.
pub(super) const MOST_PLANES: usize = 16;
/// Fraction of the interpolation weight on nonzero samples, 0 to 1, up to which the interpolated value of the
/// material's function counts as 0.
pub(super) const NO_LIGHT: f32 = 1e-4;
/// Spectral coefficients (factors of the basis spectra) of one pair of directions, on the stack.
pub(super) type Row = [f32; MOST_PLANES];

/// Interpolated spectral coefficients at a query, with the fraction of the interpolation weight that lies on nonzero
/// samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mixed {
    pub(super) row: Row,
    /// Interpolation weight of nonzero samples as a fraction of that of unmasked samples, 0 to 1; NaN if all are
    /// masked.
    pub(super) presence: f32,
}

impl Mixed {
    /// Result of interpolation where the material's function is 0: the spectral coefficients are 0, and so is the
    /// fraction of the interpolation weight that lies on nonzero samples.
    pub(super) const NOTHING: Self = Self { row: [0.0; MOST_PLANES], presence: 0.0 };

    /// Divides a weighted sum of spectral coefficients by `live`, the total interpolation weight of nonzero samples;
    /// `known` is that of unmasked samples. Weights from a least-squares fit may be negative and nearly cancel.
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

/// Weighted mean of spectral coefficients that skips masked and dark samples. Weights of a fit may be negative. If
/// samples are missing and the remaining weights nearly cancel, only positive weights count, as the fit would
/// extrapolate.
pub(super) struct Mixture {
    all: Sums,
    positive: Sums,
    /// Sum of the absolute interpolation weights of the nonzero samples added so far to a weighted mean.
    size: f32,
    /// True if a sample added so far to the weighted mean was masked, 0, or interpolated partly from samples that are
    /// 0.
    is_incomplete: bool,
}

/// Weighted sum of spectral coefficients, with the total interpolation weights of nonzero and of unmasked samples.
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
