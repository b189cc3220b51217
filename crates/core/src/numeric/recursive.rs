//! Recursive least squares in f64: growing normal equations, solved at intervals by Cholesky's method.
//!
//! The container format depends on the bits of the coefficients. Every sum has a fixed order, and loops that a compiler
//! may vectorise treat each entry independently.

/// Divisor of the padded length of rows, in entries: rows are padded with zeros to a multiple of it, so that loops
/// vectorise.
const LANES: usize = 4;
/// Ridge regularisation of recursive least squares, relative to the mean square of each feature. Raising it keeps
/// coefficients near their prior for more examples.
const RIDGE: f64 = 10.0;
/// Factor by which the number of training examples of a least-squares predictor grows before its coefficients are
/// solved for again. At least one example is added. Raising it solves less often.
const GROWTH: f64 = 1.05;

/// Recursive least squares: predicts a number as a linear combination of features, learned from all examples so far.
#[derive(Clone, Debug)]
pub(crate) struct Recursive {
    n: usize,
    /// Length of a feature vector of the least-squares predictor in memory: the number of features, padded to a
    /// multiple of [`LANES`].
    stride: usize,
    /// Sum Σ f·fᵀ over examples with feature vectors f; only the upper triangle is used.
    gram: Vec<f64>,
    /// Sum Σ f·y over examples with feature vectors f and target numbers y.
    right: Vec<f64>,
    /// Weighted number of examples (feature vectors with target numbers) from which the predictor has learned so far;
    /// earlier examples can be given a lower weight.
    count: f64,
    /// Weighted number of examples (feature vectors with target numbers) from which on the coefficients of the
    /// predictor are due to be computed again.
    next: f64,
    factor: Vec<f64>,
    coefficients: Vec<f64>,
}

impl Recursive {
    /// Creates a least-squares system of `n` features without examples.
    pub(crate) fn new(n: usize) -> Self {
        let stride = n.next_multiple_of(LANES);
        let vector = vec![0.0; stride];
        Self {
            n,
            stride,
            gram: vec![0.0; n * stride],
            right: vector.clone(),
            count: 0.0,
            next: 0.0,
            factor: vec![0.0; n * stride],
            coefficients: vector,
        }
    }

    /// Multiplies the weight of all earlier examples in the least-squares system by `by`, and marks the system as due
    /// to be solved again.
    pub(crate) fn fade(&mut self, by: f64) {
        self.gram.iter_mut().chain(&mut self.right).for_each(|x| *x *= by);
        self.count *= by;
        self.next = 0.0;
    }

