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

/// Rounding threshold: a coupling smaller than this fraction of the sum of the magnitudes of its terms is taken as 0.
const ZERO: f64 = 1e-14;
/// Longest gap of zeros, in coefficients, that is stored within a run. Raising it gives fewer, longer runs with more
/// zeros.
const GAP: usize = 3;

/// Table of all coupling coefficients `C(k; i, j)` of a line for i ≤ j, in runs of consecutive k.
#[derive(Clone, Debug)]
pub struct Couplings {
    space: Arc<LineSpace>,
    /// First run of each pair (pairs by rising i, then j), followed by the position of the end marker in `runs`.
    pairs: Vec<u32>,
    runs: Vec<Run>,
    values: Vec<f64>,
    count: usize,
}

/// Couplings of consecutive k from `first`. Values begin at `start` and end where those of the next run begin.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    first: u32,
    start: u32,
}

/// Couplings of one pair, in runs of (first k, values).
type Row = Vec<(u32, Vec<f64>)>;

impl Couplings {
    /// Computes the couplings of a line. If all functions overlap, there are n²/2 pairs of n coefficients each, which
    /// restricts the table to short lines ([`MAX_COUPLED`], [`MAX_COUPLINGS`]).
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

    /// Returns the basis of the couplings.
    pub fn space(&self) -> &Arc<LineSpace> {
        &self.space
    }

    /// Returns the number of couplings that are not 0.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns true if the product has no terms: all factors between pairs of coefficients are 0.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the size in memory in bytes, without the basis.
    pub fn bytes(&self) -> usize {
        size_of_val(self.values.as_slice()) + size_of_val(self.runs.as_slice()) + size_of_val(self.pairs.as_slice())
    }

    /// Returns `C(k; i, j)`.
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

    /// Returns the product of two spectra with all its coefficients; [`SparseSpectrum::truncated`] makes it sparse
    /// again.
    pub fn product(&self, a: &SparseSpectrum, b: &SparseSpectrum) -> Result<SparseSpectrum, AlgebraError> {
        let mut sum = Accumulator::new(&self.space);
        self.product_into(1.0, a, b, &mut sum)?;
        Ok(sum.spectrum())
    }

    /// Adds `factor · a · b` to `sum`, without allocation.
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

    /// Adds `factor · C(·; i, j)` to `sums`; i ≤ j.
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

/// Computes the couplings of two synthesis functions, in runs.
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

/// Multiplication by one fixed spectrum, as a matrix on coefficients: `M_kj = Σ_s ψ̃_k(s)·a(s)·ψ_j(s)`.
///
/// Suits a surface whose reflectance multiplies all photons that hit it. Needs no couplings; takes lines up to
/// [`MAX_GRAM`]. Stores n² numbers of 8 bytes; a product costs n multiplications per coefficient of the other factor.
#[derive(Clone, Debug)]
pub struct Multiplier {
    space: Arc<LineSpace>,
    /// Matrix entries, column by column.
    columns: Vec<f64>,
}

impl Multiplier {
    /// Prepares the multiplication by the function with these samples.
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

    /// Returns the product with a spectrum.
    pub fn product(&self, spectrum: &SparseSpectrum) -> Result<SparseSpectrum, AlgebraError> {
        let mut sum = Accumulator::new(&self.space);
        self.product_into(1.0, spectrum, &mut sum)?;
        Ok(sum.spectrum())
    }

    /// Adds `factor · product` to `sum`, without allocation.
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
