//! Which lobe the samples show: about which centre, how wide, with which tail; or none.

use super::candidates::{Candidate, deviation, noise_of};
use super::near::{FOLDS, Near, Sample, TERMS};
use super::scan::Scan;
use super::shape::{ANGLE, LEAST_TAIL, NUMBERS, STRETCH, Shape, TAIL, WIDTH, of_outgoing};
use super::solve::{Fit, Problem, predicted};
use crate::domain::LobeCentre;
use crate::domain::vector::norm;
use rayon::prelude::*;

/// Half-widths that fits start from, in distances between samples, and the factor between them.
const NARROWEST_START: f64 = 0.1;
const WIDER: f64 = 1.6;
const WIDTHS: usize = 7;
const TAILS: [f64; 3] = [LEAST_TAIL, 0.2, 0.5];
/// Rounds that starts compete after, and how many of them go on.
const ROUNDS: [(usize, usize); 3] = [(1, 8), (5, 2), (30, 1)];
/// A coordinate whose first fit costs so many times as much as the best, and this much, goes no further.
const WORSE: f64 = 1.5;
const MUCH_WORSE: f64 = 100.0;
/// Bounds of half-widths in distances between samples.
const NARROWEST: f64 = 0.04;
const WIDEST: f64 = 4.0;
/// Radius of the samples that a lobe is fitted to, in half-widths, and at most.
const REACH: f64 = 8.0;
const FARTHEST: f64 = 0.7;
/// Rounds of a fit without a part of the samples, from the fit to all.
const FOLD_ROUNDS: usize = 10;
/// What a lobe must gain of the robust cost of withheld samples, and of that for each sample of it.
const LEAST_GAIN: f64 = 15.0;
/// What another centre, or a second width, must gain above that.
const OTHER_GAIN: f64 = 3.0;
/// A sample with this part of the lobe tells how well that fits, if there are so many; misfits of so many times the
/// noise are none.
const OF_LOBE: f64 = 0.2;
const ENOUGH_OF_LOBE: usize = 8;
const MISFIT: f64 = 1.5;
/// Samples of one incidence that are kept beyond the lobe, about: they tell the base and the tail.
const THIN: usize = 160;
/// Half-widths, and distances between samples, within which all are kept.
const ALL_WITHIN: f64 = 3.0;
/// Samples that must lie above the base.
const FEWEST: usize = 3;
/// A sample is of the lobe if this part of it is; those of them that lie above the base must be as many as `MOST` says.
const SHARE: f64 = 0.1;
const MOST: f64 = 0.7;

/// A lobe that samples show.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) near: Near,
    pub(super) spacing: f64,
    pub(super) noise: f64,
    pub(super) shape: Shape,
    pub(super) bases: Vec<[f64; TERMS]>,
    pub(super) free: [bool; NUMBERS],
    /// How much less the robust cost of withheld samples is than without a lobe.
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

/// Bounds of the logarithm of a width.
fn bounds(centre: LobeCentre, spacing: f64) -> [f64; 2] {
    [NARROWEST, WIDEST].map(|width| libm::log(width * spacing / of_outgoing(centre)))
}

/// Which numbers are free: as many of the peak as there are incidences.
fn free(near: &Near, has_two_widths: bool) -> [bool; NUMBERS] {
    let [low, high] = near.range();
    let joint = near.groups.iter().any(|group| group.iter().any(|sample| sample.terms[TERMS - 1] != 0.0));
    let mut ts: Vec<f64> = near.groups.iter().filter_map(|group| Some(group.first()?.t)).collect();
    ts.sort_by(f64::total_cmp);
    ts.dedup_by(|a, b| (*a - *b).abs() < 1e-4);
    let count = if joint && high > low { 3 } else { ts.len() };
    [true, count > 1, count > 2, true, true, has_two_widths, has_two_widths]
}

/// The best lobe about the centre of a candidate, in each of the coordinates there.
pub(super) fn best(scan: &Scan<'_>, candidate: &Candidate) -> Option<Found> {
    let centres: &[LobeCentre] = if candidate.near.centre == LobeCentre::Source {
        &[LobeCentre::Source]
    } else {
        &[LobeCentre::Mirror, LobeCentre::HalfVector]
    };
    let mut first: Vec<(Near, Fit)> = centres.iter().filter_map(|&centre| started(scan, candidate, centre)).collect();
    let least = first.iter().map(|(_, fit)| fit.cost).fold(f64::INFINITY, f64::min);
    first.retain(|(_, fit)| fit.cost <= WORSE * least + MUCH_WORSE);
    // All coordinates with the same samples, as far as the widest lobe reaches.
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
    // Samples are as certain as the best of the lobes says.
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

/// A fit of a lobe to the samples within the ring of the candidate.
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
    // The best of all go on, for longer and longer.
    for (rounds, left) in ROUNDS {
        fits = fits.into_par_iter().map(|fit| problem.fit(fit, rounds)).collect();
        fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        fits.truncate(left);
    }
    fits.into_iter().next().map(|best| (near, best))
}

/// A lobe of this width and tail, as high as the samples that lie above the base make it in their middle.
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

/// The same lobe fitted to the samples within `radius`: all of those within `all`, and of the others some.
fn widened(
    scan: &Scan<'_>,
    candidate: &Candidate,
    (near, fit): &(Near, Fit),
    (radius, all): (f64, f64),
) -> Option<Found> {
    let shape = fit.shape?;
    let wide = Near::new(scan, shape.centre, radius).thinned(all, THIN);
    let scale = radius / near.radius;
    // t is less another mean, and groups may have come to it.
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

/// The fit from where it was.
pub(super) fn refitted(found: Found) -> Found {
    let fit = found.problem().fit(found.fit(), 40);
    Found { shape: fit.shape.unwrap_or(found.shape), bases: fit.bases, cost: fit.cost, ..found }
}

/// Counts samples of the lobe as less certain by as much as they depart from it beyond noise, where they do: no lobe is
/// quite of the form that is fitted.
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

/// The robust cost of all samples, each predicted by a fit without its fold, which begins with `start`.
fn withheld(problem: &Problem<'_>, start: &Fit) -> f64 {
    let of = |fold: u32| {
        let problem = Problem { without: Some(fold), ..*problem };
        problem.cost_of(&problem.fit(start.clone(), FOLD_ROUNDS), fold)
    };
    let costs: Vec<f64> = (0..FOLDS).into_par_iter().map(of).collect();
    costs.iter().sum()
}

/// Whether enough samples lie above the base, and most of those that should.
fn is_seen(found: &Found) -> bool {
    let prepared = found.shape.prepared();
    let (mut high, mut of_lobe) = (0, 0);
    for (group, base) in found.near.groups.iter().zip(&found.bases) {
        for sample in group {
            let at = predicted(sample, base, Some(&prepared));
            let limit = (4.0 * found.noise.max(sample.stated)).max(0.05);
            // Above the base by about as much as the lobe says.
            if at.log - at.base > limit.max(SHARE) {
                of_lobe += 1;
                high += usize::from(sample.log - at.base > 0.5 * (at.log - at.base));
            }
        }
    }
    high >= FEWEST && high as f64 >= MOST * f64::from(of_lobe)
}

/// A lobe with two widths, where withheld samples are clearly better predicted by it.
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

/// Samples of all incidences within half the maximum.
pub(super) fn within_half(found: &Found) -> u64 {
    found.near.groups.iter().map(|group| count(found, group)).sum()
}

/// Samples within half the maximum under an incidence, in the middle of all: as many as lie there if they are even.
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
