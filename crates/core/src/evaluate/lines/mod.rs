//! The function of samples on a grid of directions: at a stated direction it is the sample, between them it is interpolated.
//!
//! * Over **outgoing** directions: a cubic of Catmull and Rom along azimuth, then along the polar angle, over the poles and
//!   across mirror planes; of logarithms where no sample is negative. Between two entries the value leaves their range by at most
//!   a tenth of it. Samples with negative ones among them are interpolated as they are, on straight lines.
//! * Over **incoming** directions: linear in the polar angle (and azimuth), of logarithms; each stated direction is looked up where
//!   its own lobe has what is asked for ([`super::incoming::Alignment`]).
//! * Samples that are zero or masked have no logarithm: the share of live samples around is interpolated, too, on straight lines.
//! * A share of straight lines between the samples themselves can be mixed in, up to all of it: what readers of luminaires and
//!   of measured materials usually draw.
//! * Directions that the file states several times (all azimuths at a pole, both ends of a closed circle) have the mean of what is
//!   stated.

mod between;
mod carrying;
mod course;
mod integral;
mod line;
mod sphere;
#[cfg(test)]
mod tests;
mod values;

use super::incoming::{Alignment, carried};
use super::mixed::NO_LIGHT;
use crate::domain::vector::Vector;
use crate::domain::{Direction, DirectionGrid, Domain};
use crate::numeric::bracket::Bracket;
use course::{Course, FoundBetween};
use sphere::{Along, Patch, Sphere};
use values::{Places, Values};

/// Between two entries a value leaves their range by at most this part of it.
const OVERSHOOT: f32 = 0.1;
/// Incoming directions around one: two polar angles, two azimuths.
const AROUND: usize = 4;
/// A share of less than this counts as none: it comes from rounding of angles.
const ROUNDING: f64 = 1e-9;

/// The incoming directions of samples on a grid.
#[derive(Debug)]
pub(super) struct Incoming(Kind);

#[derive(Debug)]
enum Kind {
    None,
    Elevations(Vec<f64>),
    Grid(Box<Sphere>),
}

impl Incoming {
    /// No incoming direction.
    pub(super) const NONE: Self = Self(Kind::None);

    /// Elevations in degrees, of azimuth 0.
    pub(super) fn elevations(values: &[f64]) -> Self {
        Self(Kind::Elevations(values.to_vec()))
    }

    /// A grid of polar angles and azimuths.
    pub(super) fn grid(grid: &DirectionGrid) -> Self {
        Self(Kind::Grid(Box::new(Sphere::new(grid))))
    }
}

/// The interpolated function.
#[derive(Debug)]
pub(super) struct Lines {
    incoming: Incoming,
    /// Directions of the incoming places, those of azimuth 0 for elevations.
    directions: Vec<Vector>,
    outgoing: Option<Box<Sphere>>,
    values: Values,
    /// Share of straight lines between samples, 0..=1.
    straight: f32,
    domain: Domain,
    alignment: Alignment,
    /// The alignments that competed, and how much the function changes under each.
    changes: Vec<(Alignment, f64)>,
    /// How it goes from one incidence to the next, where that is not linear in logarithms.
    course: Option<Box<Course>>,
}

/// Incoming places around a direction.
#[derive(Clone, Copy, Debug)]
struct Nodes {
    places: [u32; AROUND],
    weights: [f64; AROUND],
}

/// The places around a direction that are to be mixed.
#[derive(Clone, Debug)]
pub(super) struct Found {
    count: usize,
    tables: [usize; AROUND],
    weights: [f32; AROUND],
    /// `None` where that incoming direction knows nothing: outside what the grid covers, or no outgoing axis.
    patches: [Option<Patch>; AROUND],
    /// What a divisor or a cubic adds.
    between: Option<FoundBetween>,
}

impl Found {
    /// No place.
    const NOTHING: Self =
        Self { count: 0, tables: [0; AROUND], weights: [0.0; AROUND], patches: [None; AROUND], between: None };
}

/// Numbers of some wavelengths, with the share of light that they stand for and the share that is known.
#[derive(Clone, Copy)]
struct Part<const SIZE: usize> {
    number: [f32; SIZE],
    live: [f32; SIZE],
    known: [f32; SIZE],
}

