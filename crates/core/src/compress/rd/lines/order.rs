//! Order of halvings: at each level, the axis along which neighbours resemble each other most.

use super::grid::{AXES, Grid};
use super::pairs::{halve, sums};
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
    (weights, run): (&[f32], usize),
    step: f64,
) -> (Vec<u8>, f64) {
    let leaves = grid.lengths().iter().product::<usize>();
    let mut values: Vec<Vec<f64>> =
        planes.chunks_exact(leaves).map(|plane| plane.iter().map(|&x| f64::from(x)).collect()).collect();
    let mut weights: Vec<Vec<f32>> = weights.chunks_exact(leaves).map(<[f32]>::to_vec).collect();
    let mut lengths = grid.lengths();
    let (mut order, mut all_bits) = (Vec::new(), 0.0);
    loop {
        let axes: Vec<usize> = (0..AXES).filter(|&axis| lengths[axis] > 1).collect();
        let mut best: Option<(f64, f64, usize, Vec<Vec<f64>>)> = None;
        for &axis in &axes {
            let circle = grid.lines[axis].period.is_some() && lengths[axis].is_multiple_of(2);
            let (mut bits, mut count) = (0.0, 0_u64);
            let mut means = values.clone();
            for (plane, means) in means.iter_mut().enumerate() {
                let weights = &weights[(plane / run.max(1)).min(weights.len() - 1)];
                let mut details = Vec::new();
                halve(means, weights, (lengths, axis), |parent, detail, weight| details.push((parent, detail, weight)));
                if axes.len() > 1 {
                    bits += cost(&details, means, (lengths, axis, circle), step);
                    count += details.len() as u64;
                }
            }
            let mean = bits / count.max(1) as f64;
            if best.as_ref().is_none_or(|(least, ..)| mean < *least) {
                best = Some((mean, bits, axis, means));
            }
        }
        let Some((_, bits, axis, means)) = best else { return (order, all_bits) };
        all_bits += bits;
        order.push(axis as u8);
        values = means;
        for weights in &mut weights {
            *weights = sums(weights, lengths, axis);
        }
        lengths[axis] = lengths[axis].div_ceil(2);
    }
}

/// Estimates the bits for coding the differences δ of merged neighbours as Σ log₂(1 + |δ − prediction|·√W / q), with W
/// the weight of the difference and q the quantiser step.
///
/// An entry of `details` is (merged node, δ, W). The prediction is a quarter of the next minus the previous node's
/// mean; beyond an end of the axis, means are extrapolated linearly.
fn cost(
    details: &[(usize, f64, f64)],
    means: &[f64],
    (children, axis, circle): ([usize; AXES], usize, bool),
    step: f64,
) -> f64 {
    let behind = children[axis + 1..].iter().product::<usize>();
    let parents = children[axis].div_ceil(2);
    let mut bits = 0.0;
    // One logarithm of a product replaces many logarithms.
    let mut product = 1.0;
    for &(parent, detail, weight) in details {
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
        product *= 1.0 + residual.min(1e30);
        if product > 1e200 {
            bits += libm::log2(product);
            product = 1.0;
        }
    }
    bits + libm::log2(product)
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
