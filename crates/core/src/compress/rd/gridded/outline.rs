//! Outline of the samples on a grid that are coded under a floor: smoothed, because a map of it takes bytes.
//!
//! A sample below the floor may come back as 0 or near the floor. Which of the two is cheaper depends on its
//! neighbours: a noisy border between coded samples and zeros takes many bits, a few more coded samples take few.

use super::lattice::{Lattice, Shape};
use super::repeats::Repeats;
use crate::codec::Encoder;
use crate::domain::Axis;
use crate::numeric::least_cut::{AXES, Node, for_each_pair, least_cut};
use rayon::prelude::*;

/// Share of the floor up to which samples come back as 0. Larger ones may be coded as if they were as large as the
/// floor; their error is then within the floor if the decoded value is at most this share too large.
const DARK: f32 = 0.3;
/// Bits of a coded sample below the floor, as a multiple of those of a sample above it: as all of them are coded as the
/// floor, they are smoother. Raising it leaves the outline noisier.
const SHARE: f64 = 0.4;
/// Costs of a border between a coded sample and a 0 beside it, by axis, the last being the outgoing azimuths. The map
/// is coded row by row along the last axis, where a change is hardest to foresee, and each row next to that of the
/// outgoing polar angle before.
const BORDERS: [u32; AXES] = [200, 200, 100, 400];
/// Cost of a usual border, the geometric mean of [`BORDERS`]. It is large because the cost of a sample, a whole number,
/// too, may be far smaller.
const BORDER: f64 = 200.0;
/// Largest number of samples whose outline is smoothed. Raising it takes time and 60 bytes of memory per sample.
const MOST: usize = 1 << 20;

/// Sizes in bytes of the parts of a file in which every sample below the floor is 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spent {
    /// Bytes of the map of classes (positive, negative, zero, masked).
    pub(crate) classes: usize,
    /// Bytes of the values of all other samples.
    pub(crate) values: usize,
}

/// Finds the samples that are best coded in a file on a grid of angles: all from the floor on, and those below it by
/// which their outline becomes so smooth that its map saves more than they cost. Positive samples without a mark come
/// back as 0.
///
/// `spent` are the bytes of a file that codes no sample below the floor. `None` if no sample below the floor is better
/// coded, or if there are too many samples.
pub(crate) fn outlined(axes: &[Axis], samples: &[f32], floor: f32, spent: Spent) -> Option<Vec<bool>> {
    let shape = Shape::of(axes).filter(|_| samples.len() <= MOST)?;
    let n = shape.length();
    let same = |a: usize, b: usize| samples[a].to_bits() == samples[b].to_bits();
    let lattice = Lattice::code(&mut Encoder::default(), shape, Some(&same));
    let repeats = Repeats::of(&lattice);
    let lengths = lattice.grid(false).lengths();
    let block = lengths.iter().product::<usize>();
    let node = |leaf: usize, lane: usize, cost: u32| {
        let sample = samples[repeats.first_row(leaf) * n + lane];
        if !repeats.is_own(leaf) || sample.is_nan() {
            Node::Absent
        } else if sample >= floor {
            Node::Fixed(true)
        } else if sample <= DARK * floor {
            Node::Fixed(false)
        } else {
            Node::Free(cost)
        }
    };
    let blocks: Vec<(usize, usize)> =
        (0..repeats.leaves() / block).flat_map(|first| (0..n).map(move |lane| (first * block, lane))).collect();
    let (coded, borders) = blocks
        .par_iter()
        .map(|&(first, lane)| counts(lengths, |leaf| node(first + leaf, lane, 0)))
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if coded == 0 || borders == 0 {
        return None;
    }
    let bytes_of_sample = SHARE * spent.values as f64 / coded as f64;
    let bytes_of_border = spent.classes.max(1) as f64 / borders as f64;
    let cost = (BORDER * bytes_of_sample / bytes_of_border).clamp(1.0, 1e6) as u32;
    let cut = |&(first, lane): &(usize, usize)| {
        let nodes: Vec<Node> = (first..first + block).map(|leaf| node(leaf, lane, cost)).collect();
        least_cut(lengths, BORDERS, &nodes)
    };
    let marks: Vec<Vec<bool>> = blocks.par_iter().map(cut).collect::<Option<_>>()?;
    if marks.iter().flatten().filter(|&&mark| mark).count() == coded {
        return None;
    }
    let mark = |at: usize| {
        let leaf = repeats.leaf(at / n);
        marks[leaf / block * n + at % n][leaf % block]
    };
    Some((0..samples.len()).map(mark).collect())
}

