//! Samples about the centre of a lobe: logarithms, and coordinates for the lobe and for the base.

use super::scan::Scan;
use crate::domain::LobeCentre;
use crate::domain::vector::{Vector, norm, sub};
use crate::projection::scattered::cloud::slope;
use crate::projection::scattered::relative::{ORIGINS, places};

/// Number of terms of the background's logarithm under one incoming direction. They are a quadratic in the place about
/// the lobe centre, and a slope in −ln cos θi if many incoming directions are fitted together.
pub(super) const TERMS: usize = 7;
/// Number of folds for cross-validation: the samples of each fold are predicted from those of the other folds.
pub(super) const FOLDS: u32 = 5;
/// Least number of samples about the lobe centre with which an incoming direction takes part in the fit of a lobe.
const FEWEST: usize = 8;
/// Number of samples nearest to the centre of a lobe that determine the sample spacing: from the area of the circle
/// that just contains them.
const DENSITY: usize = 12;

/// A sample near the centre of a lobe, with the quantities that lobe fits need.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) row: u32,
    /// Natural logarithm of the sample's mean over bands.
    pub(super) log: f64,
    /// Standard deviation of the natural logarithm of the sample's mean over bands, from the uncertainties in the
    /// measurement file; 0 if it states none. It is raised for samples of a lobe whose form fits badly.
    pub(super) stated: f64,
    /// Chord on the unit sphere from the sample to the lobe centre.
    pub(super) distance: f64,
    /// Values, at the sample, of the functions whose weighted sum is the logarithm of the background beneath the lobe.
    pub(super) terms: [f64; TERMS],
    /// Coordinates of the sample in the plane of the lobe: half-vector slopes, or the chord to the centre and 0.
    pub(super) place: [f64; 2],
    /// Difference of the sample's −ln cos θi, where θi is the incoming polar angle, from the mean over all incoming
    /// directions.
    pub(super) t: f64,
    /// Cosines of the incoming and the outgoing polar angle of the sample.
    pub(super) cosines: [f64; 2],
    pub(super) fold: u32,
}

/// Samples near one lobe centre, grouped by incoming direction.
#[derive(Clone, Debug)]
pub(super) struct Near {
    pub(super) centre: LobeCentre,
    /// Upper bound on the chord, on the unit sphere, from the lobe centre to the samples that are collected about it.
    pub(super) radius: f64,
    pub(super) groups: Vec<Vec<Sample>>,
    /// Mean of −ln cos θi over the incoming polar angles θi of the scan. Each sample holds the difference of its own
    /// −ln cos θi from it.
    pub(super) mean_t: f64,
}

impl Near {
    /// Collects the samples of a scan within the chord `radius` of a lobe centre. The two kinds of centre at the mirror
    /// direction (by angle and by half vector) collect the same samples.
    pub(super) fn new(scan: &Scan<'_>, centre: LobeCentre, radius: f64) -> Self {
        let mut groups: Vec<Vec<Sample>> = Vec::new();
        for incidence in scan.incidences {
            let rows = incidence.rows.iter();
            let group: Vec<Sample> = rows.filter_map(|&row| sample(scan, centre, row, radius)).collect();
            if group.len() >= FEWEST {
                groups.push(group);
            }
        }
        // The mean over incidences, not over samples.
        let means = groups.iter().map(|group| group.iter().map(|sample| sample.t).sum::<f64>() / group.len() as f64);
        let mean_t = means.sum::<f64>() / groups.len().max(1) as f64;
        for group in &mut groups {
            for sample in group.iter_mut() {
                sample.t -= mean_t;
            }
            let middle = group.iter().map(|sample| sample.t).sum::<f64>() / group.len() as f64;
            for sample in group.iter_mut() {
                sample.terms[TERMS - 1] = sample.t - middle;
            }
        }
        let mut near = Self { centre, radius, groups, mean_t };
        near.divide();
        near
    }

