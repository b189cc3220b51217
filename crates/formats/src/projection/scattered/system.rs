//! Weighted linear systems of local fits: samples as columns, summed in lanes, factored and solved.

use super::rows::PARTS;
use crate::numeric::cholesky::{backward, factor_clamped, forward};
use crate::numeric::wide;

/// Number of terms of the largest polynomial basis of a local fit: 1, u, v, a, b, u², uv, v².
pub(super) const TERMS: usize = 8;
/// Number of samples summed side by side in SIMD lanes.
const LANES: usize = 4;
/// Ridge added to the diagonal of the normal equations, as a fraction of the sum of weights. It makes the coefficients
/// of undetermined terms 0.
const RIDGE: f64 = 1e-9;

/// Columns of a local least-squares fit, one element for each sample. Columns are padded to whole SIMD lanes; the
/// padding has no weight.
#[derive(Default)]
pub(super) struct Columns {
    /// Polynomial basis functions at the samples; the first is the constant 1.
    pub(super) basis: [Vec<f64>; TERMS],
    /// Squared distances of the samples from the centre of the local fit, divided by slightly more than the largest of
    /// them.
    pub(super) squares: Vec<f64>,
    /// Weight of each sample in the local fit according to its stated uncertainty.
    pub(super) certainty: Vec<f64>,
    pub(super) robust: Vec<f64>,
    pub(super) light: Vec<f64>,
    pub(super) residuals: Vec<f64>,
    /// Weights of the samples in the last solved local least-squares fit: products of the weights by distance, by
    /// stated uncertainty, and against outliers.
    weights: Vec<f64>,
}

/// Sums and maxima of the residuals of a local fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Departure {
    pub(super) sum: f64,
    pub(super) squares: f64,
    pub(super) largest: f64,
    pub(super) brightest: f64,
}

/// Factored normal equations of a local fit, with their solution for the samples' means over bands.
pub(super) struct Factored {
    factor: [[f64; TERMS]; TERMS],
    pub(super) terms: usize,
    pub(super) solution: [f64; TERMS],
    /// Variance of the samples about the fitted polynomial; each sample counts as its mean over bands.
    pub(super) scatter: f64,
}

impl Columns {
    /// Resizes all columns of a local least-squares fit for `count` samples. Sets the weights that suppress outliers to
    /// 1.
    pub(super) fn resize(&mut self, count: usize) {
        let padded = count.next_multiple_of(LANES);
        let Self { basis, squares, certainty, robust, light, residuals, weights } = self;
        for column in [squares, certainty, robust, light, residuals, weights].into_iter().chain(basis.iter_mut()) {
            column.resize(padded, 0.0);
            column[count..].fill(0.0);
        }
        self.basis[0].fill(1.0);
        self.squares[count..].fill(1.0);
        self.robust.fill(1.0);
    }

    /// Sets the weights of the first `count` samples in a local least-squares fit. Each is the product of three
    /// weights: by distance, by stated uncertainty, and against outliers.
    ///
    /// The weight by distance falls linearly with the squared distance, to 0 at `reach`. The farthest sample has some
    /// weight, too: its squared distance is less than 1.
    fn count(&mut self, count: usize, reach: f64) {
        let padded = count.next_multiple_of(LANES);
        let [squares, certainty, robust] =
            [&self.squares, &self.certainty, &self.robust].map(|column| &column[..padded]);
        let weights = &mut self.weights[..padded];
        let inverse = 1.0 / reach;
        wide(
            #[inline(always)]
            || {
                for i in 0..padded {
                    let near = 1.0 - squares[i] * inverse;
                    weights[i] = if near > 0.0 { near } else { 0.0 } * certainty[i] * robust[i];
                }
            },
        );
    }

