//! Distinction of lobes from outliers: samples far above their neighbours that lie close together belong to a narrow
//! lobe.
//!
//! Samples of all incidences are overlaid in each of three coordinate systems ([`relative`](super::relative)). A
//! deviating sample lies *together* with others if two more lie within two sample spacings, on the same side in the
//! same bands. These deviate, too, or are at least high. Nearly all samples between the three must be like them:
//! within a lobe all are, while outliers are spread among others. Only incidences between the lowest and the highest
//! of the three count, since a lobe may appear only at grazing incidence.
//!
//! It is *light* if that holds over all incidences, and it is seen at two or more of them (unless there is only one).
//! The values must also fall off from one peak, to within a factor of two. Agreement of all bands proves nothing: a
//! spike of the lamp affects all of them.

use super::plan::Plan;
use super::relative::{ORIGINS, places};
use super::tree::{Found, Tree, nearness};
use crate::domain::Quantity;
use crate::domain::vector::{Vector, add, norm, scale, sub};
use rayon::prelude::*;

/// Largest distance at which deviating samples count as lying together, in sample spacings. Raising it takes more
/// outliers for lobes.
const SPACINGS: f64 = 2.0;
/// Least number of samples that must lie together to form a lobe; at least two deviate, the others may be only *high*
/// (brighter than noise explains). Raising it finds fewer lobes.
const FEWEST: usize = 3;
/// Least number of deviating samples among those that form a lobe. Raising it finds fewer lobes.
const FEWEST_OFF: usize = 2;
/// Least ratio of two counts of samples around an outlier, from which a lobe is assumed there: the count of those that
/// deviate in the same sense (brighter or darker than predicted) to that of all others. Raising it finds fewer lobes.
const FOREIGN: usize = 4;
/// Natural logarithm of a factor of two. The ratio of a lobe's sample to the prediction by its neighbours may exceed
/// that of a sample nearer to the lobe's peak by at most this factor. Raising it finds more lobes.
pub(super) const FACTOR: f64 = std::f64::consts::LN_2;
/// Chord between incoming directions below which they count as equal: 0.06°.
pub(super) const SAME: f64 = 1e-3;

/// A sample that, in some of its channels, deviates from its neighbours or is *high* (brighter than noise explains).
#[derive(Clone, Debug)]
pub(super) struct Off {
    pub(super) row: u32,
    /// Channels in which the sample differs from the prediction by its neighbours by more than noise explains, in
    /// increasing order. Each has the difference of natural logarithms: sample minus prediction.
    pub(super) channels: Vec<(usize, f32)>,
    /// Distance between neighbouring samples in the surroundings of this sample, as a chord on the unit sphere.
    pub(super) spacing: f64,
    /// True if the sample exceeds its neighbours by more than noise, but not enough to count as deviating.
    pub(super) is_high: bool,
}

/// Classification of a sample that deviates from its neighbours: outlier or part of a lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Company {
    /// The deviating sample is an outlier without other outliers close to it.
    Alone,
    /// The deviating sample is an outlier, close to other outliers that share no common peak with it.
    Together,
    /// The deviating sample is part of a lobe, not an outlier, and is kept.
    Light,
}

impl Off {
    /// Returns the natural logarithm of the ratio of the sample to the prediction by its neighbours: the mean over the
    /// channels in which they differ. Positive if the sample is brighter than predicted.
    pub(super) fn excess(&self) -> f64 {
        self.channels.iter().map(|channel| f64::from(channel.1)).sum::<f64>() / self.channels.len().max(1) as f64
    }

    /// Returns true if two deviating samples are both brighter or both darker than their neighbours, in most of their
    /// channels.
    pub(super) fn agrees(&self, other: &Self) -> bool {
        let mut others = other.channels.iter().peekable();
        let mut shared = 0;
        for &(channel, difference) in &self.channels {
            while others.next_if(|other| other.0 < channel).is_some() {}
            shared += usize::from(others.peek().is_some_and(|o| o.0 == channel && o.1 * difference > 0.0));
        }
        2 * shared >= self.channels.len().max(other.channels.len())
    }
}

/// Search trees of all samples of a measurement, and of those that differ from their neighbours by more than noise
/// explains, in one coordinate system, such as that of half-vector slopes.
struct Laid {
    origin: Vector,
    all: Tree<3>,
    /// For each point of the search tree of all samples, the index of its sample in the table of measured values.
    rows: Vec<u32>,
    off: Tree<3>,
    /// For each point of the search tree of deviating samples, its number in the list of these samples.
    numbers: Vec<u32>,
    places: Vec<Vector>,
}

/// All samples of a measurement, with a list of those that differ from their neighbours by more than noise explains.
struct Samples<'a> {
    plan: &'a Plan,
    offs: &'a [Off],
    /// For each sample, its number in the list of deviating samples; `u32::MAX` for other samples.
    number_of: Vec<u32>,
    has_one_incidence: bool,
}

