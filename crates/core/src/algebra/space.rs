//! A prepared basis on a line: synthesis and analysis functions of all coefficients, in f64.

use super::error::AlgebraError;
use super::inner_products::InnerProducts;
use super::limits::{MAX_GRAM, MAX_LINE};
use super::windows::Windows;
use crate::domain::Axis;
use crate::transform::{AxisTransform, Plan};
use std::sync::{Arc, OnceLock};

/// Tolerance of orthonormality: a basis counts as orthonormal if its analysis and synthesis functions differ nowhere by
/// more. Published filter tables have eleven digits or more.
const SAME: f64 = 1e-10;

/// Basis functions `ψ_0 … ψ_(n−1)` on a one-dimensional signal of n samples, shared by all spectra in that basis.
///
/// The basis is a wavelet under any boundary rule at any length, the identity, or orthonormal vectors of the caller.
/// Coefficients are ordered as [`Plan`] orders them. Everything is exact to the rounding of f64.
#[derive(Clone, Debug)]
pub struct LineSpace {
    name: String,
    transform: Option<AxisTransform>,
    length: usize,
    /// Samples of the synthesis functions: row k holds those of `ψ_k`.
    synthesis: Windows,
    /// Analysis functions: row k holds the weight of each sample in coefficient k (the dual function of `ψ_k`).
    analysis: Windows,
    norms: Vec<f64>,
    orthonormal: bool,
    gram: OnceLock<InnerProducts>,
}

impl LineSpace {
    /// Computes the basis functions of a wavelet or of the identity on a signal of `length` samples.
    pub fn new(transform: AxisTransform, length: usize) -> Result<Arc<Self>, AlgebraError> {
        check_length(length)?;
        let axis = Axis::Index { count: length, labels: vec![] };
        let plan = Plan::new(&[axis], &[transform])
            .map_err(|error| AlgebraError::Basis { length, reason: error.to_string() })?;
        let synthesis = Windows::new((0..length).map(|k| plan.footprint(0, k)));
        let analysis = Windows::new((0..length).map(|k| plan.analysis_row(0, k)));
        Ok(Arc::new(Self::of(plan.to_string(), Some(transform), length, synthesis, analysis)))
    }

    /// Creates a basis from orthonormal vectors, such as the Karhunen-Loève basis of the data
    /// ([`crate::transform::Klt`]). If there are fewer vectors than samples, spectra and products are projected on
    /// their span.
    pub fn orthonormal(name: &str, vectors: &[Vec<f64>]) -> Result<Arc<Self>, AlgebraError> {
        let length = vectors.first().map_or(0, Vec::len);
        check_length(length)?;
        let refuse = |reason: String| AlgebraError::Basis { length, reason };
        if vectors.len() > length || vectors.iter().any(|vector| vector.len() != length) {
            return Err(refuse(format!(
                "{} basis vectors are given, expected at most {length}, each of {length} numbers",
                vectors.len()
            )));
        }
        for (i, a) in vectors.iter().enumerate() {
            for (j, b) in vectors[..=i].iter().enumerate() {
                let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let expected = if i == j { 1.0 } else { 0.0 };
                let is_close = (product - expected).abs() <= 1e-9;
                if !is_close {
                    return Err(refuse(format!(
                        "the basis vectors {j} and {i} have the dot product {product}, expected {expected}"
                    )));
                }
            }
        }
        let row = |vector: &Vec<f64>| (0..).zip(vector.iter().copied()).collect();
        let rows = Windows::new(vectors.iter().map(row));
        Ok(Arc::new(Self::of(format!("{name}[{length}]"), None, length, rows.clone(), rows)))
    }

    fn of(
        name: String,
        transform: Option<AxisTransform>,
        length: usize,
        synthesis: Windows,
        analysis: Windows,
    ) -> Self {
        let norm = |k| libm::sqrt(synthesis.row(k).1.iter().map(|x| x * x).sum());
        let norms = (0..synthesis.len()).map(norm).collect();
        // Analysis equals synthesis transposed: SᵀS = 1.
        let orthonormal = synthesis.distance(&analysis) < SAME;
        Self { name, transform, length, synthesis, analysis, norms, orthonormal, gram: OnceLock::new() }
    }

    /// Returns a name such as `db4[75]`: the basis, the boundary rule (if it is not the default of the basis) and the
    /// number of samples.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the number of samples of each signal that is expanded in this basis.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Returns the number of coefficients of a spectrum in this basis: the number of basis vectors, at most that of the
    /// samples.
    pub fn coefficients(&self) -> usize {
        self.synthesis.len()
    }

    /// Returns true if the basis is orthonormal: `⟨ψ_i, ψ_j⟩`, the unweighted sum over samples, is 1 for i = j and 0
    /// otherwise.
    pub fn is_orthonormal(&self) -> bool {
        self.orthonormal
    }

    /// Returns the L2 norm `‖ψ_k‖` of basis function k: the root of the unweighted sum of its squared samples.
    ///
    /// # Panics
    /// If `k` is not the index of a coefficient.
    pub fn norm(&self, k: usize) -> f64 {
        self.norms[k]
    }

    /// Returns the size in memory of the basis functions in bytes, without the Gram matrix and other derived tables.
    pub fn bytes(&self) -> usize {
        self.synthesis.bytes() + self.analysis.bytes() + size_of_val(self.norms.as_slice())
    }

    /// Transforms `samples` to all their coefficients in this basis, without allocation.
    ///
    /// # Panics
    /// If the lengths are not those of the line.
    pub fn analyse_into(&self, samples: &[f64], coefficients: &mut [f64]) {
        assert_eq!(samples.len(), self.length, "as many samples as the line has");
        assert_eq!(coefficients.len(), self.coefficients(), "as many coefficients as the line has");
        for (k, coefficient) in coefficients.iter_mut().enumerate() {
            *coefficient = self.analysis.times(k, samples);
        }
    }

    /// Returns true if spectra of two bases can be added: the bases are one object, or one transform of one length.
    pub(super) fn is(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
            || (self.length == other.length && self.transform == other.transform && self.transform.is_some())
    }

    pub(super) fn require(&self, other: &Self) -> Result<(), AlgebraError> {
        if self.is(other) {
            return Ok(());
        }
        Err(AlgebraError::OtherBasis { found: other.name.clone(), expected: self.name.clone() })
    }

    pub(super) fn check(&self, what: &'static str, numbers: &[f64]) -> Result<(), AlgebraError> {
        if numbers.len() != self.length {
            return Err(AlgebraError::Length { what, found: numbers.len(), expected: self.length });
        }
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(AlgebraError::NotFinite { what, index, found: numbers[index] }),
            None => Ok(()),
        }
    }

    pub(super) fn synthesis(&self) -> &Windows {
        &self.synthesis
    }

    pub(super) fn analysis(&self) -> &Windows {
        &self.analysis
    }

    /// Returns the Gram matrix of the basis functions with equal weights of the samples, computed on first use; `None`
    /// if it is the identity or too large.
    pub(super) fn gram(&self) -> Option<&InnerProducts> {
        let worth = !self.orthonormal && self.length <= MAX_GRAM;
        worth.then(|| self.gram.get_or_init(|| InnerProducts::of(&self.synthesis, self.length, None)))
    }
}

fn check_length(length: usize) -> Result<(), AlgebraError> {
    match length {
        0 => Err(AlgebraError::Basis { length, reason: "no samples, expected at least one".to_owned() }),
        1..=MAX_LINE => Ok(()),
        found => Err(AlgebraError::TooLong { what: "a line", found, most: MAX_LINE }),
    }
}
