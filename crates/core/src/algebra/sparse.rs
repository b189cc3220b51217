//! Spectra as their few kept coefficients, with sums, scalings and dot products.

use super::entry::{Entry, Union};
use super::error::AlgebraError;
use super::space::LineSpace;
use crate::numeric::dense::dot_by_four;
use std::sync::Arc;

/// Spectrum `Σ value·ψ_index` in one basis ψ, stored as its nonzero coefficients by rising index.
#[derive(Clone, Debug)]
pub struct SparseSpectrum {
    space: Arc<LineSpace>,
    entries: Vec<Entry>,
}

/// A spectrum of which only the largest coefficients were kept, and the error that this causes.
#[derive(Clone, Debug)]
pub struct Truncated {
    /// Sparse spectrum that consists of the kept coefficients alone.
    pub spectrum: SparseSpectrum,
    /// L2 norm, over samples, of the dropped part of the spectrum: the exact truncation error, not a bound.
    pub error: f64,
    /// Truncation error divided by the L2 norm of the whole spectrum; 0 for a spectrum of norm 0.
    pub relative_error: f64,
}

impl SparseSpectrum {
    /// Creates a sparse spectrum from coefficients in any order; coefficients that are 0 are dropped.
    pub fn new(space: &Arc<LineSpace>, mut entries: Vec<Entry>) -> Result<Self, AlgebraError> {
        entries.sort_by_key(|entry| entry.index);
        let count = space.coefficients();
        for (i, entry) in entries.iter().enumerate() {
            let refuse = |reason| AlgebraError::Entry { index: entry.index, reason };
            if entry.index as usize >= count {
                return Err(refuse(format!(
                    "lies outside of the basis {}, expected an index below {count}",
                    space.name()
                )));
            }
            if i > 0 && entries[i - 1].index == entry.index {
                return Err(refuse("is given twice, expected once".to_owned()));
            }
            if !entry.value.is_finite() {
                return Err(refuse(format!("is {}, expected a finite number", entry.value)));
            }
        }
        entries.retain(|entry| entry.value != 0.0);
        Ok(Self::of(Arc::clone(space), entries))
    }

    /// Transforms samples of a spectrum and keeps the k coefficients c with the largest |c|·‖ψ‖, where ψ is the basis
    /// function of c (\[CPB06\] section 4.2).
    pub fn largest(space: &Arc<LineSpace>, samples: &[f64], k: usize) -> Result<Self, AlgebraError> {
        let mut spectrum = space.analyse(samples)?;
        spectrum.entries = spectrum.split(k).0;
        Ok(spectrum)
    }

    /// Creates a sparse spectrum from coefficients that are already sorted by index, in range, finite and not 0.
    pub(super) fn of(space: Arc<LineSpace>, entries: Vec<Entry>) -> Self {
        Self { space, entries }
    }

    /// Returns the basis, such as a wavelet basis, to which the coefficients of the spectrum belong.
    pub fn space(&self) -> &Arc<LineSpace> {
        &self.space
    }

    /// Returns the nonzero coefficients of the spectrum by rising index.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Returns the number of nonzero coefficients of the spectrum.
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

    /// Adds `factor` times the samples of the spectrum to `samples`.
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

    /// Returns the sum of two spectra, with the union of their coefficients.
    pub fn add(&self, other: &Self) -> Result<Self, AlgebraError> {
        self.axpy(1.0, other)
    }

    /// Returns `self + factor · other` for two spectra, with the union of their coefficients. For sums of many spectra
    /// an [`super::Accumulator`] is faster.
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

    /// Returns the unweighted sum over samples of the product of two spectra: `aᵀ·G·b` for their coefficients, where
    /// the Gram matrix G is the identity if the basis is orthonormal. For a weighted sum see [`super::Gram::dot`].
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

    /// Returns the pointwise product of two spectra: decodes both, multiplies the samples and transforms the result.
    /// [`super::Couplings`] give the same result, but are slower from about six coefficients on.
    pub fn product(&self, other: &Self) -> Result<Self, AlgebraError> {
        self.space.require(&other.space)?;
        let mut product = self.samples();
        product.iter_mut().zip(other.samples()).for_each(|(x, y)| *x *= y);
        self.space.analyse(&product)
    }

    /// Returns the L2 norm of the spectrum: the root of the sum of its squared samples.
    pub fn norm(&self) -> f64 {
        let samples = self.samples();
        libm::sqrt(dot_by_four(&samples, &samples))
    }

    /// Keeps the k coefficients c with the largest |c|·‖ψ‖, where ψ is the basis function of c, and measures the error
    /// of dropping the rest. Of equal ones, the one of lower index is kept.
    #[must_use]
    pub fn truncated(&self, k: usize) -> Truncated {
        let (kept, dropped) = self.split(k);
        let of = |entries| Self::of(Arc::clone(&self.space), entries);
        let (error, whole) = (of(dropped).norm(), self.norm());
        let relative_error = if whole > 0.0 { error / whole } else { 0.0 };
        Truncated { spectrum: of(kept), error, relative_error }
    }

    /// Splits the coefficients c of a spectrum into the k with the largest |c|·‖ψ‖ (ψ: basis function of c) and the
    /// rest, each by rising index.
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
    /// Transforms samples of a spectrum to all their nonzero coefficients.
    pub fn analyse(self: &Arc<Self>, samples: &[f64]) -> Result<SparseSpectrum, AlgebraError> {
        self.check("samples", samples)?;
        let entries = (0..self.coefficients())
            .map(|k| Entry { index: k as u32, value: self.analysis().times(k, samples) })
            .filter(|entry| entry.value != 0.0)
            .collect();
        Ok(SparseSpectrum::of(Arc::clone(self), entries))
    }
}
