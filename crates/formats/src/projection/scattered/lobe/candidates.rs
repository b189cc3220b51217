//! Search for samples that lie high about a centre: most scans end here.
//!
//! Each sample near the centre is predicted from its neighbours, as cells are. If too few samples clearly exceed the
//! prediction, cells can represent any lobe.

use super::beside::{points, predicted as made};
use super::near::{Near, TERMS};
use super::scan::Scan;
use super::shape::NUMBERS;
use super::solve::{Problem, predicted};
use crate::domain::LobeCentre;
use crate::domain::vector::norm;
use crate::projection::scattered::incidences::Incidence;
use crate::projection::scattered::noise::OF_MEDIAN;

/// Radius about a possible lobe centre within which samples brighter than their neighbours are sought, in sample
/// spacings.
const INNER: f64 = 2.0;
/// Radius about a possible lobe centre, in sample spacings, of the samples to which background and lobe are first
/// fitted.
const OUTER: f64 = 6.0;
/// Approximate number of samples, taken from the whole scan, whose deviations from their neighbours give an estimate of
/// the noise.
const JUDGES: usize = 300;
/// Number of standard deviations by which a sample must exceed the prediction from its neighbours to indicate a lobe.
/// Raising it finds fewer lobes.
const HIGH: f64 = 4.0;
/// Difference of natural logarithms by which a sample must exceed the prediction from its neighbours to indicate a
/// lobe. Raising it finds fewer lobes.
const LEAST: f64 = 0.05;
/// Least number of samples brighter than predicted from their neighbours that indicates a lobe. It is small, because
/// bright neighbours raise the prediction: of three samples in a lobe, one may stay below its prediction.
const FEWEST: usize = 2;
/// Least relative noise assumed for samples: below the noise of any instrument, and below the unevenness of a
/// background.
const LEAST_NOISE: f64 = 1e-3;
/// Upper bound on the iterations that refine a rough fit of the background beneath a possible narrow lobe. The
/// background is the measured function without the lobe.
const ROUNDS: usize = 10;
/// Least noise, relative to the values of the samples, that a rough fit of the background about a possible lobe centre
/// assumes. The fit is then refined at the measured noise.
const FIRST_NOISE: f64 = 0.02;

/// A possible lobe centre, such as the mirror direction, about which samples are brighter than their neighbours.
pub(super) struct Candidate {
    pub(super) near: Near,
    /// Usual spacing of the samples about the possible lobe centre, in radians.
    pub(super) spacing: f64,
    /// Standard deviation of the logarithms of the samples about their predictions from neighbours.
    pub(super) noise: f64,
    /// Coefficients of the background beneath the possible lobe, under each incoming direction. They are fitted to the
    /// samples in a ring about the lobe centre.
    pub(super) bases: Vec<[f64; TERMS]>,
}

/// Returns the samples about the possible lobe centre `centre` if enough of them are brighter than their neighbours
/// predict; otherwise `None`.
pub(super) fn candidate(scan: &Scan<'_>, centre: LobeCentre) -> Option<Candidate> {
    let usual = scan.plan.spacing;
    let spacing = Near::new(scan, centre, 4.0 * usual).spacing(scan.plan.unfolded)?.clamp(0.1 * usual, 3.0 * usual);
    let near = Near::new(scan, centre, (OUTER * spacing).min(1.4));
    let noise = noise_if_high(scan, &near, spacing)?;
    let beyond = INNER * spacing;
    let (free, widths) = ([false; NUMBERS], [0.0; 2]);
    let problem = Problem { near: &near, noise: FIRST_NOISE.max(noise), free, without: None, beyond, widths };
    let bases = Problem { noise, ..problem }.fit(problem.base(), ROUNDS).bases;
    Some(Candidate { near, spacing, noise, bases })
}

/// Returns the relative noise of the samples: their usual deviation from the values that their neighbours predict.
/// Returns `None` if too few samples about a likely centre of a lobe, such as the mirror direction, exceed their
/// prediction by many times the noise.
fn noise_if_high(scan: &Scan<'_>, near: &Near, spacing: f64) -> Option<f64> {
    // Excludes incidences whose mirror direction is as near as the direction back: they show the lobe about the
    // former.
    let is_apart = |row: u32| {
        let [x, y, _] = scan.plan.directions[row as usize].0;
        near.centre != LobeCentre::Source || 2.0 * norm([x, y, 0.0]) > near.radius
    };
    let few = scan.plan.few(scan.rows);
    let above = |rows: &[u32]| -> Vec<f64> {
        let points: Vec<_> = points(scan.plan, rows).into_iter().map(|point| point.0).collect();
        let logs = made(scan.plan, few, &points).into_iter().flatten().map(|[found, own]| libm::log(own / found));
        logs.filter(|log| log.is_finite()).collect()
    };
    let inner = near.all().filter(|sample| sample.distance < INNER * spacing);
    let mut inner: Vec<u32> = inner.map(|sample| sample.row).filter(|&row| is_apart(row)).collect();
    inner.sort_unstable();
    // A selection of all rows, at irregular distances.
    let count: usize = scan.incidences.iter().map(|incidence| incidence.rows().len()).sum();
    let step = (count / JUDGES).max(1) | 1;
    let mut judges: Vec<u32> = scan.incidences.iter().flat_map(Incidence::rows).copied().step_by(step).collect();
    judges.sort_unstable();
    let noise = deviation(above(&judges).into_iter().map(f64::abs).collect(), 0);
    let limit = (HIGH * noise).max(LEAST);
    let high = above(&inner).into_iter().filter(|above| *above > limit).count();
    (high >= FEWEST).then_some(noise)
}

/// Returns the robust standard deviation of residuals, computed from the median of their `magnitudes`. `used` is the
/// number of fitted terms.
pub(super) fn deviation(mut magnitudes: Vec<f64>, used: usize) -> f64 {
    if magnitudes.is_empty() {
        return LEAST_NOISE;
    }
    let count = magnitudes.len();
    let (_, median, _) = magnitudes.select_nth_unstable_by(count / 2, f64::total_cmp);
    let left = count.saturating_sub(used).max(1 + count / 4);
    (OF_MEDIAN * *median * (count as f64 / left as f64).sqrt()).max(LEAST_NOISE)
}

/// Returns the robust standard deviation of the logarithms of all samples about the fit: the background and, if `shape`
/// is given, the lobe.
pub(super) fn noise_of(near: &Near, bases: &[[f64; TERMS]], shape: Option<super::shape::Shape>) -> f64 {
    let prepared = shape.map(|shape| shape.prepared());
    let mut residuals = Vec::new();
    for (group, base) in near.groups.iter().zip(bases) {
        let off = group.iter().map(|sample| (sample.log - predicted(sample, base, prepared.as_ref()).log).abs());
        residuals.extend(off);
    }
    deviation(residuals, (TERMS - 1) * near.groups.len())
}
