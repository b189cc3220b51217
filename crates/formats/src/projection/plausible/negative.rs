//! Negative values of a file: their number, and their size relative to the largest value.

use crate::formats::{Acquisition, Samples};
use crate::notes::CheckNote;

/// Number of negative values in a file, and magnitude of the most negative one relative to the largest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Negatives {
    /// Number of negative values of the file, at least 1.
    pub values: u64,
    /// Number of values of the file, without missing ones.
    pub of: u64,
    /// Magnitude of the most negative value, relative to the largest value: 0.01 is 1 %. `None` if no value is
    /// positive.
    pub largest: Option<f64>,
}

impl Negatives {
    /// Counts the negative values of a file. Returns `None` if there are none, and for functions, which have no
    /// values.
    pub(super) fn of(acquisition: &Acquisition) -> Option<Self> {
        match &acquisition.samples {
            Samples::OnAxes { tensor, .. } => Self::among(tensor.samples()),
            Samples::Grid(grid) => Self::among(&grid.values),
            Samples::Scattered(scattered) => Self::among(&scattered.values),
            Samples::Function(_) => None,
        }
    }

    /// Counts the negative ones of `values`. Returns `None` if there are none.
    pub(super) fn among(values: &[f32]) -> Option<Self> {
        let (mut negative, mut stated, mut low, mut high) = (0, 0, 0.0_f32, 0.0_f32);
        for &value in values {
            stated += u64::from(!value.is_nan());
            negative += u64::from(value < 0.0);
            (low, high) = (low.min(value), high.max(value));
        }
        let largest = (high > 0.0).then(|| f64::from(-low) / f64::from(high));
        (negative > 0).then_some(Self { values: negative, of: stated, largest })
    }

    /// Returns the share of negative values, from 0 to 1.
    pub(super) fn share(&self) -> f64 {
        self.values as f64 / self.of as f64
    }

    /// Returns a remark for the user on the negative values of a file: how many there are, and how large the most
    /// negative one is.
    pub(super) fn remark(&self) -> CheckNote {
        let largest_percent = self.largest.map(|largest| 100.0 * largest);
        CheckNote::Negative { values: self.values, of: self.of, largest_percent }
    }
}
