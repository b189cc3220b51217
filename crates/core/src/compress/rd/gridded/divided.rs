//! Samples on a grid of angles divided by the function of chunk V (see `between`) before they are coded.

use super::lattice::Shape;
use crate::compress::{Divided, Divisor};

/// Natural logarithms of the function by which samples are divided before they are coded, for all pairs of an incoming
/// and an outgoing direction of a grid.
pub(super) struct DividedRows {
    /// Logarithms of the function, row-major `[incoming direction, outgoing direction]`.
    logarithms: Vec<f32>,
    /// Number of outgoing directions.
    outgoing: usize,
    /// Number of samples for each pair of directions.
    length: usize,
}

impl DividedRows {
    /// Evaluates `divisor` for all pairs of directions; `None` without such a function, or without incoming angles.
    pub(super) fn new(shape: &Shape, divisor: Divisor) -> Option<Self> {
        let divided = Divided::by(divisor);
        let [incoming, outgoing] = shape.directions().filter(|_| divisor != Divisor::None)?;
        let logarithms = incoming.iter().flat_map(|&wi| outgoing.iter().map(move |&wo| divided.one(wi, wo))).collect();
        Some(Self { logarithms, outgoing: outgoing.len(), length: shape.length() })
    }

    /// Logarithm of the function for one pair of directions; `row` numbers the spectra of the tensor, row-major.
    pub(super) fn of_row(&self, row: usize) -> f32 {
        self.logarithms[row % self.logarithms.len()]
    }

    /// Multiplies samples by the function. `values` holds their logarithms from the first row of the tensor on.
    pub(super) fn restore(&self, values: &mut [f32]) {
        for block in values.chunks_mut(self.logarithms.len() * self.length) {
            self.add(&self.logarithms, block);
        }
    }

    /// Multiplies the samples under one incoming direction by the function; `entry` numbers the slices of outgoing
    /// directions, row-major. `values` holds logarithms.
    pub(super) fn restore_entry(&self, entry: usize, values: &mut [f32]) {
        let first = entry * self.outgoing % self.logarithms.len();
        self.add(&self.logarithms[first..first + self.outgoing], values);
    }

    fn add(&self, logarithms: &[f32], values: &mut [f32]) {
        for (row, logarithm) in values.chunks_exact_mut(self.length).zip(logarithms) {
            row.iter_mut().for_each(|value| *value += logarithm);
        }
    }
}