/// Classifies each deviating sample in `offs`, which are in increasing order of sample index, as an outlier or as part
/// of a lobe.
pub(super) fn companies(quantity: Quantity, plan: &Plan, offs: &[Off]) -> Vec<Company> {
    let mut found = vec![Company::Alone; offs.len()];
    if offs.iter().filter(|off| !off.is_high).count() < FEWEST_OFF {
        return found;
    }
    let rows: Vec<u32> = plan.clouds.iter().flat_map(|cloud| &cloud.rows[..cloud.own()]).copied().collect();
    let mut number_of = vec![u32::MAX; plan.directions.len()];
    offs.iter().zip(0..).for_each(|(off, number)| number_of[off.row as usize] = number);
    let samples = Samples { plan, offs, number_of, has_one_incidence: has_one_incidence(plan) };
    for (coordinate, origin) in ORIGINS.into_iter().enumerate() {
        let at = |row: u32| places(quantity, plan.directions[row as usize])[coordinate];
        let places: Vec<Vector> = offs.iter().map(|off| at(off.row)).collect();
        let (all, order) = Tree::new(rows.iter().map(|&row| at(row)));
        let (off, numbers) = Tree::new(places.iter().copied());
        let rows = order.into_iter().map(|place| rows[place as usize]).collect();
        let laid = Laid { origin, all, rows, off, numbers, places };
        let around = |number| samples.around(&laid, number);
        let around: Vec<Around> = (0..offs.len()).into_par_iter().map(around).collect();
        for (found, company) in found.iter_mut().zip(&around).map(|(found, own)| (found, own.company(&around))) {
            *found = (*found).max(company);
        }
    }
    found
}

/// Returns true if all samples of a scan have the same incoming direction.
pub(super) fn has_one_incidence(plan: &Plan) -> bool {
    let mut rows = plan.clouds.iter().flat_map(|cloud| &cloud.rows[..cloud.own()]);
    let wi = |row: &u32| plan.directions[*row as usize].0;
    rows.next().map(wi).is_some_and(|first| rows.all(|row| norm(sub(wi(row), first)) < SAME))
}

/// Two counts of the samples in a region around a deviating sample: of all samples, and of those that deviate in the
/// same sense (brighter or darker than their neighbours predict).
#[derive(Clone, Copy, Default)]
struct Filling {
    alike: usize,
    count: usize,
}

impl Filling {
    fn add(&mut self, is_alike: bool) {
        self.alike += usize::from(is_alike);
        self.count += 1;
    }

    fn is_half(self) -> bool {
        self.alike > 0 && 2 * self.alike >= self.count
    }

    /// Returns true if at least four of five samples around a deviating sample deviate in the same sense: brighter, or
    /// darker, than their neighbours predict.
    fn is_full(self) -> bool {
        self.alike > 0 && FOREIGN * (self.count - self.alike) <= self.alike
    }
}

/// Surroundings of a sample that deviates from its neighbours, in one of the coordinate systems in which lobes are
/// sought.
#[derive(Default)]
struct Around {
    /// Numbers of the samples near a deviating sample that deviate in the same sense (brighter or darker than their
    /// neighbours predict) or are high (brighter than noise explains), nearest first.
    near: Vec<usize>,
    /// Number of samples, and of those that deviate in the same sense (brighter or darker than predicted), in a ball
    /// around three samples: a deviating one and the two nearest that deviate like it. The ball lies in the coordinates
    /// in which a lobe is sought, such as half-vector slopes. Samples of all incoming directions count.
    everywhere: Filling,
    /// Number of samples, and of those that deviate in the same sense (brighter or darker than predicted), in a ball
    /// around three samples: a deviating one and the two nearest that deviate like it. The ball lies in the coordinates
    /// in which a lobe is sought, such as half-vector slopes. Only incoming polar angles within the range of these
    /// three count.
    there: Filling,
    /// True if a bright sample of scattered data is part of a narrow lobe: it is brighter than its neighbours, bright
    /// samples near it form one peak with it, and, where there are several incoming directions, the peak appears under
    /// more than one of them.
    is_on_peak: bool,
}

impl Around {
    /// Classifies a deviating sample as outlier or part of a lobe. It belongs to a lobe if nearly all samples around it
    /// deviate in the same sense (brighter or darker than their neighbours predict), or if that holds for a sample near
    /// it.
    fn company(&self, all: &[Self]) -> Company {
        let begins = |filling: fn(&Self) -> Filling| {
            let is_near_full = || self.near.iter().any(|&other| filling(&all[other]).is_full());
            filling(self).is_full() || self.there.is_half() && is_near_full()
        };
        if self.is_on_peak && begins(|around| around.everywhere) {
            Company::Light
        } else if begins(|around| around.there) {
            Company::Together
        } else {
            Company::Alone
        }
    }
}

