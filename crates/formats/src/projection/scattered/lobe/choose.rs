//! Choice of the lobe that the samples show: its centre, width and tail, or no lobe.

use super::candidates::{Candidate, deviation, noise_of};
use super::near::{FOLDS, Near, Sample, TERMS};
use super::scan::Scan;
use super::shape::{ANGLE, LEAST_TAIL, NUMBERS, STRETCH, Shape, TAIL, WIDTH, of_outgoing};
use super::solve::{Fit, Problem, predicted};
use crate::domain::LobeCentre;
use crate::domain::vector::norm;
use rayon::prelude::*;

/// Smallest initial value of a lobe's half-width with which fits start, in sample spacings.
const NARROWEST_START: f64 = 0.1;
/// Ratio of neighbouring initial values of a lobe's half-width with which fits start.
const WIDER: f64 = 1.6;
/// Number of initial values of a lobe's half-width with which fits start. Raising it also tries wider lobes and is
/// slower.
const WIDTHS: usize = 7;
/// Tail parameters of a lobe, from 0 (Gaussian) to 1/2 (GGX), from which fits start.
const TAILS: [f64; 3] = [LEAST_TAIL, 0.2, 0.5];
/// Numbers of iterations after which competing fits of a lobe are compared, each with the number of best fits that
/// continue.
const ROUNDS: [(usize, usize); 3] = [(1, 8), (5, 2), (30, 1)];
/// Ratio to the least misfit up to which a coordinate system for the lobe (angles or half-vector slopes from the mirror
/// direction) is tried further after the first lobe fit in each. Raising it makes more fits.
const WORSE: f64 = 1.5;
/// Misfit, in squared standard deviations, allowed beyond [`WORSE`] times the least one for a coordinate system of the
/// lobe (angles or half-vector slopes from the mirror direction) to be tried further. Raising it makes more fits.
const MUCH_WORSE: f64 = 100.0;
/// Lower bound on the half-width of a fitted lobe, in sample spacings.
const NARROWEST: f64 = 0.04;
/// Upper bound on the half-width of a fitted lobe, in sample spacings.
const WIDEST: f64 = 4.0;
/// Distance from the centre of a lobe, in half-widths of the lobe, up to which samples take part in its fit.
const REACH: f64 = 8.0;
/// Upper bound on the distance from the centre of a lobe up to which samples take part in its fit, as a chord on the
/// unit sphere.
const FARTHEST: f64 = 0.7;
/// Number of iterations of a cross-validation fit, which leaves out one fold of the samples and starts from the fit to
/// all samples.
const FOLD_ROUNDS: usize = 10;
/// Least reduction of the robust cross-validation cost by a lobe for the lobe to be accepted. Raising it finds fewer
/// lobes.
const LEAST_GAIN: f64 = 15.0;
/// Reduction of the misfit of withheld samples, in squared standard deviations, from which a lobe in the other
/// coordinate system (angles or half-vector slopes) is preferred. Raising it keeps the first choice more often.
///
/// Three times this reduction is demanded for a lobe with a second width across the first.
const OTHER_GAIN: f64 = 3.0;
/// Least share of the lobe in a sample's value from which the sample tests the fitted form of the lobe.
const OF_LOBE: f64 = 0.2;
/// Least number of samples in the lobe from which the misfit of its form is estimated.
const ENOUGH_OF_LOBE: usize = 8;
/// Multiple of the noise below which the misfit of a lobe's form is ignored. Raising it trusts the form more.
const MISFIT: f64 = 1.5;
/// Approximate number of samples, for each incoming direction, that the fit of a lobe uses in the wider surroundings of
/// the lobe. These samples determine the background, and how slowly the lobe falls off. Raising the number is slower.
const THIN: usize = 160;
/// Radius about the centre of a lobe within which its fit uses all samples, as a multiple of the sum of the lobe's
/// half-width and the sample spacing.
const ALL_WITHIN: f64 = 3.0;
/// Least number of samples brighter than the background for a lobe to be accepted.
const FEWEST: usize = 3;
/// Excess over the background that the lobe predicts, in natural logarithms, from which a sample belongs to the lobe.
const SHARE: f64 = 0.1;
/// Least fraction of the samples in the lobe that must be brighter than the background for the lobe to be accepted.
const MOST: f64 = 0.7;

