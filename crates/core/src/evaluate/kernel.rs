//! The inner loops: planes → spectrum, and the exponential in them, in forms that compilers turn into vector code.
//!
//! Additions and multiplications only, in a fixed order: the same values on any machine, however wide its vectors are.

/// Wavelengths that are worked on together.
pub(super) const LANES: usize = 16;

/// Places that are worked on together: step by step, each step for all of them before the next, so that they do not wait for
/// one another and loops become vector code.
pub(super) const BLOCK: usize = 48;
/// A number for each place of a block.
pub(super) type Block = [f64; BLOCK];
/// A vector for each place of a block: x, y, z.
pub(super) type Vectors = [Block; 3];

/// The vector of one place of a block.
#[inline(always)]
pub(super) fn vector_of([x, y, z]: &Vectors, i: usize) -> [f64; 3] {
    [x[i], y[i], z[i]]
}

/// Sets it.
#[inline(always)]
pub(super) fn set_vector([x, y, z]: &mut Vectors, i: usize, to: [f64; 3]) {
    [x[i], y[i], z[i]] = to;
}

/// eˣ to 2 units in the last place for −87 … 88; 0 below and the largest finite power above.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    const LOG2_E: f32 = std::f32::consts::LOG2_E;
    // ln 2 in two parts, the first with few bits, so that its multiples are exact (Cody & Waite 1980).
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    // Adding 1.5 · 2²³ rounds to an integer, which is then in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let clamped = x.clamp(-87.0, 88.0);
    let shifted = clamped * LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = clamped - n * LN2_HIGH - n * LN2_LOW;
    // Minimax on ± ln 2 / 2 (Cephes' expf), in pairs (Estrin 1960), so that steps need not wait for one another.
    let rr = r * r;
    let first = 0.5 + 1.666_666_5e-1 * r;
    let second = 4.166_579_6e-2 + 8.333_452e-3 * r;
    let third = 1.398_2e-3 + 1.987_569_1e-4 * r;
    let value = (1.0 + r) + rr * (first + rr * (second + rr * third));
    let power = f32::from_bits((shifted.to_bits().wrapping_add(127)) << 23);
    if x < -87.0 { 0.0 } else { value * power }
}

/// The exponentials of all lanes.
#[inline(always)]
pub(super) fn exp_all<const N: usize>(values: &mut [f32; N]) {
    for value in values {
        *value = exp(*value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_right_to_the_last_places() {
        let mut worst = 0.0_f64;
        for i in 0..=1_750_000 {
            let x = -87.0 + i as f32 * 1e-4;
            let expected = f64::from(x).exp();
            worst = worst.max((f64::from(exp(x)) - expected).abs() / expected);
        }
        assert!(worst < 2.4e-7, "{worst}");
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(-100.0), 0.0);
        assert_eq!(exp(f32::NEG_INFINITY), 0.0);
        assert!(exp(1000.0).is_finite());
    }
}
