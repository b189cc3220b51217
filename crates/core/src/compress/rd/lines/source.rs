//! Means and details of planes, finest first: what an encoder quantises.

use super::{AXES, PairPyramid};

/// Entries along an axis as pairs: (entries before the axis, those of it, those behind).
fn around(children: [usize; AXES], axis: usize) -> (usize, usize, usize) {
    (children[..axis].iter().product(), children[axis], children[axis + 1..].iter().product())
}

/// Calls `each(parent, first child, second child)` for all parents; the last of an odd number has no second.
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

/// Sums of weights over pairs along an axis.
pub(super) fn sums(weights: &[f32], children: [usize; AXES], axis: usize) -> Vec<f32> {
    let mut sums = vec![0.0; weights.len() / children[axis] * children[axis].div_ceil(2)];
    for_each_pair(children, axis, |parent, first, second| {
        sums[parent] = weights[first] + second.map_or(0.0, |second| weights[second]);
    });
    sums
}

/// Replaces values by weighted means over pairs along an axis; calls `detail(parent, δ, W)` where both weigh.
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

/// Means and details of planes.
pub(crate) struct Source {
    roots: Vec<f64>,
    /// By halving from the finest: by plane and parent.
    details: Vec<Vec<f32>>,
}

impl Source {
    /// Analyses planes `[tensors, vectors, leaves]`; samples without weight may hold anything.
    pub(crate) fn new(pyramid: &PairPyramid, planes: &[f32], vectors: usize) -> Self {
        let leaves = pyramid.halvings.first().map_or(1, |halving| halving.children.iter().product());
        let count = planes.len() / leaves;
        let mut details: Vec<Vec<f32>> =
            pyramid.halvings.iter().map(|halving| vec![0.0; count * halving.parents.count()]).collect();
        let mut roots = Vec::with_capacity(count);
        for (plane, values) in planes.chunks_exact(leaves).enumerate() {
            let mut values: Vec<f64> = values.iter().map(|&x| f64::from(x)).collect();
            for (level, halving) in pyramid.halvings.iter().enumerate() {
                let to = &mut details[level][plane * halving.parents.count()..];
                let weights = pyramid.weights_of((plane, vectors), level);
                halve(&mut values, weights, (halving.children, halving.axis), |parent, detail, _| {
                    to[parent] = detail as f32;
                });
            }
            roots.push(values.first().copied().unwrap_or(0.0));
        }
        Self { roots, details }
    }

    /// The mean of a plane.
    pub(super) fn root(&self, plane: usize) -> f64 {
        self.roots[plane]
    }

    /// The details of a plane at a halving.
    pub(super) fn details(&self, level: usize, plane: usize, parents: usize) -> &[f32] {
        &self.details[level][plane * parents..][..parents]
    }
}