/// A lobe fitted to the samples of a scan, with the background beneath it.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) near: Near,
    pub(super) spacing: f64,
    pub(super) noise: f64,
    pub(super) shape: Shape,
    pub(super) bases: Vec<[f64; TERMS]>,
    pub(super) free: [bool; NUMBERS],
    /// Reduction, by the lobe, of the error of predicting withheld samples. The error is a sum of squared residuals in
    /// standard deviations, in which outliers count less. Positive if the lobe improves the prediction.
    pub(super) gain: f64,
    pub(super) cost: f64,
}

impl Found {
    pub(super) fn problem(&self) -> Problem<'_> {
        Problem {
            near: &self.near,
            noise: self.noise,
            free: self.free,
            without: None,
            beyond: 0.0,
            widths: bounds(self.shape.centre, self.spacing),
        }
    }

    pub(super) fn fit(&self) -> Fit {
        Fit { shape: Some(self.shape), bases: self.bases.clone(), cost: self.cost }
    }
}

/// Returns the bounds of the logarithm of a lobe's half-width, in the units of its coordinates.
fn bounds(centre: LobeCentre, spacing: f64) -> [f64; 2] {
    [NARROWEST, WIDEST].map(|width| libm::log(width * spacing / of_outgoing(centre)))
}

/// Returns, for each parameter of a lobe, true if it is fitted and false if it is fixed. One to three parameters
/// describe how the peak depends on the incoming polar angle: no more than there are such angles.
fn free(near: &Near, has_two_widths: bool) -> [bool; NUMBERS] {
    let [low, high] = near.range();
    let joint = near.groups.iter().any(|group| group.iter().any(|sample| sample.terms[TERMS - 1] != 0.0));
    let mut ts: Vec<f64> = near.groups.iter().filter_map(|group| Some(group.first()?.t)).collect();
    ts.sort_by(f64::total_cmp);
    ts.dedup_by(|a, b| (*a - *b).abs() < 1e-4);
    let count = if joint && high > low { 3 } else { ts.len() };
    [true, count > 1, count > 2, true, true, has_two_widths, has_two_widths]
}

/// Returns the narrow lobe, about a possible centre such as the mirror direction, that predicts withheld samples best.
/// Returns `None` if the prediction without a lobe is almost as good, or too few samples exceed the background.
///
/// About the mirror direction, one lobe is fitted as a function of the angle from it and another as a function of the
/// half-vector slope.
pub(super) fn best(scan: &Scan<'_>, candidate: &Candidate) -> Option<Found> {
    let centres: &[LobeCentre] = if candidate.near.centre == LobeCentre::Source {
        &[LobeCentre::Source]
    } else {
        &[LobeCentre::Mirror, LobeCentre::HalfVector]
    };
    let mut first: Vec<(Near, Fit)> = centres.iter().filter_map(|&centre| started(scan, candidate, centre)).collect();
    let least = first.iter().map(|(_, fit)| fit.cost).fold(f64::INFINITY, f64::min);
    first.retain(|(_, fit)| fit.cost <= WORSE * least + MUCH_WORSE);
    // All coordinate systems use the same samples, as far as the widest lobe reaches.
    let widths = first.iter().map(|(_, fit)| fit.shape.map_or(0.0, |shape| shape.width()));
    let width = widths.fold(0.0, f64::max);
    let radius = (REACH * width).min(FARTHEST).max(candidate.near.radius);
    let all = ALL_WITHIN * (width + candidate.spacing);
    let fitted = first.iter().filter_map(|first| widened(scan, candidate, first, (radius, all)));
    let mut fitted: Vec<Found> = fitted.collect();
    let noise = fitted.iter().map(|found| found.noise).fold(f64::INFINITY, f64::min);
    for found in &mut fitted {
        found.noise = noise;
        *found = refitted(found.clone());
        if !scan.plan.isotropic && found.shape.centre == LobeCentre::HalfVector {
            *found = stretched(found.clone());
        }
    }
    // Uncertainties of the samples follow from the misfit of the best lobe.
    fitted.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let first = doubted(fitted.first()?.clone());
    let none = withheld(&first.problem(), &Fit { shape: None, ..first.fit() });
    let certainties = first.near.clone();
    let mut best: Option<Found> = None;
    for (number, mut found) in fitted.into_iter().enumerate() {
        if number == 0 {
            found = first.clone();
        } else {
            for (own, other) in found.near.groups.iter_mut().flatten().zip(certainties.all()) {
                own.stated = other.stated;
            }
            found = refitted(found);
        }
        found.gain = none - withheld(&found.problem(), &found.fit());
        if best.as_ref().is_none_or(|best| found.gain > best.gain + OTHER_GAIN) {
            best = Some(found);
        }
    }
    best.filter(|found| found.gain > LEAST_GAIN && is_seen(found))
}

