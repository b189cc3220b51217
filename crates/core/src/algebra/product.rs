//! Pointwise products of spectra in the compressed domain, by precomputed coupling coefficients of any basis.
//!
//! The product of two synthesis functions is a function of the same line, so it has coefficients:
//!
//! ```text
//! ψ_i·ψ_j = Σ_k C(k; i, j)·ψ_k,      C(k; i, j) = Σ_s ψ̃_k(s)·ψ_i(s)·ψ_j(s)
//! ```
//!
//! with `ψ̃_k` the dual function, that is, row k of the analysis. With them `(Σ a_i ψ_i)·(Σ b_j ψ_j)` has the
//! coefficients `c_k = Σ_ij a_i·b_j·C(k; i, j)`. In a complete discrete basis this is exact, at every length and under
//! every boundary rule. (Connection coefficients in the literature are the same integrals on the real line, per scale
//! and shift.)

use super::accumulator::Accumulator;
use super::entry::{Entry, Union};
use super::error::AlgebraError;
use super::limits::{MAX_COUPLED, MAX_COUPLINGS, MAX_GRAM};
use super::space::LineSpace;
use super::sparse::SparseSpectrum;
use crate::numeric::dense::add;
use rayon::prelude::*;
use std::sync::Arc;

/// Rounding threshold of the coefficients of a product of two basis functions. Each is a sum over samples; it is set to
/// 0 if it is not above this fraction of its summands' magnitudes, added up. Raising it sets more to 0.
const ZERO: f64 = 1e-14;
/// Largest number of consecutive zeros stored within a run of coupling coefficients, those that expand the product of
/// two basis functions. Raising it gives fewer, longer runs with more zeros.
const GAP: usize = 3;

/// Table of the coupling coefficients `C(k; i, j)`: coefficient k of the product of basis functions i and j, for i ≤ j,
/// stored in runs of consecutive k.
#[derive(Clone, Debug)]
pub struct Couplings {
    space: Arc<LineSpace>,
    /// Position in `runs` of the first run of coupling coefficients of each pair (i, j) of basis functions, pairs by
    /// rising i, then j. The last entry is the position of the end marker.
    pairs: Vec<u32>,
    runs: Vec<Run>,
    values: Vec<f64>,
    count: usize,
}

/// Consecutive coefficients of the product of two basis functions, in the same basis; `first` is the index of the first
/// one. The values of a run begin at `start` in the list of all values, and end where those of the next run begin.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    first: u32,
    start: u32,
}

/// Coupling coefficients C(k; i, j) of one pair of basis functions: coefficients k of the product of functions i and j,
/// as runs of consecutive k. A run is its first k, and the coefficients from there on.
type Row = Vec<(u32, Vec<f64>)>;

impl Couplings {
    /// Computes all coupling coefficients of a basis: those that expand the product of each pair of basis functions in
    /// the basis. If all functions overlap, there are n²/2 pairs of n coefficients each, which restricts the table to
    /// short signals ([`MAX_COUPLED`], [`MAX_COUPLINGS`]).
    pub fn new(space: &Arc<LineSpace>) -> Result<Self, AlgebraError> {
        let length = space.length();
        if length > MAX_COUPLED {
            return Err(AlgebraError::TooLong { what: "couplings", found: length, most: MAX_COUPLED });
        }
        let size = space.coefficients();
        let mut table = Self { space: Arc::clone(space), pairs: vec![], runs: vec![], values: vec![], count: 0 };
        for i in 0..size {
            let rows: Vec<Row> = (i..size).into_par_iter().map(|j| row(space, i, j)).collect();
            for row in rows {
                table.pairs.push(table.runs.len() as u32);
                for (first, values) in row {
                    table.runs.push(Run { first, start: table.values.len() as u32 });
                    table.count += values.iter().filter(|value| **value != 0.0).count();
                    table.values.extend(values);
                }
            }
            if table.values.len() > MAX_COUPLINGS {
                return Err(AlgebraError::TooManyCouplings { length, most: MAX_COUPLINGS });
            }
        }
        table.pairs.push(table.runs.len() as u32);
        table.runs.push(Run { first: 0, start: table.values.len() as u32 });
        Ok(table)
    }

