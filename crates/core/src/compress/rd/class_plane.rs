//! Class plane of a measurement, and the values that a first layer approximates.

use super::super::fill::fill;
use super::super::values::Values;
use crate::codec::{ChunkKind, Class};
use crate::domain::{ErrorReport, Measurement, Restated};
use rayon::prelude::*;

/// Classes (positive, negative, zero, masked), counts and noise of a measurement's samples. None of them depends on the
/// spectral basis or the quantiser step.
#[derive(Clone, Copy)]
pub(super) struct ClassPlane<'a> {
    pub(super) values: Values,
    pub(super) classes: &'a [Class],
    /// Encoded classes of all samples; `None` if all samples are positive.
    pub(super) coded: Option<&'a (ChunkKind, Vec<u8>)>,
    pub(super) counts: ErrorReport,
    /// Magnitude to which smaller ones are raised before they are coded; 0 to raise none.
    pub(super) least: f64,
    /// Directions with several values, whose mean is to keep the error, too.
    pub(super) restated: &'a Restated,
    /// Numbers of the samples at these directions that are smaller than `least` and are not raised, in increasing
    /// order.
    pub(super) small: &'a [usize],
    /// True if negative samples on grids of angles are approximated as exactly as positive ones. If false, they take a
    /// predicted magnitude that is at most the largest magnitude of a negative sample.
    pub(super) weighs_negative: bool,
    /// Standard deviation of the samples' relative noise; `None` if not requested or not estimable.
    pub(super) noise: Option<f64>,
}

impl ClassPlane<'_> {
    /// Magnitude to which sample number `at` is raised if it is smaller.
    pub(super) fn least_of(&self, at: usize) -> f64 {
        if self.small.binary_search(&at).is_ok() { 0.0 } else { self.least }
    }
}

/// Values (logarithms or samples) that quantised coefficients approximate, filled smoothly at zero and masked samples.
pub(super) fn approximated(measurement: &Measurement, plane: ClassPlane<'_>) -> Vec<f32> {
    let samples = measurement.tensor.samples();
    let mut values = vec![0.0_f32; samples.len()];
    let block = 1 << 14;
    values.par_chunks_mut(block).zip(samples.par_chunks(block)).zip(plane.classes.par_chunks(block)).for_each(
        |((values, samples), classes)| {
            plane.values.wanted_of_all(samples, classes, plane.least, values);
        },
    );
    for &at in plane.small {
        values[at] = plane.values.wanted(samples[at], plane.classes[at], 0.0) as f32;
    }
    fill(measurement.tensor.axes(), &mut values);
    values
}
