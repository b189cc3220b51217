//! The Gram matrix of a basis, so that a dot product of two spectra is the weighted sum over samples it stands for.

use super::error::AlgebraError;
use super::inner_products::InnerProducts;
use super::limits::MAX_GRAM;
use super::space::LineSpace;
use super::sparse::SparseSpectrum;
use std::sync::Arc;

/// `G_ij = Σ_s w(s)·ψ_i(s)·ψ_j(s)`: symmetric, n² numbers; the identity where the basis is orthonormal and w is 1.
#[derive(Clone, Debug)]
pub struct Gram {
    /// The basis it was made for.
    space: Arc<LineSpace>,
    products: InnerProducts,
}

impl Gram {
    /// The matrix under one weight a sample, e.g. the widths of wavelength bands, or 1 throughout.
    pub fn new(space: &Arc<LineSpace>, weights: Option<&[f64]>) -> Result<Self, AlgebraError> {
        if space.length() > MAX_GRAM {
            return Err(AlgebraError::TooLong { what: "a Gram matrix", found: space.length(), most: MAX_GRAM });
        }
        weights.map_or(Ok(()), |weights| space.check("weights", weights))?;
        let products = InnerProducts::of(space.synthesis(), space.length(), weights);
        Ok(Self { space: Arc::clone(space), products })
    }

    /// `G_ij`.
    ///
    /// # Panics
    /// If there is no such coefficient.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.products.at(i, j)
    }

    /// `aᵀ·G·b`: the weighted sum over samples of both multiplied.
    pub fn dot(&self, a: &SparseSpectrum, b: &SparseSpectrum) -> Result<f64, AlgebraError> {
        for spectrum in [a, b] {
            self.space.require(spectrum.space())?;
        }
        Ok(self.products.sum(a.entries(), b.entries()))
    }
}
