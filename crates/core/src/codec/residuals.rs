//! Coder of quantised residuals with a logistic density of known variance, corrected by adaptive slots.
//!
//! Logistic densities of 256 scales are tabulated as integers, so that decoding evaluates no exponential. The tables
//! are computed with the pure Rust `libm`.

use super::model::{LOG_ODDS, Model};
use super::range::BitCoder;
use super::symbols::{GOLOMB_SLOTS, code_golomb};
use std::sync::LazyLock;

/// Number of tabulated variances per factor of two. Raising it distinguishes the variances of residuals more finely.
const PER_OCTAVE: i32 = 8;
/// Number of standard deviations for which logistic densities are tabulated: variances from 2^−10 to 2^22 squared
/// quantiser steps.
const SCALES: usize = 256;
/// Index, in the table of logistic densities of prediction errors, of the density for a variance of one squared
/// quantiser step.
const UNIT_SCALE: i32 = 80;
/// Number of tabulated decisions on the magnitude of a residual: larger than 0, 1, 2, …, 15.
const KINDS: usize = 16;
/// Ratio of the logistic scale parameter to the standard deviation of a residual, used for coding probabilities.
const PROBABILITY_SCALE: f64 = 0.579;
/// Ratio of the logistic scale parameter to the standard deviation of a residual, used to reconstruct values within a
/// quantiser bin.
const MEAN_SCALE: f64 = 0.58;
/// Number of sub-intervals of a quantiser bin in the midpoint rule for the mean of the logistic density over it.
const MIDPOINTS: usize = 8;
/// Fixed-point scale, in units per quantiser step, of the distance between the middle of a quantiser bin and the mean
/// of the density over it.
const OFFSET_UNITS: f64 = 4096.0;
/// Largest magnitude of tabulated log-odds: 11.5 in natural logarithms, times the fixed-point scale.
const LARGEST_ODDS: f64 = 11.5 * LOG_ODDS;

const BY_SCALE: usize = 0;
const SCALE_CLASSES: usize = 40;
const BY_NEAR: usize = BY_SCALE + KINDS * SCALE_CLASSES;
const NEAR_CLASSES: usize = 24;
/// Number of classes of the size of merged blocks of grid nodes. The class selects the adaptive probabilities for coded
/// prediction errors. Class 0 has the smallest blocks; all blocks above a limit share the last class.
pub(crate) const DEPTHS: usize = 4;
const BY_PLACE: usize = BY_NEAR + KINDS * NEAR_CLASSES * DEPTHS;
/// Number of contexts of a residual (quantised prediction error) by its place in the tensor: for each of 4 axes along
/// which grid nodes are divided, 4 classes of spectral channels.
const PLACES: usize = 16;
const PLACE_CLASSES: usize = SCALE_CLASSES.div_ceil(3);
const ESCAPE: usize = BY_PLACE + KINDS * PLACES * PLACE_CLASSES;
const SLOTS: usize = ESCAPE + GOLOMB_SLOTS;

struct Tables {
    /// Log-odds, in units of 1/256, that a prediction error with a magnitude above k − ½ quantiser steps is also above
    /// k + ½.
    ///
    /// There is one list by k, from 0 to 15, for each tabulated standard deviation: 2^−5 to 2^11 quantiser steps.
    odds: Vec<[i16; KINDS]>,
    /// Distances, in units of 1/4096 quantiser step, from the middle of a quantiser bin to the mean of the prediction
    /// errors in it.
    ///
    /// There is one list for each tabulated standard deviation, by the number of the bin, counted from 0 at a
    /// prediction error of 0. Bins beyond 15 share the last entry.
    offsets: Vec<[i16; KINDS]>,
    /// Fractional part of a binary logarithm in units of [`octaves()`], by the 6 high bits of the mantissa.
    octaves: [i8; 64],
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let deviation = |scale: usize| libm::exp2((scale as f64 + 0.5 - f64::from(UNIT_SCALE)) / f64::from(2 * PER_OCTAVE));
    Tables {
        odds: (0..SCALES).map(|scale| odds(1.0 / (PROBABILITY_SCALE * deviation(scale)))).collect(),
        offsets: (0..SCALES).map(|scale| offsets(1.0 / (MEAN_SCALE * deviation(scale)))).collect(),
        octaves: std::array::from_fn(|i| {
            libm::floor(f64::from(PER_OCTAVE) * libm::log2(1.0 + (i as f64 + 0.5) / 64.0)) as i8
        }),
    }
});

