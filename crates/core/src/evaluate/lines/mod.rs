//! Function of samples on a grid of directions: the sample itself at a stated direction, interpolated between them.
//!
//! * Over **outgoing** directions: a Catmull-Rom cubic along azimuth, then along the polar angle, over the poles and
//!   across mirror planes. It interpolates logarithms if no sample is negative. Between two entries the value leaves
//!   their range by at most a tenth of it. Data with negative samples are interpolated linearly without logarithms.
//! * Over **incoming** directions: linear in the polar angle (and azimuth), of logarithms. Each stated direction is
//!   looked up at the outgoing direction to which its lobe is aligned ([`super::incoming::Alignment`]).
//! * Zero and masked samples have no logarithm: the fraction of live samples around is interpolated linearly, too.
//! * A fraction, 0..=1, of linear interpolation of the samples themselves can be mixed in. Readers of luminaires and of
//!   measured materials usually draw straight lines.
//! * Directions that the file states several times have the mean of the stated samples: all azimuths at a pole, both
//!   ends of a closed circle.

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

/// Number of incoming directions around one: two polar angles, two azimuths.
const AROUND: usize = 4;

/// Incoming directions of samples on a grid.
#[derive(Debug)]
pub(super) struct Incoming(Kind);

#[derive(Debug)]
enum Kind {
    None,
    Elevations(Vec<f64>, Box<Line>),
    Grid(Box<Sphere>),
}

impl Incoming {
    /// Absence of an incoming direction.
    pub(super) const NONE: Self = Self(Kind::None);

    /// Elevations in degrees, at azimuth 0.
    pub(super) fn elevations(values: &[f64]) -> Self {
        let nodes = values.iter().zip(0..).map(|(&angle, entry)| Node { angle, entry }).collect();
        Self(Kind::Elevations(values.to_vec(), Box::new(Line::new(nodes, false))))
    }

    /// Grid of polar angles and azimuths.
    pub(super) fn grid(grid: &DirectionGrid) -> Self {
        Self(Kind::Grid(Box::new(Sphere::new(grid))))
    }

    /// Place of the sample as stated for an entry.
    fn stated(&self, entry: usize) -> usize {
        if let Kind::Grid(sphere) = &self.0 { sphere.stated(entry as u32) as usize } else { entry }
    }
}

/// Interpolated function of samples on a grid.
#[derive(Debug)]
pub(super) struct Lines {
    incoming: Incoming,
    /// Directions of the incoming entries, at azimuth 0 for elevations; and the same prepared for alignment.
    directions: Vec<Vector>,
    origins: Vec<Origin>,
    outgoing: Option<Box<Sphere>>,
    values: Values,
    /// Fraction of linear interpolation of samples, 0..=1.
    straight: f32,
    domain: Domain,
    alignment: Alignment,
    /// Candidate alignments, and the function's change of shape under each.
    changes: Vec<(Alignment, f64)>,
    /// Interpolation between incidences; `None` if it is linear in logarithms.
    course: Option<Box<Course>>,
}

/// Incoming places around a direction.
#[derive(Clone, Copy, Debug)]
struct Nodes {
    places: [u32; AROUND],
    weights: [f64; AROUND],
}

/// Places to be mixed for a query.
#[derive(Clone, Debug)]
pub(super) struct Found {
    count: usize,
    tables: [usize; AROUND],
    weights: [f32; AROUND],
    /// Patches under each incoming place; `None` outside what the grid covers or without an outgoing axis.
    patches: [Option<Patch>; AROUND],
    /// Data of a divisor or a cubic, if in use.
    between: Option<FoundBetween>,
}

impl Nodes {
    /// Single first place.
    const ONE: Self = Self { places: [0; AROUND], weights: [1.0, 0.0, 0.0, 0.0] };
}

impl Found {
    /// Empty lookup.
    const NOTHING: Self =
        Self { count: 0, tables: [0; AROUND], weights: [0.0; AROUND], patches: [None; AROUND], between: None };

    /// Patch under one incoming direction.
    fn one(table: usize, patch: Option<Patch>) -> Self {
        let mut found = Self { count: 1, ..Self::NOTHING };
        (found.tables[0], found.weights[0], found.patches[0]) = (table, 1.0, patch);
        found
    }
}

impl Lines {
    /// Function of samples `[entry][incoming][outgoing][lambda]`, with lobes aligned by `alignment`.
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

    /// Sets the fraction of linear interpolation of samples, 0..=1.
    pub(super) fn with_straight(self, straight: f32) -> Self {
        Self { straight, ..self }
    }

    /// Fraction of linear interpolation of samples, 0..=1.
    pub(super) fn straight(&self) -> f32 {
        self.straight
    }

    /// Alignment of lobes between incoming directions.
    pub(super) fn alignment(&self) -> Alignment {
        self.alignment
    }

    /// Outgoing domain of the quantity.
    pub(super) fn domain(&self) -> Domain {
        self.domain
    }

