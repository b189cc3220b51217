//! Coder of sample classes on grids of angles in wide contexts: each sample among its neighbours in the rows, the
//! incoming directions and the lanes before it.

use super::classes::Class;
use super::grid_classes::ClassGrid;
use super::model::{Model, WIDE};
use super::range::BitCoder;

const CLASSES: usize = 4;
/// Number of binary decisions that name a class.
const KINDS: usize = 3;
/// Numbers of contexts of the five predictions of a sample, which are mixed. A context is what a prediction sees of the
/// neighbours that are coded already (`docs/container.md`, section 8.1, names them):
///
/// * the classes of the nearest: in the same row, the row before, the incoming direction before and the lane before;
/// * which of eleven are not positive, most of them in the same row and the rows before;
/// * which of nine, most of them under the incoming directions before;
/// * which of eight, most of them in the lanes before;
/// * how many are not positive of ten in the rows before, nine under the incoming direction before and nine in the lane
///   before (hence 11, 10 and 10 counts), and which of two in the same row.
const CONTEXTS: [usize; WIDE] = [CLASSES * CLASSES * CLASSES * CLASSES, 1 << 11, 1 << 9, 1 << 8, 11 * 10 * 10 * 4];
/// Numbers of contexts of the three predictions that a row repeats an earlier one.
const REPEATS: [usize; 3] = [16, 32, 5 * 16];

/// Encodes or decodes the class of each sample (positive, negative, zero or masked) of a tensor
/// `[incoming, polar, azimuths, lanes]`. Lanes are entries of the last axis, such as wavelengths. A decoder overwrites
/// `classes`.
///
/// # Panics
/// If the number of classes is not the product of the lengths.
pub(crate) fn code_wide_classes<C: BitCoder>(coder: &mut C, grid: &ClassGrid, classes: &mut [Class]) {
    let &ClassGrid { incoming, polar, azimuths, ref lanes } = grid;
    assert_eq!(classes.len(), incoming * polar * azimuths * lanes.len(), "classes of the whole tensor");
    let mut models = Models::new();
    let mut known = vec![[0; WIDE]; azimuths];
    let positive = vec![Class::Positive; azimuths];
    // Classes of the current lane, of the one coded before it, and of the one before that.
    let [mut own, mut other, mut further] = [const { Vec::new() }; 3];
    for plane in [&mut own, &mut other, &mut further] {
        plane.resize(incoming * polar * azimuths, Class::Positive);
    }
    let mut history = 0;
    for (number, &lane) in lanes.iter().enumerate() {
        for (at, own) in own.iter_mut().enumerate() {
            *own = if C::DECODES { Class::Positive } else { classes[at * lanes.len() + lane] };
        }
        // In measurements joined with a spectrum, all lanes are zero at the same directions.
        let is_same = number > 0 && models.lanes.code_one(coder, !C::DECODES && own == other, history);
        history = (history << 1 | usize::from(is_same)) & 3;
        if is_same {
            own.copy_from_slice(&other);
        } else {
            let mut repeats = 0;
            for row in 0..incoming * polar {
                let (done, rest) = own.split_at_mut(row * azimuths);
                let around = Around::of(row, polar, &positive, done, [&other, &further]);
                models.code_row(coder, &around, &mut repeats, &mut known, &mut rest[..azimuths]);
            }
        }
        for (at, own) in own.iter().enumerate() {
            classes[at * lanes.len() + lane] = *own;
        }
        // The lane before becomes the one before that, and the current one the lane before.
        std::mem::swap(&mut further, &mut other);
        std::mem::swap(&mut other, &mut own);
    }
}