impl Lines {
    /// The function of samples `[entry][incoming][outgoing][lambda]`, lobes carried as `alignment` says.
    pub(super) fn new(
        samples: &[f32],
        lambdas: usize,
        incoming: Incoming,
        outgoing: Option<&DirectionGrid>,
        (domain, alignment): (Domain, Alignment),
    ) -> Self {
        let outgoing = outgoing.map(|grid| Box::new(Sphere::new(grid)));
        let places_in = match &incoming.0 {
            Kind::None => Places { own: 1, means: &[] },
            Kind::Elevations(values) => Places { own: values.len(), means: &[] },
            Kind::Grid(sphere) => Places { own: sphere.grid().len(), means: sphere.means() },
        };
        let places_out = match &outgoing {
            None => Places { own: 1, means: &[] },
            Some(sphere) => Places { own: sphere.grid().len(), means: sphere.means() },
        };
        let values = Values::new(samples, lambdas, &places_in, &places_out);
        let directions = match &incoming.0 {
            Kind::None => vec![[0.0, 0.0, 1.0]],
            Kind::Elevations(values) => values.iter().map(|&t| Direction::from_degrees(t, 0.0).xyz()).collect(),
            Kind::Grid(sphere) => {
                let grid = sphere.grid();
                let means = sphere.means().iter().map(|mean| mean[0] as usize);
                (0..grid.len()).chain(means).map(|entry| grid.direction(entry).xyz()).collect()
            }
        };
        Self {
            incoming,
            directions,
            outgoing,
            values,
            straight: 0.0,
            domain,
            alignment,
            changes: Vec::new(),
            course: None,
        }
    }

    /// This function with a share, 0..=1, of straight lines between samples.
    pub(super) fn with_straight(self, straight: f32) -> Self {
        Self { straight, ..self }
    }

    /// Share of straight lines between samples, 0..=1.
    pub(super) fn straight(&self) -> f32 {
        self.straight
    }

    /// The outgoing directions of the quantity.
    pub(super) fn domain(&self) -> Domain {
        self.domain
    }

    /// The alignment in which lobes are carried from one incoming direction to the next.
    pub(super) fn alignment(&self) -> Alignment {
        self.alignment
    }

    /// The alignments that competed, and how much the function changes under each.
    pub(super) fn changes(&self) -> &[(Alignment, f64)] {
        &self.changes
    }

    /// Memory in bytes, without the size of the type.
    pub(super) fn memory(&self) -> usize {
        let incoming = match &self.incoming.0 {
            Kind::None => 0,
            Kind::Elevations(values) => size_of_val(&**values),
            Kind::Grid(sphere) => size_of::<Sphere>() + sphere.memory(),
        };
        let outgoing = self.outgoing.as_ref().map_or(0, |sphere| size_of::<Sphere>() + sphere.memory());
        let course = self.course.as_ref().map_or(0, |course| course.memory());
        incoming + outgoing + self.values.memory() + size_of_val(&*self.directions) + course
    }

    /// Everything that is mixed at a place, in the smooth sense; `wi` and `wo` are turned to azimuth 0 of `wi` where incoming
    /// directions are elevations. `None` where `wi` is outside the incoming directions.
    pub(super) fn smooth(&self, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        if let Some(course) = &self.course {
            return self.smooth_between(course, entry, wi, wo);
        }
        let nodes = self.nodes(wi)?;
        let base = entry * self.values.incoming();
        let mut found = Found::NOTHING;
        for (place, weight) in nodes.places.into_iter().zip(nodes.weights).filter(|(_, weight)| *weight > 0.0) {
            let k = found.count;
            let (there, worth) = if weight == 1.0 || self.alignment == Alignment::None {
                (wo, 1.0)
            } else {
                carried(self.alignment, self.domain, wi, self.directions[place as usize], wo)
            };
            found.tables[k] = base + place as usize;
            found.weights[k] = weight as f32 * worth;
            found.patches[k] = self.outgoing.as_ref().and_then(|sphere| sphere.patch(Direction::from_unit(there)));
            found.count += 1;
        }
        Some(found)
    }