/// Fits a lobe to the samples around the centre of the candidate, from several starting widths and tails.
fn started(scan: &Scan<'_>, candidate: &Candidate, centre: LobeCentre) -> Option<(Near, Fit)> {
    let near = Near::new(scan, centre, candidate.near.radius);
    if near.groups.len() != candidate.bases.len() {
        return None;
    }
    let problem = Problem {
        near: &near,
        noise: candidate.noise,
        free: free(&near, false),
        without: None,
        beyond: 0.0,
        widths: bounds(centre, candidate.spacing),
    };
    let mut narrowest = NARROWEST_START * candidate.spacing / of_outgoing(centre);
    let mut starts = Vec::new();
    for _ in 0..WIDTHS {
        starts.extend(TAILS.map(|tail| (narrowest, tail)));
        narrowest *= WIDER;
    }
    let of = |&(width, tail): &(f64, f64)| start(&near, &candidate.bases, (centre, width, tail), candidate.noise);
    let mut fits: Vec<Fit> = starts.iter().filter_map(of).collect();
    // The best continue, for more and more rounds.
    for (rounds, left) in ROUNDS {
        fits = fits.into_par_iter().map(|fit| problem.fit(fit, rounds)).collect();
        fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        fits.truncate(left);
    }
    fits.into_iter().next().map(|best| (near, best))
}

/// Returns a starting point for the fit of a lobe with the given half-width and tail parameter. The initial height is
/// the median of those that the samples brighter than the background suggest; `None` if no sample is brighter.
fn start(
    near: &Near,
    bases: &[[f64; TERMS]],
    (centre, width, tail): (LobeCentre, f64, f64),
    noise: f64,
) -> Option<Fit> {
    let mut numbers = [0.0; NUMBERS];
    numbers[1] = if centre == LobeCentre::HalfVector { 2.0 } else { 0.0 };
    (numbers[WIDTH], numbers[TAIL]) = (libm::log(width), tail);
    let prepared = Shape { centre, numbers }.prepared();
    let mut peaks = Vec::new();
    for (group, base) in near.groups.iter().zip(bases) {
        for sample in group {
            let base = predicted(sample, base, None).log;
            if sample.log - base > (4.0 * noise).max(0.05) {
                let lobe = sample.log + libm::log(-libm::expm1(base - sample.log));
                peaks.push(lobe - prepared.at(sample).log);
            }
        }
    }
    peaks.sort_by(f64::total_cmp);
    numbers[0] = peaks.get(peaks.len() / 2)?.min(30.0);
    Some(Fit { shape: Some(Shape { centre, numbers }), bases: bases.to_vec(), cost: f64::INFINITY })
}

/// Refits the lobe to the samples within `radius` of its centre: to all samples within `all`, and to a selection of the
/// others.
fn widened(
    scan: &Scan<'_>,
    candidate: &Candidate,
    (near, fit): &(Near, Fit),
    (radius, all): (f64, f64),
) -> Option<Found> {
    let shape = fit.shape?;
    let wide = Near::new(scan, shape.centre, radius).thinned(all, THIN);
    let scale = radius / near.radius;
    // t is relative to another mean now, and there may be more incidences.
    let [p0, p1, p2, ..] = shape.numbers;
    let by = wide.mean_t - near.mean_t;
    let mut numbers = shape.numbers;
    (numbers[0], numbers[1]) = (p0 + by * (p1 + by * p2), p1 + 2.0 * by * p2);
    let bases: Vec<[f64; TERMS]> = if wide.groups.len() == near.groups.len() {
        fit.bases.iter().map(|b| [b[0], b[1] * scale, b[2] * scale, 0.0, 0.0, 0.0, 0.0]).collect()
    } else {
        let beyond = (2.0 * shape.width()).min(0.5 * radius);
        let problem = Problem {
            near: &wide,
            noise: candidate.noise,
            free: [false; NUMBERS],
            without: None,
            beyond,
            widths: [0.0; 2],
        };
        problem.base().bases
    };
    let found = Found {
        spacing: candidate.spacing,
        noise: candidate.noise,
        shape: Shape { numbers, ..shape },
        bases,
        free: free(&wide, false),
        gain: 0.0,
        cost: f64::INFINITY,
        near: wide,
    };
    let found = refitted(found);
    let noise = noise_of(&found.near, &found.bases, Some(found.shape));
    Some(Found { noise, ..found })
}

/// Repeats the fit of a lobe, starting from its previous result.
pub(super) fn refitted(found: Found) -> Found {
    let fit = found.problem().fit(found.fit(), 40);
    Found { shape: fit.shape.unwrap_or(found.shape), bases: fit.bases, cost: fit.cost, ..found }
}

