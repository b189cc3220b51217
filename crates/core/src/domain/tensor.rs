//! Flat tensors of samples with a mask, and the measurement that says what they are.

use super::axis::{Axis, AxisError, Layout, check_axes};
use super::quantity::{Quantity, Sampling, Unit};
use std::sync::Arc;

/// Samples on axes: row-major, last axis contiguous, `f32`; a masked (unmeasured) sample is NaN, nothing else is.
/// A clone shares the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    axes: Vec<Axis>,
    samples: Arc<Vec<f32>>,
}

/// Why axes and samples do not make a tensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TensorError {
    /// The axes are out of their limits or unfit.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The number of samples is not the product of the axes' lengths.
    #[error("{found} samples on axes of lengths {shape:?}, expected {expected}")]
    Count {
        /// Samples found.
        found: usize,
        /// The product.
        expected: usize,
        /// The lengths.
        shape: Vec<usize>,
    },
    /// A sample is infinite.
    #[error("sample {index} is infinite, expected a finite number or NaN for a masked one")]
    Infinite {
        /// Its flat index.
        index: usize,
    },
}

/// The first of `values` that is so. All are looked at first: a search that ends early cannot take several at a time.
pub fn first_where(values: &[f32], is_so: impl Fn(f32) -> bool) -> Option<usize> {
    let any = values.iter().fold(false, |any, &value| any | is_so(value));
    if any { values.iter().position(|&value| is_so(value)) } else { None }
}

impl Tensor {
    /// Checks axes, count and finiteness. NaN marks masked samples.
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

    /// The axes, outermost first.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The lengths of the axes.
    pub fn shape(&self) -> Vec<usize> {
        self.axes.iter().map(Axis::len).collect()
    }

    /// All samples, row-major; NaN = masked.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// The samples alone; copied only if another tensor shares them.
    pub fn into_samples(self) -> Vec<f32> {
        Arc::unwrap_or_clone(self.samples)
    }

    /// How many samples there are; at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a tensor is never empty")]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// How many samples are masked.
    pub fn masked(&self) -> usize {
        self.samples.iter().filter(|s| s.is_nan()).count()
    }

    /// The smallest and the largest sample that is not masked.
    pub fn range(&self) -> Option<(f32, f32)> {
        self.samples.iter().filter(|s| !s.is_nan()).fold(None, |range, &s| match range {
            None => Some((s, s)),
            Some((low, high)) => Some((low.min(s), high.max(s))),
        })
    }
}

/// A tensor and what it is: the input of compression, and what decoding gives back.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The radiometric quantity.
    pub quantity: Quantity,
    /// The unit of a sample.
    pub unit: Unit,
    /// What a sample on a triangle axis stands for.
    pub sampling: Sampling,
    /// The samples.
    pub tensor: Tensor,
}

impl Measurement {
    /// Checks that the axes fit the quantity.
    pub fn new(quantity: Quantity, unit: Unit, sampling: Sampling, tensor: Tensor) -> Result<Self, AxisError> {
        Layout::of(quantity, tensor.axes())?;
        Ok(Self { quantity, unit, sampling, tensor })
    }

    /// The roles of the axes.
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