    /// Everything that is mixed at an outgoing direction under one stated incoming direction.
    fn under(&self, entry: usize, node: usize, wo: Direction) -> Found {
        let patch = self.outgoing.as_ref().and_then(|sphere| sphere.patch(wo));
        Found {
            count: 1,
            tables: [entry * self.values.incoming() + node; AROUND],
            weights: [1.0, 0.0, 0.0, 0.0],
            patches: [patch, None, None, None],
            between: None,
        }
    }

    /// The nearest stated place, in the piecewise constant sense. `None` where `wi` is outside the incoming directions.
    pub(super) fn nearest(&self, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        let nodes = self.nodes(wi)?;
        let heaviest = (0..AROUND).max_by(|&a, &b| nodes.weights[a].total_cmp(&nodes.weights[b])).unwrap_or(0);
        let table = entry * self.values.incoming() + nodes.places[heaviest] as usize;
        let one = Along { cubic: [0.0, 1.0, 0.0, 0.0], t: 0.0 };
        let patch = self.outgoing.as_ref().and_then(|sphere| {
            let place = sphere.nearest(Direction::from_unit(wo))?;
            Some(Patch { places: [[place; 4]; 4], along: [one; 4], across: one })
        });
        Some(Found {
            count: 1,
            tables: [table; AROUND],
            weights: [1.0, 0.0, 0.0, 0.0],
            patches: [patch, None, None, None],
            between: None,
        })
    }

    /// The incoming places around a direction, with weights that add up to 1.
    fn nodes(&self, wi: Vector) -> Option<Nodes> {
        let one = |place: u32| Nodes { places: [place; AROUND], weights: [1.0, 0.0, 0.0, 0.0] };
        match &self.incoming.0 {
            Kind::None => Some(one(0)),
            Kind::Elevations(values) => {
                let theta = Direction::from_unit(wi).theta_degrees();
                let Bracket { below, above, t } = Bracket::held(values, theta).snapped(ROUNDING);
                Some(Nodes { places: [below as u32, above as u32, 0, 0], weights: [1.0 - t, t, 0.0, 0.0] })
            }
            Kind::Grid(sphere) => {
                let patch = sphere.patch(Direction::from_unit(wi))?;
                let snapped =
                    |t: f32| Bracket { below: 0, above: 1, t: f64::from(t) }.snapped(f64::from(f32::EPSILON)).t;
                let across = snapped(patch.across.t);
                let mut nodes = Nodes { places: [0; AROUND], weights: [0.0; AROUND] };
                for k in 0..AROUND {
                    let (row, column) = (1 + k / 2, 1 + k % 2);
                    let along = snapped(patch.along[row].t);
                    nodes.places[k] = patch.places[row][column];
                    nodes.weights[k] =
                        if row == 1 { 1.0 - across } else { across } * if column == 1 { 1.0 - along } else { along };
                }
                // A pole is one place, however many azimuths it has.
                for k in 0..AROUND {
                    for other in k + 1..AROUND {
                        if nodes.places[other] == nodes.places[k] {
                            nodes.weights[k] += std::mem::take(&mut nodes.weights[other]);
                        }
                    }
                }
                Some(nodes)
            }
        }
    }

    /// The value outside what the outgoing grid covers.
    fn outside(&self) -> f32 {
        self.outgoing.as_ref().map_or(0.0, |sphere| sphere.outside())
    }

    /// The whole spectrum of what was found.
    pub(super) fn spectrum(&self, found: &Found, out: &mut [f32]) {
        self.spectrum_with(self.straight, found, out);
    }

    /// [`Self::spectrum`] with a share of straight lines of its own.
    fn spectrum_with(&self, straight: f32, found: &Found, out: &mut [f32]) {
        if self.values.lambdas() == 1 {
            [out[0]] = self.samples(straight, found, 0);
            return;
        }
        for (start, out) in (0..).step_by(4).zip(out.chunks_mut(4)) {
            let samples = self.samples::<4>(straight, found, start);
            out.copy_from_slice(&samples[..out.len()]);
        }
    }

