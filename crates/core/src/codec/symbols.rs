//! Integers as binary decisions (zero flag, sign, magnitude), and classes of magnitudes for contexts.

use super::model::Model;
use super::range::BitCoder;

/// Number of classes, used as contexts of adaptive probabilities, of the mean magnitude of several coded integers. The
/// mean is counted in sixteenths; the magnitude of a single integer has fewer classes, [`COARSE`].
pub(crate) const FINE: usize = 12;
/// Number of coarse classes of an integer magnitude, used as contexts of adaptive probabilities.
pub(crate) const COARSE: usize = 6;
/// Smallest magnitude of a coded integer, such as a quantised coefficient, that needs an Exp-Golomb code. Smaller
/// magnitudes are coded in unary.
const UNARY: u32 = 14;
/// Largest exponent of an Exp-Golomb code, in bits: coded values stay below 2^31 − 1.
const DOUBLINGS: u32 = 30;

/// Returns the fine class (a context of adaptive probabilities) of an averaged magnitude in units of 1/16: class 0 is
/// 0, class 11 is a magnitude above 12.
pub(crate) fn fine(sixteenths: u32) -> usize {
    match sixteenths {
        0 => 0,
        1 => 1,
        2 => 2,
        3..=4 => 3,
        5..=8 => 4,
        9..=13 => 5,
        14..=19 => 6,
        20..=32 => 7,
        33..=56 => 8,
        57..=96 => 9,
        97..=192 => 10,
        _ => 11,
    }
}

/// Returns the coarse class (a context of adaptive probabilities) of an integer magnitude.
pub(crate) fn coarse(magnitude: u32) -> usize {
    match magnitude {
        0 => 0,
        1 => 1,
        2 => 2,
        3..=4 => 3,
        5..=9 => 4,
        _ => 5,
    }
}

/// Positions, in an entropy coder's model, of the adaptive probabilities for magnitudes of one kind of coded integer.
#[derive(Clone, Copy)]
pub(crate) struct MagnitudeSlots {
    first: usize,
}

impl MagnitudeSlots {
    const BY_FIRST: usize = UNARY as usize * FINE;
    const BY_SECOND: usize = UNARY as usize * FINE;
    const BY_LEVEL: usize = UNARY as usize * LEVELS;
    const ESCAPE: usize = (DOUBLINGS as usize + 1) * 2;
    /// Number of adaptive probabilities with which the entropy coder codes the magnitudes of one kind of integer, such
    /// as coefficients.
    pub(crate) const COUNT: usize = Self::BY_FIRST + Self::BY_SECOND + Self::BY_LEVEL + Self::ESCAPE;
    /// Number of sets of weights that mix probabilities when the entropy coder codes the magnitudes of one kind of
    /// integer, such as coefficients.
    pub(crate) const SETS: usize = UNARY as usize;

    pub(crate) fn at(first: usize) -> Self {
        Self { first }
    }

    /// Sets the initial probabilities of the decisions "is the magnitude of the coded integer larger than k" for every
    /// k that is coded in unary. They assume a Laplacian density whose scale follows from the class of the expected
    /// magnitude.
    pub(crate) fn set_priors(self, model: &mut Model) {
        for step in 0..UNARY as usize {
            for (class, &larger) in LARGER.iter().enumerate() {
                model.prior(self.first + step * FINE + class, larger);
                model.prior(self.first + Self::BY_FIRST + step * FINE + class, larger);
            }
        }
    }
}

/// Number of wavelet or subdivision levels that contexts distinguish; finer levels share the last one.
pub(crate) const LEVELS: usize = 8;

/// Initial probabilities `P(|q| > i | |q| ≥ i) · 65536` of a quantised value q, for 12 classes of its expected
/// magnitude: from 0 in the first class to above 12 in the last.
const LARGER: [u32; FINE] = [5_243, 5_243, 5_243, 6_554, 9_830, 16_384, 23_593, 32_768, 42_598, 51_118, 57_672, 62_259];
/// Initial probabilities `P(q ≠ 0) · 65536` of a quantised value q, for 12 classes of its expected magnitude: from 0 in
/// the first class to above 12 in the last.
pub(crate) const NONZERO: [u32; FINE] =
    [1_311, 3_277, 6_554, 13_107, 22_938, 32_768, 42_598, 52_429, 58_982, 62_259, 63_570, 64_225];