    /// Returns true if enough examples were added since the last solution for the least-squares system to be solved
    /// again.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    pub(crate) fn is_due(&self) -> bool {
        self.next <= 0.0 || self.count >= self.next
    }

    /// Computes the coefficients that minimise the squared error plus a ridge term towards `prior`, whose missing
    /// entries are 0. The ridge of a feature is ten times its mean square plus `least`. If rounding makes the system
    /// singular, the coefficients are `prior`.
    pub(crate) fn solve(&mut self, prior: &[f64], least: f64) {
        let (n, stride) = (self.n, self.stride);
        self.next = self.count * GROWTH + 1.0;
        self.factor.copy_from_slice(&self.gram);
        self.coefficients.copy_from_slice(&self.right);
        for i in 0..n {
            let own = self.gram[i * stride + i];
            let ridge = if self.count > 0.0 { RIDGE * own / self.count } else { 0.0 } + least;
            self.factor[i * stride + i] = own + ridge;
            self.coefficients[i] += ridge * prior.get(i).copied().unwrap_or(0.0);
        }
        if !(self.eliminate() && self.coefficients.iter().all(|c| c.is_finite())) {
            self.coefficients.fill(0.0);
            self.coefficients[..prior.len()].copy_from_slice(prior);
        }
    }

    /// Replaces the least-squares matrix A by its Cholesky factor U with A = Uᵀ·U, row by row, and the right-hand side
    /// by the solution. Returns false if a pivot is not positive.
    fn eliminate(&mut self) -> bool {
        let (n, stride) = (self.n, self.stride);
        let x = &mut self.coefficients;
        for k in 0..n {
            let (above, below) = self.factor.split_at_mut((k + 1) * stride);
            let row = &mut above[k * stride..];
            if row[k].is_nan() || row[k] <= 0.0 {
                return false;
            }
            let pivot = row[k].sqrt();
            let inverse = 1.0 / pivot;
            row[k] = pivot;
            row[k + 1..].iter_mut().for_each(|u| *u *= inverse);
            x[k] *= inverse;
            let known = x[k];
            x[k + 1..].iter_mut().zip(&row[k + 1..]).for_each(|(x, u)| *x -= u * known);
            for (i, lower) in below.chunks_exact_mut(stride).enumerate() {
                let first = k + 1 + i;
                let factor = row[first];
                lower[first..].iter_mut().zip(&row[first..]).for_each(|(a, u)| *a -= factor * u);
            }
        }
        for i in (0..n).rev() {
            let row = &self.factor[i * stride..][..stride];
            for k in i + 1..n {
                x[i] -= row[k] * x[k];
            }
            x[i] /= row[i];
        }
        true
    }

    /// Predicts a number as Σ cᵢ·fᵢ from coefficients c and features f, which are padded with 0 to a multiple of 4.
    /// Four sums (s₀ of i = 0, 4, 8, …, s₁ of i = 1, 5, …, and so on) are added as (s₀ + s₂) + (s₁ + s₃).
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    pub(crate) fn predict(&self, features: &[f64]) -> f64 {
        let mut sums = [0.0; LANES];
        for (c, f) in self.coefficients.chunks_exact(LANES).zip(features.chunks_exact(LANES)) {
            for k in 0..LANES {
                sums[k] += c[k] * f[k];
            }
        }
        (sums[0] + sums[2]) + (sums[1] + sums[3])
    }

    /// Adds an example, features and target number, to the least-squares sums; features are padded with 0 to a multiple
    /// of 4.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    pub(crate) fn learn(&mut self, features: &[f64], wanted: f64) {
        let features = &features[..self.stride];
        for (i, row) in self.gram.chunks_exact_mut(self.stride).enumerate() {
            let first = i & !(LANES - 1);
            let own = features[i];
            let (row, features) = (&mut row[first..], &features[first..]);
            for (a, f) in row.chunks_exact_mut(LANES).zip(features.chunks_exact(LANES)) {
                for k in 0..LANES {
                    a[k] += own * f[k];
                }
            }
        }
        for (b, f) in self.right.chunks_exact_mut(LANES).zip(features.chunks_exact(LANES)) {
            for k in 0..LANES {
                b[k] += wanted * f[k];
            }
        }
        self.count += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::super::dense;
    use super::*;

    fn features(i: usize) -> [f64; 8] {
        let x = |k: usize| libm::sin((i * (k + 3)) as f64 * 0.37) + 0.1 * k as f64;
        std::array::from_fn(|k| if k < 6 { x(k) } else { 0.0 })
    }

    #[test]
    fn a_linear_rule_is_learned() {
        let mut system = Recursive::new(6);
        let rule = [0.5, -1.0, 0.25, 0.0, 3.0, -0.125];
        let truth = |f: &[f64; 8]| dense::dot(&rule, &f[..6]);
        let mut last = 0.0;
        for i in 0..4000 {
            let f = features(i);
            if system.is_due() {
                system.solve(&[0.0; 4], 1e-9);
            }
            last = (system.predict(&f) - truth(&f)).abs();
            system.learn(&f, truth(&f));
        }
        // The ridge gives the prior the weight of ten examples.
        assert!(last < 0.05, "{last}");
    }

    #[test]
    fn the_solution_is_that_of_the_normal_equations() {
        let mut system = Recursive::new(6);
        for i in 0..50 {
            system.learn(&features(i), i as f64);
        }
        let prior = [0.3, -0.2, 0.1, 0.0];
        system.solve(&prior, 0.01);
        let row = |i: usize| {
            let ridge = RIDGE * system.gram[i * 8 + i] / 50.0 + 0.01;
            let entry = |j: usize| system.gram[i.min(j) * 8 + i.max(j)] + if i == j { ridge } else { 0.0 };
            let right = system.right[i] + ridge * prior.get(i).copied().unwrap_or(0.0);
            (0..6).map(entry).chain([right]).collect::<Vec<f64>>()
        };
        let expected = dense::solve(&mut (0..6).map(row).collect::<Vec<_>>()).unwrap();
        for (found, expected) in system.coefficients.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn without_examples_or_with_huge_ones_the_prior_holds() {
        let prior = [0.25, -0.25, 0.0, 0.0];
        let mut system = Recursive::new(6);
        system.solve(&prior, 1e-9);
        assert!(system.coefficients.iter().zip(prior).all(|(c, p)| (c - p).abs() < 1e-12));
        system.learn(&[1e200; 8], 1.0);
        system.solve(&prior, 1e-9);
        assert_eq!(system.coefficients[..4], prior);
    }

    #[test]
    fn fading_halves_what_examples_weigh() {
        let mut system = Recursive::new(4);
        system.learn(&[1.0, 2.0, 3.0, 4.0], 2.0);
        system.fade(0.5);
        assert!(system.is_due());
        assert_eq!((system.count, system.right[1], system.gram[5]), (0.5, 2.0, 2.0));
    }
}
