//! Uniform quantiser: one step for all coefficients, each normalised by the norm of its synthesis function.

use crate::domain::Axis;
use crate::transform::{Plan, Weights};
use rayon::prelude::*;

/// Widening of the quantiser's zero bin, in steps: coefficients within 0.5 + this become 0. Raising it drops more
/// coefficients.
const DEAD_ZONE: f32 = 0.12;
/// Shift of decoded coefficient magnitudes towards 0, in steps, because small coefficients are more frequent within a
/// bin.
const RECONSTRUCTION_OFFSET: f32 = 0.03;
/// Upper bound on the magnitude of a quantised coefficient.
pub(crate) const LARGEST: f32 = (1 << 30) as f32;

/// Norms of the synthesis functions of a tensor transform: `lanes` along the last axis, `rows` the products of those
/// along all others. A coefficient times both norms is in units of the sample error it makes if dropped.
pub(crate) struct Scales {
    rows: Vec<Scale>,
    lanes: Vec<Scale>,
}

/// Norm of a synthesis function, and 1 / norm, so that inner loops multiply instead of dividing.
#[derive(Clone, Copy)]
struct Scale {
    norm: f32,
    inverse: f32,
}

impl Scale {
    fn times(self, other: Self) -> Self {
        Self { norm: self.norm * other.norm, inverse: self.inverse * other.inverse }
    }
}

impl Scales {
    pub(crate) fn new(axes: &[Axis], plan: &Plan) -> Self {
        let norms = |axis| plan.norms(axis, Weights::Count);
        let mut rows = vec![1.0_f64];
        for axis in 0..axes.len().saturating_sub(1) {
            let norms = norms(axis);
            rows = rows.iter().flat_map(|row| norms.iter().map(move |norm| row * norm)).collect();
        }
        let lanes = axes.len().checked_sub(1).map_or_else(|| vec![1.0], norms);
        let single =
            |v: Vec<f64>| v.into_iter().map(|norm| Scale { norm: norm as f32, inverse: (1.0 / norm) as f32 }).collect();
        Self { rows: single(rows), lanes: single(lanes) }
    }

    /// Builds the table of coefficient norms for a single axis of `lanes` coefficients whose basis functions all have
    /// norm 1. One quantiser step then treats all coefficients alike.
    pub(crate) fn uniform(lanes: usize) -> Self {
        let one = Scale { norm: 1.0, inverse: 1.0 };
        Self { rows: vec![one], lanes: vec![one; lanes] }
    }

    /// Calls `each(coefficient, norm, result)` for every coefficient in `from`, in parallel, with the norm of its
    /// synthesis function. The call sets `result`, the element of `to` with the same index.
    fn for_each<A: Sync, B: Send>(&self, from: &[A], to: &mut [B], each: impl Fn(&A, Scale, &mut B) + Sync) {
        let n = self.lanes.len();
        // Blocks of whole rows, large enough to be worth a task.
        let block = (1_usize << 14).div_ceil(n);
        let rows = self.rows.par_chunks(block);
        rows.zip(from.par_chunks(block * n)).zip(to.par_chunks_mut(block * n)).for_each(|((rows, from), to)| {
            for ((row, from), to) in rows.iter().zip(from.chunks_exact(n)).zip(to.chunks_exact_mut(n)) {
                for ((lane, from), to) in self.lanes.iter().zip(from).zip(to) {
                    each(from, row.times(*lane), to);
                }
            }
        });
    }

    /// Multiplies coefficients by the norms of their synthesis functions, divides them by `step` and rounds them to
    /// integers, with a widened zero bin.
    pub(crate) fn quantise(&self, step: f32, coefficients: &[f32], quantised: &mut [i32]) {
        let inverse = 1.0 / step;
        self.for_each(coefficients, quantised, |&c, scale, q| *q = quantise(c, scale, inverse));
    }

    /// Converts quantised integers back to coefficients, with the quantiser step `step` and the norms of their
    /// synthesis functions.
    pub(crate) fn dequantise(&self, step: f32, quantised: &[i32], coefficients: &mut [f32]) {
        self.for_each(quantised, coefficients, |&q, scale, c| *c = dequantise(q, scale, step));
    }

