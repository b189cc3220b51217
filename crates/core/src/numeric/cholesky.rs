//! Cholesky factors of symmetric matrices, in f64, in a fixed order.
//!
//! If a matrix is singular up to rounding, a pivot vanishes. `Definite` then fails, because its caller has an
//! alternative. `factor_clamped` continues with a smallest pivot, because a fit needs some solution. `GramFactor` skips
//! the column, because a decoder must know which columns exist.

use super::dense::dot;
use super::wide;

/// Cholesky factor of a symmetric positive definite matrix.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Definite<const N: usize> {
    /// Lower triangle L of the Cholesky factorisation A = L·Lᵀ.
    factor: [[f64; N]; N],
    n: usize,
}

impl<const N: usize> Definite<N> {
    /// Computes the Cholesky factor of the first `n` rows and columns of a matrix, of which only the lower triangle is
    /// read. The result is `None` if a pivot is not positive.
    #[inline]
    pub(crate) fn new(matrix: &[[f64; N]; N], n: usize) -> Option<Self> {
        let mut factor = [[0.0; N]; N];
        for i in 0..n {
            for j in 0..=i {
                let left = matrix[i][j] - dot(&factor[i][..j], &factor[j][..j]);
                if i == j {
                    if left <= 0.0 {
                        return None;
                    }
                    factor[i][i] = left.sqrt();
                } else {
                    factor[i][j] = left / factor[j][j];
                }
            }
        }
        Some(Self { factor, n })
    }

    /// Solves the factored linear system for a right-hand side; entries beyond the factored rows stay unchanged.
    #[inline]
    pub(crate) fn solve(&self, mut x: [f64; N]) -> [f64; N] {
        let Self { factor, n } = self;
        for i in 0..*n {
            x[i] = (x[i] - dot(&factor[i][..i], &x[..i])) / factor[i][i];
        }
        for i in (0..*n).rev() {
            let known: f64 = (i + 1..*n).map(|k| factor[k][i] * x[k]).sum();
            x[i] = (x[i] - known) / factor[i][i];
        }
        x
    }
}

/// Smallest pivot of the Cholesky factorisation [`factor_clamped`], relative to the first diagonal entry. Smaller
/// pivots are raised to it.
const LEAST_PIVOT: f64 = 1e-14;

/// Replaces the lower triangle of the first `N` rows of a positive semidefinite matrix by its Cholesky factor. Diagonal
/// entries are stored as reciprocals, by which solving multiplies. Pivots are clamped to 1e-14 of the first diagonal
/// entry.
///
/// It does not use `Definite`: products are subtracted one after another, and recorded projections depend on this
/// rounding.
#[inline]
pub fn factor_clamped<const N: usize, const M: usize>(matrix: &mut [[f64; M]; M]) {
    let least = (LEAST_PIVOT * matrix[0][0]).max(1e-300);
    for j in 0..N {
        let row = matrix[j];
        let mut pivot = row[j];
        for factor in &row[..j] {
            pivot -= factor * factor;
        }
        let inverse = 1.0 / pivot.max(least).sqrt();
        for below in &mut matrix[j + 1..N] {
            let mut left = below[j];
            for k in 0..j {
                left -= below[k] * row[k];
            }
            below[j] = left * inverse;
        }
        matrix[j][j] = inverse;
    }
}

/// Returns L⁻¹·x for the Cholesky factor L of [`factor_clamped`]; entries beyond its rows are 0.
#[inline]
pub fn forward<const N: usize, const M: usize>(factor: &[[f64; M]; M], mut x: [f64; M]) -> [f64; M] {
    x[N..].fill(0.0);
    for i in 0..N {
        for k in 0..i {
            x[i] -= factor[i][k] * x[k];
        }
        x[i] *= factor[i][i];
    }
    x
}

/// Returns L⁻ᵀ·x for the Cholesky factor L of [`factor_clamped`]; entries beyond its rows stay unchanged.
#[inline]
pub fn backward<const N: usize, const M: usize>(factor: &[[f64; M]; M], mut x: [f64; M]) -> [f64; M] {
    for i in (0..N).rev() {
        for k in i + 1..N {
            x[i] -= factor[k][i] * x[k];
        }
        x[i] *= factor[i][i];
    }
    x
}

/// Threshold of linear independence: a column is skipped if the part orthogonal to all earlier columns has less than
/// this fraction of its squared norm. Raising it skips more columns.
const INDEPENDENT: f64 = 1e-4;

/// Cholesky factor L of the Gram matrix of a set of columns, with which the columns are made orthonormal: row-major
/// lower triangle, with rows of zeros for skipped columns.
///
/// It does not use [`Definite`]: the size is known at run time only, products of all rows are summed at once, and
/// container files depend on this rounding.
#[derive(Default)]
pub(crate) struct GramFactor {
    n: usize,
    lower: Vec<f64>,
}

