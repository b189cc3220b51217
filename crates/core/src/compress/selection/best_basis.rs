//! Search for the best basis of a spectrum: bases are tried in parallel, and ranked in an order that does not depend on
//! threads.

use super::k_term::{Approximation, RelativeErrors, exchange, greedy, largest, refitted};
use super::{Constraint, Dictionary};
use crate::transform::{AxisTransform, Boundary, LineBasis};
use rayon::prelude::*;

/// Method of choosing a given number of coefficients in a basis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The largest coefficients of the spectrum are chosen, and keep their values.
    Largest,
    /// The largest coefficients of the spectrum are chosen, and their values refitted for the least relative RMS error
    /// er(L2).
    Refitted,
    /// Coefficients of the spectrum are chosen one by one for the least relative RMS error er(L2), refitted, and
    /// exchanged while that lowers the error.
    Greedy,
}

/// Basis of a spectrum with its approximation by few terms and the error of this.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranked {
    /// Name of the basis in which the spectrum is approximated.
    pub basis: String,
    /// Approximation of the spectrum by the chosen number of functions of the basis `basis`.
    pub approximation: Approximation,
    /// Relative errors of the approximated spectrum against the original one.
    pub errors: RelativeErrors,
}

/// Number of bases, those of least error after greedy selection of functions, in which selected functions are then
/// exchanged for others to lower the error. Raising it costs time.
const EXCHANGED: usize = 24;
const ROUNDS: usize = 6;

/// Lists every wavelet basis with every boundary rule, on a line of `length` samples. A basis with its default rule is
/// named `bior4.4`, with another rule `bior4.4 periodic`.
pub fn line_dictionaries(length: usize) -> Vec<Dictionary> {
    let pairs: Vec<(LineBasis, Boundary)> =
        LineBasis::distinct().flat_map(|basis| Boundary::ALL.iter().map(move |&boundary| (basis, boundary))).collect();
    let dictionaries: Vec<Option<Dictionary>> = pairs
        .par_iter()
        .map(|&(basis, boundary)| {
            let own = boundary == basis.boundary();
            let name = if own { basis.name().to_owned() } else { format!("{basis} {boundary}") };
            Dictionary::new(name, length, AxisTransform::Line { basis, boundary }).ok()
        })
        .collect();
    dictionaries.into_iter().flatten().collect()
}

/// Approximates `samples` by `count` functions of each basis. Returns the approximations by relative RMS error er(L2),
/// least first, ties in the order given.
///
/// Constraints (weighted sums of the samples that must stay exact) apply unless `choice` keeps the coefficients'
/// values; bases that cannot meet them are left out.
pub fn best_basis(
    dictionaries: &[Dictionary],
    samples: &[f64],
    count: usize,
    choice: Choice,
    constraints: &[Constraint],
) -> Vec<Ranked> {
    let approximate = |dictionary: &Dictionary| match choice {
        // Plain selection has two common rankings; the better one is taken.
        Choice::Largest => Some(better(samples, [false, true].map(|r| largest(dictionary, samples, count, r)))),
        Choice::Refitted => {
            let both = [false, true].map(|relative| largest(dictionary, samples, count, relative));
            let fitted = both.into_iter().filter_map(|plain| refitted(dictionary, samples, &plain.kept, constraints));
            fitted.reduce(|a, b| better(samples, [a, b]))
        }
        Choice::Greedy => greedy(dictionary, samples, count, constraints),
    };
    let found: Vec<Option<Approximation>> = dictionaries.par_iter().map(approximate).collect();
    let mut ranked: Vec<(usize, Approximation, f64)> = found
        .into_iter()
        .enumerate()
        .filter_map(|(i, approximation)| approximation.map(|a| (i, a)))
        .map(|(i, a)| {
            let error = RelativeErrors::between(samples, &a.samples).l2;
            (i, a, error)
        })
        .collect();
    sort(&mut ranked);
    if choice == Choice::Greedy {
        let head = ranked.len().min(EXCHANGED);
        ranked[..head].par_iter_mut().for_each(|(i, approximation, error)| {
            *approximation = exchange(&dictionaries[*i], samples, approximation.clone(), ROUNDS, constraints);
            *error = RelativeErrors::between(samples, &approximation.samples).l2;
        });
        sort(&mut ranked);
    }
    ranked
        .into_iter()
        .map(|(i, approximation, _)| Ranked {
            basis: dictionaries[i].name().to_owned(),
            errors: RelativeErrors::between(samples, &approximation.samples),
            approximation,
        })
        .collect()
}

fn sort(ranked: &mut [(usize, Approximation, f64)]) {
    ranked.sort_by(|a, b| a.2.total_cmp(&b.2).then(a.0.cmp(&b.0)));
}

fn better(samples: &[f64], [a, b]: [Approximation; 2]) -> Approximation {
    let error = |x: &Approximation| RelativeErrors::between(samples, &x.samples).l2;
    if error(&b) < error(&a) { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ranking_is_ordered_and_the_same_on_any_number_of_threads() {
        let samples: Vec<f64> = (0..80).map(|i| 1.0 + (f64::from(i) * 0.2).cos().abs()).collect();
        let dictionaries = line_dictionaries(80);
        for choice in [Choice::Largest, Choice::Refitted, Choice::Greedy] {
            let ranked = best_basis(&dictionaries, &samples, 8, choice, &[]);
            assert_eq!(ranked.len(), dictionaries.len());
            assert!(ranked.is_sorted_by(|a, b| a.errors.l2 <= b.errors.l2));
            let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            assert_eq!(single.install(|| best_basis(&dictionaries, &samples, 8, choice, &[])), ranked);
        }
    }
}
