//! Natural logarithm by additions and multiplications only, so that results are identical on every machine.

use std::ops::{Add, Mul, Sub};
use wide::f32x4;

/// High and low part of ln 2 in f32; the high part has few bits, so that its multiples are exact (Cody & Waite 1980).
const LN_2_HIGH: f32 = 0.693_359_4;
const LN_2_LOW: f32 = -2.121_944_4e-4;
/// Mantissa below which it is doubled, so that the argument of the logarithm's polynomial is at most √2 − 1 in
/// magnitude.
const ROOT_HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Returns the natural logarithm of a positive normal x to 2 units in the last place (an absolute 1e-7 near 1).
///
/// x = 2ᵉ·m with √½ ≤ m < √2; the polynomial for ln m is Cephes' logf, by Horner's rule.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
pub(crate) fn ln_f32(x: f32) -> f32 {
    let [r, e] = reduced(x);
    combined(r, e)
}

/// Returns the natural logarithms of four numbers, with bits identical to [`ln_f32`].
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
pub(crate) fn ln_four(x: f32x4) -> f32x4 {
    let parts = x.to_array().map(reduced);
    combined(f32x4::new(parts.map(|[r, _]| r)), f32x4::new(parts.map(|[_, e]| e)))
}

/// Splits x into mantissa and exponent: returns m − 1 and e of x = 2ᵉ·m.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn reduced(x: f32) -> [f32; 2] {
    let bits = x.to_bits();
    let m = f32::from_bits(bits & 0x007F_FFFF | 0x3F00_0000);
    let is_low = m < ROOT_HALF;
    let exponent = (bits >> 23) as i32 - 126 - i32::from(is_low);
    [if is_low { m + m - 1.0 } else { m - 1.0 }, exponent as f32]
}

/// Returns the natural logarithm ln((1 + r)·2ᵉ).
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn combined<T>(r: T, e: T) -> T
where
    T: Copy + From<f32> + Add<Output = T> + Sub<Output = T> + Mul<Output = T>,
{
    let of = T::from;
    let rr = r * r;
    let p = of(7.037_683_6e-2);
    let p = p * r - of(1.151_461e-1);
    let p = p * r + of(1.167_699_9e-1);
    let p = p * r - of(1.242_014_1e-1);
    let p = p * r + of(1.424_932_3e-1);
    let p = p * r - of(1.666_805_8e-1);
    let p = p * r + of(2.000_071_5e-1);
    let p = p * r - of(2.499_999_4e-1);
    let p = p * r + of(3.333_333e-1);
    let tail = p * r * rr + e * of(LN_2_LOW) - of(0.5) * rr;
    (r + tail) + e * of(LN_2_HIGH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_logarithm() {
        for i in 0..400_000 {
            let x = libm::exp(-80.0 + 4e-4 * f64::from(i)) as f32;
            let expected = libm::log(f64::from(x));
            let error = (f64::from(ln_f32(x)) - expected).abs();
            assert!(error < 1e-7 + 2.5e-7 * expected.abs(), "{x}: {} {expected}", ln_f32(x));
        }
        assert_eq!(ln_f32(1.0), 0.0);
        let four = [0.3, 1.0, 17.5, 2e-30];
        assert_eq!(ln_four(f32x4::new(four)).to_array(), four.map(ln_f32));
    }
}
