//! Inner products of synthesis functions, so that a dot product of coefficients is the sum over samples it stands for.

use super::space::LineSpace;
use super::sparse::{Entry, SparseSpectrum};
use super::{AlgebraError, MAX_GRAM};
use std::sync::Arc;

/// `G_ij = Σ_s w(s)·ψ_i(s)·ψ_j(s)`: symmetric, n² numbers; the identity where the basis is orthonormal and w is 1.
#[derive(Clone, Debug)]
pub struct Gram {
    size: usize,
    values: Vec<f64>,
    /// The basis it was made for; not set where that holds it.
    space: Option<Arc<LineSpace>>,
}

impl Gram {
    /// The matrix under one weight a sample, e.g. the widths of wavelength bands, or 1 throughout.
    pub fn new(space: &Arc<LineSpace>, weights: Option<&[f64]>) -> Result<Self, AlgebraError> {
        if space.length() > MAX_GRAM {
            return Err(AlgebraError::TooLong { what: "a Gram matrix", found: space.length(), most: MAX_GRAM });
        }
        weights.map_or(Ok(()), |weights| space.check("weights", weights))?;
        Ok(Self { space: Some(Arc::clone(space)), ..Self::of(space, weights) })
    }

    pub(super) fn of(space: &LineSpace, weights: Option<&[f64]>) -> Self {
        let (size, functions) = (space.coefficients(), space.synthesis());
        let mut values = vec![0.0; size * size];
        let mut weighted = vec![0.0; space.length()];
        for i in 0..size {
            weighted.fill(0.0);
            functions.add(i, 1.0, &mut weighted);
            if let Some(weights) = weights {
                weighted.iter_mut().zip(weights).for_each(|(x, w)| *x *= w);
            }
            for j in 0..=i {
                let product = functions.times(j, &weighted);
                values[i * size + j] = product;
                values[j * size + i] = product;
            }
        }
        Self { size, values, space: None }
    }

    /// `G_ij`.
    ///
    /// # Panics
    /// If there is no such coefficient.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        assert!(i < self.size && j < self.size, "coefficients {i} and {j} of {}", self.size);
        self.values[i * self.size + j]
    }

    /// `aᵀ·G·b`: the weighted sum over samples of both multiplied.
    pub fn dot(&self, a: &SparseSpectrum, b: &SparseSpectrum) -> Result<f64, AlgebraError> {
        for spectrum in [a, b] {
            self.space.as_ref().map_or(Ok(()), |space| space.require(spectrum.space()))?;
        }
        Ok(self.sum(a.entries(), b.entries()))
    }

    pub(super) fn sum(&self, a: &[Entry], b: &[Entry]) -> f64 {
        let row = |a: &Entry| {
            let row = &self.values[a.index as usize * self.size..][..self.size];
            a.value * b.iter().map(|b| row[b.index as usize] * b.value).sum::<f64>()
        };
        a.iter().map(row).sum()
    }
}