    /// The stated samples `[outgoing, lambda]` of a slice of the axes before the outgoing one, of a tensor of these entries along
    /// the incoming and the outgoing axis and in a spectrum.
    pub(super) fn slice(&self, [n_in, n_out, lambdas]: [usize; 3], slice: usize) -> Vec<f32> {
        let table = slice / n_in * self.values.incoming() + slice % n_in;
        let places = 0..n_out as u32;
        let sample = |place, lambda| self.values.sample(self.values.numbers::<1>(table, place, lambda)[0]);
        places.flat_map(|place| (0..lambdas).map(move |lambda| sample(place, lambda))).collect()
    }

    /// One sample of what was found.
    pub(super) fn sample(&self, found: &Found, lambda: usize) -> f32 {
        self.samples::<1>(self.straight, found, lambda)[0]
    }

    /// `SIZE` samples from `lambda` on, of the function with a share of straight lines.
    #[inline(always)]
    fn samples<const SIZE: usize>(&self, share: f32, found: &Found, lambda: usize) -> [f32; SIZE] {
        if share == 0.0 {
            return self.curved(found, lambda);
        }
        let straight = self.on_straight_lines(found, lambda);
        if share == 1.0 {
            return straight;
        }
        let curved = self.curved::<SIZE>(found, lambda);
        std::array::from_fn(|l| (1.0 - share) * curved[l] + share * straight[l])
    }

    /// `SIZE` samples from `lambda` on, on straight lines between the samples around; masked ones are left out.
    fn on_straight_lines<const SIZE: usize>(&self, found: &Found, lambda: usize) -> [f32; SIZE] {
        let (mut sums, mut known, mut total) = ([0.0; SIZE], [0.0; SIZE], 0.0);
        for k in 0..found.count {
            let weight = found.weights[k];
            total += weight;
            let mut add = |place: u32, weight: f32| {
                let numbers = self.values.numbers::<SIZE>(found.tables[k], place, lambda);
                for l in 0..SIZE {
                    let sample = self.values.sample(numbers[l]);
                    if !sample.is_nan() {
                        sums[l] += weight * sample;
                        known[l] += weight;
                    }
                }
            };
            match (&found.patches[k], &self.outgoing) {
                (Some(patch), _) => {
                    for (row, across) in [(1, 1.0 - patch.across.t), (2, patch.across.t)] {
                        let t = patch.along[row].t;
                        add(patch.places[row][1], weight * across * (1.0 - t));
                        add(patch.places[row][2], weight * across * t);
                    }
                }
                (None, None) => add(0, weight),
                (None, Some(_)) if self.outside() == 0.0 => known.iter_mut().for_each(|known| *known += weight),
                (None, Some(_)) => {}
            }
        }
        std::array::from_fn(|l| if known[l] <= NO_LIGHT * total { f32::NAN } else { sums[l] / known[l] })
    }

    /// `SIZE` samples from `lambda` on, on curved lines.
    #[inline(always)]
    fn curved<const SIZE: usize>(&self, found: &Found, lambda: usize) -> [f32; SIZE] {
        if let Some(between) = &found.between {
            return self.curved_between(between, found, lambda);
        }
        let mut sums = Part { number: [0.0; SIZE], live: [0.0; SIZE], known: [0.0; SIZE] };
        let mut total = 0.0;
        for k in 0..found.count {
            let weight = found.weights[k];
            total += weight;
            let part = self.part::<SIZE>(found.tables[k], found.patches[k].as_ref(), lambda);
            for l in 0..SIZE {
                sums.number[l] += weight * part.live[l] * part.number[l];
                sums.live[l] += weight * part.live[l];
                sums.known[l] += weight * part.known[l];
            }
        }
        std::array::from_fn(|l| {
            let (live, known) = (sums.live[l], sums.known[l]);
            if known <= NO_LIGHT * total {
                return f32::NAN;
            }
            if live <= NO_LIGHT * total {
                return 0.0;
            }
            let sample = self.values.sample(sums.number[l] / live);
            if live < known { sample * (live / known) } else { sample }
        })
    }

