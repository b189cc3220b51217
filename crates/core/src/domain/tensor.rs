//! Flat tensors of samples with a mask, and measurements: tensors with quantity, unit and sampling.

use super::axis::{Axis, AxisError, Layout, check_axes};
use super::quantity::{Quantity, Sampling, Unit};
use std::sync::Arc;

/// Samples on axes: `f32`, row-major, last axis contiguous. NaN always means masked (unmeasured). Clones share the
/// samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    axes: Vec<Axis>,
    samples: Arc<Vec<f32>>,
}

/// Reasons why axes and samples do not form a tensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TensorError {
    /// The axes exceed their limits or do not fit together.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The number of samples is not the product of the lengths of the axes.
    #[error("{found} samples on axes of lengths {shape:?}, expected {expected}")]
    Count {
        /// Number of samples found.
        found: usize,
        /// Product of the lengths.
        expected: usize,
        /// Lengths of the axes.
        shape: Vec<usize>,
    },
    /// A sample is infinite.
    #[error("sample {index} is infinite, expected a finite number or NaN for a masked one")]
    Infinite {
        /// Flat index of the sample.
        index: usize,
    },
}

/// Returns the index of the first of `values` for which `is_so` is true. A pass over all values comes first, because a
/// loop without early exit can be vectorised.
pub fn first_where(values: &[f32], is_so: impl Fn(f32) -> bool) -> Option<usize> {
    let any = values.iter().fold(false, |any, &value| any | is_so(value));
    if any { values.iter().position(|&value| is_so(value)) } else { None }
}

impl Tensor {
    /// Creates a tensor after checking axes, number of samples and finiteness. NaN marks masked samples.
    pub fn new(axes: Vec<Axis>, samples: Vec<f32>) -> Result<Self, TensorError> {
        let expected = check_axes(&axes)?;
        if samples.len() != expected {
            let shape = axes.iter().map(Axis::len).collect();
            return Err(TensorError::Count { found: samples.len(), expected, shape });
        }
        if let Some(index) = first_where(&samples, f32::is_infinite) {
            return Err(TensorError::Infinite { index });
        }
        Ok(Self { axes, samples: Arc::new(samples) })
    }

    /// Returns the axes, outermost first.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Returns the lengths of the axes.
    pub fn shape(&self) -> Vec<usize> {
        self.axes.iter().map(Axis::len).collect()
    }

    /// Returns all samples, row-major; NaN = masked.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// Returns the samples, which are copied only if another tensor shares them.
    pub fn into_samples(self) -> Vec<f32> {
        Arc::unwrap_or_clone(self.samples)
    }

    /// Returns the number of samples; at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a tensor is never empty")]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Returns the number of masked samples.
    pub fn masked(&self) -> usize {
        self.samples.iter().filter(|s| s.is_nan()).count()
    }

    /// Returns the smallest and the largest unmasked sample; `None` if all are masked.
    pub fn range(&self) -> Option<(f32, f32)> {
        self.samples.iter().filter(|s| !s.is_nan()).fold(None, |range, &s| match range {
            None => Some((s, s)),
            Some((low, high)) => Some((low.min(s), high.max(s))),
        })
    }
}

/// Tensor with its quantity, unit and sampling: the input of compression and the result of decoding.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Radiometric quantity.
    pub quantity: Quantity,
    /// Unit of a sample.
    pub unit: Unit,
    /// Meaning of a sample on a triangle axis.
    pub sampling: Sampling,
    /// Samples and axes.
    pub tensor: Tensor,
}

impl Measurement {
    /// Creates a measurement after checking that the axes fit the quantity.
    pub fn new(quantity: Quantity, unit: Unit, sampling: Sampling, tensor: Tensor) -> Result<Self, AxisError> {
        Layout::of(quantity, tensor.axes())?;
        Ok(Self { quantity, unit, sampling, tensor })
    }

    /// Returns the roles of the axes.
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
