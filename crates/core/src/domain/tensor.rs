//! Flat tensors of samples with a mask, and measurements: tensors with quantity, unit and sampling.

use super::axis::{Axis, AxisError, Layout, check_axes};
use super::quantity::{Quantity, Sampling, Unit};
use super::shared::Shared;

/// Tensor of `f32` samples on axes: row-major, last axis contiguous. NaN always means masked (unmeasured). Clones share
/// the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    axes: Vec<Axis>,
    samples: Shared,
}

/// Reasons why axes and samples do not form a tensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TensorError {
    /// The axes exceed their limits or do not fit together.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The number of samples is not the product of the lengths of the axes.
    #[error("{found} samples on axes of lengths {shape:?}, expected {expected} samples")]
    Count {
        /// Number of samples given, which does not fit the axes of the tensor.
        found: usize,
        /// Number of samples expected: the product of the lengths of the axes.
        expected: usize,
        /// Number of entries on each axis of the refused tensor.
        shape: Vec<usize>,
    },
    /// A sample of the tensor is infinite.
    #[error("sample {index} is infinite, expected a finite number or NaN for a masked one")]
    Infinite {
        /// Index of the infinite sample in row-major order, from 0.
        index: usize,
    },
}

/// Returns the index of the first of `values` that fulfils the condition `is_so`. A pass over all values comes first,
/// because a loop without early exit can be vectorised.
pub fn first_where(values: &[f32], is_so: impl Fn(f32) -> bool) -> Option<usize> {
    let any = values.iter().fold(false, |any, &value| any | is_so(value));
    if any { values.iter().position(|&value| is_so(value)) } else { None }
}

impl Tensor {
    /// Creates a tensor after checking its axes, the number of samples and that none is infinite. NaN marks masked
    /// samples.
    pub fn new(axes: Vec<Axis>, samples: Vec<f32>) -> Result<Self, TensorError> {
        Self::sharing(axes, samples.into())
    }

    /// Creates a tensor, after the checks of [`Tensor::new`], of samples that others hold, too. None is copied.
    pub fn sharing(axes: Vec<Axis>, samples: Shared) -> Result<Self, TensorError> {
        let expected = check_axes(&axes)?;
        if samples.len() != expected {
            let shape = axes.iter().map(Axis::len).collect();
            return Err(TensorError::Count { found: samples.len(), expected, shape });
        }
        if let Some(index) = first_where(&samples, f32::is_infinite) {
            return Err(TensorError::Infinite { index });
        }
        Ok(Self { axes, samples })
    }

    /// Returns the axes of the tensor, outermost first.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Returns the number of entries of each axis of this tensor, outermost axis first.
    pub fn shape(&self) -> Vec<usize> {
        self.axes.iter().map(Axis::len).collect()
    }

    /// Returns all samples of the tensor, row-major; NaN marks masked samples.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// Returns the samples of the tensor, which are copied only if another tensor shares them.
    pub fn into_samples(self) -> Vec<f32> {
        self.samples.into_vec()
    }

    /// Returns the number of samples of the tensor; at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a tensor is never empty")]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Returns the number of masked samples of the tensor.
    pub fn masked(&self) -> usize {
        self.samples.iter().filter(|s| s.is_nan()).count()
    }

    /// Returns the smallest and the largest unmasked sample of the tensor; `None` if all are masked.
    pub fn range(&self) -> Option<(f32, f32)> {
        self.samples.iter().filter(|s| !s.is_nan()).fold(None, |range, &s| match range {
            None => Some((s, s)),
            Some((low, high)) => Some((low.min(s), high.max(s))),
        })
    }
}

/// Measurement: a tensor with its radiometric quantity, unit and kind of sampling. It is the input of compression and
/// the result of decoding.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Radiometric quantity of the measurement, such as a BRDF.
    pub quantity: Quantity,
    /// Physical unit of a sample.
    pub unit: Unit,
    /// Meaning of a sample on an axis of triangles: an average or a value at a point.
    pub sampling: Sampling,
    /// Samples of the measurement and their axes.
    pub tensor: Tensor,
}

impl Measurement {
    /// Creates a measurement after checking that the axes of the tensor fit the radiometric quantity.
    pub fn new(quantity: Quantity, unit: Unit, sampling: Sampling, tensor: Tensor) -> Result<Self, AxisError> {
        Layout::of(quantity, tensor.axes())?;
        Ok(Self { quantity, unit, sampling, tensor })
    }

    /// Returns the meaning of each axis: index, incoming direction, outgoing direction or wavelength.
    pub fn layout(&self) -> Result<Layout, AxisError> {
        Layout::of(self.quantity, self.tensor.axes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_infinities_are_refused() {
        let axes = || vec![Axis::Rgb];
        assert!(matches!(Tensor::new(axes(), vec![1.0; 4]), Err(TensorError::Count { found: 4, expected: 3, .. })));
        assert_eq!(Tensor::new(axes(), vec![0.0, f32::INFINITY, 0.0]), Err(TensorError::Infinite { index: 1 }));
        let tensor = Tensor::new(axes(), vec![-1.0, f32::NAN, 2.0]).unwrap();
        assert_eq!((tensor.masked(), tensor.range(), tensor.shape()), (1, Some((-1.0, 2.0)), vec![3]));
    }
}