    /// What the table of an incoming place has in a patch.
    #[inline(always)]
    fn part<const SIZE: usize>(&self, table: usize, patch: Option<&Patch>, lambda: usize) -> Part<SIZE> {
        match (patch, &self.outgoing) {
            (Some(patch), _) => self.patch::<SIZE>(table, patch, lambda),
            (None, None) => self.node(table, 0, lambda),
            (None, Some(_)) => {
                let outside = self.outside();
                let known = if outside.is_nan() { 0.0 } else { 1.0 };
                let live = if self.values.is_logarithmic() { 0.0 } else { known };
                Part { number: [0.0; SIZE], live: [live; SIZE], known: [known; SIZE] }
            }
        }
    }

    /// Numbers of one place, with their shares of light and of known samples.
    #[inline(always)]
    fn node<const SIZE: usize>(&self, table: usize, place: u32, lambda: usize) -> Part<SIZE> {
        let mut part =
            Part { number: self.values.numbers::<SIZE>(table, place, lambda), live: [1.0; SIZE], known: [1.0; SIZE] };
        if !self.values.is_whole() {
            for l in 0..SIZE {
                if part.number[l].is_nan() {
                    (part.live[l], part.known[l]) = (0.0, 0.0);
                } else if part.number[l] == f32::NEG_INFINITY {
                    part.live[l] = 0.0;
                }
                if part.live[l] == 0.0 {
                    part.number[l] = 0.0;
                }
            }
        }
        part
    }

    /// Interpolates in a patch: along each row, then across the rows.
    #[inline(always)]
    fn patch<const SIZE: usize>(&self, table: usize, patch: &Patch, lambda: usize) -> Part<SIZE> {
        if !self.values.is_logarithmic() {
            // Straight lines, for which the four samples around are enough.
            let row = |r: usize| {
                let [one, two] = [1, 2].map(|column| self.node(table, patch.places[r][column], lambda));
                straight(&one, &two, patch.along[r].t)
            };
            return straight(&row(1), &row(2), patch.across.t);
        }
        let row = |r: usize| {
            let places = patch.places[r];
            self.mixed(places.map(|place| self.node(table, place, lambda)), &patch.along[r])
        };
        self.mixed([row(0), row(1), row(2), row(3)], &patch.across)
    }

    /// Four parts along a line.
    #[inline(always)]
    fn mixed<const SIZE: usize>(&self, parts: [Part<SIZE>; 4], along: &Along) -> Part<SIZE> {
        let Along { cubic, t } = *along;
        let mut mixed = Part { number: [0.0; SIZE], live: [1.0; SIZE], known: [1.0; SIZE] };
        let [before, one, two, after] = &parts;
        for l in 0..SIZE {
            let (low, high) = (one.number[l], two.number[l]);
            let room = OVERSHOOT * (high - low).abs();
            let sum = cubic[0] * before.number[l] + cubic[1] * low + cubic[2] * high + cubic[3] * after.number[l];
            mixed.number[l] = sum.max(low.min(high) - room).min(low.max(high) + room);
        }
        if self.values.is_whole() {
            return mixed;
        }
        // A cubic where all four have light, else a straight line.
        let mut line = straight(one, two, t);
        for l in 0..SIZE {
            if parts.iter().all(|part| part.live[l] == 1.0) {
                line.number[l] = mixed.number[l];
            }
        }
        line
    }
}

/// Two parts along a straight line, each by the share of light that it stands for.
#[inline(always)]
fn straight<const SIZE: usize>(one: &Part<SIZE>, two: &Part<SIZE>, t: f32) -> Part<SIZE> {
    let between = |one: &[f32; SIZE], two: &[f32; SIZE]| std::array::from_fn(|l| (1.0 - t) * one[l] + t * two[l]);
    let live: [f32; SIZE] = between(&one.live, &two.live);
    let number = std::array::from_fn(|l| {
        let sum = (1.0 - t) * one.live[l] * one.number[l] + t * two.live[l] * two.number[l];
        if live[l] > 0.0 { sum / live[l] } else { 0.0 }
    });
    Part { number, live, known: between(&one.known, &two.known) }
}
