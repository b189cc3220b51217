//! Sums of many spectra in the compressed domain: one dense row of coefficients, no allocation per spectrum.

use super::entry::Entry;
use super::error::AlgebraError;
use super::space::LineSpace;
use super::sparse::SparseSpectrum;
use std::sync::Arc;

/// Running sum `Σ factor · spectrum` over wavelet coefficients of spectra, as photon gathering needs it (\[CPB06\]
/// section 6.2.2).
#[derive(Clone, Debug)]
pub struct Accumulator {
    space: Arc<LineSpace>,
    sums: Vec<f64>,
}

impl Accumulator {
    /// Creates a running sum of spectra in which all coefficients are 0.
    pub fn new(space: &Arc<LineSpace>) -> Self {
        Self { space: Arc::clone(space), sums: vec![0.0; space.coefficients()] }
    }

    /// Adds `factor · spectrum` to the running sum: one multiplication and one addition per coefficient of `spectrum`.
    pub fn axpy(&mut self, factor: f64, spectrum: &SparseSpectrum) -> Result<(), AlgebraError> {
        self.space.require(spectrum.space())?;
        for entry in spectrum.entries() {
            self.sums[entry.index as usize] += factor * entry.value;
        }
        Ok(())
    }

    /// Returns the basis, such as a wavelet basis, to which the coefficients of the summed spectra belong.
    pub fn space(&self) -> &Arc<LineSpace> {
        &self.space
    }

    /// Returns all coefficients of the running sum of spectra, zeros included.
    pub fn coefficients(&self) -> &[f64] {
        &self.sums
    }

    pub(super) fn coefficients_mut(&mut self) -> &mut [f64] {
        &mut self.sums
    }

    /// Decodes the running sum of spectra into `samples` and overwrites them. One call decodes all spectra that were
    /// added.
    ///
    /// # Panics
    /// If the length of `samples` is not that of the line.
    pub fn samples_into(&self, samples: &mut [f64]) {
        assert_eq!(samples.len(), self.space.length(), "as many samples as the line has");
        samples.fill(0.0);
        for (k, &sum) in self.sums.iter().enumerate().filter(|(_, sum)| **sum != 0.0) {
            self.space.synthesis().add(k, sum, samples);
        }
    }

    /// Returns the running sum of spectra as one sparse spectrum, without the coefficients that are 0.
    pub fn spectrum(&self) -> SparseSpectrum {
        let entries = (0..).zip(&self.sums).filter(|(_, sum)| **sum != 0.0);
        let entries = entries.map(|(index, &value)| Entry { index, value }).collect();
        SparseSpectrum::of(Arc::clone(&self.space), entries)
    }

    /// Sets all coefficients of the running sum to 0, so that it can be reused.
    pub fn clear(&mut self) {
        self.sums.fill(0.0);
    }
}