/// Returns the log-odds that the magnitude of a residual above k − ½ is also above k + ½, for all k. `h` is the
/// quantiser step divided by the logistic scale parameter.
fn odds(h: f64) -> [i16; KINDS] {
    let t = libm::exp(-0.5 * h);
    let mut tail = t;
    std::array::from_fn(|kind| {
        let p = if kind == 0 {
            2.0 * t / (1.0 + t)
        } else {
            let next = tail * t * t;
            let p = t * t * (1.0 + tail) / (1.0 + next);
            tail = next;
            p
        };
        let odds = LOG_ODDS * (libm::log(p.max(1e-300)) - libm::log((1.0 - p).max(1e-300)));
        libm::round(odds.clamp(-LARGEST_ODDS, LARGEST_ODDS)) as i16
    })
}

/// Returns the distances from the middle of each quantiser bin to the mean of the density over it, at most half a step.
/// `h` is the quantiser step divided by the logistic scale parameter.
fn offsets(h: f64) -> [i16; KINDS] {
    std::array::from_fn(|magnitude| {
        if magnitude == 0 {
            return 0;
        }
        let (mut sum, mut weight) = (0.0, 0.0);
        for k in 0..MIDPOINTS {
            let from_middle = (k as f64 + 0.5) / MIDPOINTS as f64 - 0.5;
            // Relative to the density at the near end of the bin, to avoid underflow.
            let fall = libm::exp(-(from_middle + 0.5) * h);
            let t = libm::exp(-(magnitude as f64 + from_middle) * h);
            let density = fall / ((1.0 + t) * (1.0 + t));
            sum += density * from_middle;
            weight += density;
        }
        libm::round(OFFSET_UNITS * sum / weight) as i16
    })
}

/// Returns the logarithm of a positive number in eighths of an octave, rounded down, from 6 bits of the mantissa.
///
/// Scales and contexts are derived from it. For 0, infinities and NaN the result lies outside the range of tabulated
/// variances.
#[inline]
pub(crate) fn octaves(x: f64) -> i32 {
    let bits = x.to_bits();
    let power = (bits >> 52 & 0x7FF) as i32 - 1023;
    power * PER_OCTAVE + i32::from(TABLES.octaves[(bits >> 46 & 63) as usize])
}

/// Expected distribution of one residual: index of its logistic density, and contexts of the adaptive probabilities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected {
    scale: usize,
    near: usize,
    depth: usize,
    place: usize,
}

impl Expected {
    /// Creates the expected distribution of a quantised prediction error (residual) from its `variance`, in squared
    /// quantiser steps.
    ///
    /// `near` is the mean squared prediction error at neighbouring nodes of the grid, in the same unit. `depth` (size
    /// class of merged blocks, below [`DEPTHS`]) and `place` (axis of the division and class of the spectral channel,
    /// below [`PLACES`]) select adaptive probabilities.
    #[inline]
    pub(crate) fn new(variance: f64, near: f64, depth: usize, place: usize) -> Self {
        Self {
            scale: (octaves(variance) + UNIT_SCALE).clamp(0, SCALES as i32 - 1) as usize,
            near: (((3 * octaves(near)) >> 5) + 9).clamp(0, NEAR_CLASSES as i32 - 1) as usize,
            depth,
            place,
        }
    }