    /// Quantises `coefficients` and converts the integers back, as a decoder does; `decoded` takes the results.
    pub(crate) fn requantise(&self, step: f32, coefficients: &[f32], decoded: &mut [f32]) {
        let inverse = 1.0 / step;
        self.for_each(coefficients, decoded, |&c, scale, d| *d = dequantise(quantise(c, scale, inverse), scale, step));
    }

    /// Keeps coefficients whose magnitude times the norm of their synthesis function reaches `threshold`, and sets the
    /// others to 0.
    pub(crate) fn threshold(&self, threshold: f32, coefficients: &[f32], kept: &mut [f32]) {
        self.for_each(coefficients, kept, |&c, scale, k| *k = if c.abs() * scale.norm >= threshold { c } else { 0.0 });
    }

    /// Counts the nonzero coefficients whose magnitude times the norm of their synthesis function reaches `threshold`.
    pub(crate) fn count_above(&self, threshold: f32, coefficients: &[f32]) -> u64 {
        self.count(coefficients, |c, scale| c != 0.0 && c.abs() * scale.norm >= threshold)
    }

    /// Counts the coefficients that are not quantised to 0 at `step`.
    pub(crate) fn count_kept(&self, step: f32, coefficients: &[f32]) -> u64 {
        let inverse = 1.0 / step;
        self.count(coefficients, |c, scale| quantise(c, scale, inverse) != 0)
    }

    /// Returns the threshold that exactly `count` coefficients reach (without ties) with their magnitude times the norm
    /// of their synthesis function; 0 if `count` includes all of them.
    pub(crate) fn threshold_of_count(&self, count: usize, coefficients: &[f32]) -> f32 {
        let mut magnitudes = vec![0.0; coefficients.len()];
        self.for_each(coefficients, &mut magnitudes, |&c, scale, m| *m = c.abs() * scale.norm);
        let Some(last) = count.checked_sub(1).filter(|&last| last < magnitudes.len()) else {
            return if count == 0 { f32::MAX } else { 0.0 };
        };
        *magnitudes.select_nth_unstable_by(last, |a, b| b.total_cmp(a)).1
    }

    /// Squared error of the samples, in an orthonormal basis, if `coefficients` are quantised with the step at which
    /// `count` of them do not become 0.
    pub(crate) fn lost(&self, count: usize, coefficients: &[f32]) -> f64 {
        let least = self.threshold_of_count(count, coefficients);
        let step = (least / (0.5 + DEAD_ZONE)).clamp(f32::MIN_POSITIVE, f32::MAX);
        let mut lost = vec![0.0_f64; coefficients.len()];
        let inverse = 1.0 / step;
        self.for_each(coefficients, &mut lost, |&c, scale, lost| {
            let error = f64::from(c - dequantise(quantise(c, scale, inverse), scale, step)) * f64::from(scale.norm);
            *lost = error * error;
        });
        lost.iter().sum()
    }

    fn count(&self, coefficients: &[f32], counts: impl Fn(f32, Scale) -> bool + Sync) -> u64 {
        let n = self.lanes.len();
        let rows = self.rows.par_iter().zip(coefficients.par_chunks_exact(n));
        rows.map(|(row, c)| c.iter().zip(&self.lanes).filter(|(c, lane)| counts(**c, row.times(**lane))).count() as u64)
            .sum()
    }
}

fn quantise(coefficient: f32, scale: Scale, inverse_step: f32) -> i32 {
    integer_of(coefficient * scale.norm * inverse_step)
}

/// Rounds a coefficient, given in quantiser steps, to an integer, with a widened zero bin.
pub(crate) fn integer_of(x: f32) -> i32 {
    let magnitude = (x.abs() + (0.5 - DEAD_ZONE)).min(LARGEST) as i32;
    if x < 0.0 { -magnitude } else { magnitude }
}

/// Decodes a quantised integer to a coefficient, in quantiser steps.
pub(crate) fn steps_of(quantised: i32) -> f32 {
    quantised as f32 - quantised.signum() as f32 * RECONSTRUCTION_OFFSET
}

fn dequantise(quantised: i32, scale: Scale, step: f32) -> f32 {
    steps_of(quantised) * step * scale.inverse
}
