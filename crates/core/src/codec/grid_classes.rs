//! Coder of sample classes on grids of angles: rows of azimuths, each sample in the context of its neighbours on every
//! axis.

use super::classes::Class;
use super::model::Model;
use super::range::BitCoder;

const CLASSES: usize = 4;
/// Number of contexts formed by the classes (positive, negative, zero, masked) of four neighbouring samples.
const CUBE: usize = CLASSES * CLASSES * CLASSES * CLASSES;
const REPEATS: usize = 0;
const NEAR: usize = REPEATS + 4;
const AHEAD: usize = NEAR + 3 * CUBE;
const ALONG: usize = AHEAD + 3 * CUBE;
const LANES: usize = ALONG + 3 * CUBE;
const SLOTS: usize = LANES + 4;

/// Shape of a tensor of sample classes (positive, negative, zero, masked), and the coding order of the entries of its
/// last axis.
#[derive(Clone, Debug)]
pub(crate) struct ClassGrid {
    /// Number of slices of the tensor that hold all outgoing directions: the product of the lengths of the axes before
    /// them.
    pub(crate) incoming: usize,
    /// Number of outgoing polar angles.
    pub(crate) polar: usize,
    /// Number of outgoing azimuths.
    pub(crate) azimuths: usize,
    /// Indices of the spectral channels (entries of the last axis of the tensor, such as wavelengths), in the order in
    /// which their sample classes are coded.
    pub(crate) lanes: Vec<usize>,
}

/// Encodes or decodes the class of each sample (positive, negative, zero or masked) of a tensor
/// `[incoming, polar, azimuths, lanes]`. Lanes are entries of the last axis, such as wavelengths. A decoder overwrites
/// `classes`.
///
/// # Panics
/// If the number of classes is not the product of the lengths.
pub(crate) fn code_grid_classes<C: BitCoder>(coder: &mut C, grid: &ClassGrid, classes: &mut [Class]) {
    let &ClassGrid { incoming, polar, azimuths, ref lanes } = grid;
    assert_eq!(classes.len(), incoming * polar * azimuths * lanes.len(), "classes of the whole tensor");
    let mut model = Model::new(SLOTS, 3 * CLASSES);
    let slice = polar * azimuths;
    let none = vec![Class::Positive; azimuths];
    // Classes of the current lane and of the one coded before it.
    let [mut own, mut before] = [vec![Class::Positive; incoming * slice], vec![Class::Positive; incoming * slice]];
    let mut lane_repeats = 0;
    for (number, &lane) in lanes.iter().enumerate() {
        for (at, own) in own.iter_mut().enumerate() {
            *own = if C::DECODES { Class::Positive } else { classes[at * lanes.len() + lane] };
        }
        // In measurements joined with a spectrum, all lanes are zero at the same directions.
        let is_same = number > 0 && model.code_one(coder, !C::DECODES && own == before, LANES + lane_repeats);
        lane_repeats = (lane_repeats << 1 | usize::from(is_same)) & 3;
        if is_same {
            for (at, before) in before.iter().enumerate() {
                classes[at * lanes.len() + lane] = *before;
            }
            continue;
        }
        let mut repeats = 0;
        for row in 0..incoming * polar {
            let (done, rest) = own.split_at_mut(row * azimuths);
            let here = &mut rest[..azimuths];
            let earlier = |by: usize| &done[(row - by) * azimuths..][..azimuths];
            let back = if row >= polar { earlier(polar) } else { &none };
            let up = if row % polar > 0 { earlier(1) } else { &none };
            let alike = if row >= polar { back } else { up };
            let repeat = model.code_one(coder, !C::DECODES && here == alike, REPEATS + repeats);
            repeats = (repeats << 1 | usize::from(repeat)) & 3;
            if repeat {
                here.copy_from_slice(alike);
            } else {
                let other = &before[row * azimuths..][..azimuths];
                code_row(coder, &mut model, [up, back, other], here);
            }
        }
        for (at, own) in own.iter().enumerate() {
            classes[at * lanes.len() + lane] = *own;
        }
        std::mem::swap(&mut own, &mut before);
    }
}

fn code_row<C: BitCoder>(coder: &mut C, model: &mut Model, [up, back, other]: [&[Class]; 3], row: &mut [Class]) {
    let context = |classes: [Class; 4]| classes.iter().fold(0, |context, &class| CLASSES * context + class as usize);
    for j in 0..row.len() {
        let left = |by: usize| if j >= by { row[j - by] } else { Class::Positive };
        let ahead = |row: &[Class]| row.get(j + 1).copied().unwrap_or_default();
        let near = context([left(1), up[j], back[j], other[j]]);
        let further = context([left(1), ahead(up), ahead(back), ahead(other)]);
        let along = context([left(1), left(2), up[j], other[j]]);
        row[j] = row[j].code(|kind, bit| {
            let slots = [NEAR + kind * CUBE + near, AHEAD + kind * CUBE + further, ALONG + kind * CUBE + along];
            model.code(coder, bit, slots, kind * CLASSES + other[j] as usize)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::range::{Decoder, Encoder};
    use crate::numeric::drawn::list;
    use arbtest::arbtest;

    fn round_trip(grid: &ClassGrid, classes: &[Class]) -> usize {
        let mut encoder = Encoder::default();
        code_grid_classes(&mut encoder, grid, &mut classes.to_vec());
        let bytes = encoder.finish();
        let mut decoded = vec![Class::Masked; classes.len()];
        code_grid_classes(&mut Decoder::new(&bytes), grid, &mut decoded);
        assert_eq!(decoded, classes);
        bytes.len()
    }

    #[test]
    fn classes_round_trip() {
        arbtest(|u| {
            let all = [Class::Positive, Class::Negative, Class::Zero, Class::Masked];
            let classes = list(u, 120..=120, |u| u.choose(&all).copied())?;
            for (incoming, polar, azimuths, lanes) in
                [(1, 1, 1, (0..120).collect()), (2, 5, 4, vec![1, 2, 0]), (120, 1, 1, vec![0]), (1, 10, 12, vec![0])]
            {
                round_trip(&ClassGrid { incoming, polar, azimuths, lanes }, &classes);
            }
            Ok(())
        });
    }

    #[test]
    fn lanes_that_repeat_cost_next_to_nothing() {
        let grid = ClassGrid { incoming: 1, polar: 30, azimuths: 40, lanes: (0..300).collect() };
        let class = |i: usize| if i / 300 % 7 == 3 { Class::Zero } else { Class::Positive };
        let classes: Vec<_> = (0..360_000).map(class).collect();
        let one: Vec<_> = classes.iter().step_by(300).copied().collect();
        let alone = round_trip(&ClassGrid { lanes: vec![0], ..grid.clone() }, &one);
        assert!(round_trip(&grid, &classes) <= alone + 4);
    }

    #[test]
    fn smooth_borders_cost_little() {
        let grid = ClassGrid { incoming: 20, polar: 30, azimuths: 40, lanes: vec![1, 2, 0] };
        let class = |i: usize| {
            let (polar, azimuth) = (i / 120 % 30, i / 3 % 40);
            if polar * polar + azimuth * azimuth < 600 + i / 3600 * 10 { Class::Positive } else { Class::Zero }
        };
        assert!(round_trip(&grid, &(0..72_000).map(class).collect::<Vec<_>>()) < 500);
    }
}