    /// Returns the mean of the expected density over the quantiser bin of `residual`, in quantiser steps: the value to
    /// reconstruct.
    #[inline]
    pub(crate) fn mean_of(self, residual: i32) -> f64 {
        let offset = TABLES.offsets[self.scale][residual.unsigned_abs().min(KINDS as u32 - 1) as usize];
        let magnitude = f64::from(residual.unsigned_abs()) + f64::from(offset) / OFFSET_UNITS;
        if residual < 0 { -magnitude } else { magnitude }
    }
}

/// Coder of residuals (quantised prediction errors), with adaptive probabilities.
pub(crate) struct ResidualCoder {
    model: Model<4>,
    tables: &'static Tables,
}

impl Default for ResidualCoder {
    fn default() -> Self {
        Self { model: Model::guided(SLOTS, KINDS), tables: &TABLES }
    }
}

impl ResidualCoder {
    /// Encodes or decodes a residual, given its expected distribution.
    #[inline]
    pub(crate) fn code<C: BitCoder>(&mut self, coder: &mut C, expected: Expected, residual: i32) -> i32 {
        let wanted = residual.unsigned_abs();
        let class =
            (((5 * (expected.scale as i32 - UNIT_SCALE)) >> 5) + 12).clamp(0, SCALE_CLASSES as i32 - 1) as usize;
        let odds = &self.tables.odds[expected.scale];
        let decide = |coder: &mut C, model: &mut Model<4>, bit: bool, kind: usize| {
            let slots = [
                BY_SCALE + kind * SCALE_CLASSES + class,
                BY_NEAR + (kind * NEAR_CLASSES + expected.near) * DEPTHS + expected.depth,
                BY_PLACE + (kind * PLACES + expected.place) * PLACE_CLASSES + class / 3,
            ];
            model.code_guided(coder, bit, (i32::from(odds[kind]), slots), kind)
        };
        if !decide(coder, &mut self.model, wanted != 0, 0) {
            return 0;
        }
        let negative = coder.even(residual < 0);
        let mut magnitude = 1;
        while magnitude < KINDS as u32 && decide(coder, &mut self.model, wanted > magnitude, magnitude as usize) {
            magnitude += 1;
        }
        if magnitude == KINDS as u32 {
            magnitude += self.code_rest(coder, expected, wanted.wrapping_sub(magnitude));
        }
        let magnitude = magnitude.min(i32::MAX as u32) as i32;
        if negative { -magnitude } else { magnitude }
    }

    /// Encodes or decodes the excess over 16 of the magnitude of a residual (quantised prediction error).
    ///
    /// The lowest log₂ σ bits of the excess (at most 12) are coded with probability one half; σ is the expected
    /// standard deviation of the residual in quantiser steps.
    fn code_rest<C: BitCoder>(&mut self, coder: &mut C, expected: Expected, rest: u32) -> u32 {
        let low = ((expected.scale as i32 - UNIT_SCALE) / (2 * PER_OCTAVE)).clamp(0, 12) as u32;
        let high = code_golomb(coder, &mut self.model, ESCAPE, rest >> low).min(u32::MAX >> 1 >> low);
        high << low | coder.bits(rest & ((1 << low) - 1), low)
    }
}

