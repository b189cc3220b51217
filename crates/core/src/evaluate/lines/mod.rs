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
mod block;
mod carrying;
mod course;
mod incidences;
mod integral;
mod line;
mod part;
mod sphere;
#[cfg(test)]
mod tests;
mod values;

use super::incoming::{Alignment, Origin, carried_to};
use super::number::Number;
use crate::domain::vector::Vector;
use crate::domain::{Direction, DirectionGrid, Domain};
use crate::numeric::arctangent::atan2_degrees;
use crate::numeric::bracket::Bracket;
use ::wide::f32x4;
use course::{Course, FoundBetween};
use line::{Line, Node};
use part::Sums;
use sphere::{Patch, Sphere};
use values::{Places, Values};

/// Incoming directions around one: two polar angles, two azimuths.
const AROUND: usize = 4;

/// The incoming directions of samples on a grid.
#[derive(Debug)]
pub(super) struct Incoming(Kind);

#[derive(Debug)]
enum Kind {
    None,
    Elevations(Vec<f64>, Box<Line>),
    Grid(Box<Sphere>),
}

impl Incoming {
    /// No incoming direction.
    pub(super) const NONE: Self = Self(Kind::None);

    /// Elevations in degrees, of azimuth 0.
    pub(super) fn elevations(values: &[f64]) -> Self {
        let nodes = values.iter().zip(0..).map(|(&angle, entry)| Node { angle, entry }).collect();
        Self(Kind::Elevations(values.to_vec(), Box::new(Line::new(nodes, false))))
    }

    /// A grid of polar angles and azimuths.
    pub(super) fn grid(grid: &DirectionGrid) -> Self {
        Self(Kind::Grid(Box::new(Sphere::new(grid))))
    }

    /// The place of what is stated for an entry.
    fn stated(&self, entry: usize) -> usize {
        if let Kind::Grid(sphere) = &self.0 { sphere.stated(entry as u32) as usize } else { entry }
    }
}

/// The interpolated function.
#[derive(Debug)]
pub(super) struct Lines {
    incoming: Incoming,
    /// Directions of the incoming entries, those of azimuth 0 for elevations; and as lobes are carried from them.
    directions: Vec<Vector>,
    origins: Vec<Origin>,
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

impl Nodes {
    /// The first place alone.
    const ONE: Self = Self { places: [0; AROUND], weights: [1.0, 0.0, 0.0, 0.0] };
}

impl Found {
    /// No place.
    const NOTHING: Self =
        Self { count: 0, tables: [0; AROUND], weights: [0.0; AROUND], patches: [None; AROUND], between: None };

