//! Means and details of planes, finest first: the input of an encoder's quantiser.

use super::halvings::Halvings;
use super::pairs::halve;

/// Unquantised input of an encoder, for each spectral channel: the mean over the whole grid, and the details
/// (differences of merged neighbours) from which finer means follow.
pub(crate) struct Source {
    roots: Vec<f64>,
    /// Details (differences of merged neighbours) of each halving of the grid, finest first: `[channel, node]`.
    details: Vec<Vec<f32>>,
}

impl Source {
    /// Computes the mean of values `[slice, channel, direction]` over all directions, merging neighbouring blocks of
    /// directions in pairs, and the difference of each pair (detail). Values of weight 0 may be any number.
    pub(super) fn new(halvings: &Halvings, planes: &[f32], vectors: usize) -> Self {
        let leaves = halvings.all().first().map_or(1, |halving| halving.children.iter().product());
        let count = planes.len() / leaves;
        let mut details: Vec<Vec<f32>> =
            halvings.all().iter().map(|halving| vec![0.0; count * halving.parents.count()]).collect();
        let mut roots = Vec::with_capacity(count);
        for (plane, values) in planes.chunks_exact(leaves).enumerate() {
            let mut values: Vec<f64> = values.iter().map(|&x| f64::from(x)).collect();
            for (level, halving) in halvings.all().iter().enumerate() {
                let to = &mut details[level][plane * halving.parents.count()..];
                let weights = halvings.weights_of((plane, vectors), level);
                halve(&mut values, weights, (halving.children, halving.axis), |parent, detail, _| {
                    to[parent] = detail as f32;
                });
            }
            roots.push(values.first().copied().unwrap_or(0.0));
        }
        Self { roots, details }
    }

    /// Original mean of a spectral channel over the whole grid.
    pub(super) fn root(&self, plane: usize) -> f64 {
        self.roots[plane]
    }

    /// Original details (differences of merged neighbours) of a spectral channel at one halving of the grid.
    pub(super) fn details(&self, level: usize, plane: usize, parents: usize) -> &[f32] {
        &self.details[level][plane * parents..][..parents]
    }
}
