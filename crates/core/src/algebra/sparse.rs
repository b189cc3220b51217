//! A spectrum as the few coefficients that were kept of it, and its sums, scalings and dot products.

use super::entry::{Entry, Union};
use super::error::AlgebraError;
use super::space::LineSpace;
use crate::numeric::dense::dot_by_four;
use std::sync::Arc;

/// `Σ value·ψ_index`: a function on a line in one basis, as its coefficients that are not 0, by rising index.
#[derive(Clone, Debug)]
pub struct SparseSpectrum {
    space: Arc<LineSpace>,
    entries: Vec<Entry>,
}

/// A spectrum of fewer coefficients, and what that cost.
#[derive(Clone, Debug)]
pub struct Truncated {
    /// What was kept.
    pub spectrum: SparseSpectrum,
    /// The L2 norm, over samples, of what was dropped: the error itself, not a bound.
    pub error: f64,
    /// The same over the norm of the whole; 0 where both are 0.
    pub relative_error: f64,
}

impl SparseSpectrum {
    /// The spectrum of these coefficients, in any order; zeros are left out.
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

    /// The spectrum of the k coefficients that matter most of samples (\[CPB06\] section 4.2: by |c|·‖ψ‖).
    pub fn largest(space: &Arc<LineSpace>, samples: &[f64], k: usize) -> Result<Self, AlgebraError> {
        let mut spectrum = space.analyse(samples)?;
        spectrum.entries = spectrum.split(k).0;
        Ok(spectrum)
    }

    /// Entries are sorted, in range, finite and not 0.
    pub(super) fn of(space: Arc<LineSpace>, entries: Vec<Entry>) -> Self {
        Self { space, entries }
    }

    /// The basis it is in.
    pub fn space(&self) -> &Arc<LineSpace> {
        &self.space
    }

    /// Its coefficients by rising index, none of them 0.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// How many coefficients there are.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether it is 0 everywhere.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Its samples.
    pub fn samples(&self) -> Vec<f64> {
        let mut samples = vec![0.0; self.space.length()];
        self.add_samples(1.0, &mut samples);
        samples
    }

    /// Adds `factor` times its samples to `samples`.
    ///
    /// # Panics
    /// If there are not as many as the line has.
    pub fn add_samples(&self, factor: f64, samples: &mut [f64]) {
        assert_eq!(samples.len(), self.space.length(), "as many samples as the line has");
        for entry in &self.entries {
            self.space.synthesis().add(entry.index as usize, factor * entry.value, samples);
        }
    }

    /// `factor` times itself.
    pub fn scale(&mut self, factor: f64) {
        self.entries.iter_mut().for_each(|entry| entry.value *= factor);
        self.entries.retain(|entry| entry.value != 0.0);
    }

    /// The sum of both: the union of their coefficients.
    pub fn add(&self, other: &Self) -> Result<Self, AlgebraError> {
        self.axpy(1.0, other)
    }

    /// `self + factor · other`: the union of their coefficients, each rounded once. Sums of many go into an
    /// [`super::Accumulator`].
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

    /// Σ over samples of both multiplied: `aᵀ·G·b`, where G is the identity of an orthonormal basis. A sum with weights is
    /// that of [`super::Gram::dot`].
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

    /// The pointwise product by way of samples: decoded, multiplied and encoded, on a line of any length. From about six
    /// coefficients on it is cheaper than [`super::Couplings`], and gives the same.
    pub fn product(&self, other: &Self) -> Result<Self, AlgebraError> {
        self.space.require(&other.space)?;
        let mut product = self.samples();
        product.iter_mut().zip(other.samples()).for_each(|(x, y)| *x *= y);
        self.space.analyse(&product)
    }

    /// The L2 norm over samples.
    pub fn norm(&self) -> f64 {
        let samples = self.samples();
        libm::sqrt(dot_by_four(&samples, &samples))
    }

    /// The k coefficients that matter most (by |c|·‖ψ‖, the earlier of equal ones), and the error of leaving out the others.
    #[must_use]
    pub fn truncated(&self, k: usize) -> Truncated {
        let (kept, dropped) = self.split(k);
        let of = |entries| Self::of(Arc::clone(&self.space), entries);
        let (error, whole) = (of(dropped).norm(), self.norm());
        let relative_error = if whole > 0.0 { error / whole } else { 0.0 };
        Truncated { spectrum: of(kept), error, relative_error }
    }

    /// The k coefficients that matter most, and the others.
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
    /// All coefficients of samples, those that are 0 left out.
    pub fn analyse(self: &Arc<Self>, samples: &[f64]) -> Result<SparseSpectrum, AlgebraError> {
        self.check("samples", samples)?;
        let entries = (0..self.coefficients())
            .map(|k| Entry { index: k as u32, value: self.analysis().times(k, samples) })
            .filter(|entry| entry.value != 0.0)
            .collect();
        Ok(SparseSpectrum::of(Arc::clone(self), entries))
    }
}
