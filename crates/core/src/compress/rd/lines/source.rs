//! Means and details of planes, finest first: the input of an encoder's quantiser.

use super::halvings::Halvings;
use super::pairs::halve;

/// Least number of the finest grid nodes whose means or details are held, and freed, together. Raising it takes memory;
/// with few, the many lists of a table of small grids take more than their entries.
const GROUP: usize = 1 << 16;

/// Returns the number of spectral channels whose means or details are held, and freed, together.
pub(super) fn group(halvings: &Halvings) -> usize {
    GROUP.div_ceil(leaves(halvings).max(1))
}

fn leaves(halvings: &Halvings) -> usize {
    halvings.all().first().map_or(1, |halving| halving.children.iter().product())
}

/// Unquantised input of an encoder for some successive spectral channels.
#[derive(Clone)]
struct Part {
    roots: Vec<f64>,
    /// Details (differences of merged neighbours) of each halving of the grid, finest first: `[channel, node]`.
    details: Vec<Vec<f32>>,
}

/// Unquantised input of an encoder, for each spectral channel: the mean over the whole grid, and the details
/// (differences of merged neighbours) from which finer means follow.
#[derive(Clone)]
pub(crate) struct Source {
    parts: Vec<Part>,
    /// Number of spectral channels in each part but the last.
    group: usize,
}

impl Source {
    /// Computes the mean of values `[slice, channel, direction]` over all directions, merging neighbouring blocks of
    /// directions in pairs, and the difference of each pair (detail). Values of weight 0 may be any number.
    pub(super) fn new(halvings: &Halvings, planes: &[f32], vectors: usize) -> Self {
        let (leaves, group) = (leaves(halvings), group(halvings));
        let part = |(number, planes): (usize, &[f32])| {
            let count = planes.len() / leaves;
            let mut details: Vec<Vec<f32>> =
                halvings.all().iter().map(|halving| vec![0.0; count * halving.parents.count()]).collect();
            let mut roots = Vec::with_capacity(count);
            for (at, values) in planes.chunks_exact(leaves).enumerate() {
                let mut values: Vec<f64> = values.iter().map(|&x| f64::from(x)).collect();
                for (level, halving) in halvings.all().iter().enumerate() {
                    let to = &mut details[level][at * halving.parents.count()..];
                    let weights = halvings.weights_of((number * group + at, vectors), level);
                    halve(&mut values, &weights, (halving.children, halving.axis), |parent, detail, _| {
                        to[parent] = detail as f32;
                    });
                }
                roots.push(values.first().copied().unwrap_or(0.0));
            }
            Part { roots, details }
        };
        Self { parts: planes.chunks(leaves * group).enumerate().map(part).collect(), group }
    }

    /// Frees the details of a halving of the grid in a group of spectral channels.
    pub(super) fn free(&mut self, group: usize, level: usize) {
        self.parts[group].details[level] = Vec::new();
    }

    /// Original mean of a spectral channel over the whole grid.
    pub(super) fn root(&self, plane: usize) -> f64 {
        self.parts[plane / self.group].roots[plane % self.group]
    }

    /// Original details (differences of merged neighbours) of a spectral channel at one halving of the grid.
    pub(super) fn details(&self, level: usize, plane: usize, parents: usize) -> &[f32] {
        &self.parts[plane / self.group].details[level][plane % self.group * parents..][..parents]
    }
}
