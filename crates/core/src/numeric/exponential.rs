//! Exponential functions by additions and multiplications only, so that results are identical on every machine,
//! whatever its vector width.
//!
//! All three split x into k·ln 2 + r with |r| ≤ ln 2 / 2, so that eˣ = 2ᵏ·eʳ. They differ in the polynomial for eʳ, and
//! recorded results depend on their bits: `exp_f64` is part of the container format, `exp_estrin` computes answers of
//! queries, and `exp_horner` samples of projections.

use ::wide::f32x4;

/// Rounding constant 1.5 · 2⁵²: adding and subtracting it rounds an f64 to the nearest integer, ties to even, for |x| <
/// 2^51.
const ROUNDER_F64: f64 = 6_755_399_441_055_744.0;
/// High and low part of ln 2 in f64; products of the high part with the integers used here are exact.
const LN_2_HIGH_F64: f64 = 0.693_147_180_369_123_8;
const LN_2_LOW_F64: f64 = 1.908_214_929_270_587_7e-10;
const INVERSE_FACTORIALS: [f64; 10] =
    [1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0, 1.0 / 5_040.0, 1.0 / 40_320.0, 1.0 / 362_880.0];

/// Rounding constant 1.5 · 2²³: adding it rounds an f32 to an integer, which is then in the low bits.
const ROUNDER_F32: f32 = 12_582_912.0;
/// High and low part of ln 2 in f32; the high part has few bits, so that its multiples are exact (Cody & Waite 1980).
const LN_2_HIGH_F32: f32 = 0.693_359_4;
const LN_2_LOW_F32: f32 = -2.121_944_4e-4;

/// Returns eˣ with a relative error below 1e-11, as used by the decoder. x is clamped to −120..=100; beyond these
/// limits an f32 underflows or overflows.
///
/// The polynomial is Σ rⁱ / i! for i = 0..=9 by Horner's rule. Its remainder is below 7e-12, far below the rounding to
/// f32 that follows.
#[inline]
pub(crate) fn exp_f64(x: f64) -> f64 {
    let x = x.clamp(-120.0, 100.0);
    let shifted = x * std::f64::consts::LOG2_E + ROUNDER_F64;
    let k = shifted - ROUNDER_F64;
    let r = x - k * LN_2_HIGH_F64 - k * LN_2_LOW_F64;
    let mut sum = INVERSE_FACTORIALS[9];
    for i in (0..9).rev() {
        sum = sum * r + INVERSE_FACTORIALS[i];
    }
    // The low bits of `shifted` are k in two's complement; |k| < 200 keeps the exponent in range.
    let exponent = (shifted.to_bits() & 0xFFF).wrapping_add(1023) & 0x7FF;
    sum * f64::from_bits(exponent << 52)
}

/// Exponent of 2 by which the power of 2 is made larger for x below −87, where it may be a denormal, which has no
/// exponent of its own.
const RAISED_BY: f32 = 64.0;
/// Factor 2⁻⁶⁴ by which the product of that larger power is multiplied.
const LOWERING: f32 = 1.0 / 18_446_744_073_709_551_616.0;
/// Smallest x whose exponential is not rounded to 0, rounded down.
const LEAST: f32 = -104.0;

/// Returns eˣ to 2 units in the last place for x up to 88, denormals to one unit; larger x give the largest finite
/// power.
///
/// The polynomial is evaluated in independent pairs (Estrin 1960).
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
pub(crate) fn exp_estrin(x: f32) -> f32 {
    let clamped = x.clamp(LEAST, 88.0);
    let shifted = clamped * std::f32::consts::LOG2_E + ROUNDER_F32;
    let n = shifted - ROUNDER_F32;
    let r = clamped - n * LN_2_HIGH_F32 - n * LN_2_LOW_F32;
    let (raised, lowering) = if x < -87.0 { (shifted + RAISED_BY, LOWERING) } else { (shifted, 1.0) };
    // Minimax on ± ln 2 / 2 (Cephes' expf).
    let rr = r * r;
    let first = 0.5 + 1.666_666_5e-1 * r;
    let second = 4.166_579_6e-2 + 8.333_452e-3 * r;
    let third = 1.398_2e-3 + 1.987_569_1e-4 * r;
    let value = (1.0 + r) + rr * (first + rr * (second + rr * third));
    let power = f32::from_bits((raised.to_bits().wrapping_add(127)) << 23);
    value * power * lowering
}

