//! Columns made orthonormal: Cholesky's factor of their Gram matrix, in f64, in order.

use crate::domain::wide;

/// A column with less than this part of its square left by those before it is left out.
const INDEPENDENT: f64 = 1e-4;

/// Cholesky's factor of the Gram matrix of columns: row-major lower triangle, with rows of zeros for columns left out.
#[derive(Default)]
pub(super) struct Factor {
    n: usize,
    lower: Vec<f64>,
}

impl Factor {
    /// Of a Gram matrix; columns that depend on those before them are left out, and those that `keep` does not want.
    pub(super) fn new(n: usize, gram: &[f64], keep: impl Fn(usize) -> bool) -> Self {
        wide(
            #[inline(always)]
            || Self::of(n, gram, keep),
        )
    }

    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn of(n: usize, gram: &[f64], keep: impl Fn(usize) -> bool) -> Self {
        let (mut lower, mut columns) = (vec![0.0; n * n], vec![0.0; n * n]);
        let mut sums = vec![0.0; n];
        for i in (0..n).filter(|&i| keep(i)) {
            let row = &mut lower[i * n..][..n];
            // Σ_k L_ik · L_jk of all j at once, in the order of k.
            sums.fill(0.0);
            for k in 0..i {
                let column = &columns[k * n..][..i];
                if columns[k * n + k] > 0.0 {
                    let own = (gram[i * n + k] - sums[k]) / columns[k * n + k];
                    row[k] = own;
                    if own != 0.0 {
                        sums[k + 1..i].iter_mut().zip(&column[k + 1..]).for_each(|(sum, other)| *sum += own * other);
                    }
                }
            }
            let own = gram[i * n + i];
            let left = own - row[..i].iter().map(|a| a * a).sum::<f64>();
            if left > INDEPENDENT * own {
                row[i] = left.sqrt();
                (0..=i).for_each(|k| columns[k * n + i] = row[k]);
            } else {
                row.fill(0.0);
            }
        }
        Self { n, lower }
    }

    pub(super) fn keeps(&self, column: usize) -> bool {
        self.lower[column * self.n + column] > 0.0
    }

    /// L⁻¹ x, in place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        for i in 0..self.n {
            let row = &self.lower[i * self.n..][..self.n];
            let product: f64 = row[..i].iter().zip(&*x).map(|(l, x)| l * x).sum();
            x[i] = if row[i] > 0.0 { (x[i] - product) / row[i] } else { 0.0 };
        }
    }

    /// L⁻ᵀ x, in place.
    pub(super) fn solve_transposed(&self, x: &mut [f64]) {
        for i in (0..self.n).rev() {
            let row = &self.lower[i * self.n..][..self.n];
            x[i] = if row[i] > 0.0 { x[i] / row[i] } else { 0.0 };
            let own = x[i];
            x.iter_mut().zip(&row[..i]).for_each(|(x, l)| *x -= l * own);
        }
    }

    /// Lᵀ x, in place.
    pub(super) fn multiply_transposed(&self, x: &mut [f64]) {
        for j in 0..self.n {
            x[j] = (j..self.n).map(|i| self.lower[i * self.n + j] * x[i]).sum();
        }
    }
}