    /// Candidate alignments, and the function's change of shape under each.
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

    /// Finds all places mixed at a query of the smooth form; `None` if `wi` is outside the incoming directions. If
    /// those are elevations, `wi` and `wo` are already rotated to azimuth 0 of `wi`.
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

    /// Direction under an incoming place that corresponds to `wo` under `wi`, and its weight.
    #[inline]
    fn carried(&self, wi: &Origin, place: u32, wo: Vector) -> (Vector, f32) {
        let (alignment, is_free) = self.way(wo[2]);
        let (there, worth) = carried_to(alignment, is_free, *wi, self.origins[place as usize], wo.map(|x| x as f32));
        (there.map(f64::from), worth)
    }

    /// Alignment of directions on the side of the height `z`, and true if there is no horizon. Transmitted light
    /// rotates. Only a phase function rotates on the whole sphere; it has no horizon.
    #[inline]
    fn way(&self, z: f64) -> (Alignment, bool) {
        let is_whole = self.domain == Domain::Sphere;
        let alignment = if is_whole && z < 0.0 { Alignment::Rotation } else { self.alignment };
        (alignment, is_whole && self.alignment == Alignment::Rotation)
    }

    /// Lookup of an outgoing direction under one stated incoming direction, with the stated samples.
    fn under(&self, entry: usize, node: usize, wo: Direction) -> Found {
        let patch = self.outgoing.as_ref().and_then(|sphere| sphere.patch(wo.xyz()));
        Found::one(entry * self.values.incoming() + self.incoming.stated(node), patch)
    }

    /// Nearest stated place, for the piecewise constant form; `None` if `wi` is outside the incoming directions.
    pub(super) fn nearest(&self, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        let nodes = self.nodes(wi)?;
        let heaviest = (0..AROUND).max_by(|&a, &b| nodes.weights[a].total_cmp(&nodes.weights[b])).unwrap_or(0);
        let table = entry * self.values.incoming() + nodes.places[heaviest] as usize;
        let patch = self.outgoing.as_ref().and_then(|sphere| sphere.nearest(Direction::from_unit(wo)));
        Some(Found::one(table, patch))
    }

    /// Incoming places around a direction, with weights that sum to 1.
    #[inline(always)]
    fn nodes(&self, wi: Vector) -> Option<Nodes> {
        match &self.incoming.0 {
            Kind::None => Some(Nodes::ONE),
            Kind::Elevations(_, line) => Some(nodes_between(line, elevation(wi))),
            Kind::Grid(sphere) => nodes_around(sphere, wi),
        }
    }

    /// Writes the whole spectrum at a place, as [`Lines::smooth`] and [`Lines::spectrum`] give it; `None` if `wi` is
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

    /// Returns one sample, or four, at a place; `None` if `wi` is outside. The lookup stays in registers.
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

    /// Writes the whole spectrum at the places found.
    #[inline]
    pub(super) fn spectrum(&self, found: &Found, out: &mut [f32]) {
        self.spectrum_with(self.straight, found, out);
    }

    /// Stated samples `[outgoing, lambda]` of one slice of the axes before the outgoing one. The shape is the number of
    /// entries of the incoming and the outgoing axis and of samples in a spectrum.
    pub(super) fn slice(&self, [n_in, n_out, lambdas]: [usize; 3], slice: usize) -> Vec<f32> {
        let table = slice / n_in * self.values.incoming() + self.incoming.stated(slice % n_in);
        let place = |entry| self.outgoing.as_ref().map_or(entry, |sphere| sphere.stated(entry));
        let sample = |place, lambda| self.values.sample(self.values.numbers::<f32>(table, place, lambda));
        (0..n_out as u32).flat_map(|o| (0..lambdas).map(move |lambda| sample(place(o), lambda))).collect()
    }

    /// Sample at the places found, at one wavelength.
    pub(super) fn sample(&self, found: &Found, lambda: usize) -> f32 {
        self.samples(self.straight, found, lambda)
    }
}

/// Elevation in degrees of an incoming direction of any azimuth.
#[inline(always)]
fn elevation([x, y, z]: Vector) -> f64 {
    atan2_degrees((x * x + y * y).sqrt(), z)
}

/// Two elevations around one, with linear weights.
#[inline(always)]
fn nodes_between(line: &Line, elevation: f64) -> Nodes {
    let ([below, above], t) = line.between(elevation);
    Nodes { places: [below, above, 0, 0], weights: [1.0 - t, t, 0.0, 0.0] }
}

/// Places of a grid around a direction; `None` outside what it covers.
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
    // A pole is one place for all its azimuths.
    for k in 0..AROUND {
        for other in k + 1..AROUND {
            if nodes.places[other] == nodes.places[k] {
                nodes.weights[k] += std::mem::take(&mut nodes.weights[other]);
            }
        }
    }
    Some(nodes)
}
