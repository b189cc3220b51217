//! Whether samples lie high about a centre: most scans end here.
//!
//! Under each incidence a smooth base is fitted to a ring of samples about the centre and continued to it. Where too few
//! samples within the ring lie above that base, there is no lobe that cells could not hold.

use super::near::{Near, TERMS};
use super::scan::Scan;
use super::shape::NUMBERS;
use super::solve::{Problem, predicted};
use crate::domain::LobeCentre;

/// Radii of the ring in distances between samples.
pub(super) const INNER: f64 = 2.0;
pub(super) const OUTER: f64 = 6.0;
/// Standard deviations, and difference of logarithms, by which a sample must lie above the base.
const HIGH: f64 = 4.5;
const LEAST: f64 = 0.05;
/// Samples that must lie high.
pub(super) const FEWEST: usize = 3;
/// Least noise: smaller than any instrument has, and than a base is smooth.
const LEAST_NOISE: f64 = 1e-3;
/// Ratio of the standard deviation of normal deviates to the median of their magnitudes.
const OF_MEDIAN: f64 = 1.4826;

/// A centre about which samples lie high.
pub(super) struct Candidate {
    pub(super) near: Near,
    /// The usual distance between samples there.
    pub(super) spacing: f64,
    /// Standard deviation of logarithms about the base of the ring.
    pub(super) noise: f64,
    /// The base of the ring.
    pub(super) bases: Vec<[f64; TERMS]>,
}

/// The samples about `centre`, if enough lie high there or are among `raised`, which are rows in increasing order.
pub(super) fn candidate(scan: &Scan<'_>, centre: LobeCentre, raised: &[u32]) -> Option<Candidate> {
    let usual = scan.plan.spacing;
    let spacing = Near::new(scan, centre, 4.0 * usual).spacing(scan.plan.unfolded)?.clamp(0.1 * usual, 3.0 * usual);
    let near = Near::new(scan, centre, (OUTER * spacing).min(1.4));
    let problem = Problem {
        near: &near,
        noise: usual_noise(scan),
        free: [false; NUMBERS],
        without: None,
        beyond: INNER * spacing,
        widths: [0.0; 2],
    };
    let first = problem.base();
    let noise = noise_of(&near, &first.bases, problem.beyond);
    let fit = Problem { noise, ..problem }.fit(first, 10);
    let noise = noise_of(&near, &fit.bases, problem.beyond);
    let (mut high, mut known) = (0, 0);
    for (group, base) in near.groups.iter().zip(&fit.bases) {
        let ring = group.iter().filter(|sample| sample.distance >= problem.beyond).count() as f64;
        let limit = (HIGH * noise * (1.0 + 2.0 * TERMS as f64 / ring.max(1.0)).sqrt()).max(LEAST);
        for sample in group.iter().filter(|sample| sample.distance < problem.beyond) {
            high += usize::from(sample.log - predicted(sample, base, None).log > limit.max(HIGH * sample.stated));
            known += usize::from(raised.binary_search(&sample.row).is_ok());
        }
    }
    (high.max(known) >= FEWEST).then(|| Candidate { spacing, noise, bases: fit.bases, near })
}

/// Noise to begin with.
fn usual_noise(_scan: &Scan<'_>) -> f64 {
    0.02
}

/// Standard deviation of the logarithms of samples beyond a distance about their base, by their median.
fn noise_of(near: &Near, bases: &[[f64; TERMS]], beyond: f64) -> f64 {
    let (mut residuals, mut used) = (Vec::new(), 0);
    for (group, base) in near.groups.iter().zip(bases) {
        used += TERMS - 1;
        let ring = group.iter().filter(|sample| sample.distance >= beyond);
        residuals.extend(ring.map(|sample| (sample.log - predicted(sample, base, None).log).abs()));
    }
    deviation(residuals, used)
}

/// Standard deviation of residuals by the median of their magnitudes, after a fit of so many terms.
pub(super) fn deviation(mut magnitudes: Vec<f64>, used: usize) -> f64 {
    if magnitudes.is_empty() {
        return LEAST_NOISE;
    }
    let count = magnitudes.len();
    let (_, median, _) = magnitudes.select_nth_unstable_by(count / 2, f64::total_cmp);
    let left = count.saturating_sub(used).max(1 + count / 4);
    (OF_MEDIAN * *median * (count as f64 / left as f64).sqrt()).max(LEAST_NOISE)
}