/// Counts the nodes of a grid that are given as true, and their borders with others.
fn counts(lengths: [usize; AXES], node: impl Fn(usize) -> Node) -> (usize, usize) {
    let nodes: Vec<Node> = (0..lengths.iter().product()).map(node).collect();
    let is_coded = |node: Node| node == Node::Fixed(true);
    let coded = nodes.iter().filter(|node| is_coded(**node)).count();
    let mut borders = 0;
    for_each_pair(lengths, |_, a, b| {
        let both = nodes[a] != Node::Absent && nodes[b] != Node::Absent;
        borders += usize::from(both && is_coded(nodes[a]) != is_coded(nodes[b]));
    });
    (coded, borders)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{AzimuthExtent, Azimuths, DirectionGrid, Frame};

    const SPENT: Spent = Spent { classes: 1000, values: 1000 };

    fn axes() -> Vec<Axis> {
        let angles = |step: f64, count: u8| (0..count).map(|k| step * f64::from(k)).collect::<Vec<_>>();
        let azimuths = Azimuths { angles: angles(15.0, 24), extent: AzimuthExtent::Circle };
        let grid = DirectionGrid::new(Frame::Surface, angles(4.0, 20), Some(azimuths)).unwrap();
        vec![Axis::Elevation(angles(10.0, 6)), Axis::Grid(grid), Axis::Rgb]
    }

    /// Samples that fall towards larger polar angles, with noise of a factor of two or less about every mean. The
    /// elevations 20° and 30° have the same samples.
    fn noisy(length: usize) -> Vec<f32> {
        let mut state = 5_u64;
        let mut samples = Vec::with_capacity(length);
        for at in 0..length {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let noise = (state >> 40) as f64 / 16_777_216.0;
            let slice = length / 6;
            samples.push(match (at / slice, at / 72 % 20) {
                (3, _) => samples[at - slice],
                (_, 19) => -0.1,
                (_, 18) => 0.0,
                (_, polar) => libm::exp2(3.0 - 0.5 * polar as f64 + noise) as f32,
            });
        }
        samples[7] = f32::NAN;
        samples
    }

    #[test]
    fn an_outline_is_smooth_and_goes_around_everything_from_the_floor_on() {
        let (axes, samples) = (axes(), noisy(6 * 20 * 24 * 3));
        let marks = outlined(&axes, &samples, 1.0, SPENT).unwrap();
        for (&sample, &mark) in samples.iter().zip(&marks) {
            assert!(if sample >= 1.0 { mark } else { !mark || sample > 0.3 }, "{sample} {mark}");
        }
        let slice = samples.len() / 6;
        assert_eq!(marks[2 * slice..3 * slice], marks[3 * slice..4 * slice]);
        let borders = |marks: &[bool]| marks.windows(4).filter(|of| of[0] != of[3]).count();
        let floored: Vec<bool> = samples.iter().map(|&sample| sample >= 1.0).collect();
        assert!(2 * borders(&marks) < borders(&floored), "{} {}", borders(&marks), borders(&floored));
    }

    #[test]
    fn the_more_a_sample_costs_the_fewer_are_coded() {
        let (axes, samples) = (axes(), noisy(6 * 20 * 24 * 3));
        let coded = |values| {
            let marks = outlined(&axes, &samples, 1.0, Spent { classes: 1000, values });
            marks.map(|marks| marks.into_iter().filter(|&mark| mark).count())
        };
        let least = samples.iter().filter(|&&sample| sample >= 1.0).count();
        let [few, some, all] = [1000, 20_000, 10_000_000].map(coded);
        assert!(few > some && some > Some(least) && all.is_none(), "{few:?} {some:?} {all:?} {least}");
    }

    #[test]
    fn without_a_border_there_is_no_outline() {
        let axes = axes();
        let count = axes.iter().map(Axis::len).product();
        assert_eq!(outlined(&axes, &vec![0.5; count], 1.0, SPENT), None);
        assert_eq!(outlined(&axes, &vec![2.0; count], 1.0, SPENT), None);
        assert_eq!(outlined(&[Axis::Rgb], &[0.5, 2.0, 0.1], 1.0, SPENT), None);
    }
}
