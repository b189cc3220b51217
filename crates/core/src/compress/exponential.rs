//! From logarithms to samples: the decoder's exponential, in additions and multiplications only, so that every machine and
//! language gets the same bits.
//!
//! With k the integer nearest to x / ln 2 and r = x − k·ln 2, |r| ≤ 0.3466: eˣ = 2ᵏ · Σ rⁱ / i! for i = 0..=9, evaluated by
//! Horner's rule from the highest power down. The remainder is below 7e-12, far below the rounding to f32 that follows.
//! Arguments are clamped to −120..=100, outside of which an f32 underflows or overflows anyway.

use crate::domain::wide;
use rayon::prelude::*;

/// Adding and subtracting this rounds to the nearest integer, ties to even, for |x| < 2^51.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// ln 2 in two parts; k times the first is exact.
const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
const INVERSE_FACTORIALS: [f64; 10] =
    [1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5_040.0, 1.0 / 40_320.0, 1.0 / 362_880.0];

/// eˣ, to 1e-11 relative.
#[inline]
fn exp(x: f64) -> f64 {
    let x = x.clamp(-120.0, 100.0);
    let shifted = x * std::f64::consts::LOG2_E + ROUNDER;
    let k = shifted - ROUNDER;
    let r = x - k * LN_2_HIGH - k * LN_2_LOW;
    let mut sum = INVERSE_FACTORIALS[9];
    for i in (0..9).rev() {
        sum = sum * r + INVERSE_FACTORIALS[i];
    }
    // The low bits of `shifted` hold k in two's complement; |k| < 200 keeps the exponent in range.
    let exponent = (shifted.to_bits() & 0xFFF).wrapping_add(1023) & 0x7FF;
    sum * f64::from_bits(exponent << 52)
}

/// Adds `steps[i] · step` to each logarithm.
pub(crate) fn add_corrections(step: f32, steps: &[i32], logs: &mut [f32]) {
    logs.par_chunks_mut(1 << 14).zip(steps.par_chunks(1 << 14)).for_each(|(logs, steps)| {
        for (log, &k) in logs.iter_mut().zip(steps) {
            *log += k as f32 * step;
        }
    });
}

/// Replaces logarithms by magnitudes.
pub(crate) fn exponentiate(logs: &mut [f32]) {
    logs.par_chunks_mut(1 << 14).for_each(|chunk| {
        wide(
            #[inline(always)]
            || chunk.iter_mut().for_each(|value| *value = exp(f64::from(*value)) as f32),
        );
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential() {
        for i in -119_000..99_000 {
            let x = f64::from(i) / 1000.0 + 1e-4;
            let (ours, theirs) = (exp(x), libm::exp(x));
            assert!((ours / theirs - 1.0).abs() < 1e-11, "{x}: {ours} {theirs}");
        }
        assert_eq!(exp(0.0), 1.0);
    }

    #[test]
    fn the_ends_underflow_and_overflow_an_f32() {
        assert_eq!(exp(f64::NEG_INFINITY) as f32, 0.0);
        assert!((exp(f64::INFINITY) as f32).is_infinite());
        assert!(exp(f64::NAN).is_nan());
    }
}