/// Encodes or decodes a number without adaptive probabilities: 5 bits for its bit length, the bits below the leading
/// one, and a sign.
pub(crate) fn code_number<C: BitCoder>(coder: &mut C, number: i32) -> i32 {
    let wanted = number.unsigned_abs().min(i32::MAX as u32);
    let count = coder.bits(u32::BITS - wanted.leading_zeros(), 5);
    if count == 0 {
        return 0;
    }
    let low = (1 << (count - 1)) - 1;
    let magnitude = ((low + 1) | coder.bits(wanted & low, count - 1)) as i32;
    if coder.even(number < 0) { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};
    use crate::numeric::random::open;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    fn expected(i: usize) -> Expected {
        Expected::new(libm::exp2(i as f64 % 36.0 - 12.0), libm::exp2(i as f64 % 17.0 - 8.0), i % DEPTHS, i % PLACES)
    }

    #[test]
    fn octaves_are_logarithms() {
        for i in -800..800 {
            let x = libm::exp2(f64::from(i) / 16.0 + 0.02);
            assert!((f64::from(octaves(x)) - (f64::from(i) / 2.0 + 0.16)).abs() <= 1.0, "{i}");
        }
        assert!(octaves(0.0) < -1000 && octaves(f64::INFINITY) > 1000 && octaves(f64::NAN) > 1000);
    }

    #[test]
    fn tabulated_probabilities_are_those_of_the_density() {
        let cdf = |x: f64| 1.0 / (1.0 + libm::exp(-x));
        let probability = |odds: i16| cdf(f64::from(odds) / LOG_ODDS);
        let h = 1.0 / (PROBABILITY_SCALE * libm::exp2(0.5 / 16.0));
        let odds = TABLES.odds[UNIT_SCALE as usize];
        assert!((probability(odds[0]) - 2.0 * cdf(-0.5 * h)).abs() < 1e-3);
        for (k, &odds) in odds.iter().enumerate().skip(1) {
            let larger = cdf(-(k as f64 + 0.5) * h) / cdf(-(k as f64 - 0.5) * h);
            assert!((probability(odds) - larger).abs() < 1e-3, "{k}");
        }
    }

    #[test]
    fn means_lie_in_their_bins_towards_zero() {
        for i in 0..40 {
            for q in -20..=20 {
                let mean = expected(i).mean_of(q);
                assert!((mean - f64::from(q)).abs() <= 0.5 && mean.abs() <= f64::from(q.abs()), "{i} {q} {mean}");
            }
        }
    }

    #[test]
    fn residuals_of_any_size_round_trip() {
        let values: Vec<i32> =
            (-40..40).chain([1000, -65_536, 1 << 29, -(1 << 30), i32::MAX, -i32::MAX]).flat_map(|q| [q; 9]).collect();
        let (mut encoder, mut residuals) = (Encoder::default(), ResidualCoder::default());
        for (i, &value) in values.iter().enumerate() {
            assert_eq!(code_number(&mut encoder, value), value);
            assert_eq!(residuals.code(&mut encoder, expected(i), value), value);
        }
        let bytes = encoder.finish();
        let (mut decoder, mut residuals) = (Decoder::new(&bytes), ResidualCoder::default());
        for (i, &value) in values.iter().enumerate() {
            assert_eq!(code_number(&mut decoder, 0), value);
            assert_eq!(residuals.code(&mut decoder, expected(i), 0), value, "{i}");
        }
    }

    #[test]
    fn a_stated_density_costs_its_entropy() {
        // A logistic density with a standard deviation of 2 steps costs 3.0 bits per residual.
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut encoder = Encoder::default();
        let mut residuals = ResidualCoder::default();
        let count = 20_000;
        for _ in 0..count {
            let u = open(&mut random);
            let x = 2.0 * PROBABILITY_SCALE * libm::log(u / (1.0 - u));
            residuals.code(&mut encoder, Expected::new(4.0, 4.0, 0, 0), libm::round(x) as i32);
        }
        let bits = 8.0 * encoder.finish().len() as f64 / f64::from(count);
        let entropy = (2.0 + libm::log(2.0 * PROBABILITY_SCALE)) / std::f64::consts::LN_2;
        assert!((bits / entropy - 1.0).abs() < 0.02, "{bits} {entropy}");
    }

    #[test]
    fn garbage_decodes_to_some_residual() {
        for byte in 0..=255_u8 {
            let bytes = [byte; 64];
            let (mut decoder, mut residuals) = (Decoder::new(&bytes), ResidualCoder::default());
            for i in 0..300 {
                code_number(&mut decoder, 0);
                residuals.code(&mut decoder, expected(i), 0);
            }
        }
    }
}
