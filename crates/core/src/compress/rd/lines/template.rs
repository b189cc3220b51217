//! Neighbours that predict a detail, and neighbours whose errors estimate how well it is predicted.

use super::grid::AXES;
use super::neighbours::{Distance, distance};

/// Number of earlier spectral channels whose details serve to predict those of a channel. Raising it slows coding.
pub(super) const BEFORE: usize = 2;

/// Relative positions of the neighbours that predict the detail of a node when one axis is halved; axes with one entry
/// contribute none.
pub(super) struct Template {
    /// Neighbours of a grid node whose means, less the mean of the node, are inputs for predicting the node's detail,
    /// the difference of its two halves.
    pub(super) differences: [Distance; 4],
    /// Pairs of neighbours of a grid node whose difference of means is an input for predicting the node's detail, the
    /// difference of its two halves.
    pub(super) slopes: Vec<[Distance; 2]>,
    /// Blocks of directions near the one whose detail (difference of its two halves) is predicted. Details of these
    /// blocks in the same spectral channel, decoded before, are inputs of the prediction.
    pub(super) details: Vec<Distance>,
    /// Block of directions whose detail (difference of its two halves) is predicted, and two beside it. Details of
    /// these blocks in the two spectral channels before are inputs of the prediction.
    pub(super) others: [Distance; 3],
    /// Blocks of directions near the one whose detail (difference of its two halves) is predicted, each with a weight.
    /// The weighted mean of the squared prediction errors there serves to estimate the error of this prediction.
    pub(super) errors: Vec<(Distance, f32)>,
    is_long: bool,
}

impl Template {
    /// Lists the relative positions of the neighbours from which the difference of two grid nodes, merged along `axis`,
    /// is predicted. `long` marks the grid axes with more than one entry, along which neighbours exist.
    pub(super) fn new(axis: usize, long: [bool; AXES]) -> Self {
        let across: Vec<usize> = (0..AXES).filter(|&b| b != axis && long[b]).collect();
        let (mut slopes, mut details) = (Vec::new(), vec![distance(&[(axis, -1)])]);
        for &b in &across {
            for side in [1, -1] {
                slopes.push([distance(&[(axis, 1), (b, side)]), distance(&[(axis, -1), (b, side)])]);
            }
            details.push(distance(&[(b, -1)]));
            if b < axis {
                details.push(distance(&[(b, -1), (axis, 1)]));
            }
            details.push(distance(&[(b, -1), (axis, -1)]));
            details.push(distance(&[(b, -2)]));
        }
        for (i, &b) in across.iter().enumerate() {
            for &c in &across[i + 1..] {
                details.extend([-1, 1].map(|side| distance(&[(b, -1), (c, side)])));
            }
        }
        let all: Vec<usize> = (0..AXES).filter(|&b| long[b]).collect();
        let mut errors = Vec::new();
        for &b in &all {
            errors.extend([(distance(&[(b, -1)]), 1.0), (distance(&[(b, -2)]), 0.5)]);
        }
        for (i, &b) in all.iter().enumerate() {
            for &c in &all[i + 1..] {
                for (back, side, counts) in [(-1, -1, 0.5), (-1, 1, 0.5), (-1, 2, 0.25), (-2, 1, 0.25), (-2, -1, 0.25)]
                {
                    errors.push((distance(&[(b, back), (c, side)]), counts));
                }
            }
        }
        Self {
            differences: [1, -1, 2, -2].map(|by| distance(&[(axis, by)])),
            slopes,
            details,
            others: [0, 1, -1].map(|by| distance(&[(axis, by)])),
            errors,
            is_long: long[axis],
        }
    }

    /// Number of features from which a detail is predicted, including details of earlier spectral channels.
    pub(super) fn features(&self) -> usize {
        self.differences.len() + self.slopes.len() + self.details.len() + BEFORE * self.others.len()
    }

    /// Returns true if the grid axis along which these nodes merge in pairs has more than one entry, so that a node has
    /// neighbours along it.
    pub(super) fn is_long(&self) -> bool {
        self.is_long
    }
}
