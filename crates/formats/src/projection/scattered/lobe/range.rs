//! Light that a lobe may have, by the samples: fits whose width is held where the best one's is not.

use super::choose::Found;
use super::shape::{NUMBERS, Shape, WIDTH};
use super::solve::{Fit, Problem};
use crate::domain::{Direction, Lobe};

/// How much the robust cost may rise: two standard deviations.
const RISE: f64 = 4.0;
/// The first step of the logarithm of the width; each is twice the one before.
const STEP: f64 = 2e-3;
const STEPS: usize = 12;
/// Halvings of the last step.
const HALVINGS: usize = 3;
/// Rounds of each fit.
const ROUNDS: usize = 12;
/// Standard deviations of the light of lobes of one width, and their least: that of a lobe which is not quite of the
/// form that is fitted.
const DEVIATIONS: f64 = 2.0;
const LEAST: f64 = 0.01;
/// Incidences at which the light of each lobe is found, about.
const FEW: usize = 3;
/// Change of a number that the change of the light is measured by.
const SMALL: f64 = 1e-3;

/// The mean of the albedo of a lobe over incidences, for a colour of 1.
pub(super) fn light(lobe: &Lobe, incidences: &[f64]) -> f64 {
    let under = |theta: &f64| lobe.under(Direction::from_degrees(*theta, 0.0)).map_or(0.0, |under| under.light());
    incidences.iter().map(under).sum::<f64>() / incidences.len().max(1) as f64
}

/// The least and the largest light of lobes with which the samples agree; that of the one found is `whole`.
pub(super) fn range(found: &Found, incidences: &[f64], whole: f64) -> [f64; 2] {
    // A few of the incidences tell how the light changes.
    let few: Vec<f64> = incidences.iter().copied().step_by(incidences.len().div_ceil(FEW).max(1)).collect();
    let of = |shape: Shape| {
        let parameters = shape.parameters(found.near.mean_t, found.near.range());
        let light = light(&Lobe::new(parameters).ok()?, &few);
        (light.is_finite() && light > 0.0).then_some(light)
    };
    let mut free = found.free;
    free[WIDTH] = false;
    let problem = Problem { free, ..found.problem() };
    let best = found.fit();
    let Some(own) = of(found.shape) else { return [0.0, 1.0] };
    let mut ends = [own; 2];
    for side in [-1.0, 1.0] {
        let (mut inside, mut step, mut halvings) = (best.clone(), STEP, 0);
        for _ in 0..STEPS + HALVINGS {
            let Some(mut shape) = inside.shape else { break };
            shape.numbers[WIDTH] += side * step;
            if !(problem.widths[0]..=problem.widths[1]).contains(&shape.numbers[WIDTH]) {
                break;
            }
            // The light stays, about.
            shape.numbers[0] -= 2.0 * side * step;
            let next = problem.fit(Fit { shape: Some(shape), ..inside.clone() }, ROUNDS);
            if next.cost > best.cost + RISE {
                halvings += 1;
                if halvings > HALVINGS {
                    break;
                }
                step *= 0.5;
                continue;
            }
            if let Some(light) = next.shape.and_then(&of) {
                ends = [ends[0].min(light), ends[1].max(light)];
            }
            inside = next;
            step *= if halvings == 0 { 2.0 } else { 0.5 };
        }
    }
    let deviation = deviation(&problem, &best, own, &of).max(LEAST);
    let factor = libm::exp(DEVIATIONS * deviation.min(2.0));
    let of_all = whole / own;
    [of_all * ends[0] / factor, (of_all * ends[1] * factor).min(1.0)]
}

/// Standard deviation of the logarithm of the light of lobes of one width.
fn deviation(problem: &Problem<'_>, best: &Fit, own: f64, of: &impl Fn(Shape) -> Option<f64>) -> f64 {
    let Some(shape) = best.shape else { return f64::INFINITY };
    let slope = |i: usize| {
        // Tails are held below 1/2.
        let small = if shape.numbers[i] + SMALL > 0.5 && i == super::shape::TAIL { -SMALL } else { SMALL };
        let mut numbers = shape.numbers;
        numbers[i] += small;
        let moved = if problem.free[i] { of(Shape { numbers, ..shape }) } else { Some(own) };
        moved.map_or(0.0, |light| libm::log(light / own) / small)
    };
    let slopes: [f64; NUMBERS] = std::array::from_fn(slope);
    problem.deviation(best, slopes)
}