    /// A patch under one incoming direction.
    fn one(table: usize, patch: Option<Patch>) -> Self {
        let mut found = Self { count: 1, ..Self::NOTHING };
        (found.tables[0], found.weights[0], found.patches[0]) = (table, 1.0, patch);
        found
    }
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
            Kind::None => Places { own: 1, same: &[] },
            Kind::Elevations(values, _) => Places { own: values.len(), same: &[] },
            Kind::Grid(sphere) => Places { own: sphere.grid().len(), same: sphere.same() },
        };
        let places_out = match &outgoing {
            None => Places { own: 1, same: &[] },
            Some(sphere) => Places { own: sphere.grid().len(), same: sphere.same() },
        };
        let values = Values::new(samples, lambdas, &places_in, &places_out);
        let directions: Vec<Vector> = match &incoming.0 {
            Kind::None => vec![[0.0, 0.0, 1.0]],
            Kind::Elevations(values, _) => values.iter().map(|&t| Direction::from_degrees(t, 0.0).xyz()).collect(),
            Kind::Grid(sphere) => {
                let grid = sphere.grid();
                (0..grid.len()).map(|entry| grid.direction(entry).xyz()).collect()
            }
        };
        let origins = directions.iter().map(|&direction| Origin::new(direction)).collect();
        let changes = Vec::new();
        Self {
            incoming,
            directions,
            origins,
            outgoing,
            values,
            straight: 0.0,
            domain,
            alignment,
            changes,
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

    /// The alignment in which lobes are carried from one incoming direction to the next.
    pub(super) fn alignment(&self) -> Alignment {
        self.alignment
    }

    /// The outgoing directions of the quantity.
    pub(super) fn domain(&self) -> Domain {
        self.domain
    }

    /// The alignments that competed, and how much the function changes under each.
    pub(super) fn changes(&self) -> &[(Alignment, f64)] {
        &self.changes
    }

    /// Memory in bytes, without the size of the type.
    pub(super) fn memory(&self) -> usize {
        let incoming = match &self.incoming.0 {
            Kind::None => 0,
            Kind::Elevations(values, line) => size_of_val(&**values) + size_of::<Line>() + line.memory(),
            Kind::Grid(sphere) => size_of::<Sphere>() + sphere.memory(),
        };
        let outgoing = self.outgoing.as_ref().map_or(0, |sphere| size_of::<Sphere>() + sphere.memory());
        let directions = size_of_val(&*self.directions) + size_of_val(&*self.origins);
        let course = self.course.as_ref().map_or(0, |course| course.memory());
        incoming + outgoing + self.values.memory() + directions + course
    }

    /// Everything that is mixed at a place, in the smooth sense; `wi` and `wo` are turned to azimuth 0 of `wi` where incoming
    /// directions are elevations. `None` where `wi` is outside the incoming directions.
    #[inline]
    pub(super) fn smooth(&self, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        if let Some(course) = &self.course {
            return self.smooth_between(course, entry, wi, wo);
        }
        let nodes = self.nodes(wi)?;
        let base = entry * self.values.incoming();
        let origin = Origin::new(wi);
        let mut found = Found::NOTHING;
        for (place, weight) in nodes.places.into_iter().zip(nodes.weights).filter(|(_, weight)| *weight > 0.0) {
            let k = found.count;
            let (there, worth) = if weight == 1.0 || self.alignment == Alignment::None {
                (wo, 1.0)
            } else {
                self.carried(&origin, place, wo)
            };
            found.tables[k] = base + place as usize;
            found.weights[k] = weight as f32 * worth;
            found.patches[k] = self.outgoing.as_ref().and_then(|sphere| sphere.patch(there));
            found.count += 1;
        }
        Some(found)
    }

    /// Where an incoming place has what is seen along `wo` under `wi`, and how much that is worth.
    #[inline]
    fn carried(&self, wi: &Origin, place: u32, wo: Vector) -> (Vector, f32) {
        let (alignment, is_free) = self.way(wo[2]);
        let (there, worth) = carried_to(alignment, is_free, *wi, self.origins[place as usize], wo.map(|x| x as f32));
        (there.map(f64::from), worth)
    }

    /// The alignment of directions on the side of the height `z`, and whether there is no horizon: what goes through a
    /// surface turns, and a phase function, which alone turns on the whole sphere, has none.
    #[inline]
    fn way(&self, z: f64) -> (Alignment, bool) {
        let is_whole = self.domain == Domain::Sphere;
        let alignment = if is_whole && z < 0.0 { Alignment::Rotation } else { self.alignment };
        (alignment, is_whole && self.alignment == Alignment::Rotation)
    }

    /// Everything that is mixed at an outgoing direction under one stated incoming direction, as it is stated.
    fn under(&self, entry: usize, node: usize, wo: Direction) -> Found {
        let patch = self.outgoing.as_ref().and_then(|sphere| sphere.patch(wo.xyz()));
        Found::one(entry * self.values.incoming() + self.incoming.stated(node), patch)
    }

    /// The nearest stated place, in the piecewise constant sense. `None` where `wi` is outside the incoming directions.
    pub(super) fn nearest(&self, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        let nodes = self.nodes(wi)?;
        let heaviest = (0..AROUND).max_by(|&a, &b| nodes.weights[a].total_cmp(&nodes.weights[b])).unwrap_or(0);
        let table = entry * self.values.incoming() + nodes.places[heaviest] as usize;
        let patch = self.outgoing.as_ref().and_then(|sphere| sphere.nearest(Direction::from_unit(wo)));
        Some(Found::one(table, patch))
    }

    /// The incoming places around a direction, with weights that add up to 1.
    #[inline(always)]
    fn nodes(&self, wi: Vector) -> Option<Nodes> {
        match &self.incoming.0 {
            Kind::None => Some(Nodes::ONE),
            Kind::Elevations(_, line) => Some(nodes_between(line, elevation(wi))),
            Kind::Grid(sphere) => nodes_around(sphere, wi),
        }
    }

    /// The whole spectrum at a place, as [`Lines::smooth`] and [`Lines::spectrum`] have it; `None` where `wi` is
    /// outside the incoming directions.
    #[inline]
    pub(super) fn smooth_spectrum(&self, entry: usize, wi: Vector, wo: Vector, out: &mut [f32]) -> Option<()> {
        if self.course.is_some() {
            self.spectrum(&self.smooth(entry, wi, wo)?, out);
            return Some(());
        }
        match out.len() {
            1 => self.smooth_samples::<f32>(entry, wi, wo)?.write_some(out),
            2..=4 => self.smooth_samples::<f32x4>(entry, wi, wo)?.write_some(out),
            _ => self.spectrum(&self.smooth(entry, wi, wo)?, out),
        }
        Some(())
    }

    /// A sample or four at a place; `None` where `wi` is outside. Nothing that is found goes through memory here.
    #[inline(always)]
    fn smooth_samples<T: Number>(&self, entry: usize, wi: Vector, wo: Vector) -> Option<T> {
        let nodes = self.nodes(wi)?;
        let base = entry * self.values.incoming();
        let mut sums = Sums::nothing();
        for (&place, &weight) in nodes.places.iter().zip(&nodes.weights).filter(|(_, weight)| **weight > 0.0) {
            let (there, worth) = if weight == 1.0 || self.alignment == Alignment::None {
                (wo, 1.0)
            } else {
                self.carried(&Origin::new(wi), place, wo)
            };
            let at = (base + place as usize, weight as f32 * worth);
            let patch = self.outgoing.as_ref().and_then(|sphere| sphere.patch(there));
            self.add(&mut sums, self.straight, at, patch.as_ref(), 0);
        }
        Some(self.settled(&sums, self.straight))
    }

    /// The whole spectrum of what was found.
    #[inline]
    pub(super) fn spectrum(&self, found: &Found, out: &mut [f32]) {
        self.spectrum_with(self.straight, found, out);
    }

    /// The stated samples `[outgoing, lambda]` of a slice of the axes before the outgoing one, of a tensor of these entries along
    /// the incoming and the outgoing axis and in a spectrum.
    pub(super) fn slice(&self, [n_in, n_out, lambdas]: [usize; 3], slice: usize) -> Vec<f32> {
        let table = slice / n_in * self.values.incoming() + self.incoming.stated(slice % n_in);
        let place = |entry| self.outgoing.as_ref().map_or(entry, |sphere| sphere.stated(entry));
        let sample = |place, lambda| self.values.sample(self.values.numbers::<f32>(table, place, lambda));
        (0..n_out as u32).flat_map(|o| (0..lambdas).map(move |lambda| sample(place(o), lambda))).collect()
    }

    /// One sample of what was found.
    pub(super) fn sample(&self, found: &Found, lambda: usize) -> f32 {
        self.samples(self.straight, found, lambda)
    }
}

/// The elevation of an incoming direction, of any azimuth, in degrees.
#[inline(always)]
fn elevation([x, y, z]: Vector) -> f64 {
    atan2_degrees((x * x + y * y).sqrt(), z)
}

/// The two elevations around one.
#[inline(always)]
fn nodes_between(line: &Line, elevation: f64) -> Nodes {
    let ([below, above], t) = line.between(elevation);
    Nodes { places: [below, above, 0, 0], weights: [1.0 - t, t, 0.0, 0.0] }
}

/// The places of a grid around a direction; `None` outside what it covers.
fn nodes_around(sphere: &Sphere, wi: Vector) -> Option<Nodes> {
    let patch = sphere.patch(wi)?;
    let snapped = |t: f32| Bracket { below: 0, above: 1, t: f64::from(t) }.snapped(f64::from(f32::EPSILON)).t;
    let across = snapped(patch.across.t);
    let mut nodes = Nodes { places: [0; AROUND], weights: [0.0; AROUND] };
    for k in 0..AROUND {
        let (row, column) = (1 + k / 2, 1 + k % 2);
        let along = snapped(patch.along(row).t);
        nodes.places[k] = sphere.first_of(patch.place(row, column));
        nodes.weights[k] = if row == 1 { 1.0 - across } else { across } * if column == 1 { 1.0 - along } else { along };
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
