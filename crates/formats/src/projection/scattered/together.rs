//! Light or outlier: which samples far above their neighbours lie together, as those of a narrow lobe do.
//!
//! Samples of all incidences are laid over each other in each of three coordinates ([`relative`](super::relative)). A sample
//! far off its neighbours lies *together* with others if two more lie within two sample spacings, on the same side in the
//! same bands, off too or at least high, and nearly all samples between the three are like them: within a lobe all are, while
//! outliers are spread among samples that are not. Only incidences between the lowest and the highest of the three count, as a
//! lobe may appear at grazing incidence only. It is *light* if the same holds over all incidences, it is seen at two of them or
//! more (or there is only one), and the values fall off from one peak, to within a factor of two. That all bands agree proves
//! nothing: a spike of the lamp has all of them.

use super::plan::Plan;
use super::relative::{ORIGINS, places};
use super::tree::{Found, Tree, nearness};
use crate::domain::Quantity;
use crate::domain::vector::{Vector, add, norm, scale, sub};
use rayon::prelude::*;

/// Sample spacings within which samples lie together. Raising it joins outliers.
const SPACINGS: f64 = 2.0;
/// Samples that lie together at least, and those of them that are off; the others are at least high.
const FEWEST: usize = 3;
const FEWEST_OFF: usize = 2;
/// Of so many samples that are off, one may be among them that is not: where it is said that nearly all are.
const FOREIGN: usize = 4;
/// Logarithm of the factor to within which values fall off from one peak.
const FACTOR: f64 = std::f64::consts::LN_2;
/// Chords between incoming directions below which these are one: 0.06°.
const SAME: f64 = 1e-3;

/// A sample that lies off its neighbours or is high, in some of its channels.
#[derive(Clone, Debug)]
pub(super) struct Off {
    pub(super) row: u32,
    /// The channels, increasing, with the differences of logarithms from the prediction.
    pub(super) channels: Vec<(usize, f32)>,
    /// The distance between the samples around, as a chord.
    pub(super) spacing: f64,
    /// Whether it is above the others by more than noise, but not so far that it is off.
    pub(super) is_high: bool,
}

/// The company of a sample that lies off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Company {
    /// Alone: an outlier.
    Alone,
    /// With others, though not as one peak.
    Together,
    /// One of a lobe's.
    Light,
}

impl Off {
    /// The mean difference; its sign is the side.
    fn excess(&self) -> f64 {
        self.channels.iter().map(|channel| f64::from(channel.1)).sum::<f64>() / self.channels.len().max(1) as f64
    }

    /// Whether the two are off on the same side in the same channels, most of them.
    fn agrees(&self, other: &Self) -> bool {
        let mut others = other.channels.iter().peekable();
        let mut shared = 0;
        for &(channel, difference) in &self.channels {
            while others.next_if(|other| other.0 < channel).is_some() {}
            shared += usize::from(others.peek().is_some_and(|o| o.0 == channel && o.1 * difference > 0.0));
        }
        2 * shared >= self.channels.len().max(other.channels.len())
    }
}

/// All samples in one coordinate, and those that are off.
struct Laid {
    origin: Vector,
    all: Tree<3>,
    /// The row of each point of `all`.
    rows: Vec<u32>,
    off: Tree<3>,
    /// The number of each point of `off`, and where each number lies.
    numbers: Vec<u32>,
    places: Vec<Vector>,
}

/// What is known of all samples.
struct Samples<'a> {
    plan: &'a Plan,
    offs: &'a [Off],
    /// The number among `offs` of each row, `u32::MAX` for the others.
    number_of: Vec<u32>,
    has_one_incidence: bool,
}

/// The company of each of `offs`, which are in increasing order of rows.
pub(super) fn companies(quantity: Quantity, plan: &Plan, offs: &[Off]) -> Vec<Company> {
    let mut found = vec![Company::Alone; offs.len()];
    if offs.iter().filter(|off| !off.is_high).count() < FEWEST_OFF {
        return found;
    }
    let rows: Vec<u32> = plan.clouds.iter().flat_map(|cloud| &cloud.rows[..cloud.own()]).copied().collect();
    let mut number_of = vec![u32::MAX; plan.directions.len()];
    offs.iter().zip(0..).for_each(|(off, number)| number_of[off.row as usize] = number);
    let first = rows.first().map(|&row| plan.directions[row as usize].0);
    let is_first = |row: &u32| first.is_some_and(|wi| norm(sub(plan.directions[*row as usize].0, wi)) < SAME);
    let has_one_incidence = rows.iter().all(is_first);
    let samples = Samples { plan, offs, number_of, has_one_incidence };
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

/// Samples in a place: how many are off or high in the same way, and how many there are.
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

    /// Whether nearly all are alike.
    fn is_full(self) -> bool {
        self.alike > 0 && FOREIGN * (self.count - self.alike) <= self.alike
    }
}

/// What lies around a sample that is off, in one coordinate.
#[derive(Default)]
struct Around {
    /// The samples within reach that are off or high in the same way, nearest first.
    near: Vec<usize>,
    /// Samples between it and the nearest of them: how many are off or high in the same way, and how many there are.
    everywhere: Filling,
    /// The same of incidences that are not lower or higher than those of these.
    there: Filling,
    /// Whether it is above, seen at several incidences where there are several, and fits to one peak.
    is_on_peak: bool,
}

impl Around {
    /// A sample is in the company of those nearly all around it, or of a sample near it that is.
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

    /// What lies around one of the samples that are off, in one coordinate; of those that are no more than high nothing.
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
        // The nearest that is off, and the nearest other.
        let Some(&second) = near.iter().find(|&&other| !self.offs[other].is_high) else { return Around::default() };
        let Some(&third) = near.iter().find(|&&other| other != second) else { return Around::default() };
        let (everywhere, there) = self.between(laid, [number, second, third]);
        let wi = self.wi(number);
        let is_elsewhere = |&other: &usize| norm(sub(self.wi(other), wi)) >= SAME;
        let is_seen_twice = self.has_one_incidence || near.iter().any(is_elsewhere);
        let is_on_peak = off.excess() > 0.0 && is_seen_twice && self.is_on_peak(laid, number, &near);
        Around { near, everywhere, there, is_on_peak }
    }

    /// Samples between those of `group`, about as wide as these lie apart: how many are off or high like the first, and how
    /// many there are; then the same of incidences that are not lower or higher than those of the group.
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

    /// Whether a sample is no farther than a factor of two from a fall from one peak, as those `near` show it: that of the
    /// coordinate, the brightest of them, or their centre of gravity.
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
