//! Natural logarithms of many numbers at once, bit for bit equal to those of `libm`.
//!
//! The method is that of FreeBSD's `e_log.c` for positive normal numbers: x = 2ᵏ · (1 + f), √½ < 1 + f < √2, and ln(1 +
//! f) from a polynomial in s = f / (2 + f). All other numbers go to `libm` itself.

use crate::numeric::wide;

/// Count of numbers whose logarithms are computed together.
const LANES: usize = 16;

/// Replaces every number by its natural logarithm.
pub(crate) fn logarithms(values: &mut [f64]) {
    wide(
        #[inline(always)]
        || {
            let mut lanes = values.chunks_exact_mut(LANES);
            for lane in &mut lanes {
                let normal = |&x: &f64| u32::from(x >= f64::MIN_POSITIVE) * u32::from(x < f64::INFINITY);
                if lane.iter().map(normal).sum::<u32>() as usize == LANES {
                    for x in lane {
                        *x = log(*x);
                    }
                } else {
                    for x in lane {
                        *x = libm::log(*x);
                    }
                }
            }
            for x in lanes.into_remainder() {
                *x = libm::log(*x);
            }
        },
    );
}

/// Natural logarithm of a positive normal number.
#[inline]
fn log(x: f64) -> f64 {
    const LN_2_HIGH: f64 = 0.693_147_180_369_123_8;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let bits = x.to_bits();
    let high = ((bits >> 32) as u32).wrapping_add(0x3FF0_0000 - 0x3FE6_A09E);
    let k = f64::from((high >> 20) as i32 - 0x3FF);
    let high = (high & 0x000F_FFFF) + 0x3FE6_A09E;
    let f = f64::from_bits(u64::from(high) << 32 | bits & 0xFFFF_FFFF) - 1.0;
    let half_square = 0.5 * f * f;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w * (0.399_999_999_994_094_2 + w * (0.222_221_984_321_497_84 + w * 0.153_138_376_992_093_73));
    let odd = z
        * (0.666_666_666_666_673_5
            + w * (0.285_714_287_436_623_9 + w * (0.181_835_721_616_180_5 + w * 0.147_981_986_051_165_86)));
    let r = odd + even;
    s * (half_square + r) + k * LN_2_LOW - half_square + f + k * LN_2_HIGH
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_those_of_libm() {
        let places =
            (0..1_u32 << 31).step_by(8191).chain((-4000..4000).map(|k| 1.0_f32.to_bits().wrapping_add_signed(k)));
        let singles = places.map(|bits| f64::from(f32::from_bits(bits)));
        let doubles = (0..1_u64 << 20).map(|k| f64::from_bits(k.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
        let values: Vec<f64> = singles.chain(doubles).chain([0.0, -0.0, -1.0, 1.0, f64::INFINITY, f64::NAN]).collect();
        let mut found = values.clone();
        logarithms(&mut found);
        for (&x, found) in values.iter().zip(found) {
            let wanted = libm::log(x);
            assert!(found.to_bits() == wanted.to_bits() || found.is_nan() && wanted.is_nan(), "{x}: {found} {wanted}");
        }
    }
}