/// Raises the uncertainty of samples in the lobe by the misfit of the lobe beyond the noise, if there is any. No real
/// lobe has exactly the fitted form.
fn doubted(mut found: Found) -> Found {
    let prepared = found.shape.prepared();
    let mut residuals = Vec::new();
    for (group, base) in found.near.groups.iter().zip(&found.bases) {
        for sample in group {
            let at = predicted(sample, base, Some(&prepared));
            if at.share > OF_LOBE {
                residuals.push((sample.log - at.log).abs());
            }
        }
    }
    if residuals.len() < ENOUGH_OF_LOBE {
        return found;
    }
    let misfit = deviation(residuals, found.free.iter().filter(|free| **free).count());
    if misfit < MISFIT * found.noise {
        return found;
    }
    for (group, base) in found.near.groups.iter_mut().zip(&found.bases) {
        for sample in group {
            let share = predicted(sample, base, Some(&prepared)).share;
            sample.stated = norm([sample.stated, share * misfit, found.noise]);
        }
    }
    refitted(found)
}

/// Returns the robust cross-validation cost of a lobe: the misfit of all samples, each to a lobe fitted without the
/// samples of its fold. Each of these fits starts from `start`.
fn withheld(problem: &Problem<'_>, start: &Fit) -> f64 {
    let of = |fold: u32| {
        let problem = Problem { without: Some(fold), ..*problem };
        problem.cost_of(&problem.fit(start.clone(), FOLD_ROUNDS), fold)
    };
    let costs: Vec<f64> = (0..FOLDS).into_par_iter().map(of).collect();
    costs.iter().sum()
}

/// Returns true if enough samples are brighter than the background, including most samples that the lobe should
/// brighten.
fn is_seen(found: &Found) -> bool {
    let prepared = found.shape.prepared();
    let (mut high, mut of_lobe) = (0, 0);
    for (group, base) in found.near.groups.iter().zip(&found.bases) {
        for sample in group {
            let at = predicted(sample, base, Some(&prepared));
            let limit = (4.0 * found.noise.max(sample.stated)).max(0.05);
            // At least half of the excess over the base that the lobe predicts.
            if at.log - at.base > limit.max(SHARE) {
                of_lobe += 1;
                high += usize::from(sample.log - at.base > 0.5 * (at.log - at.base));
            }
        }
    }
    high >= FEWEST && high as f64 >= MOST * f64::from(of_lobe)
}

/// Returns the lobe with two different widths if it predicts withheld samples clearly better than the given lobe with
/// one width.
fn stretched(found: Found) -> Found {
    let mut best = found.clone();
    for eighth in 0..4 {
        let mut start = found.clone();
        (start.free[STRETCH], start.free[ANGLE]) = (true, true);
        start.shape.numbers[STRETCH] = 0.3;
        start.shape.numbers[ANGLE] = f64::from(eighth) * std::f64::consts::FRAC_PI_4;
        let next = refitted(start);
        if next.cost < best.cost {
            best = next;
        }
    }
    if !best.free[STRETCH] {
        return found;
    }
    let [one, two] = [&found, &best].map(|found| withheld(&found.problem(), &found.fit()));
    if two + 3.0 * OTHER_GAIN < one { best } else { found }
}

/// Returns the number of samples, of all incoming directions, within half maximum of the lobe.
pub(super) fn within_half(found: &Found) -> u64 {
    found.near.groups.iter().map(|group| count(found, group)).sum()
}

/// Returns the usual number of samples within half maximum of the lobe under one incoming direction: the median, but no
/// more than the sample spacing suggests.
pub(super) fn usually_within_half(found: &Found) -> f64 {
    let half = found.shape.width() / found.spacing;
    let even = std::f64::consts::PI * half * half;
    let mut counts: Vec<u64> = found.near.groups.iter().map(|group| count(found, group)).collect();
    counts.sort_unstable();
    counts.get(counts.len() / 2).map_or(even, |&count| (count as f64).min(even))
}

fn count(found: &Found, group: &[Sample]) -> u64 {
    let [a, b] = found.shape.widths();
    let (sin, cos) = libm::sincos(found.shape.numbers[ANGLE]);
    let is_within = |sample: &&Sample| {
        let [x, y] = sample.place;
        let [x, y] = [(cos * x + sin * y) / a, (cos * y - sin * x) / b];
        x * x + y * y <= 1.0
    };
    group.iter().filter(is_within).count() as u64
}
