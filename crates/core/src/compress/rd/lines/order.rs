//! Order of halvings: at each level, the axis along which neighbours resemble each other most.

use super::grid::{AXES, Grid};
use super::pairs::halve;
use super::weights::Weights;
use crate::codec::BitCoder;

/// Finds the order in which to merge neighbouring angles of a grid in pairs along its axes, so that coding costs least.
/// Also estimates the bits for coding the differences of merged neighbours.
///
/// Each step takes the axis along which these differences are predicted best from the original means. `planes` holds
/// values `[channel, direction]`. `weights` holds one set of weights of all directions for each `run` successive
/// channels.
pub(crate) fn order_of_halvings(
    grid: &Grid,
    planes: &[f32],
    (weights, run): (&[u8], usize),
    step: f64,
) -> (Vec<u8>, f64) {
    let leaves = grid.lengths().iter().product::<usize>();
    let count = planes.len() / leaves;
    // Means after the halvings so far; none before the first, as a copy of all values in f64 takes much memory.
    let mut halved: Vec<Vec<f64>> = Vec::new();
    let values = |halved: &[Vec<f64>], plane: usize| {
        let given = || planes[plane * leaves..][..leaves].iter().map(|&x| f64::from(x)).collect();
        halved.get(plane).cloned().unwrap_or_else(given)
    };
    let mut weights: Vec<Weights> = weights.chunks_exact(leaves).map(|set| Weights::Small(set.to_vec())).collect();
    let mut lengths = grid.lengths();
    let (mut order, mut all_bits) = (Vec::new(), 0.0);
    loop {
        let axes: Vec<usize> = (0..AXES).filter(|&axis| lengths[axis] > 1).collect();
        let set = |plane: usize| (plane / run.max(1)).min(weights.len() - 1);
        let cost = |axis: usize| {
            let circle = grid.lines[axis].period.is_some() && lengths[axis].is_multiple_of(2);
            let (mut bits, mut details) = (0.0, 0_u64);
            for plane in 0..count {
                let (weights, mut own) = (weights[set(plane)].floats(), values(&halved, plane));
                let mut means = own.clone();
                halve(&mut means, &weights, (lengths, axis), |_, _, _| ());
                let mut cost = Cost::new(&means, (lengths, axis, circle), step);
                halve(&mut own, &weights, (lengths, axis), |parent, detail, weight| {
                    cost.add(parent, detail, weight);
                    details += 1;
                });
                bits += cost.bits();
            }
            (bits / details.max(1) as f64, bits)
        };
        let costs = match axes.as_slice() {
            // Nothing is to be chosen.
            [only] => vec![(*only, (0.0, 0.0))],
            several => several.iter().map(|&axis| (axis, cost(axis))).collect(),
        };
        let Some((axis, (_, bits))) = costs.into_iter().reduce(|best, one| if one.1.0 < best.1.0 { one } else { best })
        else {
            return (order, all_bits);
        };
        all_bits += bits;
        order.push(axis as u8);
        halved = (0..count)
            .map(|plane| {
                let mut means = values(&halved, plane);
                halve(&mut means, &weights[set(plane)].floats(), (lengths, axis), |_, _, _| ());
                means.shrink_to_fit();
                means
            })
            .collect();
        for weights in &mut weights {
            *weights = weights.merged(lengths, axis);
        }
        lengths[axis] = lengths[axis].div_ceil(2);
    }
}

/// Estimate of the bits for coding the differences δ of merged neighbours along one axis: the sum of
/// log₂(1 + |δ − prediction|·√W / q), with W the weight of the difference and q the quantiser step.
///
/// The prediction is a quarter of the next minus the previous node's mean; beyond an end of the axis, means are
/// extrapolated linearly.
struct Cost<'a> {
    /// Means of the merged nodes.
    means: &'a [f64],
    /// Number of merged nodes along the axis, and product of the lengths of the axes behind it.
    parents: usize,
    behind: usize,
    circle: bool,
    step: f64,
    bits: f64,
    /// One logarithm of a product replaces many logarithms.
    product: f64,
}

impl<'a> Cost<'a> {
    fn new(means: &'a [f64], (children, axis, circle): ([usize; AXES], usize, bool), step: f64) -> Self {
        let behind = children[axis + 1..].iter().product::<usize>();
        Self { means, parents: children[axis].div_ceil(2), behind, circle, step, bits: 0.0, product: 1.0 }
    }

    /// Adds the bits for the difference `detail`, of weight `weight`, of the neighbours that node `parent` merges.
    fn add(&mut self, parent: usize, detail: f64, weight: f64) {
        let &mut Self { means, parents, behind, circle, step, .. } = self;
        let at = parent / behind % parents;
        let own = means[parent];
        let side = |by: isize| {
            let to = at as isize + by;
            let exists = circle || (0..parents as isize).contains(&to);
            exists.then(|| means[parent - at * behind + to.rem_euclid(parents as isize) as usize * behind])
        };
        let (after, before) = match (side(1), side(-1)) {
            (Some(after), Some(before)) => (after, before),
            (Some(after), None) => (after, 2.0 * own - after),
            (None, Some(before)) => (2.0 * own - before, before),
            (None, None) => (own, own),
        };
        let residual = (detail - (after - before) / 4.0).abs() * weight.sqrt() / step;
        self.product *= 1.0 + residual.min(1e30);
        if self.product > 1e200 {
            self.bits += libm::log2(self.product);
            self.product = 1.0;
        }
    }

    fn bits(self) -> f64 {
        self.bits + libm::log2(self.product)
    }
}

/// Encodes or decodes the order in which the axes of a grid are halved down to one entry each; any bytes decode to some
/// order.
pub(crate) fn code_order<C: BitCoder>(coder: &mut C, grid: &Grid, order: &[u8]) -> Vec<u8> {
    let mut lengths = grid.lengths();
    let mut coded = Vec::new();
    loop {
        let axes: Vec<usize> = (0..AXES).filter(|&axis| lengths[axis] > 1).collect();
        let Some(&last) = axes.last() else { return coded };
        let wanted = order.get(coded.len()).map_or(last, |&axis| usize::from(axis));
        // One decision for each remaining axis but the last: is it this one?
        let axis = axes[..axes.len() - 1].iter().copied().find(|&axis| coder.even(axis == wanted)).unwrap_or(last);
        coded.push(axis as u8);
        lengths[axis] = lengths[axis].div_ceil(2);
    }
}
