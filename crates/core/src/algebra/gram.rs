//! Gram matrix of a basis: dot products of coefficients that equal weighted sums over samples.

use super::error::AlgebraError;
use super::inner_products::InnerProducts;
use super::limits::MAX_GRAM;
use super::space::LineSpace;
use super::sparse::SparseSpectrum;
use std::sync::Arc;

/// Gram matrix `G_ij = Σ_s w(s)·ψ_i(s)·ψ_j(s)` of basis functions ψ under sample weights w: symmetric, n² numbers. It
/// is the identity if the basis is orthonormal and w is 1.
#[derive(Clone, Debug)]
pub struct Gram {
    /// Basis whose functions belong to the rows and columns of the Gram matrix.
    space: Arc<LineSpace>,
    products: InnerProducts,
}

impl Gram {
    /// Computes the Gram matrix with one weight per sample, such as the widths of wavelength bands; `None` weights
    /// every sample by 1.
    pub fn new(space: &Arc<LineSpace>, weights: Option<&[f64]>) -> Result<Self, AlgebraError> {
        if space.length() > MAX_GRAM {
            return Err(AlgebraError::TooLong { what: "a Gram matrix", found: space.length(), most: MAX_GRAM });
        }
        weights.map_or(Ok(()), |weights| space.check("weights", weights))?;
        let products = InnerProducts::of(space.synthesis(), space.length(), weights);
        Ok(Self { space: Arc::clone(space), products })
    }

    /// Returns entry `G_ij` of the Gram matrix.
    ///
    /// # Panics
    /// If `i` or `j` is not the index of a coefficient.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.products.at(i, j)
    }

    /// Returns `aᵀ·G·b` for coefficients a and b: the weighted sum over samples of the product of two spectra.
    pub fn dot(&self, a: &SparseSpectrum, b: &SparseSpectrum) -> Result<f64, AlgebraError> {
        for spectrum in [a, b] {
            self.space.require(spectrum.space())?;
        }
        Ok(self.products.sum(a.entries(), b.entries()))
    }
}
