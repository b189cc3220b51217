//! K-term approximations of a spectrum: largest coefficients, largest coefficients refitted, and greedy selection.
//!
//! For relative errors each sample is weighted by its inverse: er(L2)² = mean ((s' − s)/s)².

use super::Dictionary;
use crate::numeric::dense::{dot, scale};
use crate::numeric::least_squares::constrained;
use crate::numeric::orthogonal::{take_away, take_away_twice};

/// Approximation of a spectrum by few basis functions: their numbers, their coefficients, and the resulting samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Approximation {
    /// Indices, within the basis, of the selected basis functions.
    pub kept: Vec<usize>,
    /// Coefficients of the selected basis functions, in the order of `kept`.
    pub coefficients: Vec<f64>,
    /// Approximated samples: sum of the selected basis functions times their coefficients.
    pub samples: Vec<f64>,
}

/// Relative errors of an approximation over the samples above 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelativeErrors {
    /// Mean relative error |s' − s|/s of approximated samples s' over original ones s > 0.
    pub l1: f64,
    /// Root mean square of the relative error (s' − s)/s of approximated samples s' over original ones s > 0.
    pub l2: f64,
}

/// Linear functional (weighted sum) of the samples that an approximation must keep exactly.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// Weights of a weighted sum of samples, one weight for each sample. An approximation must keep the value of this
    /// sum exactly.
    pub weights: Vec<f64>,
}

impl RelativeErrors {
    /// Computes the relative errors of the samples `found` against the original `samples`.
    pub fn between(samples: &[f64], found: &[f64]) -> Self {
        let (mut l1, mut l2, mut n) = (0.0, 0.0, 0.0);
        for (&s, f) in samples.iter().zip(found).filter(|(s, _)| **s > 0.0) {
            let q = (f - s).abs() / s;
            l1 += q;
            l2 += q * q;
            n += 1.0;
        }
        if n == 0.0 { Self::default() } else { Self { l1: l1 / n, l2: (l2 / n).sqrt() } }
    }
}

/// Weight of each sample in er(L2): 1/s, and 0 for samples ≤ 0, which have no relative error.
fn weights(samples: &[f64]) -> Vec<f64> {
    samples.iter().map(|&s| if s > 0.0 { 1.0 / s } else { 0.0 }).collect()
}