    /// Builds and factorises the normal equations of a local least-squares fit to the first `count` samples of a
    /// neighbourhood. The weight of a sample falls to 0 at the squared radius `reach`, which is stated as a fraction of
    /// the squared radius of the whole neighbourhood.
    pub(super) fn system(&mut self, count: usize, reach: f64, joint: bool, terms: usize) -> Factored {
        self.count(count, reach);
        let padded = count.next_multiple_of(LANES);
        let [weights, light] = [&self.weights, &self.light].map(|column| lanes(&column[..padded]));
        let basis = self.basis.each_ref().map(|column| lanes(&column[..padded]));
        let mut matrix = [[0.0; TERMS]; TERMS];
        let mut right = [0.0; TERMS];
        let (mut square, mut number) = (0.0, 0.0);
        wide(
            #[inline(always)]
            || {
                square = total(
                    weights
                        .iter()
                        .zip(light)
                        .fold([0.0; LANES], |sum, (w, l)| std::array::from_fn(|i| sum[i] + w[i] * l[i] * l[i])),
                );
                let (whole, rest) = self.robust[..count].as_chunks::<LANES>();
                number = total(whole.iter().fold([0.0; LANES], |sum, new| std::array::from_fn(|i| sum[i] + new[i])))
                    + rest.iter().sum::<f64>();
                add_row::<0>(&basis, weights, light, &mut matrix, &mut right);
                add_row::<1>(&basis, weights, light, &mut matrix, &mut right);
                add_row::<2>(&basis, weights, light, &mut matrix, &mut right);
                add_row::<3>(&basis, weights, light, &mut matrix, &mut right);
                add_row::<4>(&basis, weights, light, &mut matrix, &mut right);
                add_row::<5>(&basis, weights, light, &mut matrix, &mut right);
                if joint {
                    add_row::<6>(&basis, weights, light, &mut matrix, &mut right);
                    add_row::<7>(&basis, weights, light, &mut matrix, &mut right);
                }
            },
        );
        let total = matrix[0][0];
        for (i, row) in matrix.iter_mut().enumerate().take(terms).skip(1) {
            row[i] += RIDGE * total;
        }
        let mut factored = Factored::new(matrix, terms);
        factored.solution = factored.solve(right);
        let explained: f64 = factored.solution.iter().zip(&right).map(|(a, b)| a * b).sum();
        let freedom = 1.0 - terms as f64 / number.max(terms as f64 + 1.0);
        // A sum of squares within rounding of 0 counts as 0.
        let left = square - explained;
        factored.scatter = if left > 1e-12 * square { left / (total * freedom) } else { 0.0 };
        factored
    }

    /// Computes the magnitudes of the residuals of the first `count` samples about the polynomial with the coefficients
    /// `solution`.
    pub(super) fn depart(&mut self, count: usize, solution: &[f64; TERMS]) -> Departure {
        let Self { basis, light, residuals, .. } = self;
        let padded = count.next_multiple_of(LANES);
        let (light, residuals) = (&light[..padded], &mut residuals[..padded]);
        let (mut sum, mut squares) = ([0.0; LANES], [0.0; LANES]);
        let (mut largest, mut brightest) = ([0.0_f64; LANES], [0.0_f64; LANES]);
        wide(
            #[inline(always)]
            || {
                residuals.fill(solution[0]);
                for (column, term) in basis.iter().zip(solution).skip(1).filter(|(_, term)| **term != 0.0) {
                    residuals.iter_mut().zip(column).for_each(|(residual, x)| *residual += term * x);
                }
                residuals.iter_mut().zip(light).for_each(|(residual, light)| *residual = (light - *residual).abs());
                residuals[count..].fill(0.0);
                for (residuals, lights) in lanes(residuals).iter().zip(lanes(light)) {
                    for l in 0..LANES {
                        let (residual, light) = (residuals[l], lights[l].abs());
                        sum[l] += residual;
                        squares[l] += residual * residual;
                        largest[l] = if residual > largest[l] { residual } else { largest[l] };
                        brightest[l] = if light > brightest[l] { light } else { brightest[l] };
                    }
                }
            },
        );
        let most = |lanes: [f64; LANES]| lanes.into_iter().fold(0.0, f64::max);
        Departure { sum: total(sum), squares: total(squares), largest: most(largest), brightest: most(brightest) }
    }

    /// Sets the robust weight of each sample from its residual by Tukey's bisquare: 1 at residual 0, falling to 0 at
    /// `limit`, and 0 beyond.
    pub(super) fn trust(&mut self, limit: f64) {
        for (robust, residual) in self.robust.iter_mut().zip(&self.residuals) {
            let far = residual / limit;
            *robust = (1.0 - far * far).max(0.0).powi(2);
        }
    }

