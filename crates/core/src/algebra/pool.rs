//! Many sparse spectra in flat memory, six bytes per coefficient, such as those of a photon map.

use super::accumulator::Accumulator;
use super::error::AlgebraError;
use super::space::LineSpace;
use super::sparse::SparseSpectrum;
use std::sync::Arc;

/// List of sparse spectra in one basis, in contiguous memory. Coefficients are rounded to f32 (a relative error of at
/// most 6e-8); sums are computed in f64.
#[derive(Clone, Debug)]
pub struct SpectrumPool {
    space: Arc<LineSpace>,
    indices: Vec<u16>,
    values: Vec<f32>,
    /// Position in `indices` and `values` of the first coefficient of each spectrum, followed by the total number of
    /// coefficients.
    starts: Vec<usize>,
}

impl SpectrumPool {
    /// Creates an empty list of sparse spectra.
    pub fn new(space: &Arc<LineSpace>) -> Self {
        Self { space: Arc::clone(space), indices: Vec::new(), values: Vec::new(), starts: vec![0] }
    }

    /// Appends a sparse spectrum to this pool of spectra. Returns its position in the pool, from 0.
    pub fn push(&mut self, spectrum: &SparseSpectrum) -> Result<usize, AlgebraError> {
        self.space.require(spectrum.space())?;
        let large = spectrum.entries().iter().find(|entry| !(entry.value as f32).is_finite());
        if let Some(entry) = large {
            let reason = format!("is {}, expected a number that an f32 holds", entry.value);
            return Err(AlgebraError::Entry { index: entry.index, reason });
        }
        // Indices fit in u16: a line has at most 4096 coefficients.
        self.indices.extend(spectrum.entries().iter().map(|entry| entry.index as u16));
        self.values.extend(spectrum.entries().iter().map(|entry| entry.value as f32));
        self.starts.push(self.values.len());
        Ok(self.len() - 1)
    }

    /// Returns the number of stored spectra.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns true if the list holds no spectrum.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the size in memory of the stored spectra in bytes, without their basis.
    pub fn bytes(&self) -> usize {
        size_of_val(self.indices.as_slice()) + size_of_val(self.values.as_slice()) + size_of_val(self.starts.as_slice())
    }

    /// Adds `Σ factor · spectrum` over stored spectra to `sum`, without allocation. `photons` are pairs of spectrum
    /// number and factor.
    ///
    /// # Panics
    /// If a number is not that of a stored spectrum.
    pub fn gather(
        &self,
        photons: impl IntoIterator<Item = (usize, f64)>,
        sum: &mut Accumulator,
    ) -> Result<(), AlgebraError> {
        self.space.require(sum.space())?;
        let sums = sum.coefficients_mut();
        for (photon, factor) in photons {
            assert!(photon < self.len(), "spectrum {photon} of {}", self.len());
            let own = self.starts[photon]..self.starts[photon + 1];
            for (&index, &value) in self.indices[own.clone()].iter().zip(&self.values[own]) {
                sums[usize::from(index)] += factor * f64::from(value);
            }
        }
        Ok(())
    }
}
