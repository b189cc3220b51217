//! Dense vectors and small linear systems in f64.

/// Returns the dot product Σ aᵢ·bᵢ, added in order.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Returns the dot product Σ aᵢ·bᵢ as four interleaved sums of fixed order, which vectorise.
///
/// Faster than [`dot`] for long vectors, but rounds differently: results recorded with sums in order need [`dot`].
pub(crate) fn dot_by_four(a: &[f64], b: &[f64]) -> f64 {
    let (left, right) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = left.remainder().iter().zip(right.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 4];
    for (a, b) in left.zip(right) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Returns the Euclidean length of a vector.
#[inline]
pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Adds `factor · b` to the vector `a`.
#[inline]
pub(crate) fn add(a: &mut [f64], factor: f64, b: &[f64]) {
    a.iter_mut().zip(b).for_each(|(x, y)| *x += factor * y);
}

/// Subtracts `factor · b` from the vector `a`.
#[inline]
pub(crate) fn subtract(a: &mut [f64], factor: f64, b: &[f64]) {
    a.iter_mut().zip(b).for_each(|(x, y)| *x -= factor * y);
}

/// Multiplies each entry of a vector by `factor`.
#[inline]
pub(crate) fn scale(a: &mut [f64], factor: f64) {
    for x in a {
        *x *= factor;
    }
}

/// Solves a square linear system (row-major, right-hand side last in each row) by Gaussian elimination with partial
/// pivoting; `None` if it is singular to working precision.
pub(crate) fn solve(rows: &mut [Vec<f64>]) -> Option<Vec<f64>> {
    let n = rows.len();
    let scale = rows.iter().flat_map(|row| &row[..n]).fold(0.0_f64, |m, x| m.max(x.abs()));
    for column in 0..n {
        let pivot = (column..n).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        if rows[pivot][column].abs() <= 1e-14 * scale {
            return None;
        }
        rows.swap(column, pivot);
        eliminate(rows, column);
    }
    Some(substitute(rows))
}

/// Solves a square linear system like [`solve`], but without row exchanges: container files depend on the rounding of
/// polynomials fitted in this way. The matrix must be far from singular.
pub(crate) fn solve_in_order(rows: &mut [Vec<f64>]) -> Vec<f64> {
    for column in 0..rows.len() {
        eliminate(rows, column);
    }
    substitute(rows)
}

/// Reduces the rows of an augmented matrix `[A | B]` to `[1 | A⁻¹·B]` by the Gauss–Jordan method with partial pivoting;
/// `A` must not be singular.
///
/// It does not use [`solve`]: rows are multiplied by the inverse of their pivot, and the wavelets at the ends of lines
/// are defined with this rounding.
pub(crate) fn reduce(rows: &mut [Vec<f64>]) {
    for column in 0..rows.len() {
        let mut pivot = column;
        for r in column + 1..rows.len() {
            if rows[r][column].abs() > rows[pivot][column].abs() {
                pivot = r;
            }
        }
        rows.swap(column, pivot);
        let by = 1.0 / rows[column][column];
        scale(&mut rows[column], by);
        let source = rows[column].clone();
        for (r, row) in rows.iter_mut().enumerate() {
            let factor = row[column];
            if r != column && factor != 0.0 {
                subtract(row, factor, &source);
            }
        }
    }
}

/// Eliminates one column of a linear system below the diagonal; the resulting zeros are not written.
fn eliminate(rows: &mut [Vec<f64>], column: usize) {
    let (above, below) = rows.split_at_mut(column + 1);
    let leader = &above[column];
    for row in below {
        let factor = row[column] / leader[column];
        subtract(&mut row[column..], factor, &leader[column..]);
    }
}

/// Solves a linear system in triangular form by back substitution.
fn substitute(rows: &[Vec<f64>]) -> Vec<f64> {
    let n = rows.len();
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        x[i] = (rows[i][n] - dot(&rows[i][i + 1..n], &x[i + 1..])) / rows[i][i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the rows `[A | A·x]` of a linear system that is far from singular, and its solution `x`, for tests.
    fn system(n: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
        let x: Vec<f64> = (0..n).map(|i| 1.0 - 0.3 * i as f64).collect();
        let rows = (0..n).map(|i| {
            let mut row: Vec<f64> = (0..n).map(|j| 1.0 / (1 + i + 2 * j) as f64).collect();
            row[i] += 1.0;
            row.push(dot(&row, &x));
            row
        });
        (rows.collect(), x)
    }

    #[test]
    fn both_sums_of_products_are_the_same_where_nothing_is_rounded() {
        for n in 0..11 {
            let a: Vec<f64> = (0..n).map(f64::from).collect();
            let expected: f64 = (0..n).map(|x| f64::from(x * x)).sum();
            assert_eq!([dot(&a, &a), dot_by_four(&a, &a)], [expected; 2]);
        }
    }

    #[test]
    fn all_eliminations_solve_the_system() {
        for n in 1..9 {
            let (rows, x) = system(n);
            let mut reduced = rows.clone();
            reduce(&mut reduced);
            let found = [
                solve(&mut rows.clone()).unwrap(),
                solve_in_order(&mut rows.clone()),
                reduced.iter().map(|row| row[n]).collect(),
            ];
            for found in found {
                assert!(found.iter().zip(&x).all(|(found, x)| (found - x).abs() < 1e-12), "{n}: {found:?} {x:?}");
            }
        }
    }

    #[test]
    fn pivoting_finds_the_row_that_is_not_zero() {
        let rows = vec![vec![0.0, 2.0, 4.0], vec![3.0, 0.0, 3.0]];
        assert_eq!(solve(&mut rows.clone()), Some(vec![1.0, 2.0]));
        let mut reduced = rows;
        reduce(&mut reduced);
        assert_eq!(reduced, [[1.0, 0.0, 1.0], [0.0, 1.0, 2.0]]);
    }

    #[test]
    fn singular_systems_are_refused() {
        assert_eq!(solve(&mut [vec![1.0, 2.0, 1.0], vec![2.0, 4.0, 1.0]]), None);
        assert_eq!(solve(&mut [vec![0.0, 1.0]]), None);
    }
}
