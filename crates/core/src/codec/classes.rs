//! Coder of sample classes (positive, negative, zero, masked): one symbol per sample; a repeated row costs one
//! decision.

use super::model::Model;
use super::range::BitCoder;

/// Class of a sample (positive, negative, zero or masked), coded before its magnitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Class {
    /// Class of the samples above 0.
    #[default]
    Positive = 0,
    /// Class of the samples below 0.
    Negative = 1,
    /// Class of the samples that are exactly 0, or below a floor that the user declared.
    Zero = 2,
    /// Class of the masked samples, which were not measured.
    Masked = 3,
}

const CLASSES: usize = 4;
const REPEATS: usize = 0;
const NEAR: usize = 4;
const FAR: usize = NEAR + 3 * CLASSES * CLASSES * CLASSES;
const LEFT: usize = FAR + 3 * CLASSES * CLASSES * CLASSES;
const SLOTS: usize = LEFT + 3 * CLASSES * CLASSES;

impl Class {
    /// Encodes or decodes a class by at most three binary decisions: that it is not positive, that it is not negative,
    /// that it is masked. `decide(number, bit)` codes decision `number`; a decoder ignores `self`.
    pub(super) fn code(self, mut decide: impl FnMut(usize, bool) -> bool) -> Self {
        if !decide(0, self != Self::Positive) {
            Self::Positive
        } else if !decide(1, self != Self::Negative) {
            Self::Negative
        } else if decide(2, self == Self::Masked) {
            Self::Masked
        } else {
            Self::Zero
        }
    }
}

/// Encodes or decodes the classes of samples (positive, negative, zero, masked) in memory order, in rows of `lanes`; a
/// decoder overwrites `classes`.
///
/// # Panics
/// If the number of classes is not a multiple of `lanes`.
pub(crate) fn code_classes<C: BitCoder>(coder: &mut C, lanes: usize, classes: &mut [Class]) {
    assert_eq!(classes.len() % lanes, 0, "classes come in rows");
    let mut model = Model::new(SLOTS, 3);
    let mut above = vec![Class::Positive; lanes];
    let mut further = above.clone();
    let mut repeats = 0_usize;
    for row in classes.chunks_exact_mut(lanes) {
        let repeat = model.code_one(coder, !C::DECODES && *row == above, REPEATS + repeats);
        repeats = (repeats << 1 | usize::from(repeat)) & 3;
        if repeat {
            row.copy_from_slice(&above);
        } else {
            code_row(coder, &mut model, &above, &further, row);
        }
        std::mem::swap(&mut further, &mut above);
        above.copy_from_slice(row);
    }
}

fn code_row<C: BitCoder>(coder: &mut C, model: &mut Model, above: &[Class], further: &[Class], row: &mut [Class]) {
    for j in 0..row.len() {
        let back = |k: usize| if j >= k { row[j - k] } else { Class::Positive } as usize;
        let next = above.get(j + 1).copied().unwrap_or_default() as usize;
        let (left, left2) = (back(1), back(2));
        let (up, up2) = (above[j] as usize, further[j] as usize);
        let near = (left * CLASSES + up) * CLASSES + next;
        let far = (up * CLASSES + up2) * CLASSES + left;
        let beside = left * CLASSES + left2;
        row[j] = row[j].code(|kind, bit| {
            let cubes = CLASSES * CLASSES * CLASSES;
            let slots =
                [NEAR + kind * cubes + near, FAR + kind * cubes + far, LEFT + kind * CLASSES * CLASSES + beside];
            model.code(coder, bit, slots, kind)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};
    use crate::numeric::drawn::list;
    use arbtest::arbtest;

    fn round_trip(lanes: usize, classes: &[Class]) -> usize {
        let mut encoder = Encoder::default();
        code_classes(&mut encoder, lanes, &mut classes.to_vec());
        let bytes = encoder.finish();
        let mut decoded = vec![Class::Positive; classes.len()];
        code_classes(&mut Decoder::new(&bytes), lanes, &mut decoded);
        assert_eq!(decoded, classes);
        bytes.len()
    }

    #[test]
    fn classes_round_trip() {
        arbtest(|u| {
            let all = [Class::Positive, Class::Negative, Class::Zero, Class::Masked];
            let classes = list(u, 60..=60, |u| u.choose(&all).copied())?;
            for lanes in [1, 5, 60] {
                round_trip(lanes, &classes);
            }
            Ok(())
        });
    }

    #[test]
    fn structure_costs_little() {
        // The lower half of a luminaire at 1,300 wavelengths, the rest zero.
        let classes: Vec<_> =
            (0..2048 * 1300).map(|i| if i / 1300 % 2048 < 1024 { Class::Positive } else { Class::Zero }).collect();
        assert!(round_trip(1300, &classes) < 100);
    }
}
