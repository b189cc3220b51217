//! Pairs of entries along an axis: sums of weights, weighted means and details.

use super::grid::AXES;
use std::ops::Add;

/// Number of entries of the axes before `axis`, of this axis, and of the axes behind it.
fn around(children: [usize; AXES], axis: usize) -> (usize, usize, usize) {
    (children[..axis].iter().product(), children[axis], children[axis + 1..].iter().product())
}

/// Calls `each(parent, first child, second child)` for all pairs of neighbours along an axis; the last of an odd number
/// has no second child.
fn for_each_pair(children: [usize; AXES], axis: usize, mut each: impl FnMut(usize, usize, Option<usize>)) {
    let (before, length, behind) = around(children, axis);
    let mut parent = 0;
    for outer in 0..before {
        for pair in 0..length.div_ceil(2) {
            let first = (outer * length + 2 * pair) * behind;
            for inner in 0..behind {
                each(parent, first + inner, (2 * pair + 1 < length).then_some(first + behind + inner));
                parent += 1;
            }
        }
    }
}

/// Sums the weights of neighbouring grid nodes along an axis, pair by pair: the weights of the coarser nodes into which
/// the pairs merge.
pub(super) fn sums<T>(weights: &[T], children: [usize; AXES], axis: usize) -> Vec<T>
where
    T: Add<Output = T> + Copy + Default,
{
    let mut sums = vec![T::default(); weights.len() / children[axis] * children[axis].div_ceil(2)];
    for_each_pair(children, axis, |parent, first, second| {
        sums[parent] = weights[first] + second.map_or(T::default(), |second| weights[second]);
    });
    sums
}

/// Replaces values by weighted means over pairs of neighbours along an axis. Calls `detail(parent, δ, W)` if both have
/// weight, with their difference δ and W = w₀·w₁ / (w₀ + w₁).
pub(super) fn halve(
    values: &mut Vec<f64>,
    weights: &[f32],
    (children, axis): ([usize; AXES], usize),
    mut detail: impl FnMut(usize, f64, f64),
) {
    let mut end = 0;
    for_each_pair(children, axis, |parent, first, second| {
        let (w0, c0) = (f64::from(weights[first]), values[first]);
        let (w1, c1) = second.map_or((0.0, 0.0), |second| (f64::from(weights[second]), values[second]));
        let sum = w0 + w1;
        values[parent] = if w1 <= 0.0 {
            if w0 > 0.0 { c0 } else { 0.0 }
        } else if w0 <= 0.0 {
            c1
        } else {
            detail(parent, c1 - c0, w0 * w1 / sum);
            (w0 * c0 + w1 * c1) / sum
        };
        end = parent + 1;
    });
    values.truncate(end);
}
