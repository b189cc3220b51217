//! Change of a function's shape from one incoming direction to its neighbours, which decides the alignment.

use crate::domain::vector::Vector;
use rayon::prelude::*;

/// Offset added to the standard deviation of ln(f₁ / f₂) before its geometric mean over pairs of incoming directions;
/// f₁ and f₂ are the function's values under a pair. It makes smaller deviations count as equal.
const NO_CHANGE: f64 = 0.02;
/// Approximate maximum number of pairs of neighbouring incoming directions over which the standard deviation of ln(f₁ /
/// f₂) is averaged; f₁ and f₂ are the function's values under a pair. A higher maximum makes the average more reliable
/// and takes longer.
const MOST_PAIRS: usize = 256;

/// Change of the function's shape between neighbouring incoming directions; 0 if values differ by a constant factor.
/// For a pair it is the standard deviation, over corresponding outgoing directions, of the logarithm of the ratio of
/// the two values, weighted by the first value squared. The result is the geometric mean over pairs.
///
/// `light(entry, node, wo)` is the function and `measure(wo)` the weight of a direction. `carried(node, other, wo)`
/// returns the direction under `other` that corresponds to `wo` under `node`, and its weight.
pub(super) fn change_of_shape(
    (pairs, entries): (&[(usize, usize)], usize),
    directions: &[Vector],
    light: impl Fn(usize, usize, Vector) -> f64 + Sync,
    measure: impl Fn(Vector) -> f64 + Sync,
    carried: impl Fn(usize, usize, Vector) -> (Vector, f32) + Sync,
) -> f64 {
    let few = pairs.len().div_ceil(MOST_PAIRS).max(1);
    let sums: Vec<(f64, f64)> = pairs
        .par_iter()
        .step_by(few)
        .flat_map_iter(|&(node, other)| (0..entries).map(move |entry| (entry, node, other)))
        .map(|(entry, node, other)| {
            let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
            for &d in directions {
                let (there, worth) = carried(node, other, d);
                let here = light(entry, node, d);
                let there = light(entry, other, there);
                if here > 0.0 && there > 0.0 && worth > 0.5 {
                    // Weighted by the square of the light, so that lobes decide rather than their surroundings.
                    let weight = here * here * measure(d);
                    let ratio = libm::log(here / there);
                    sum += weight;
                    first += weight * ratio;
                    second += weight * ratio * ratio;
                }
            }
            let deviation = (second / sum - (first / sum).powi(2)).max(0.0).sqrt();
            if sum > 0.0 { (libm::log(deviation + NO_CHANGE), 1.0) } else { (0.0, 0.0) }
        })
        .collect();
    // The geometric mean keeps pairs at grazing incidence, where the height of lobes changes most, from dominating.
    let (logarithms, count) = sums.iter().fold((0.0, 0.0), |sum: (f64, f64), s| (sum.0 + s.0, sum.1 + s.1));
    if count > 0.0 { libm::exp(logarithms / count) - NO_CHANGE } else { 0.0 }
}