    /// Returns the basis for whose functions the table lists the coefficients of all pairwise products.
    pub fn space(&self) -> &Arc<LineSpace> {
        &self.space
    }

    /// Returns the number of nonzero coupling coefficients (factors with which products of basis functions are
    /// expanded).
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns true if the table has no nonzero coupling coefficient, so that every product of two spectra in this
    /// basis is 0.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the size in memory, in bytes, of the table that expands products of basis functions; the functions
    /// themselves are not included.
    pub fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice()) + size_of_val(self.runs.as_slice()) + size_of_val(self.pairs.as_slice())
    }

    /// Returns the coupling coefficient `C(k; i, j)`: coefficient k of the product of basis functions i and j.
    ///
    /// # Panics
    /// If `k`, `i` or `j` is not the index of a coefficient.
    pub fn at(&self, k: usize, i: usize, j: usize) -> f64 {
        let size = self.space.coefficients();
        assert!(k < size && i < size && j < size, "couplings {k}; {i}, {j} of {size}");
        let mut dense = vec![0.0; size];
        self.add_pair(i.min(j), i.max(j), 1.0, &mut dense);
        dense[k]
    }

    /// Returns the pointwise product of two spectra with all its coefficients; [`SparseSpectrum::truncated`] makes it
    /// sparse again.
    pub fn product(&self, a: &SparseSpectrum, b: &SparseSpectrum) -> Result<SparseSpectrum, AlgebraError> {
        let mut sum = Accumulator::new(&self.space);
        self.product_into(1.0, a, b, &mut sum)?;
        Ok(sum.spectrum())
    }

    /// Adds `factor · a · b`, the scaled pointwise product of two spectra, to `sum`, without allocation.
    pub fn product_into(
        &self,
        factor: f64,
        a: &SparseSpectrum,
        b: &SparseSpectrum,
        sum: &mut Accumulator,
    ) -> Result<(), AlgebraError> {
        for space in [a.space(), b.space(), sum.space()] {
            self.space.require(space)?;
        }
        let sums = sum.coefficients_mut();
        let mut first = Union { a: a.entries(), b: b.entries() };
        while let Some((i, a_i, b_i)) = first.next() {
            let diagonal = factor * a_i * b_i;
            if diagonal != 0.0 {
                self.add_pair(i as usize, i as usize, diagonal, sums);
            }
            for (j, a_j, b_j) in first.clone() {
                let both = factor * (a_i * b_j + a_j * b_i);
                if both != 0.0 {
                    self.add_pair(i as usize, j as usize, both, sums);
                }
            }
        }
        Ok(())
    }

    /// Adds the product of basis functions `i` and `j`, times `factor`, to a signal: `sums` are the coefficients of the
    /// signal in the same basis. Requires i ≤ j.
    fn add_pair(&self, i: usize, j: usize, factor: f64, sums: &mut [f64]) {
        // The rows before row i contain n, n − 1, … pairs.
        let pair = i * (2 * self.space.coefficients() - i + 1) / 2 + (j - i);
        let own = self.pairs[pair] as usize..=self.pairs[pair + 1] as usize;
        for &[run, next] in self.runs[own].array_windows() {
            let values = &self.values[run.start as usize..next.start as usize];
            let first = run.first as usize;
            if let [value] = values {
                sums[first] += factor * value;
            } else {
                add(&mut sums[first..first + values.len()], factor, values);
            }
        }
    }
}

