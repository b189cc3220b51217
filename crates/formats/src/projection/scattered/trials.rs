//! Predictions of withheld samples, which determine the number of neighbours and whether the data are symmetric.

use super::cells::{Fitted, Scratch};
use super::cloud::Cloud;
use super::fit::{Place, Support};
use super::rows::PARTS;
use super::withheld::{Trial, trials};
use crate::domain::vector::Vector;
use crate::domain::{Domain, TriangleMesh};
use rayon::prelude::*;

/// Numbers of neighbours of a local fit that compete in predicting withheld samples.
const NEIGHBOURS: [usize; 6] = [12, 18, 28, 42, 64, 96];
/// Number of nearest samples from which each withheld sample is predicted to estimate how noise correlates between
/// spectral bands.
const FEW: usize = 27;
/// Largest ratio of prediction errors at which a larger number of neighbours counts as better, since it takes more
/// time. Raising it chooses more neighbours.
const BETTER: f64 = 0.98;
/// Relative prediction error of withheld samples below which only rounding of values is left. Numbers of neighbours
/// with a smaller error count as equally good, and the largest of them is chosen.
const ROUNDING: f64 = f32::EPSILON as f64;
/// Approximate number of withheld samples that are predicted to choose settings of the local fits, such as the number
/// of neighbours. Raising it is slower.
const JUDGES: usize = 400;
/// Fraction of the largest value that is added to each value in relative prediction errors, so that faint values count
/// less.
const FAINT: f64 = 1e-3;
/// Factor by which mirror images in the plane of incidence may predict samples worse than the samples of their own side
/// do for data to count as symmetric. Raising it accepts less symmetric data.
const AS_WELL: f64 = 1.1;
/// Relative error allowed in predicting samples from those on the other side of the plane of incidence, on top of a
/// multiple ([`AS_WELL`]) of the error from their own side. Data within it count as mirror-symmetric. Raising it
/// accepts less symmetric data.
const NEARLY: f64 = 1e-3;
/// Subdivision level of a triangle mesh of outgoing directions, at whose centroids it is tested whether the nearest
/// samples lie on all sides. Raising it tests more directions.
const AROUND_LEVEL: u8 = 2;
/// Least share of outgoing directions that have neighbouring samples on all sides, as a fraction of the share with 96
/// neighbours. Fewer neighbours are chosen for a local fit only if they reach it. Raising it chooses more neighbours.
const MOST: f64 = 0.9;
/// Ratio of the prediction error with some number of neighbours to the least error with fewer, above which still larger
/// numbers are not tried. Raising it tries more numbers.
const WORSE: f64 = 1.5;
/// Reciprocal of the fraction of the prediction errors of withheld samples that are ignored as possible outliers, the
/// largest first: 20 ignores 5 % of the errors. Raising it ignores fewer errors.
const TRIMMED: usize = 20;

/// Predicts the value in a pair of directions from nearby samples. `withheld` leaves out the samples withheld for
/// validation. Returns `None` if the pair is far from all samples.
pub(super) fn predict(
    fitted: &Fitted<'_>,
    wi: Vector,
    wo: Vector,
    withheld: bool,
    scratch: &mut Scratch,
) -> Option<Support> {
    let cloud = fitted.cloud;
    let taken = |item: u32| {
        let item = item as usize;
        !(withheld && cloud.is_withheld[item]) && (!fitted.sides_apart || cloud.wo[item][2] * wo[2] >= 0.0)
    };
    cloud.nearest(&cloud.key(wi, wo), fitted.neighbours, taken, &mut scratch.found);
    scratch.row.resize(fitted.rows.width, 0.0);
    let support = fitted.value(&Place { wi, wo, parts: [wo; PARTS] }, [1.0; PARTS], scratch)?;
    (support.nearest < support.reach).then_some(support)
}

/// Returns pairs of predicted and measured values of withheld samples, in every band. `image` returns the outgoing
/// direction at which a sample is predicted: its own, or its mirror image in the plane of incidence.
fn predictions(
    clouds: &[Cloud],
    like: Fitted<'_>,
    trials: &[Trial],
    image: impl Fn(Vector) -> Vector + Sync,
) -> Vec<Vec<(f64, f64)>> {
    let predicted = |scratch: &mut Scratch, trial: &Trial| {
        let cloud = &clouds[trial.cloud];
        let (row, wi, wo) = trial.of(cloud);
        let there = predict(&Fitted { cloud, ..like }, wi, image(wo), true, scratch);
        let pairs = scratch.row.iter().zip(like.rows.row(row)).map(|(&a, &b)| (f64::from(a), f64::from(b)));
        if there.is_some() { pairs.collect() } else { Vec::new() }
    };
    trials.par_iter().map_init(Scratch::default, predicted).collect()
}