/// Rows around the one that is coded. Those that do not exist are positive.
struct Around<'a> {
    /// Rows of the two polar angles before.
    up: [&'a [Class]; 2],
    /// Rows of the same polar angle, of the two incoming directions before.
    back: [&'a [Class]; 2],
    /// Rows of the polar angles before and after, of the incoming direction before.
    beside_back: [&'a [Class]; 2],
    /// Rows of the same place in the two lanes coded before.
    other: [&'a [Class]; 2],
    /// Rows of the polar angles before and after, in the lane coded before.
    beside_other: [&'a [Class]; 2],
    /// Row that the coded one may repeat: that of the incoming direction before or, without one, of the polar angle
    /// before.
    alike: &'a [Class],
    /// Row of the same place as `alike`, in the lane coded before.
    alike_other: &'a [Class],
}

impl<'a> Around<'a> {
    /// Finds the rows around row number `row` among the rows `done` of its lane, and among those of the two lanes
    /// before.
    fn of(
        row: usize,
        polar: usize,
        positive: &'a [Class],
        done: &'a [Class],
        [other, further]: [&'a [Class]; 2],
    ) -> Self {
        let azimuths = positive.len();
        let (incoming, angle) = (row / polar, row % polar);
        let (first, last) = (angle == 0, angle + 1 == polar);
        let line = |plane: &'a [Class], there: bool, at: usize| {
            if there { &plane[at * azimuths..][..azimuths] } else { positive }
        };
        let back = [1, 2].map(|by| line(done, incoming >= by, row.wrapping_sub(by * polar)));
        let up = [1, 2].map(|by| line(done, angle >= by, row.wrapping_sub(by)));
        let before = row.wrapping_sub(polar);
        Self {
            up,
            back,
            beside_back: [
                line(done, incoming > 0 && !first, before.wrapping_sub(1)),
                line(done, incoming > 0 && !last, before.wrapping_add(1)),
            ],
            other: [line(other, true, row), line(further, true, row)],
            beside_other: [line(other, !first, row.wrapping_sub(1)), line(other, !last, row + 1)],
            alike: if incoming > 0 { back[0] } else { up[0] },
            alike_other: if incoming > 0 {
                line(other, true, before)
            } else {
                line(other, !first, row.wrapping_sub(1))
            },
        }
    }

    /// Returns the contexts of the decision that the row repeats `alike`, and the weight set, for the last two such
    /// decisions in `repeats`.
    fn repeating(&self, repeats: usize) -> ([usize; 3], usize) {
        let other_repeats = self.other[0] == self.alike_other;
        let other_is_it = self.other[0] == self.alike;
        let back_repeats = self.back[0] == self.back[1];
        let up_repeats = self.up[0] == self.beside_back[0];
        let is_even = self.alike.iter().all(|class| *class == self.alike[0]);
        let share = self.alike.iter().filter(|class| **class != Class::Positive).count() * 4 / self.alike.len();
        let set = bits([other_repeats, other_is_it]);
        let contexts = [
            repeats << 2 | set,
            bits([is_even, back_repeats, up_repeats]) << 2 | set,
            share << 4 | repeats << 2 | bits([is_even, back_repeats]),
        ];
        (contexts, set)
    }

    /// Writes the parts of the contexts of each sample of the row that do not depend on the row itself.
    fn know(&self, known: &mut [[usize; WIDE]]) {
        let ([up, up2], [back, back2], [other, other2]) = (self.up, self.back, self.other);
        let ([back_before, back_after], [other_before, other_after]) = (self.beside_back, self.beside_other);
        // Counts of what is not positive in the columns j − 2 to j + 2 of both rows above, and in squares of nine.
        let column = |rows: &[&[Class]], j: usize| rows.iter().filter(|row| is_other(row, j)).count();
        let above = |j| column(&[up, up2], j);
        let squares = [[back, back_before, back_after], [other, other_before, other_after]];
        let square = |number: usize, j| column(&squares[number], j);
        let mut sums = [above(0) + above(1), square(0, 0), square(1, 0)];
        for (j, known) in known.iter_mut().enumerate() {
            // Columns left of the first are positive: their numbers wrap.
            sums[0] = sums[0] + above(j + 2) - above(j.wrapping_sub(3));
            for (number, sum) in (0..2).zip(&mut sums[1..]) {
                *sum = *sum + square(number, j + 1) - square(number, j.wrapping_sub(2));
            }
            let there = |row: &[Class]| is_other(row, j);
            let left = |row: &[Class]| is_other(row, j.wrapping_sub(1));
            let right = |row: &[Class]| is_other(row, j + 1);
            *known = [
                (CLASSES * up[j] as usize + back[j] as usize) * CLASSES + other[j] as usize,
                bits([left(up), there(up), right(up), there(up2), left(back), there(back), right(back), there(other)]),
                bits([
                    left(back),
                    there(back),
                    right(back),
                    there(back2),
                    there(back_before),
                    there(back_after),
                    there(up),
                    there(other),
                ]),
                bits([
                    left(other),
                    there(other),
                    right(other),
                    there(other2),
                    there(other_before),
                    there(other_after),
                    there(up),
                ]),
                (sums[0] * 10 + sums[1]) * 10 + sums[2],
            ];
        }
    }
}

/// Adaptive models of the three sorts of decisions.
struct Models {
    lanes: Model,
    repeats: Model,
    samples: Model<WIDE>,
}

impl Models {
    fn new() -> Self {
        Self {
            lanes: Model::new(4, 1),
            repeats: Model::new(REPEATS.iter().sum(), 4),
            samples: Model::wide(KINDS * CONTEXTS.iter().sum::<usize>(), KINDS * CLASSES),
        }
    }

    fn code_row<C: BitCoder>(
        &mut self,
        coder: &mut C,
        around: &Around<'_>,
        repeats: &mut usize,
        known: &mut [[usize; WIDE]],
        row: &mut [Class],
    ) {
        let ([first, second, third], set) = around.repeating(*repeats);
        let slots = [first, REPEATS[0] + second, REPEATS[0] + REPEATS[1] + third];
        let repeat = self.repeats.code(coder, !C::DECODES && *row == *around.alike, slots, set);
        *repeats = (*repeats << 1 | usize::from(repeat)) & 3;
        if repeat {
            row.copy_from_slice(around.alike);
            return;
        }
        around.know(known);
        let other = around.other[0];
        // Class of the sample before, and which of the three before are not positive, the nearest in the lowest bit.
        let (mut left, mut signs) = (Class::Positive, 0_usize);
        for (j, class) in row.iter_mut().enumerate() {
            let [near, cross, back, lane, counts] = known[j];
            let contexts = [
                near * CLASSES + left as usize,
                cross << 3 | signs,
                back << 1 | signs & 1,
                lane << 1 | signs & 1,
                counts << 2 | signs & 3,
            ];
            *class = class.code(|kind, bit| {
                let mut start = 0;
                let slots = std::array::from_fn(|number| {
                    let slot = start + kind * CONTEXTS[number] + contexts[number];
                    start += KINDS * CONTEXTS[number];
                    slot
                });
                self.samples.code(coder, bit, slots, kind * CLASSES + other[j] as usize)
            });
            left = *class;
            signs = (signs << 1 | usize::from(left != Class::Positive)) & 7;
        }
    }
}

/// Returns true if a row has a sample at `j` that is not positive.
fn is_other(row: &[Class], j: usize) -> bool {
    row.get(j).is_some_and(|class| *class != Class::Positive)
}

/// Returns the number whose binary digits are the given ones, the highest first.
fn bits<const N: usize>(digits: [bool; N]) -> usize {
    digits.iter().fold(0, |number, &digit| number << 1 | usize::from(digit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::code_grid_classes;
    use crate::codec::range::{Decoder, Encoder};
    use crate::numeric::drawn::list;
    use arbtest::arbtest;

    fn round_trip(grid: &ClassGrid, classes: &[Class]) -> usize {
        let mut encoder = Encoder::default();
        code_wide_classes(&mut encoder, grid, &mut classes.to_vec());
        let bytes = encoder.finish();
        let mut decoded = vec![Class::Masked; classes.len()];
        code_wide_classes(&mut Decoder::new(&bytes), grid, &mut decoded);
        assert_eq!(decoded, classes);
        bytes.len()
    }

    #[test]
    fn classes_round_trip() {
        arbtest(|u| {
            let all = [Class::Positive, Class::Negative, Class::Zero, Class::Masked];
            let classes = list(u, 120..=120, |u| u.choose(&all).copied())?;
            for (incoming, polar, azimuths, lanes) in [
                (1, 1, 1, (0..120).collect()),
                (1, 1, 120, vec![0]),
                (2, 5, 4, vec![1, 2, 0]),
                (5, 1, 12, vec![0, 1]),
                (120, 1, 1, vec![0]),
                (1, 10, 12, vec![0]),
            ] {
                round_trip(&ClassGrid { incoming, polar, azimuths, lanes }, &classes);
            }
            Ok(())
        });
    }

    #[test]
    fn lanes_and_rows_that_repeat_cost_next_to_nothing() {
        let grid = ClassGrid { incoming: 1, polar: 30, azimuths: 40, lanes: (0..300).collect() };
        let class = |i: usize| if i / 300 % 7 == 3 { Class::Zero } else { Class::Positive };
        let classes: Vec<_> = (0..360_000).map(class).collect();
        let one: Vec<_> = classes.iter().step_by(300).copied().collect();
        let alone = round_trip(&ClassGrid { lanes: vec![0], ..grid.clone() }, &one);
        assert!(round_trip(&grid, &classes) <= alone + 4);
        let rows = ClassGrid { incoming: 300, polar: 30, azimuths: 40, lanes: vec![0] };
        let classes: Vec<_> = (0..360_000).map(|i| class(300 * (i % 1200))).collect();
        assert!(round_trip(&rows, &classes) <= alone + 24);
    }

    #[test]
    fn a_noisy_border_takes_fewer_bytes_than_in_the_contexts_of_four_neighbours() {
        let grid = ClassGrid { incoming: 20, polar: 30, azimuths: 40, lanes: vec![1, 2, 0] };
        // The noise of a direction is that of the same direction at other incidences.
        let class = |i: usize| {
            let (polar, azimuth, lane) = (i / 120 % 30, i / 3 % 40, i % 3);
            let noise = (i / 3 % 1200).wrapping_mul(2_654_435_761) >> 7 & 127;
            if polar * polar + azimuth * azimuth + noise < 600 + i / 3600 * 10 + lane * 40 {
                Class::Positive
            } else {
                Class::Zero
            }
        };
        let classes: Vec<_> = (0..72_000).map(class).collect();
        let mut narrow = Encoder::default();
        code_grid_classes(&mut narrow, &grid, &mut classes.clone());
        let (wide, narrow) = (round_trip(&grid, &classes), narrow.finish().len());
        assert!(10 * wide < 9 * narrow, "{wide} and {narrow} bytes");
    }
}
