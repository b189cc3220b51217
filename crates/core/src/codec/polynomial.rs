//! Polynomial fit of a list of numbers: the wavelengths of a spectrometer are a polynomial of the pixel, up to
//! rounding.

use crate::numeric::dense::solve_in_order;

/// Highest degree of a polynomial fitted to a list of numbers.
pub(super) const MAX_DEGREE: usize = 12;

/// Polynomial that predicts the entries of a list from their position, as Chebyshev coefficients on −1 … 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Polynomial {
    pub(super) coefficients: Vec<f64>,
}

/// Maps position `i` in a list of `count` numbers to −1 … 1, the argument of the polynomial fitted to the list.
fn place(i: usize, count: usize) -> f64 {
    if count < 2 { 0.0 } else { 2.0 * i as f64 / (count - 1) as f64 - 1.0 }
}

impl Polynomial {
    /// Fits a polynomial of `degree` to a list of values by least squares.
    pub(super) fn fit(values: &[f64], degree: usize) -> Self {
        let n = degree + 1;
        let mut matrix = vec![vec![0.0; n + 1]; n];
        let mut terms = vec![1.0; n];
        for (i, &value) in values.iter().enumerate() {
            let t = place(i, values.len());
            for k in 1..n {
                terms[k] = if k == 1 { t } else { 2.0 * t * terms[k - 1] - terms[k - 2] };
            }
            for (p, row) in matrix.iter_mut().enumerate() {
                for (entry, term) in row.iter_mut().zip(&terms) {
                    *entry += terms[p] * term;
                }
                row[n] += terms[p] * value;
            }
        }
        // The matrix is far from singular.
        let coefficients = solve_in_order(&mut matrix);
        Self { coefficients }
    }

    /// Returns the number that the fitted polynomial predicts at position `i` of a list of `count` numbers.
    pub(super) fn at(&self, i: usize, count: usize) -> f64 {
        let t = place(i, count);
        let (mut next, mut after) = (0.0, 0.0);
        for &c in self.coefficients.iter().skip(1).rev() {
            (next, after) = (c + 2.0 * t * next - after, next);
        }
        self.coefficients.first().map_or(0.0, |c| c + t * next - after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_found_again() {
        let f = |i: usize| 200.0 + 0.17 * i as f64 - 1e-5 * (i * i) as f64 + 1e-9 * (i * i * i) as f64;
        let values: Vec<f64> = (0..500).map(f).collect();
        for degree in 3..=MAX_DEGREE {
            let polynomial = Polynomial::fit(&values, degree);
            for (i, value) in values.iter().enumerate() {
                assert!((polynomial.at(i, 500) - value).abs() < 1e-9);
            }
        }
    }
}