/// Returns the root mean square of the relative errors of `predictions`, pairs of predicted and measured values,
/// without the largest errors. Values below about 1/1000 of the largest one count less.
///
/// Uses only samples that were predicted also in `beside`, the predictions with which these are compared.
fn score(predictions: &[Vec<(f64, f64)>], beside: &[Vec<(f64, f64)>]) -> f64 {
    let both = predictions.iter().zip(beside).filter(|(a, b)| !a.is_empty() && !b.is_empty());
    let pairs: Vec<&(f64, f64)> =
        both.flat_map(|(a, _)| a).filter(|(found, expected)| !found.is_nan() && !expected.is_nan()).collect();
    let brightest = pairs.iter().map(|(_, expected)| expected.abs()).fold(f64::MIN_POSITIVE, f64::max);
    let square = |found: f64, expected: f64| ((found - expected) / (expected.abs() + FAINT * brightest)).powi(2);
    let mut squares: Vec<f64> = pairs.iter().map(|(found, expected)| square(*found, *expected)).collect();
    if squares.is_empty() {
        return f64::INFINITY;
    }
    // Single outliers say nothing about the others.
    squares.sort_by(f64::total_cmp);
    let kept = squares.len() - squares.len() / TRIMMED;
    (squares[..kept].iter().sum::<f64>() / kept as f64).sqrt()
}

/// Returns the fraction of the variance of values about their prediction that is independent between bands. It is 0 if
/// the noise is common to all bands of a sample, or if there is one band.
pub(super) fn own_noise(clouds: &[Cloud], like: Fitted<'_>) -> f64 {
    if like.rows.width == 1 {
        return 0.0;
    }
    let found = predictions(clouds, Fitted { neighbours: FEW, ..like }, &trials(clouds, JUDGES), |wo| wo);
    let relative = |(found, expected): &(f64, f64)| (found / expected, 1.0);
    let each: Vec<Vec<(f64, f64)>> = found.iter().map(|row| row.iter().map(relative).collect()).collect();
    let mean = |row: &Vec<(f64, f64)>| vec![(row.iter().map(|pair| pair.0).sum::<f64>() / row.len() as f64, 1.0)];
    let light: Vec<Vec<(f64, f64)>> = each.iter().filter(|row| !row.is_empty()).map(mean).collect();
    let share = (score(&light, &light) / score(&each, &each)).powi(2);
    let bands = like.rows.width as f64;
    let own = (1.0 - share) / (1.0 - 1.0 / bands);
    if own.is_finite() { own.clamp(0.0, 1.0) } else { 0.0 }
}

/// Returns the number of neighbours of a local fit that predicts withheld samples best.
pub(super) fn neighbours(clouds: &[Cloud], like: Fitted<'_>, domain: Domain) -> usize {
    let trials = trials(clouds, JUDGES);
    let (mut best, mut least) = (NEIGHBOURS[0], f64::INFINITY);
    for neighbours in NEIGHBOURS {
        let found = predictions(clouds, Fitted { neighbours, ..like }, &trials, |wo| wo);
        let error = score(&found, &found).max(ROUNDING);
        if error < BETTER * least || error == ROUNDING {
            (best, least) = (neighbours, error);
        } else if error > WORSE * least {
            break;
        }
    }
    // Samples along lines predict each other, but nothing between the lines: neighbours must lie on all sides.
    let around = |neighbours: usize| surrounded(Fitted { neighbours, ..like }, domain);
    let most = around(NEIGHBOURS[NEIGHBOURS.len() - 1]);
    NEIGHBOURS.into_iter().find(|&n| n >= best && around(n) >= MOST * most).unwrap_or(best)
}

/// Returns the fraction of tried outgoing directions, under one incoming direction, that have neighbouring samples on
/// all sides.
fn surrounded(fitted: Fitted<'_>, domain: Domain) -> f64 {
    let Some(mesh) = TriangleMesh::new(domain, AROUND_LEVEL) else { return 0.0 };
    let first = fitted.cloud.rows.iter().zip(&fitted.cloud.wi).min_by_key(|(row, _)| **row);
    let wi = first.map_or([0.0, 0.0, 1.0], |(_, wi)| *wi);
    let is_surrounded = |scratch: &mut Scratch, cell: usize| {
        let wo = mesh.centroid(cell).xyz();
        predict(&fitted, wi, wo, false, scratch).is_some_and(|support| support.surrounded)
    };
    let found: Vec<bool> = (0..mesh.len()).into_par_iter().map_init(Scratch::default, is_surrounded).collect();
    found.iter().filter(|found| **found).count() as f64 / found.len() as f64
}

/// Returns true if mirror images in the plane of incidence predict withheld samples as well as the samples of their own
/// side do.
pub(super) fn is_symmetric(clouds: &[Cloud], like: Fitted<'_>) -> bool {
    let trials = trials(clouds, JUDGES);
    let own = predictions(clouds, like, &trials, |wo| wo);
    let mirrored = predictions(clouds, like, &trials, |[x, y, z]| [x, -y, z]);
    let both = own.iter().zip(&mirrored).filter(|(a, b)| !a.is_empty() && !b.is_empty()).count();
    2 * both > trials.len() && score(&mirrored, &own) <= AS_WELL * score(&own, &mirrored) + NEARLY
}