/// Selects the `count` largest coefficients of `samples`, with unchanged values. If `relative`, those with the largest
/// effect on the relative error, |c|·‖ψ/s‖, otherwise those of largest L2 norm, |c|·‖ψ‖.
pub(super) fn largest(dictionary: &Dictionary, samples: &[f64], count: usize, relative: bool) -> Approximation {
    let c = dictionary.coefficients(samples);
    let w = if relative { weights(samples) } else { vec![1.0; samples.len()] };
    let magnitude = |k: usize| {
        let square: f64 = dictionary.atom(k).iter().zip(&w).map(|(a, w)| (a * w) * (a * w)).sum();
        c[k].abs() * square.sqrt()
    };
    let mut ranked: Vec<(f64, usize)> = (0..dictionary.len()).map(|k| (magnitude(k), k)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let kept: Vec<usize> = ranked.into_iter().take(count).map(|(_, k)| k).collect();
    let coefficients: Vec<f64> = kept.iter().map(|&k| c[k]).collect();
    let samples = dictionary.synthesise(&kept, &coefficients);
    Approximation { kept, coefficients, samples }
}

/// Refits the coefficients of the basis functions `kept` to `samples` for the least relative RMS error er(L2), while
/// the weighted sums in `constraints` stay exact. `None` if these cannot, or if the functions are linearly dependent.
pub(super) fn refitted(
    dictionary: &Dictionary,
    samples: &[f64],
    kept: &[usize],
    constraints: &[Constraint],
) -> Option<Approximation> {
    let w = weights(samples);
    let weighted = |v: &[f64]| -> Vec<f64> { v.iter().zip(&w).map(|(v, w)| v * w).collect() };
    let columns: Vec<Vec<f64>> = kept.iter().map(|&k| weighted(dictionary.atom(k))).collect();
    let bounds: Vec<(Vec<f64>, f64)> = constraints
        .iter()
        .map(|c| (kept.iter().map(|&k| dot(&c.weights, dictionary.atom(k))).collect(), dot(&c.weights, samples)))
        .collect();
    let coefficients = constrained(&columns, &weighted(samples), &bounds)?;
    let samples = dictionary.synthesise(kept, &coefficients);
    Some(Approximation { kept: kept.to_vec(), coefficients, samples })
}

/// Selects functions of a basis one by one for the least relative RMS error er(L2) of `samples`, then refits them:
/// orthogonal least squares (Chen, Billings & Luo 1989).
///
/// Each step adds the function that lowers the error most with all coefficients free. While selecting, `constraints`
/// (weighted sums of the samples to keep) count as heavily weighted samples.
pub(super) fn greedy(
    dictionary: &Dictionary,
    samples: &[f64],
    count: usize,
    constraints: &[Constraint],
) -> Option<Approximation> {
    let problem = Problem::new(dictionary, samples, constraints);
    let mut kept = Vec::with_capacity(count);
    while kept.len() < count {
        kept.push(problem.best_addition(&kept)?);
    }
    refitted(dictionary, samples, &kept, constraints)
}

/// Improves an approximation by exchanging one basis function at a time, until no exchange lowers the error or after
/// `rounds` rounds.
pub(super) fn exchange(
    dictionary: &Dictionary,
    samples: &[f64],
    start: Approximation,
    rounds: usize,
    constraints: &[Constraint],
) -> Approximation {
    let problem = Problem::new(dictionary, samples, constraints);
    let mut best = start;
    let mut error = RelativeErrors::between(samples, &best.samples).l2;
    for _ in 0..rounds {
        let mut improved = false;
        for i in 0..best.kept.len() {
            let mut kept = best.kept.clone();
            kept.remove(i);
            let Some(added) = problem.best_addition(&kept) else { continue };
            kept.push(added);
            let Some(candidate) = refitted(dictionary, samples, &kept, constraints) else { continue };
            let found = RelativeErrors::between(samples, &candidate.samples).l2;
            if found < error * (1.0 - 1e-9) {
                (best, error, improved) = (candidate, found, true);
            }
        }
        if !improved {
            break;
        }
    }
    best
}

/// Least-squares problem of selecting functions to approximate a spectrum: samples s and functions, both weighted by
/// 1/s, with an extra row for each weighted sum of samples that must stay exact.
struct Problem {
    columns: Vec<Vec<f64>>,
    target: Vec<f64>,
}

/// Weight of a constraint (a weighted sum of the spectrum's samples that must stay exact) while basis functions are
/// selected for the least error, relative to all samples together. Raising it favours functions that help to meet it.
const CONSTRAINT_WEIGHT: f64 = 30.0;

impl Problem {
    fn new(dictionary: &Dictionary, samples: &[f64], constraints: &[Constraint]) -> Self {
        let w = weights(samples);
        let bound = CONSTRAINT_WEIGHT * (samples.len() as f64).sqrt();
        let extended = |v: &[f64]| {
            let rows = constraints.iter().map(|c| bound * dot(&c.weights, v) / dot(&c.weights, samples));
            v.iter().zip(&w).map(|(v, w)| v * w).chain(rows).collect()
        };
        let columns = (0..dictionary.len()).map(|k| extended(dictionary.atom(k))).collect();
        Self { columns, target: extended(samples) }
    }

    /// Number of the basis function outside `kept` that lowers the squared error most when added; `None` if none is
    /// left.
    fn best_addition(&self, kept: &[usize]) -> Option<usize> {
        let mut basis: Vec<Vec<f64>> = Vec::with_capacity(kept.len());
        for &k in kept {
            let mut v = self.columns[k].clone();
            let squares = take_away_twice(&mut v, &basis);
            if squares.after > 1e-20 * squares.before {
                scale(&mut v, 1.0 / squares.after.sqrt());
                basis.push(v);
            }
        }
        let mut residual = self.target.clone();
        take_away(&mut residual, &basis);
        let mut best: Option<(f64, usize)> = None;
        for (k, column) in self.columns.iter().enumerate() {
            if kept.contains(&k) {
                continue;
            }
            let whole = dot(column, column);
            let free = whole - basis.iter().map(|q| dot(q, column)).map(|along| along * along).sum::<f64>();
            if free <= 1e-9 * whole {
                continue;
            }
            let along = dot(column, &residual);
            let gain = along * along / free;
            if best.is_none_or(|(highest, _)| gain > highest) {
                best = Some((gain, k));
            }
        }
        best.map(|(_, k)| k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::{AxisTransform, LineBasis};

    fn setup() -> (Dictionary, Vec<f64>) {
        let basis = LineBasis::BIOR44;
        let dictionary = Dictionary::new(basis.name(), 80, AxisTransform::line(basis)).unwrap();
        let samples = (0..80).map(|i| 0.2 + (f64::from(i) * 0.11).sin().powi(2) + 0.01 * f64::from(i % 7)).collect();
        (dictionary, samples)
    }

    fn er(samples: &[f64], found: &Approximation) -> f64 {
        RelativeErrors::between(samples, &found.samples).l2
    }

    #[test]
    fn each_refinement_lowers_the_error() {
        let (dictionary, samples) = setup();
        for count in [3, 4, 8, 16] {
            let plain = largest(&dictionary, &samples, count, true);
            let fitted = refitted(&dictionary, &samples, &plain.kept, &[]).unwrap();
            let picked = greedy(&dictionary, &samples, count, &[]).unwrap();
            let exchanged = exchange(&dictionary, &samples, picked.clone(), 4, &[]);
            let errors = [plain, fitted, picked, exchanged].map(|a| er(&samples, &a));
            assert!(errors[1] <= errors[0] && errors[3] <= errors[2], "{count}: {errors:?}");
            assert!(errors[2] <= errors[1] * 1.05, "{count}: {errors:?}");
        }
        let all = largest(&dictionary, &samples, 80, false);
        assert!(er(&samples, &all) < 1e-5);
    }

    #[test]
    fn constraints_hold_exactly() {
        let (dictionary, samples) = setup();
        let constraints: Vec<Constraint> = (0..3)
            .map(|j| Constraint {
                weights: (0..80).map(|i| (-0.01 * (f64::from(i) - 20.0 * f64::from(j + 1)).powi(2)).exp()).collect(),
            })
            .collect();
        for count in [3, 7, 11] {
            let found = greedy(&dictionary, &samples, count, &constraints).unwrap();
            assert_eq!(found.kept.len(), count);
            for constraint in &constraints {
                let (wanted, got) = (dot(&constraint.weights, &samples), dot(&constraint.weights, &found.samples));
                assert!((got - wanted).abs() < 1e-9 * wanted, "{count}");
            }
        }
        assert_eq!(refitted(&dictionary, &samples, &[0, 1], &constraints), None);
    }

    #[test]
    fn samples_without_relative_error_do_not_count() {
        let errors = RelativeErrors::between(&[0.0, -1.0, 2.0, 4.0], &[9.0, 9.0, 2.2, 4.0]);
        assert!((errors.l1 - 0.05).abs() < 1e-12 && (errors.l2 - (0.005_f64).sqrt()).abs() < 1e-12);
        assert_eq!(RelativeErrors::between(&[0.0], &[1.0]), RelativeErrors::default());
    }
}
