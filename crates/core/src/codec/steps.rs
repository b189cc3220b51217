//! Coder of rows of small signed integers, mostly 0, in the context of the integers beside and above.

use super::model::Model;
use super::range::BitCoder;
use super::symbols::{GOLOMB_SLOTS, code_golomb};

const NONZERO: usize = 0;
const SIGN: usize = NONZERO + 9;
const MAGNITUDE: usize = SIGN + 3;
/// Initial probability, in 1/65536, that a coded integer is not 0: one in five.
const USUALLY_NONZERO: u32 = 13_107;

/// Encodes or decodes corrections of the light (albedo, flux): rows of `lanes` small signed integers, mostly 0. A
/// decoder overwrites them.
///
/// # Panics
/// If the number of integers is not a multiple of `lanes`.
pub(crate) fn code_steps<C: BitCoder>(coder: &mut C, lanes: usize, steps: &mut [i32]) {
    assert_eq!(steps.len() % lanes, 0, "steps come in rows");
    let mut model = Model::new(MAGNITUDE + GOLOMB_SLOTS, 1);
    for context in 0..9 {
        model.prior(NONZERO + context, USUALLY_NONZERO);
    }
    // A missing neighbour is a context of its own.
    let state = |known: Option<i32>| known.map_or(2, |step| usize::from(step != 0));
    for at in 0..steps.len() {
        let beside = (at % lanes > 0).then(|| steps[at - 1]);
        let above = at.checked_sub(lanes).map(|above| steps[above]);
        let step = steps[at];
        let context = 3 * state(beside) + state(above);
        if !model.code_one(coder, step != 0, NONZERO + context) {
            steps[at] = 0;
            continue;
        }
        let sign = (beside.unwrap_or(0).signum() + 1) as usize;
        let negative = model.code_one(coder, step < 0, SIGN + sign);
        let below = code_golomb(coder, &mut model, MAGNITUDE, step.unsigned_abs().wrapping_sub(1));
        let magnitude = below.min(i32::MAX as u32 - 1) as i32 + 1;
        steps[at] = if negative { -magnitude } else { magnitude };
    }
}

/// Encodes or decodes flags that come in runs, each in the context of the preceding flag; a decoder overwrites them.
pub(crate) fn code_flags<C: BitCoder>(coder: &mut C, flags: &mut [bool]) {
    let mut model = Model::new(2, 0);
    let mut before = false;
    for flag in flags {
        *flag = model.code_one(coder, *flag, usize::from(before));
        before = *flag;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};
    use crate::numeric::drawn::{any_list, list};
    use arbtest::arbtest;

    fn round_trip(lanes: usize, steps: &[i32]) -> usize {
        let mut encoder = Encoder::default();
        code_steps(&mut encoder, lanes, &mut steps.to_vec());
        let bytes = encoder.finish();
        let mut decoded = vec![7; steps.len()];
        code_steps(&mut Decoder::new(&bytes), lanes, &mut decoded);
        assert_eq!(decoded, steps);
        bytes.len()
    }

    #[test]
    fn rare_small_steps_are_small() {
        let mut steps = [0; 4 * 16];
        steps[0] = 3;
        steps[1] = -2;
        assert!(round_trip(16, &steps) <= 6);
        let busy: Vec<i32> = (0..64).map(|i| i % 5 - 2).collect();
        assert!(round_trip(16, &busy) <= 40);
    }

    #[test]
    fn any_steps_round_trip() {
        arbtest(|u| {
            let steps = list(u, 1..=59, |u| u.int_in_range(-2_000_000_000..=2_000_000_000))?;
            round_trip(1, &steps);
            round_trip(steps.len(), &steps);
            Ok(())
        });
    }

    #[test]
    fn any_bytes_are_steps() {
        arbtest(|u| {
            let bytes: Vec<u8> = any_list(u, 0..=59)?;
            code_steps(&mut Decoder::new(&bytes), 5, &mut [0; 40]);
            Ok(())
        });
    }
}
