//! Halvings of a grid: axis and parents of each, and the weights of all means over the samples.

use super::grid::{AXES, Grid};
use super::guess::{Coefficients, coefficients};
use super::neighbours::Places;
use super::pairs::sums;

/// One halving: `children` become `parents`.
pub(super) struct Halving {
    pub(super) axis: usize,
    pub(super) children: [usize; AXES],
    pub(super) parents: Places,
    /// Filters of each node of the halved axis.
    pub(super) guess: Vec<Coefficients>,
}

/// Weights of the samples of planes, and of all means over them.
struct Weights {
    /// Weights after each halving, from the finest to the root.
    levels: Vec<Vec<f32>>,
}

/// All halvings of a grid, and the weights of planes on it.
pub(super) struct Halvings {
    /// Halvings, finest first.
    steps: Vec<Halving>,
    /// Weights of each tensor, or of each plane; the last set serves all that follow.
    weights: Vec<Weights>,
    /// True if the planes of one tensor have weights of their own.
    by_plane: bool,
}

impl Halvings {
    /// Computes the halvings of a grid in the given order; missing halvings are added, superfluous ones skipped.
    /// `weights` are those of all leaves, one set for each tensor or (`by_plane`) plane; the last serves all that
    /// follow.
    pub(super) fn new(grid: &Grid, order: &[u8], weights: &[f32], by_plane: bool) -> Self {
        let mut children = grid.lengths();
        let leaves = children.iter().product::<usize>();
        let mut levels: Vec<Weights> =
            weights.chunks(leaves.max(1)).map(|w| Weights { levels: vec![w.to_vec()] }).collect();
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
                if let Some(last) = set.levels.last() {
                    let sums = sums(last, children, axis);
                    set.levels.push(sums);
                }
            }
            halvings.push(Halving { axis, children, parents: Places::new(parents, wraps), guess });
            children = parents;
        }
        Self { steps: halvings, weights: levels, by_plane }
    }

    /// All halvings, finest first.
    pub(super) fn all(&self) -> &[Halving] {
        &self.steps
    }

    /// Weights of a plane after `level` halvings; there are `vectors` planes to a tensor.
    pub(super) fn weights_of(&self, (plane, vectors): (usize, usize), level: usize) -> &[f32] {
        let set = if self.by_plane { plane } else { plane / vectors.max(1) };
        &self.weights[set.min(self.weights.len() - 1)].levels[level]
    }
}
