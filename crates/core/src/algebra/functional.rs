//! Dot product with one fixed function, for tristimulus values, fluxes or any quadrature: one multiplication per
//! coefficient.

use super::error::AlgebraError;
use super::space::LineSpace;
use super::sparse::SparseSpectrum;
use std::sync::Arc;

/// Linear functional `f ↦ Σ_s w(s)·f(s)` (a weighted sum over samples s), computed from wavelet coefficients c as `Σ_k
/// c_k·F_k` with `F_k = Σ_s w(s)·ψ_k(s)`.
///
/// For a tristimulus value, w is the colour-matching curve times the width of each wavelength's band, and times the
/// illuminant if the spectrum is a reflectance.
#[derive(Clone, Debug)]
pub struct Functional {
    space: Arc<LineSpace>,
    values: Vec<f64>,
}

impl Functional {
    /// Precomputes a weighted sum over the samples of spectra; `weights` has one entry per sample.
    pub fn new(space: &Arc<LineSpace>, weights: &[f64]) -> Result<Self, AlgebraError> {
        space.check("weights", weights)?;
        let values = (0..space.coefficients()).map(|k| space.synthesis().times(k, weights)).collect();
        Ok(Self { space: Arc::clone(space), values })
    }

    /// Returns the weighted sum over the samples of `spectrum`, computed from its coefficients.
    pub fn of(&self, spectrum: &SparseSpectrum) -> Result<f64, AlgebraError> {
        self.space.require(spectrum.space())?;
        Ok(spectrum.entries().iter().map(|entry| entry.value * self.values[entry.index as usize]).sum())
    }
}
