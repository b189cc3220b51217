//! Predictions of withheld samples, which determine the number of neighbours and whether the data are symmetric.

use super::cells::{Fitted, Scratch};
use super::cloud::Cloud;
use super::fit::{Place, Support};
use super::rows::PARTS;
use super::withheld::{Trial, trials};
use crate::domain::vector::Vector;
use crate::domain::{Domain, TriangleMesh};
use rayon::prelude::*;

/// Competing numbers of neighbours.
const NEIGHBOURS: [usize; 6] = [12, 18, 28, 42, 64, 96];
/// Number of neighbours that estimates how noise is shared between bands.
const FEW: usize = 27;
/// Largest ratio of errors at which more neighbours count as better: they take more time.
const BETTER: f64 = 0.98;
/// Relative error that is only rounding of values. More neighbours would average it down and win for no reason.
const ROUNDING: f64 = f32::EPSILON as f64;
/// Approximate number of samples that determine the choice.
const JUDGES: usize = 400;
/// Fraction of the largest value below which values count as 0 in the choice.
const FAINT: f64 = 1e-3;
/// Factor, and absolute margin, by which a mirror image may predict worse than the own side and still count as
/// symmetric.
const AS_WELL: f64 = 1.1;
const NEARLY: f64 = 1e-3;
/// Level of the triangles at whose centroids the surroundings are tested, and the fraction of the best share of
/// surrounded places that suffices.
const AROUND_LEVEL: u8 = 2;
const MOST: f64 = 0.9;
/// Ratio of errors at which larger numbers of neighbours are no longer tried.
const WORSE: f64 = 1.5;
/// One of this many squared errors, the largest, is ignored.
const TRIMMED: usize = 20;

/// Predicts the value in a direction; `withheld` leaves out the withheld samples. Returns `None` if it is far from
/// any.
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

/// Returns pairs of predicted and measured values of the trials, in every band.
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

/// Returns the root mean square of relative errors, in which faint values count less. Uses only trials that `beside`
/// also predicts.
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
/// the noise is common to a row, or if there is one band.
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

/// Returns the number of neighbours that predicts withheld samples best.
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

/// Returns the fraction of places with neighbours on all sides.
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

/// Returns true if the mirror image in the plane of incidence predicts withheld samples as well as their own side
/// does.
pub(super) fn is_symmetric(clouds: &[Cloud], like: Fitted<'_>) -> bool {
    let trials = trials(clouds, JUDGES);
    let own = predictions(clouds, like, &trials, |wo| wo);
    let mirrored = predictions(clouds, like, &trials, |[x, y, z]| [x, -y, z]);
    let both = own.iter().zip(&mirrored).filter(|(a, b)| !a.is_empty() && !b.is_empty()).count();
    2 * both > trials.len() && score(&mirrored, &own) <= AS_WELL * score(&own, &mirrored) + NEARLY
}
