//! Spectra as their few kept coefficients, with sums, scalings and dot products.

use super::entry::{Entry, Union};
use super::error::AlgebraError;
use super::space::LineSpace;
use crate::numeric::dense::dot_by_four;
use std::sync::Arc;

/// Function `Σ value·ψ_index` on a line in one basis, stored as its nonzero coefficients by rising index.
#[derive(Clone, Debug)]
pub struct SparseSpectrum {
    space: Arc<LineSpace>,
    entries: Vec<Entry>,
}

/// A truncated spectrum and the error of the truncation.
#[derive(Clone, Debug)]
pub struct Truncated {
    /// Spectrum of the kept coefficients.
    pub spectrum: SparseSpectrum,
    /// L2 norm over samples of the dropped part: the error itself, not a bound.
    pub error: f64,
    /// Error divided by the L2 norm of the whole spectrum; 0 if both are 0.
    pub relative_error: f64,
}

impl SparseSpectrum {
    /// Creates a spectrum from coefficients in any order; zeros are dropped.
    pub fn new(space: &Arc<LineSpace>, mut entries: Vec<Entry>) -> Result<Self, AlgebraError> {
        entries.sort_by_key(|entry| entry.index);
        let count = space.coefficients();
        for (i, entry) in entries.iter().enumerate() {
            let refuse = |reason| AlgebraError::Entry { index: entry.index, reason };
            if entry.index as usize >= count {
                return Err(refuse(format!("outside of {}, expected an index below {count}", space.name())));
            }
            if i > 0 && entries[i - 1].index == entry.index {
                return Err(refuse("given twice, expected once".to_owned()));
            }
            if !entry.value.is_finite() {
                return Err(refuse(format!("is {}, expected a finite number", entry.value)));
            }
        }
        entries.retain(|entry| entry.value != 0.0);
        Ok(Self::of(Arc::clone(space), entries))
    }

    /// Transforms samples and keeps the k coefficients with the largest |c|·‖ψ‖ (\[CPB06\] section 4.2).
    pub fn largest(space: &Arc<LineSpace>, samples: &[f64], k: usize) -> Result<Self, AlgebraError> {
        let mut spectrum = space.analyse(samples)?;
        spectrum.entries = spectrum.split(k).0;
        Ok(spectrum)
    }

    /// Wraps entries that are already sorted, in range, finite and not 0.
    pub(super) fn of(space: Arc<LineSpace>, entries: Vec<Entry>) -> Self {
        Self { space, entries }
    }

    /// Returns the basis of the coefficients.
    pub fn space(&self) -> &Arc<LineSpace> {
        &self.space
    }

    /// Returns the nonzero coefficients by rising index.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Returns the number of nonzero coefficients.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns true if the spectrum is 0 everywhere.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Decodes the spectrum to its samples.
    pub fn samples(&self) -> Vec<f64> {
        let mut samples = vec![0.0; self.space.length()];
        self.add_samples(1.0, &mut samples);
        samples
    }

    /// Adds `factor` times the samples of this spectrum to `samples`.
    ///
    /// # Panics
    /// If the length of `samples` is not that of the line.
    pub fn add_samples(&self, factor: f64, samples: &mut [f64]) {
        assert_eq!(samples.len(), self.space.length(), "as many samples as the line has");
        for entry in &self.entries {
            self.space.synthesis().add(entry.index as usize, factor * entry.value, samples);
        }
    }

    /// Multiplies the spectrum by `factor`.
    pub fn scale(&mut self, factor: f64) {
        self.entries.iter_mut().for_each(|entry| entry.value *= factor);
        self.entries.retain(|entry| entry.value != 0.0);
    }

    /// Returns `self + other`: the union of their coefficients.
    pub fn add(&self, other: &Self) -> Result<Self, AlgebraError> {
        self.axpy(1.0, other)
    }

    /// Returns `self + factor · other`: the union of their coefficients. For sums of many spectra an
    /// [`super::Accumulator`] is faster.
    pub fn axpy(&self, factor: f64, other: &Self) -> Result<Self, AlgebraError> {
        self.space.require(&other.space)?;
        let mut entries = Vec::with_capacity(self.len() + other.len());
        for (index, a, b) in (Union { a: &self.entries, b: &other.entries }) {
            let value = a + factor * b;
            if value != 0.0 {
                entries.push(Entry { index, value });
            }
        }
        Ok(Self::of(Arc::clone(&self.space), entries))
    }

    /// Returns the sum over samples of the product of both spectra: `aᵀ·G·b`, where G is the identity if the basis is
    /// orthonormal. For a weighted sum see [`super::Gram::dot`].
    pub fn dot(&self, other: &Self) -> Result<f64, AlgebraError> {
        self.space.require(&other.space)?;
        Ok(if self.space.is_orthonormal() {
            (Union { a: &self.entries, b: &other.entries }).map(|(_, a, b)| a * b).sum()
        } else if let Some(gram) = self.space.gram() {
            gram.sum(&self.entries, &other.entries)
        } else {
            dot_by_four(&self.samples(), &other.samples())
        })
    }

    /// Returns the pointwise product: decodes both, multiplies the samples and encodes the result, on a line of any
    /// length. The result is that of [`super::Couplings`]; from about six coefficients on this way is cheaper.
    pub fn product(&self, other: &Self) -> Result<Self, AlgebraError> {
        self.space.require(&other.space)?;
        let mut product = self.samples();
        product.iter_mut().zip(other.samples()).for_each(|(x, y)| *x *= y);
        self.space.analyse(&product)
    }

    /// Returns the L2 norm over samples.
    pub fn norm(&self) -> f64 {
        let samples = self.samples();
        libm::sqrt(dot_by_four(&samples, &samples))
    }

    /// Keeps the k coefficients with the largest |c|·‖ψ‖ (of equal ones the earlier) and measures the error of dropping
    /// the rest.
    #[must_use]
    pub fn truncated(&self, k: usize) -> Truncated {
        let (kept, dropped) = self.split(k);
        let of = |entries| Self::of(Arc::clone(&self.space), entries);
        let (error, whole) = (of(dropped).norm(), self.norm());
        let relative_error = if whole > 0.0 { error / whole } else { 0.0 };
        Truncated { spectrum: of(kept), error, relative_error }
    }

    /// Splits the coefficients into the k with the largest |c|·‖ψ‖ and the rest, each by rising index.
    fn split(&self, k: usize) -> (Vec<Entry>, Vec<Entry>) {
        let weight = |entry: &Entry| entry.value.abs() * self.space.norm(entry.index as usize);
        let mut order = self.entries.clone();
        order.sort_by(|a, b| weight(b).total_cmp(&weight(a)).then(a.index.cmp(&b.index)));
        let mut dropped = order.split_off(k.min(order.len()));
        for entries in [&mut order, &mut dropped] {
            entries.sort_by_key(|entry| entry.index);
        }
        (order, dropped)
    }
}

impl LineSpace {
    /// Transforms samples to all their nonzero coefficients.
    pub fn analyse(self: &Arc<Self>, samples: &[f64]) -> Result<SparseSpectrum, AlgebraError> {
        self.check("samples", samples)?;
        let entries = (0..self.coefficients())
            .map(|k| Entry { index: k as u32, value: self.analysis().times(k, samples) })
            .filter(|entry| entry.value != 0.0)
            .collect();
        Ok(SparseSpectrum::of(Arc::clone(self), entries))
    }
}
