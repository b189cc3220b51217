//! Errors at the original samples, by region: of the fit, of withheld samples, and of the cells.

use super::cells::{Fitted, Scratch};
use super::cloud::Cloud;
use super::trials::{Trial, predict};
use rayon::prelude::*;
use serde::Serialize;

/// Samples are compared in pieces of this length.
const PIECE: usize = 256;
/// A sample of at least this part of what the brightest are under its incoming direction belongs to the peak.
const PEAK: f64 = 0.5;
/// One in so many samples may be brighter than what counts as the brightest: outliers are.
const BRIGHTER: usize = 200;
/// The height below which an outgoing direction grazes: that of 70°.
const GRAZING: f64 = 0.342_020_143_325_668_7;

/// What is known of a fit to scattered samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ScatterReport {
    /// Samples (directions, or pairs of them).
    pub samples: u64,
    /// Values of them that are missing.
    pub missing: u64,
    /// Values that are negative; they are kept.
    pub negative: u64,
    /// Nearest samples that each value is fitted to.
    pub neighbours: usize,
    /// Every tenth sample predicted from the other nine, or as many of them as are compared.
    pub left_out: Regions,
    /// The fit itself at original samples, as many as are compared.
    pub fit: Regions,
    /// The cells' averages, taken as constant over each cell, at all original samples.
    pub constant: Regions,
    /// The share of the withheld samples whose light lies more than a third, and ten times the usual, from the prediction.
    pub outliers: f64,
    /// What quadratics through cells of the outgoing level cannot say, about; `None` where it was not tried.
    pub representation: Option<f64>,
}

/// Relative errors by region of the outgoing direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Regions {
    /// Everywhere.
    pub all: Scores,
    /// At least half as bright as the brightest (99.5 % of samples are darker) under the same incoming direction.
    pub peak: Scores,
    /// The rest.
    pub middle: Scores,
    /// Less bright, more than 70° from the normal.
    pub grazing: Scores,
}

/// Relative errors of positive values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Values that were compared.
    pub values: u64,
    /// Mean of |s' − s| / s.
    pub er_l1: f64,
    /// Root mean square of (s' − s) / s.
    pub er_l2: f64,
}

/// A region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Region {
    Peak,
    Middle,
    Grazing,
}

/// Scores in the making: count, sum, sum of squares in the order of [`Region`].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally([(u64, f64, f64); 3]);

impl Tally {
    pub(super) fn add(&mut self, region: Region, found: f32, expected: f32) {
        let error = (f64::from(found) - f64::from(expected)).abs() / f64::from(expected);
        if expected > 0.0 && !error.is_nan() {
            let sums = &mut self.0[region as usize];
            *sums = (sums.0 + 1, sums.1 + error, sums.2 + error * error);
        }
    }

    pub(super) fn join(&mut self, other: &Self) {
        for (sums, more) in self.0.iter_mut().zip(&other.0) {
            *sums = (sums.0 + more.0, sums.1 + more.1, sums.2 + more.2);
        }
    }

    pub(super) fn finish(&self) -> Regions {
        let scores = |sums: &[(u64, f64, f64)]| {
            let (count, sum, squares) = sums.iter().fold((0, 0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1, a.2 + b.2));
            let n = (count as f64).max(1.0);
            Scores { values: count, er_l1: sum / n, er_l2: (squares / n).sqrt() }
        };
        let [peak, middle, grazing] = &self.0;
        Regions {
            all: scores(&self.0),
            peak: scores(&[*peak]),
            middle: scores(&[*middle]),
            grazing: scores(&[*grazing]),
        }
    }
}

/// The brightest light of samples, but for a few.
pub(super) fn brightest(mut lights: Vec<f64>) -> f64 {
    lights.retain(|light| !light.is_nan());
    if lights.is_empty() {
        return f64::INFINITY;
    }
    let place = lights.len() - 1 - lights.len() / BRIGHTER;
    *lights.select_nth_unstable_by(place, f64::total_cmp).1
}

/// The region of a sample of so much light, at this height, where the brightest have `brightest`.
pub(super) fn region(light: f64, brightest: f64, height: f64) -> Region {
    if light >= PEAK * brightest {
        Region::Peak
    } else if height.abs() < GRAZING {
        Region::Grazing
    } else {
        Region::Middle
    }
}

/// Errors of predictions at `trials`; with them withheld, or not. Beside them the share of outliers.
pub(super) fn compare(
    clouds: &[Cloud],
    like: Fitted<'_>,
    trials: &[Trial],
    regions: &[Region],
    withheld: bool,
) -> (Regions, f64) {
    let pieces: Vec<(Tally, Vec<f64>)> = trials
        .par_chunks(PIECE)
        .map_init(Scratch::default, |scratch, trials| {
            let (mut tally, mut lights) = (Tally::default(), Vec::new());
            for trial in trials {
                let cloud = &clouds[trial.cloud];
                let (row, wi, wo) = trial.of(cloud);
                let there = predict(&Fitted { cloud, ..like }, wi, wo, withheld, scratch);
                if there.is_none() {
                    continue;
                }
                let (mut light, mut whole) = (0.0, 0.0);
                for (&found, &expected) in scratch.row.iter().zip(like.rows.row(row)) {
                    tally.add(regions[row as usize], found, expected);
                    if !found.is_nan() && !expected.is_nan() {
                        light += f64::from(found - expected);
                        whole += f64::from(found.abs());
                    }
                }
                lights.push(if whole > 0.0 { (light / whole).abs() } else { 0.0 });
            }
            (tally, lights)
        })
        .collect();
    let (mut tally, mut lights) = (Tally::default(), Vec::new());
    for (part, more) in pieces {
        tally.join(&part);
        lights.extend(more);
    }
    (tally.finish(), outliers(lights))
}

fn outliers(mut lights: Vec<f64>) -> f64 {
    if lights.is_empty() {
        return 0.0;
    }
    let middle = lights.len() / 2;
    let usual = *lights.select_nth_unstable_by(middle, f64::total_cmp).1;
    let limit = (10.0 * usual).max(1.0 / 3.0);
    lights.iter().filter(|light| **light > limit).count() as f64 / lights.len() as f64
}
