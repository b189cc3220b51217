//! Sums of many spectra in the compressed domain: one dense row of coefficients, no allocation per spectrum.

use super::entry::Entry;
use super::error::AlgebraError;
use super::space::LineSpace;
use super::sparse::SparseSpectrum;
use std::sync::Arc;

/// `Σ factor · spectrum`, coefficient by coefficient: what photon gathering does (\[CPB06\] section 6.2.2).
#[derive(Clone, Debug)]
pub struct Accumulator {
    space: Arc<LineSpace>,
    sums: Vec<f64>,
}

impl Accumulator {
    /// An empty sum.
    pub fn new(space: &Arc<LineSpace>) -> Self {
        Self { space: Arc::clone(space), sums: vec![0.0; space.coefficients()] }
    }

    /// Adds `factor · spectrum`: one multiplication and addition a coefficient.
    pub fn axpy(&mut self, factor: f64, spectrum: &SparseSpectrum) -> Result<(), AlgebraError> {
        self.space.require(spectrum.space())?;
        for entry in spectrum.entries() {
            self.sums[entry.index as usize] += factor * entry.value;
        }
        Ok(())
    }

    /// The basis it is in.
    pub fn space(&self) -> &Arc<LineSpace> {
        &self.space
    }

    /// All coefficients of the sum.
    pub fn coefficients(&self) -> &[f64] {
        &self.sums
    }

    pub(super) fn coefficients_mut(&mut self) -> &mut [f64] {
        &mut self.sums
    }

    /// The samples of the sum into `samples`, replacing what is there: the one decoding of a whole gathering.
    ///
    /// # Panics
    /// If there are not as many as the line has.
    pub fn samples_into(&self, samples: &mut [f64]) {
        assert_eq!(samples.len(), self.space.length(), "as many samples as the line has");
        samples.fill(0.0);
        for (k, &sum) in self.sums.iter().enumerate().filter(|(_, sum)| **sum != 0.0) {
            self.space.synthesis().add(k, sum, samples);
        }
    }

    /// The sum as a spectrum.
    pub fn spectrum(&self) -> SparseSpectrum {
        let entries = (0..).zip(&self.sums).filter(|(_, sum)| **sum != 0.0);
        let entries = entries.map(|(index, &value)| Entry { index, value }).collect();
        SparseSpectrum::of(Arc::clone(&self.space), entries)
    }

    /// Empties the sum, to be used again.
    pub fn clear(&mut self) {
        self.sums.fill(0.0);
    }
}