impl Samples<'_> {
    fn wi(&self, number: usize) -> Vector {
        self.plan.directions[self.offs[number].row as usize].0
    }

    /// Finds the samples near a deviating sample that deviate in the same sense (brighter or darker than predicted),
    /// and counts all samples between them. Distances are measured in the coordinate system of `laid`, such as that of
    /// half-vector slopes. Finds nothing around a sample that is brighter than noise explains, but not enough to count
    /// as deviating.
    fn around(&self, laid: &Laid, number: usize) -> Around {
        let (off, place) = (&self.offs[number], laid.places[number]);
        if off.is_high {
            return Around::default();
        }
        let mut near: Vec<Found> = Vec::new();
        let reach = SPACINGS * off.spacing;
        let is_alike = |point: u32| {
            let other = laid.numbers[point as usize] as usize;
            other != number && off.agrees(&self.offs[other])
        };
        laid.off.within((&place, 0), reach * reach, is_alike, &mut near);
        near.sort_unstable_by_key(nearness);
        let near: Vec<usize> = near.iter().map(|near| laid.numbers[near.1 as usize] as usize).collect();
        // The nearest deviating sample, and the nearest other one.
        let Some(&second) = near.iter().find(|&&other| !self.offs[other].is_high) else { return Around::default() };
        let Some(&third) = near.iter().find(|&&other| other != second) else { return Around::default() };
        let (everywhere, there) = self.between(laid, [number, second, third]);
        let wi = self.wi(number);
        let is_elsewhere = |&other: &usize| norm(sub(self.wi(other), wi)) >= SAME;
        let is_seen_twice = self.has_one_incidence || near.iter().any(is_elsewhere);
        let is_on_peak = off.excess() > 0.0 && is_seen_twice && self.is_on_peak(laid, number, &near);
        Around { near, everywhere, there, is_on_peak }
    }

    /// Counts the samples in a ball about the centroid of three deviating samples, `group`, that just contains these
    /// three. Counts apart those that deviate in the same sense (brighter or darker than predicted) as the first of the
    /// three.
    ///
    /// Returns the counts for all incoming directions, then for incoming polar angles within the range of the three.
    fn between(&self, laid: &Laid, group: [usize; FEWEST]) -> (Filling, Filling) {
        let sum = group.iter().fold([0.0; 3], |sum, &other| add(sum, laid.places[other]));
        let centre = scale(sum, 1.0 / group.len() as f64);
        let radius = group.iter().map(|&other| norm(sub(laid.places[other], centre))).fold(0.0, f64::max) + 1e-9;
        let heights = group.iter().map(|&other| self.wi(other)[2]);
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
        let mut inside = Vec::new();
        laid.all.within((&centre, 0), radius * radius, |_| true, &mut inside);
        let (mut everywhere, mut there) = (Filling::default(), Filling::default());
        for &(_, point) in &inside {
            let row = laid.rows[point as usize] as usize;
            let other = self.offs.get(self.number_of[row] as usize);
            let is_alike = other.is_some_and(|other| other.agrees(&self.offs[group[0]]));
            let z = self.plan.directions[row].0[2];
            everywhere.add(is_alike);
            if z >= low - SAME && z <= high + SAME {
                there.add(is_alike);
            }
        }
        (everywhere, there)
    }

    /// Returns true if a deviating sample and the samples `near` it decrease from one peak, to within a factor of two.
    /// Peaks tried are the origin of the coordinates, the brightest sample, and the centre of gravity.
    fn is_on_peak(&self, laid: &Laid, number: usize, near: &[usize]) -> bool {
        let excess = |number: usize| self.offs[number].excess();
        let group = || near.iter().copied().chain([number]);
        let brighter = |best: usize, next: usize| if excess(next) > excess(best) { next } else { best };
        let brightest = group().fold(number, brighter);
        let total: f64 = group().map(|other| excess(other).max(0.0)).sum();
        let weigh = |sum, other: usize| add(sum, scale(laid.places[other], excess(other).max(0.0)));
        let gravity = scale(group().fold([0.0; 3], weigh), 1.0 / total.max(f64::MIN_POSITIVE));
        [laid.origin, laid.places[brightest], gravity].into_iter().any(|peak| {
            let far = |other: usize| norm(sub(laid.places[other], peak));
            let (own, high) = (far(number), excess(number));
            let fits = |&other: &usize| {
                if far(other) > own { high >= excess(other) - FACTOR } else { high <= excess(other) + FACTOR }
            };
            near.iter().all(fits)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn off(channels: &[(usize, f32)]) -> Off {
        Off { row: 0, channels: channels.to_vec(), spacing: 0.04, is_high: false }
    }

    #[test]
    fn bands_that_disagree_are_no_company() {
        let all = off(&[(0, 1.0), (1, 2.0), (2, 1.0)]);
        assert!(all.agrees(&all) && all.agrees(&off(&[(0, 3.0), (2, 1.0)])));
        assert!(!all.agrees(&off(&[(1, 2.0)])) && !off(&[(1, 2.0)]).agrees(&all));
        assert!(!all.agrees(&off(&[(0, -1.0), (1, -1.0), (2, -1.0)])));
        assert!((all.excess() - 4.0 / 3.0).abs() < 1e-12);
    }
}
