//! Samples withheld from a fit, to be predicted by it.

use super::cloud::Cloud;
use crate::domain::vector::Vector;

/// A sample withheld from fits, to be predicted by them: the number of its group of samples that are fitted together,
/// and its index in this group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    pub(super) cloud: usize,
    pub(super) point: u32,
}

impl Trial {
    /// Returns the index of this withheld sample in the table of measured values, and its incoming and outgoing
    /// direction.
    pub(super) fn of(self, cloud: &Cloud) -> (u32, Vector, Vector) {
        let point = self.point as usize;
        (cloud.rows[point], cloud.wi[point], cloud.wo[point])
    }
}

/// Returns about `count` of the samples withheld for validation, evenly spread.
pub(super) fn trials(clouds: &[Cloud], count: usize) -> Vec<Trial> {
    let all: Vec<Trial> = clouds
        .iter()
        .enumerate()
        .flat_map(|(cloud, of)| {
            let own = of.rows[..of.own()].iter().copied().zip(0..).zip(&of.is_withheld);
            let mut withheld: Vec<(u32, u32)> = own.filter(|(_, is)| **is).map(|(point, _)| point).collect();
            withheld.sort_unstable();
            withheld.into_iter().map(move |(_, point)| Trial { cloud, point })
        })
        .collect();
    let step = all.len().div_ceil(count.max(1)).max(1);
    all.into_iter().step_by(step).collect()
}
