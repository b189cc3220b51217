//! Weights of grid nodes in means over them: whole numbers, held in a byte each while all are small.

use super::grid::AXES;
use super::pairs::sums;
use std::borrow::Cow;

/// Weights of all nodes of a grid. A node of merged ones weighs as much as its two parts together.
#[derive(Debug)]
pub(super) enum Weights {
    /// Weights of at most 255: those of single directions, which are 0 or 1, and of nodes that merge few.
    Small(Vec<u8>),
    /// Weights of nodes that merge many directions.
    Large(Vec<f32>),
}

impl Weights {
    /// Weights of the nodes after neighbours along an axis are merged in pairs; the axes of this grid have the lengths
    /// `children`.
    pub(super) fn merged(&self, children: [usize; AXES], axis: usize) -> Self {
        match self {
            Self::Small(weights) if weights.iter().all(|&weight| weight <= u8::MAX / 2) => {
                Self::Small(sums(weights, children, axis))
            }
            _ => Self::Large(sums(&self.floats(), children, axis)),
        }
    }

    /// Weights as numbers to compute with.
    pub(super) fn floats(&self) -> Cow<'_, [f32]> {
        match self {
            Self::Small(weights) => weights.iter().map(|&weight| f32::from(weight)).collect(),
            Self::Large(weights) => Cow::Borrowed(weights),
        }
    }

    /// Weight of the first node, 0 if there is none.
    pub(super) fn first(&self) -> f32 {
        match self {
            Self::Small(weights) => f32::from(weights.first().copied().unwrap_or(0)),
            Self::Large(weights) => weights.first().copied().unwrap_or(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_sums_however_they_are_held() {
        let leaves: Vec<u8> = (0..640).map(|i| u8::from(i % 5 != 2)).collect();
        let mut weights = Weights::Small(leaves.clone());
        let (mut length, mut span) = (leaves.len(), 1);
        while length > 1 {
            weights = weights.merged([1, 1, 1, length], 3);
            (length, span) = (length.div_ceil(2), 2 * span);
            let blocks = leaves.chunks(span).map(|block| block.iter().map(|&weight| f32::from(weight)).sum::<f32>());
            assert_eq!(weights.floats().as_ref(), blocks.collect::<Vec<f32>>());
        }
        assert!(matches!(weights, Weights::Large(_)));
        assert_eq!(weights.first(), 512.0);
    }
}