    /// Calls `with` for each sample of nonzero weight among the first `count` samples. Passes its weights in the fitted
    /// values at the points `parts`.
    pub(super) fn weigh(
        &mut self,
        (count, reach): (usize, f64),
        factored: &Factored,
        parts: &[[f64; TERMS]; PARTS],
        mut with: impl FnMut(usize, [f64; PARTS]),
    ) {
        self.count(count, reach);
        let solutions = parts.map(|part| factored.solve(part));
        let by_term: [[f64; PARTS]; TERMS] = std::array::from_fn(|j| solutions.map(|solution| solution[j]));
        let basis = self.basis.each_ref().map(|column| &column[..count]);
        let weights = &self.weights[..count];
        wide(
            #[inline(always)]
            || {
                for i in 0..count {
                    if weights[i] == 0.0 {
                        continue;
                    }
                    let mut sums = [0.0; PARTS];
                    for j in 0..TERMS {
                        for p in 0..PARTS {
                            sums[p] += by_term[j][p] * basis[j][i];
                        }
                    }
                    with(i, sums.map(|sum| weights[i] * sum));
                }
            },
        );
    }
}

/// Splits a column into groups of samples that are summed side by side in SIMD lanes.
fn lanes(column: &[f64]) -> &[[f64; LANES]] {
    column.as_chunks().0
}

fn total(lanes: [f64; LANES]) -> f64 {
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}

/// Computes row `J` of the lower triangle of the normal matrix of a local fit, and element `J` of its right-hand side,
/// as sums over the samples.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn add_row<const J: usize>(
    basis: &[&[[f64; LANES]]; TERMS],
    weights: &[[f64; LANES]],
    light: &[[f64; LANES]],
    matrix: &mut [[f64; TERMS]; TERMS],
    right: &mut [f64; TERMS],
) {
    let n = weights.len();
    let basis = basis.map(|column| &column[..n]);
    let light = &light[..n];
    let mut sums = [[0.0; LANES]; TERMS];
    let mut lights = [0.0; LANES];
    for i in 0..n {
        let weighted: [f64; LANES] = std::array::from_fn(|l| weights[i][l] * basis[J][i][l]);
        for k in 0..=J {
            for l in 0..LANES {
                sums[k][l] += weighted[l] * basis[k][i][l];
            }
        }
        for l in 0..LANES {
            lights[l] += weighted[l] * light[i][l];
        }
    }
    right[J] = total(lights);
    for k in 0..=J {
        matrix[J][k] = total(sums[k]);
    }
}

impl Factored {
    /// Computes the Cholesky factor of the normal equations from the first `terms` rows of the lower triangle of
    /// `matrix`.
    fn new(mut matrix: [[f64; TERMS]; TERMS], terms: usize) -> Self {
        match terms {
            6 => factor_clamped::<6, TERMS>(&mut matrix),
            8 => factor_clamped::<8, TERMS>(&mut matrix),
            5 => factor_clamped::<5, TERMS>(&mut matrix),
            3 => factor_clamped::<3, TERMS>(&mut matrix),
            _ => factor_clamped::<1, TERMS>(&mut matrix),
        }
        Self { factor: matrix, terms, solution: [0.0; TERMS], scatter: 0.0 }
    }

    /// Solves the factored normal equations for a right-hand side; the solution is 0 beyond the terms of the fit.
    pub(super) fn solve(&self, right: [f64; TERMS]) -> [f64; TERMS] {
        match self.terms {
            6 => backward::<6, TERMS>(&self.factor, forward::<6, TERMS>(&self.factor, right)),
            8 => backward::<8, TERMS>(&self.factor, forward::<8, TERMS>(&self.factor, right)),
            5 => backward::<5, TERMS>(&self.factor, forward::<5, TERMS>(&self.factor, right)),
            3 => backward::<3, TERMS>(&self.factor, forward::<3, TERMS>(&self.factor, right)),
            _ => backward::<1, TERMS>(&self.factor, forward::<1, TERMS>(&self.factor, right)),
        }
    }

    /// Returns the variance of the linear combination `of` of the coefficients if the variances of the samples are
    /// their inverse weights. It is the quadratic form of the inverse normal matrix.
    pub(super) fn variance(&self, of: [f64; TERMS]) -> f64 {
        let half = match self.terms {
            6 => forward::<6, TERMS>(&self.factor, of),
            8 => forward::<8, TERMS>(&self.factor, of),
            5 => forward::<5, TERMS>(&self.factor, of),
            3 => forward::<3, TERMS>(&self.factor, of),
            _ => forward::<1, TERMS>(&self.factor, of),
        };
        half.iter().map(|x| x * x).sum()
    }

    /// Returns the value of a polynomial that was fitted to the samples' means over bands, at one pair of directions.
    /// `at` holds the values of the terms of the polynomial there, such as 1, u, v, u², uv and v².
    pub(super) fn light(&self, at: &[f64; TERMS]) -> f64 {
        self.solution.iter().zip(at).map(|(a, b)| a * b).sum()
    }
}
