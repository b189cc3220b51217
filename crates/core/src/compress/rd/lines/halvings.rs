//! Halvings of a grid: axis and parents of each, and the weights of all means over the samples.

use super::grid::{AXES, Grid};
use super::guess::{Coefficients, coefficients};
use super::neighbours::{Places, Recent};
use super::weights::Weights;
use std::borrow::Cow;

/// One halving of a grid: merges neighbouring nodes along one axis in pairs, `children` to `parents`.
pub(super) struct Halving {
    pub(super) axis: usize,
    pub(super) children: [usize; AXES],
    pub(super) parents: Places,
    /// Places for the errors of predictions at the nodes: coding a node reads those of nodes shortly before it.
    pub(super) recent: Recent,
    /// Filter that predicts the difference of the two children of a node from the means of the node's neighbours, for
    /// each node of the coarser axis.
    pub(super) guess: Vec<Coefficients>,
}

/// All halvings of a grid (merges of neighbouring nodes along one axis), from the full one to a single node, and the
/// weights of the nodes.
pub(super) struct Halvings {
    /// Merges of neighbouring directions, and of the blocks so formed, in pairs along one axis at a time: from the full
    /// grid of angles to a single block.
    steps: Vec<Halving>,
    /// Weights of directions in means over blocks of directions: one set for each slice of the tensor or, with
    /// `by_plane`, for each spectral channel of each slice. The last set also serves all slices or channels after it.
    ///
    /// A set holds the weights of the nodes of the full grid, and of those after each merge of neighbours in pairs.
    weights: Vec<Vec<Weights>>,
    /// True if each spectral channel has its own weights of directions, with which means are formed; false if all
    /// channels share them.
    by_plane: bool,
}

impl Halvings {
    /// Computes the halvings of a grid, merges of neighbours in pairs along one axis each. `order` lists these axes;
    /// superfluous entries are skipped, and merges added until one node is left.
    ///
    /// `weights` holds one set of weights of all grid nodes for each slice of the tensor or (`by_plane`) each spectral
    /// channel; the last set serves all later ones.
    pub(super) fn new(grid: &Grid, order: &[u8], weights: &[u8], by_plane: bool) -> Self {
        let mut children = grid.lengths();
        let first = children.iter().position(|&n| n > 1).unwrap_or(AXES - 1);
        let leaves = children.iter().product::<usize>();
        let mut levels: Vec<Vec<Weights>> =
            weights.chunks(leaves.max(1)).map(|set| vec![Weights::Small(set.to_vec())]).collect();
        let mut halved = [0; AXES];
        let mut halvings = Vec::with_capacity(order.len());
        let rest = (0..AXES).flat_map(|axis| std::iter::repeat_n(axis, usize::BITS as usize));
        for axis in order.iter().map(|&axis| usize::from(axis) % AXES).chain(rest) {
            if children[axis] < 2 {
                continue;
            }
            let circles = grid.lines.each_ref().map(|line| line.period.is_some());
            let mut wraps = circles;
            wraps[axis] &= children[axis].is_multiple_of(2);
            let mut parents = children;
            parents[axis] = children[axis].div_ceil(2);
            halved[axis] += 1;
            let guess = coefficients(&grid.lines[axis], halved[axis], wraps[axis]);
            for set in &mut levels {
                if let Some(last) = set.last() {
                    let merged = last.merged(children, axis);
                    set.push(merged);
                }
            }
            let (places, recent) = (Places::new(parents, wraps), Recent::new(parents, wraps, first));
            halvings.push(Halving { axis, children, parents: places, recent, guess });
            children = parents;
        }
        Self { steps: halvings, weights: levels, by_plane }
    }

    /// Returns all merges of neighbouring grid nodes in pairs, one axis at a time, in order from the full grid to a
    /// single node.
    pub(super) fn all(&self) -> &[Halving] {
        &self.steps
    }

    /// Returns the weights of grid nodes in means of a spectral channel, after `level` merges of neighbours in pairs.
    /// `place` is the number of the channel, counted through all slices of the tensor, and the number of channels of a
    /// slice.
    pub(super) fn weights_of(&self, place: (usize, usize), level: usize) -> Cow<'_, [f32]> {
        self.set_of(place)[level].floats()
    }

    /// Returns the weight of a whole spectral channel, at a `place` as in [`Halvings::weights_of`]: that of the single
    /// node into which all directions merge.
    pub(super) fn weight_of_all(&self, place: (usize, usize)) -> f32 {
        self.set_of(place).last().map_or(0.0, Weights::first)
    }

    fn set_of(&self, (plane, vectors): (usize, usize)) -> &[Weights] {
        let set = if self.by_plane { plane } else { plane / vectors.max(1) };
        &self.weights[set.min(self.weights.len() - 1)]
    }
}
