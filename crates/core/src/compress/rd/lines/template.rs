//! Neighbours that predict a detail, and neighbours whose errors estimate how well it is predicted.

use super::grid::AXES;
use super::neighbours::{Distance, distance};

/// Number of earlier planes whose details are features.
pub(super) const BEFORE: usize = 2;

/// Neighbours of a node when one axis is halved; axes with one entry contribute none.
pub(super) struct Template {
    /// Neighbours whose difference from the node's mean is a feature.
    pub(super) differences: [Distance; 4],
    /// Pairs of neighbours whose difference is a feature.
    pub(super) slopes: Vec<[Distance; 2]>,
    /// Neighbours whose detail in this plane is a feature.
    pub(super) details: Vec<Distance>,
    /// Neighbours whose details in earlier planes are features.
    pub(super) others: [Distance; 3],
    /// Neighbours whose prediction errors are averaged to predict the spread of a node's, with their weights.
    pub(super) errors: Vec<(Distance, f32)>,
    is_long: bool,
}

impl Template {
    /// Builds the template for halving `axis`; `long` axes have more than one entry.
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

    /// Number of features, including those of earlier planes.
    pub(super) fn features(&self) -> usize {
        self.differences.len() + self.slopes.len() + self.details.len() + BEFORE * self.others.len()
    }

    /// Returns true if the axis has more than one entry.
    pub(super) fn is_long(&self) -> bool {
        self.is_long
    }
}