/// Computes the exponentials of four numbers, with the bits of [`exp_estrin`] except for NaN.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
pub(crate) fn exp_estrin_of_four(x: f32x4) -> f32x4 {
    let of = f32x4::splat;
    let is_low = x.simd_lt(of(-87.0));
    let clamped = x.simd_lt(of(LEAST)).bitselect(of(LEAST), x);
    let clamped = clamped.simd_gt(of(88.0)).bitselect(of(88.0), clamped);
    let shifted = clamped * of(std::f32::consts::LOG2_E) + of(ROUNDER_F32);
    let n = shifted - of(ROUNDER_F32);
    let r = clamped - n * of(LN_2_HIGH_F32) - n * of(LN_2_LOW_F32);
    let rr = r * r;
    let first = of(0.5) + of(1.666_666_5e-1) * r;
    let second = of(4.166_579_6e-2) + of(8.333_452e-3) * r;
    let third = of(1.398_2e-3) + of(1.987_569_1e-4) * r;
    let value = (of(1.0) + r) + rr * (first + rr * (second + rr * third));
    let raised = shifted + is_low.bitselect(of(RAISED_BY), f32x4::ZERO);
    let powers = raised.to_array().map(|raised| f32::from_bits((raised.to_bits().wrapping_add(127)) << 23));
    value * f32x4::new(powers) * is_low.bitselect(of(LOWERING), of(1.0))
}

/// Returns eˣ to about 2 units in the last place, exactly 1 at 0; x is clamped to −87..=88, and NaN gives NaN.
///
/// The polynomial is the Taylor polynomial, evaluated by Horner's rule without branches.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
pub fn exp_horner(x: f32) -> f32 {
    let x = if x > 88.0 { 88.0 } else { x };
    let x = if x < -87.0 { -87.0 } else { x };
    let shifted = x * std::f32::consts::LOG2_E + ROUNDER_F32;
    let n = shifted - ROUNDER_F32;
    let r = x - n * LN_2_HIGH_F32;
    let r = r - n * LN_2_LOW_F32;
    let p = 1.0 / 5040.0;
    let p = p * r + 1.0 / 720.0;
    let p = p * r + 1.0 / 120.0;
    let p = p * r + 1.0 / 24.0;
    let p = p * r + 1.0 / 6.0;
    let p = p * r + 0.5;
    let p = p * r + 1.0;
    let p = p * r + 1.0;
    p * f32::from_bits((shifted.to_bits() << 23).wrapping_add(127 << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decoders_is_the_exponential() {
        for i in -119_000..99_000 {
            let x = f64::from(i) / 1000.0 + 1e-4;
            let (ours, theirs) = (exp_f64(x), libm::exp(x));
            assert!((ours / theirs - 1.0).abs() < 1e-11, "{x}: {ours} {theirs}");
        }
        assert_eq!(exp_f64(0.0), 1.0);
    }

    #[test]
    fn the_decoders_ends_underflow_and_overflow_an_f32() {
        assert_eq!(exp_f64(f64::NEG_INFINITY) as f32, 0.0);
        assert!((exp_f64(f64::INFINITY) as f32).is_infinite());
        assert!(exp_f64(f64::NAN).is_nan());
    }

    #[test]
    fn both_f32_ways_are_right_to_the_last_places() {
        let mut worst = [0.0_f64; 2];
        for i in 0..=1_750_000 {
            let x = -87.0 + i as f32 * 1e-4;
            let expected = libm::exp(f64::from(x));
            for (worst, found) in worst.iter_mut().zip([exp_estrin(x), exp_horner(x)]) {
                *worst = worst.max((f64::from(found) - expected).abs() / expected);
            }
        }
        assert!(worst[0] < 2.4e-7 && worst[1] < 4e-7, "{worst:?}");
        assert_eq!([exp_estrin(0.0), exp_horner(0.0)], [1.0, 1.0]);
    }

    #[test]
    fn denormals_are_right_to_the_last_place() {
        for i in 0..=165_000 {
            let x = -103.5 + i as f32 * 1e-4;
            let (found, expected) = (exp_estrin(x), libm::exp(f64::from(x)));
            let place = f64::from(f32::from_bits(1)).max(2.4e-7 * expected);
            assert!((f64::from(found) - expected).abs() <= place, "{x}: {found:e} {expected:e}");
        }
    }

    #[test]
    fn four_at_once_have_the_bits_of_each() {
        let ends = [-100.0, -87.0, 88.0, f32::NEG_INFINITY, f32::INFINITY, 1000.0, 0.0, -0.0];
        let all: Vec<f32> = ends.into_iter().chain((0..44_000).map(|i| -108.0 + i as f32 * 4.5e-3)).collect();
        for four in all.as_chunks::<4>().0 {
            assert_eq!(exp_estrin_of_four(f32x4::new(*four)).to_array(), four.map(exp_estrin), "{four:?}");
        }
        assert!(exp_estrin_of_four(f32x4::splat(f32::NAN)).to_array()[0].is_nan());
    }

    #[test]
    fn the_ends_of_both_f32_ways_are_finite() {
        assert_eq!([-104.0, f32::NEG_INFINITY].map(exp_estrin), [0.0, 0.0]);
        assert_eq!(exp_horner(f32::NEG_INFINITY), exp_horner(-87.0));
        assert!(exp_estrin(1000.0).is_finite() && exp_horner(1000.0).is_finite());
        assert!(exp_horner(f32::NAN).is_nan());
    }
}