impl GramFactor {
    /// Computes the Cholesky factor of the Gram matrix of `n` columns. It skips columns that depend linearly on earlier
    /// ones and columns for which `keep` is false.
    pub(crate) fn new(n: usize, gram: &[f64], keep: impl Fn(usize) -> bool) -> Self {
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
            // Σ_k L_ik · L_jk for all j at once, in the order of k.
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

    /// Returns false if the factorisation skipped a column of the set to be made orthonormal, because the column
    /// depends linearly on earlier ones or was excluded.
    pub(crate) fn keeps(&self, column: usize) -> bool {
        self.lower[column * self.n + column] > 0.0
    }

    /// Multiplies `x` in place by L⁻¹, where L·Lᵀ is the Gram matrix of the columns. Skipped columns get 0.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        for i in 0..self.n {
            let row = &self.lower[i * self.n..][..self.n];
            let product: f64 = row[..i].iter().zip(&*x).map(|(l, x)| l * x).sum();
            x[i] = if row[i] > 0.0 { (x[i] - product) / row[i] } else { 0.0 };
        }
    }

    /// Multiplies `x` in place by L⁻ᵀ, where L is the Cholesky factor of a Gram matrix. Elements for columns that the
    /// factorisation skipped as linearly dependent become 0.
    pub(crate) fn solve_transposed(&self, x: &mut [f64]) {
        for i in (0..self.n).rev() {
            let row = &self.lower[i * self.n..][..self.n];
            x[i] = if row[i] > 0.0 { x[i] / row[i] } else { 0.0 };
            let own = x[i];
            x.iter_mut().zip(&row[..i]).for_each(|(x, l)| *x -= l * own);
        }
    }

    /// Multiplies `x` in place by Lᵀ, where L is the Cholesky factor.
    pub(crate) fn multiply_transposed(&self, x: &mut [f64]) {
        for j in 0..self.n {
            x[j] = (j..self.n).map(|i| self.lower[i * self.n + j] * x[i]).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::dense;
    use super::*;

    const N: usize = 6;

    /// Returns a positive definite matrix and a right-hand side, for tests.
    fn system() -> ([[f64; N]; N], [f64; N]) {
        let entry = |i: usize, j: usize| 1.0 / (1 + i.abs_diff(j)) as f64 + if i == j { 0.3 * i as f64 } else { 0.0 };
        (std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))), std::array::from_fn(|i| 1.0 - 0.4 * i as f64))
    }

    /// Solves the first `n` rows of a linear system by Gaussian elimination.
    fn plain(matrix: &[[f64; N]; N], right: &[f64; N], n: usize) -> Vec<f64> {
        let row = |i: usize| matrix[i][..n].iter().copied().chain([right[i]]).collect();
        dense::solve(&mut (0..n).map(row).collect::<Vec<Vec<f64>>>()).unwrap()
    }

    #[track_caller]
    fn assert_close(found: &[f64], expected: &[f64]) {
        assert!(found.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?} {expected:?}");
    }

    #[test]
    fn all_factors_solve_the_system() {
        let (matrix, right) = system();
        let expected = plain(&matrix, &right, N);
        assert_close(&Definite::new(&matrix, N).unwrap().solve(right), &expected);
        let mut factor = matrix;
        factor_clamped::<N, N>(&mut factor);
        assert_close(&backward::<N, N>(&factor, forward::<N, N>(&factor, right)), &expected);
        let factor = GramFactor::new(N, &matrix.concat(), |_| true);
        let mut x = right;
        factor.solve(&mut x);
        factor.solve_transposed(&mut x);
        assert_close(&x, &expected);
    }

    #[test]
    fn leading_parts_are_systems_of_their_own() {
        let (matrix, right) = system();
        let expected = plain(&matrix, &right, 3);
        let found = Definite::new(&matrix, 3).unwrap().solve(right);
        assert_close(&found, &expected);
        assert_eq!(found[3..], right[3..]);
        let mut factor = matrix;
        factor_clamped::<3, N>(&mut factor);
        let found = backward::<3, N>(&factor, forward::<3, N>(&factor, right));
        assert_close(&found, &expected);
        assert_eq!(found[3..], [0.0; 3]);
    }

    #[test]
    fn a_vanishing_pivot_is_refused_clamped_or_skipped() {
        // The third column equals the second, and all steps are exact.
        let matrix = [[4.0, 2.0, 2.0, 0.0], [2.0, 5.0, 5.0, 0.0], [2.0, 5.0, 5.0, 0.0], [0.0, 0.0, 0.0, 9.0]];
        let right = [1.0, -2.0, 3.0, 6.0];
        assert!(Definite::new(&matrix, 4).is_none());
        assert!(Definite::new(&matrix, 2).is_some());
        let mut factor = matrix;
        factor_clamped::<4, 4>(&mut factor);
        assert_eq!(factor[2][2], 1.0 / (LEAST_PIVOT * 4.0).sqrt());
        assert!(backward::<4, 4>(&factor, forward::<4, 4>(&factor, right)).iter().all(|x| x.is_finite()));
        let keeps = |factor: GramFactor| -> [bool; 4] { std::array::from_fn(|column| factor.keeps(column)) };
        assert_eq!(keeps(GramFactor::new(4, &matrix.concat(), |_| true)), [true, true, false, true]);
        assert_eq!(keeps(GramFactor::new(4, &matrix.concat(), |column| column != 1)), [true, false, true, true]);
        let factor = GramFactor::new(4, &matrix.concat(), |_| true);
        let mut x = right;
        factor.solve(&mut x);
        assert_eq!(x, [0.5, -1.25, 0.0, 2.0]);
    }

    #[test]
    fn multiplication_undoes_the_transposed_solution() {
        let (matrix, right) = system();
        let factor = GramFactor::new(N, &matrix.concat(), |_| true);
        let mut x = right;
        factor.solve_transposed(&mut x);
        factor.multiply_transposed(&mut x);
        assert_close(&x, &right);
    }
}