/// Computes the coefficients of the product of basis functions i and j, expanded in the basis to which both belong, as
/// runs of consecutive indices without long stretches of zeros.
fn row(space: &LineSpace, i: usize, j: usize) -> Row {
    let ((a, left), (b, right)) = (space.synthesis().row(i), space.synthesis().row(j));
    let first = a.max(b);
    let end = (a + left.len()).min(b + right.len());
    if first >= end {
        return Row::new();
    }
    let products: Vec<f64> =
        left[first - a..end - a].iter().zip(&right[first - b..end - b]).map(|(x, y)| x * y).collect();
    let mut row = Row::new();
    for k in 0..space.coefficients() {
        let (c, dual) = space.analysis().row(k);
        let (from, to) = (first.max(c), end.min(c + dual.len()));
        if from >= to {
            continue;
        }
        let (dual, products) = (&dual[from - c..to - c], &products[from - first..to - first]);
        let (mut value, mut size) = (0.0, 0.0);
        for (x, y) in dual.iter().zip(products) {
            value += x * y;
            size += (x * y).abs();
        }
        if value.abs() <= ZERO * size {
            continue;
        }
        match row.last_mut() {
            Some((start, values)) if k - (*start as usize + values.len()) <= GAP => {
                values.resize(k - *start as usize, 0.0);
                values.push(value);
            }
            _ => row.push((k as u32, vec![value])),
        }
    }
    row
}

/// Multiplication by one fixed spectrum `a`, as a matrix on wavelet coefficients: `M_kj = Σ_s ψ̃_k(s)·a(s)·ψ_j(s)`.
///
/// Suits a surface whose reflectance multiplies all photons that hit it. Needs no couplings; takes lines up to
/// [`MAX_GRAM`]. Stores n² numbers of 8 bytes; a product costs n multiplications per coefficient of the other factor.
#[derive(Clone, Debug)]
pub struct Multiplier {
    space: Arc<LineSpace>,
    /// Matrix, column by column, that maps the coefficients of a spectrum to those of the spectrum times a fixed one.
    columns: Vec<f64>,
}

impl Multiplier {
    /// Computes the matrix of the pointwise multiplication by a fixed spectrum, given by its `samples`. The matrix maps
    /// coefficients in the basis `space` to coefficients in that basis.
    pub fn new(space: &Arc<LineSpace>, samples: &[f64]) -> Result<Self, AlgebraError> {
        if space.length() > MAX_GRAM {
            return Err(AlgebraError::TooLong { what: "a multiplier", found: space.length(), most: MAX_GRAM });
        }
        space.check("samples", samples)?;
        let size = space.coefficients();
        let mut columns = vec![0.0; size * size];
        let mut product = vec![0.0; space.length()];
        for (j, column) in columns.chunks_exact_mut(size).enumerate() {
            product.fill(0.0);
            space.synthesis().add(j, 1.0, &mut product);
            product.iter_mut().zip(samples).for_each(|(x, a)| *x *= a);
            space.analyse_into(&product, column);
        }
        Ok(Self { space: Arc::clone(space), columns })
    }

    /// Returns the pointwise product of `spectrum` and the fixed spectrum that was passed to [`Multiplier::new`].
    pub fn product(&self, spectrum: &SparseSpectrum) -> Result<SparseSpectrum, AlgebraError> {
        let mut sum = Accumulator::new(&self.space);
        self.product_into(1.0, spectrum, &mut sum)?;
        Ok(sum.spectrum())
    }

    /// Adds to `sum`, without allocation, `factor` times the pointwise product of `spectrum` and the fixed spectrum
    /// that was passed to [`Multiplier::new`].
    pub fn product_into(
        &self,
        factor: f64,
        spectrum: &SparseSpectrum,
        sum: &mut Accumulator,
    ) -> Result<(), AlgebraError> {
        self.space.require(spectrum.space())?;
        self.space.require(sum.space())?;
        let size = self.space.coefficients();
        for &Entry { index, value } in spectrum.entries() {
            let column = &self.columns[index as usize * size..][..size];
            add(sum.coefficients_mut(), factor * value, column);
        }
        Ok(())
    }
}
