//! Range of the light of a lobe that agrees with the samples, from fits with widths other than the best.

use super::choose::Found;
use super::shape::{NUMBERS, Shape, WIDTH};
use super::solve::{Fit, Problem};
use crate::domain::{Direction, Lobe};

/// Rise of the robust cost over that of the best fit up to which a lobe still agrees with the samples: two standard
/// deviations. Raising it widens the range of possible albedos.
const RISE: f64 = 4.0;
/// First step of the natural logarithm of a lobe's width in the search for all widths that agree with the samples. It
/// doubles after each width that agrees. Raising it is faster and coarser.
const STEP: f64 = 2e-3;
/// Upper bound on the lobe widths tried on either side of the best one, to find all albedos that agree with the
/// samples; tries after halved steps are not counted. Raising it takes longer.
const STEPS: usize = 12;
/// Upper bound on how often the step to the next lobe width is halved once a width no longer agrees with the samples.
/// Raising it finds the limit of the widths more exactly and takes longer.
const HALVINGS: usize = 3;
/// Upper bound on the iterations of each lobe fit at a given width, in the search for all albedos of the lobe that
/// agree with the samples. Raising it takes longer.
const ROUNDS: usize = 12;
/// Number of standard deviations by which the range of a lobe's possible albedos is widened. They are those of the
/// albedo fitted at a fixed width of the lobe. Raising the number widens the range.
const DEVIATIONS: f64 = 2.0;
/// Least relative standard deviation assumed for the albedo of a lobe: no real lobe has exactly the fitted form.
const LEAST: f64 = 0.01;
/// Approximate number of incoming directions at which the albedo of each tried lobe is computed.
const FEW: usize = 3;
/// Step of the numerical derivatives of a lobe's albedo by the fitted parameters.
const SMALL: f64 = 1e-3;

/// Returns the mean albedo of a lobe over incoming polar angles in degrees, for a colour factor of 1.
pub(super) fn light(lobe: &Lobe, incidences: &[f64]) -> f64 {
    let under = |theta: &f64| lobe.under(Direction::from_degrees(*theta, 0.0)).map_or(0.0, |under| under.light());
    incidences.iter().map(under).sum::<f64>() / incidences.len().max(1) as f64
}

/// Returns the smallest and the largest albedo of lobes that agree with the samples. `whole` is the albedo of the best
/// lobe.
pub(super) fn range(found: &Found, incidences: &[f64], whole: f64) -> [f64; 2] {
    // A few of the incidences show how the light changes.
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
            // Keeps the light about constant.
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

/// Returns the standard deviation of the natural logarithm of a lobe's albedo, fitted at a fixed width of the lobe.
fn deviation(problem: &Problem<'_>, best: &Fit, own: f64, of: &impl Fn(Shape) -> Option<f64>) -> f64 {
    let Some(shape) = best.shape else { return f64::INFINITY };
    let slope = |i: usize| {
        // Tails are bounded by 1/2.
        let small = if shape.numbers[i] + SMALL > 0.5 && i == super::shape::TAIL { -SMALL } else { SMALL };
        let mut numbers = shape.numbers;
        numbers[i] += small;
        let moved = if problem.free[i] { of(Shape { numbers, ..shape }) } else { Some(own) };
        moved.map_or(0.0, |light| libm::log(light / own) / small)
    };
    let slopes: [f64; NUMBERS] = std::array::from_fn(slope);
    problem.deviation(best, slopes)
}