    /// Keeps all samples within the chord `all` of the lobe centre, and about `count` of the farther samples of each
    /// incoming direction.
    pub(super) fn thinned(mut self, all: f64, count: usize) -> Self {
        for group in &mut self.groups {
            let far = group.iter().filter(|sample| sample.distance > all).count();
            let step = far.div_ceil(count).max(1);
            let mut number = 0;
            group.retain(|sample| {
                number += usize::from(sample.distance > all);
                sample.distance <= all || number % step == 0
            });
        }
        self.divide();
        self
    }

    /// Assigns cross-validation folds: neighbours in the order of distance from the centre are in different folds.
    fn divide(&mut self) {
        let at = |&(i, k): &(usize, usize)| self.groups[i][k];
        let all = self.groups.iter().enumerate().flat_map(|(i, group)| (0..group.len()).map(move |k| (i, k)));
        let mut order: Vec<(usize, usize)> = all.collect();
        order.sort_by(|a, b| at(a).distance.total_cmp(&at(b).distance).then(at(a).row.cmp(&at(b).row)));
        for ((i, k), number) in order.into_iter().zip(0..) {
            self.groups[i][k].fold = number % FOLDS;
        }
    }

    /// Returns the usual spacing of samples near the lobe centre, in radians. `is_half` is true if only one side of the
    /// plane of incidence was measured. Returns `None` if no incoming direction has enough samples.
    pub(super) fn spacing(&self, is_half: bool) -> Option<f64> {
        let mut found: Vec<f64> = Vec::new();
        for group in &self.groups {
            let mut distances: Vec<f64> = group.iter().map(|sample| sample.distance).collect();
            distances.sort_by(f64::total_cmp);
            found.extend(distances.get(DENSITY - 1).map(|far| far * (std::f64::consts::PI / DENSITY as f64).sqrt()));
        }
        found.sort_by(f64::total_cmp);
        let half = if is_half { std::f64::consts::FRAC_1_SQRT_2 } else { 1.0 };
        found.get(found.len() / 2).map(|spacing| spacing * half)
    }

    /// Yields the samples near the lobe centre under all incoming directions.
    pub(super) fn all(&self) -> impl Iterator<Item = &Sample> {
        self.groups.iter().flatten()
    }

    /// Returns the smallest and the largest −ln cos θi of the samples.
    pub(super) fn range(&self) -> [f64; 2] {
        let ts = self.all().map(|sample| sample.t + self.mean_t);
        let [low, high] = ts.fold([f64::INFINITY, 0.0], |[low, high], t| [t.min(low), t.max(high)]);
        [low.min(high), high]
    }
}

fn sample(scan: &Scan<'_>, centre: LobeCentre, row: u32, radius: f64) -> Option<Sample> {
    let (wi, wo) = scan.plan.directions[row as usize];
    let onward = if centre == LobeCentre::Source { wi } else { [-wi[0], -wi[1], wi[2]] };
    let distance = norm(sub(wo, onward));
    let log = scan.logs[row as usize];
    if distance > radius || wi[2] <= 0.0 || wo[2] <= 0.0 || log.is_nan() {
        return None;
    }
    let (which, place) = match centre {
        LobeCentre::Mirror => (0, [distance, 0.0]),
        LobeCentre::HalfVector => (0, slope(wi, wo)),
        LobeCentre::Source => (2, [distance, 0.0]),
    };
    let [x, y] = beside(wi, wo, which).map(|x| x / radius);
    Some(Sample {
        row,
        log,
        stated: scan.stated(row),
        distance,
        terms: [1.0, x, y, x * x, x * y, y * y, 0.0],
        place: if place[0].is_nan() { return None } else { place },
        t: -libm::log(wi[2]),
        cosines: [wi[2], wo[2]],
        fold: 0,
    })
}

/// Returns the offset of the outgoing direction from the lobe centre, along and across the plane of incidence.
fn beside(wi: Vector, wo: Vector, which: usize) -> [f64; 2] {
    let place = sub(places(crate::domain::Quantity::Brdf, (wi, wo))[which], ORIGINS[which]);
    [place[1], place[2]]
}