/// Encodes or decodes the magnitude, at least 1, of an integer such as a quantised coefficient. The contexts are two
/// classes of the expected magnitude, `first` and `second`, and the integer's wavelet or subdivision level, `level`.
pub(crate) fn code_magnitude<C: BitCoder>(
    coder: &mut C,
    model: &mut Model,
    slots: MagnitudeSlots,
    set: usize,
    magnitude: u32,
    (first, second, level): (usize, usize, usize),
) -> u32 {
    let by_second = slots.first + MagnitudeSlots::BY_FIRST;
    let by_level = by_second + MagnitudeSlots::BY_SECOND;
    for step in 0..UNARY - 1 {
        let s = step as usize;
        let contexts = [slots.first + s * FINE + first, by_second + s * FINE + second, by_level + s * LEVELS + level];
        if !model.code(coder, magnitude > step + 1, contexts, set + s) {
            return step + 1;
        }
    }
    let escape = by_level + MagnitudeSlots::BY_LEVEL;
    (UNARY + code_golomb(coder, model, escape, magnitude.wrapping_sub(UNARY))).min(i32::MAX as u32)
}

/// Number of adaptive probabilities that the Exp-Golomb code [`code_golomb`] needs in a model.
pub(crate) const GOLOMB_SLOTS: usize = (DOUBLINGS as usize + 1) * 2;

/// Encodes or decodes `value` < 2^31 − 1 by an adaptive Exp-Golomb code of value + 1: the position of its highest bit,
/// the next bit, then the remaining bits.
pub(crate) fn code_golomb<C: BitCoder, const N: usize>(
    coder: &mut C,
    model: &mut Model<N>,
    first: usize,
    value: u32,
) -> u32 {
    let target = if C::DECODES { 0 } else { (value + 1).ilog2() };
    let mut doublings = 0;
    while doublings < DOUBLINGS && model.code_one(coder, target > doublings, first + doublings as usize) {
        doublings += 1;
    }
    if doublings == 0 {
        return 0;
    }
    let shown = value.wrapping_add(1);
    let next = first + DOUBLINGS as usize + 1 + doublings as usize;
    let top = model.code_one(coder, shown >> (doublings - 1) & 1 == 1, next);
    let rest = coder.bits(shown, doublings - 1);
    ((2 | u32::from(top)) << (doublings - 1) | rest & ((1 << (doublings - 1)) - 1)).wrapping_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};

    #[test]
    fn magnitudes_of_any_size_round_trip() {
        let values: Vec<u32> = (1..40).chain([100, 1000, 65_535, 1 << 20, 1 << 30]).collect();
        let model = || {
            let mut model = Model::new(MagnitudeSlots::COUNT, MagnitudeSlots::SETS);
            MagnitudeSlots::at(0).set_priors(&mut model);
            model
        };
        let (mut m, mut encoder) = (model(), Encoder::default());
        for &value in &values {
            code_magnitude(&mut encoder, &mut m, MagnitudeSlots::at(0), 0, value, (value as usize % FINE, 3, 2));
        }
        let bytes = encoder.finish();
        let (mut m, mut decoder) = (model(), Decoder::new(&bytes));
        for &value in &values {
            let contexts = (value as usize % FINE, 3, 2);
            assert_eq!(code_magnitude(&mut decoder, &mut m, MagnitudeSlots::at(0), 0, 0, contexts), value);
        }
    }

    #[test]
    fn garbage_decodes_to_some_magnitude() {
        for byte in 0..=255_u8 {
            let bytes = [byte; 64];
            let mut model = Model::new(MagnitudeSlots::COUNT, MagnitudeSlots::SETS);
            let mut decoder = Decoder::new(&bytes);
            for _ in 0..200 {
                code_magnitude(&mut decoder, &mut model, MagnitudeSlots::at(0), 0, 0, (0, 0, 0));
            }
        }
    }
}
