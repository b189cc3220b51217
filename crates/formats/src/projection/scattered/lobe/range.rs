//! Light that a lobe may have, by the samples: fits whose width is held where the best one's is not.

use super::choose::Found;
use super::shape::WIDTH;
use super::solve::{Fit, Problem};
use crate::domain::{Direction, Lobe};

/// How much the robust cost may rise: two standard deviations.
const RISE: f64 = 4.0;
/// The first step of the logarithm of the width, and the factor to the next.
const STEP: f64 = 0.03;
const LONGER: f64 = 1.5;
const STEPS: usize = 16;
/// Rounds of each fit.
const ROUNDS: usize = 15;

/// The mean of the albedo of a lobe over incidences, for a colour of 1.
pub(super) fn light(lobe: &Lobe, incidences: &[f64]) -> f64 {
    let under = |theta: &f64| lobe.under(Direction::from_degrees(*theta, 0.0)).map_or(0.0, |under| under.light());
    incidences.iter().map(under).sum::<f64>() / incidences.len().max(1) as f64
}

/// The least and the largest light of lobes with which the samples agree.
pub(super) fn range(found: &Found, incidences: &[f64]) -> [f64; 2] {
    let of = |fit: &Fit| {
        let parameters = fit.shape?.parameters(found.near.mean_t, found.near.range());
        Some(light(&Lobe::new(parameters).ok()?, incidences)).filter(|light| light.is_finite())
    };
    let mut free = found.free;
    free[WIDTH] = false;
    let problem = Problem { free, ..found.problem() };
    let [low, high] = problem.widths;
    let best = found.fit();
    let mut range = of(&best).map_or([0.0; 2], |light| [light; 2]);
    for side in [-1.0, 1.0] {
        let (mut fit, mut step) = (best.clone(), STEP);
        for _ in 0..STEPS {
            let Some(mut shape) = fit.shape else { break };
            shape.numbers[WIDTH] += side * step;
            if !(low..=high).contains(&shape.numbers[WIDTH]) {
                break;
            }
            // The light stays, about.
            shape.numbers[0] -= 2.0 * side * step;
            fit = problem.fit(Fit { shape: Some(shape), ..fit }, ROUNDS);
            let Some(light) = of(&fit) else { break };
            let is_beyond = fit.cost > best.cost + RISE;
            // The first beyond counts, too, where it is not far: the end lies before it.
            if fit.cost < best.cost + 4.0 * RISE {
                range = [range[0].min(light), range[1].max(light)];
            }
            if is_beyond {
                break;
            }
            step *= LONGER;
        }
    }
    [range[0].max(0.0), range[1].min(1.0)]
}
