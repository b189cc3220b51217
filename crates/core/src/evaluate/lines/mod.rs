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
use crate::domain::vector::Vector;
use crate::domain::{Direction, DirectionGrid, Domain};
use crate::numeric::arctangent::atan2_degrees;
use crate::numeric::bracket::Bracket;
use crate::numeric::number::Number;
use ::wide::f32x4;
use course::{Course, FoundBetween};
use line::Line;
pub(super) use line::Node;
use part::Sums;
pub(super) use sphere::{Borders, azimuth_nodes};
use sphere::{Patch, Sphere};
use values::{Places, Values};

/// Number of measured incoming directions around a queried one: two polar angles times two azimuths.
const AROUND: usize = 4;

/// Measured incoming directions of samples on a grid.
#[derive(Debug)]
pub(super) struct Incoming(Kind);

#[derive(Debug)]
enum Kind {
    None,
    Elevations(Vec<f64>, Box<Line>),
    Grid(Box<Sphere>),
}

impl Incoming {
    /// Empty list of incoming directions, for data without an incoming axis.
    pub(super) const NONE: Self = Self(Kind::None);

    /// Incoming directions given by elevations in degrees, at azimuth 0.
    pub(super) fn elevations(values: &[f64]) -> Self {
        let nodes = values.iter().zip(0..).map(|(&angle, entry)| Node { angle, entry }).collect();
        Self(Kind::Elevations(values.to_vec(), Box::new(Line::new(nodes, false))))
    }

    /// Incoming directions on a grid of polar angles and azimuths.
    pub(super) fn grid(grid: &DirectionGrid, borders: Borders) -> Self {
        Self(Kind::Grid(Box::new(Sphere::new(grid, borders))))
    }

    /// Number of the table that holds the original samples of an incoming direction, before directions that coincide
    /// are averaged.
    fn stated(&self, entry: usize) -> usize {
        if let Kind::Grid(sphere) = &self.0 { sphere.stated(entry as u32) as usize } else { entry }
    }
}

/// Function interpolated between samples on a grid of polar angles and azimuths.
#[derive(Debug)]
pub(super) struct Lines {
    incoming: Incoming,
    /// Measured incoming directions as unit vectors; if only elevations were measured, their azimuth is 0. Then the
    /// same directions together with the cosine and sine of their azimuth.
    directions: Vec<Vector>,
    origins: Vec<Origin>,
    outgoing: Option<Box<Sphere>>,
    values: Values,
    /// Weight, 0..=1, of linear interpolation of samples in an interpolated value. Cubic interpolation of logarithms
    /// has the rest of the weight.
    straight: f32,
    domain: Domain,
    alignment: Alignment,
    /// Candidate rules by which lobes follow the incoming direction, each with the change of the function's shape under
    /// it. That is the standard deviation of ln(f₁ / f₂), where f₁ and f₂ are values of the material's function at
    /// aligned outgoing directions under neighbouring incoming directions; it is 0 if lobes keep their shape.
    changes: Vec<(Alignment, f64)>,
    /// Interpolation between incoming directions with a divisor (model divided out before interpolation) or a cubic;
    /// `None` if it is linear in logarithms.
    course: Option<Box<Course>>,
}

/// Measured incoming directions around a queried one, with interpolation weights.
#[derive(Clone, Copy, Debug)]
struct Nodes {
    places: [u32; AROUND],
    weights: [f64; AROUND],
}

/// Samples that determine the value for a pair of directions, with their weights.
#[derive(Clone, Debug)]
pub(super) struct Found {
    count: usize,
    tables: [usize; AROUND],
    weights: [f32; AROUND],
    /// For each measured incoming direction around the queried one, the samples around the outgoing direction; `None`
    /// outside the grid or without an outgoing axis.
    patches: [Option<Patch>; AROUND],
    /// Data for cubic interpolation between incoming directions, or for interpolation of samples that are first divided
    /// by a model; `None` if neither is used.
    between: Option<FoundBetween>,
}

impl Nodes {
    /// Selection of the first measured incoming direction alone.
    const ONE: Self = Self { places: [0; AROUND], weights: [1.0, 0.0, 0.0, 0.0] };
}

impl Found {
    /// Initial state of the search for the samples that determine the value at a query: none found yet.
    const NOTHING: Self =
        Self { count: 0, tables: [0; AROUND], weights: [0.0; AROUND], patches: [None; AROUND], between: None };

    /// Search result for a query at one measured incoming direction: the number of its table of samples, with weight 1,
    /// and the samples around the outgoing direction.
    fn one(table: usize, patch: Option<Patch>) -> Self {
        let mut found = Self { count: 1, ..Self::NOTHING };
        (found.tables[0], found.weights[0], found.patches[0]) = (table, 1.0, patch);
        found
    }

    /// Search result at the same incoming directions with nothing measured at the outgoing direction.
    pub(super) fn without_samples(self) -> Self {
        Self { patches: [None; AROUND], between: None, ..self }
    }
}

impl Lines {
    /// Builds the function of samples `[combination of indices][incoming][outgoing][wavelength]`, with lobes aligned
    /// between incoming directions by `alignment`.
    pub(super) fn new(
        samples: &[f32],
        lambdas: usize,
        incoming: Incoming,
        outgoing: Option<(&DirectionGrid, Borders)>,
        (domain, alignment): (Domain, Alignment),
    ) -> Self {
        let outgoing = outgoing.map(|(grid, borders)| Box::new(Sphere::new(grid, borders)));
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

    /// Sets the weight, 0..=1, of linear interpolation of samples in an interpolated value. Cubic interpolation of
    /// logarithms has the rest of the weight.
    pub(super) fn with_straight(self, straight: f32) -> Self {
        Self { straight, ..self }
    }

    /// Returns the weight, 0..=1, of linear interpolation of samples in an interpolated value. Cubic interpolation of
    /// logarithms has the rest of the weight.
    pub(super) fn straight(&self) -> f32 {
        self.straight
    }

    /// Returns the rule by which lobes follow the incoming direction in interpolation.
    pub(super) fn alignment(&self) -> Alignment {
        self.alignment
    }

    /// Domain of the outgoing directions of the quantity.
    pub(super) fn domain(&self) -> Domain {
        self.domain
    }

    /// Candidate rules by which lobes follow the incoming direction, each with the change of the function's shape under
    /// it. That is the standard deviation of ln(f₁ / f₂), where f₁ and f₂ are values of the material's function at
    /// aligned outgoing directions under neighbouring incoming directions; it is 0 if lobes keep their shape.
    pub(super) fn changes(&self) -> &[(Alignment, f64)] {
        &self.changes
    }

    /// Heap memory in bytes of the interpolated function: samples and lookup tables.
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

    /// Finds the samples that determine the smoothly interpolated value for a pair of directions; `None` if `wi` is
    /// outside the measured incoming directions. If these are elevations, both vectors are already rotated so that `wi`
    /// has azimuth 0.
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

    /// Outgoing direction to which `wo` moves when lobes follow the incoming direction from `wi` to measured incoming
    /// direction number `place`. Also returns a factor on the interpolation weight of this measured direction, near 0
    /// where moved lobes reach the horizon.
    #[inline]
    fn carried(&self, wi: &Origin, place: u32, wo: Vector) -> (Vector, f32) {
        let (alignment, is_free) = self.way(wo[2]);
        let (there, worth) = carried_to(alignment, is_free, *wi, self.origins[place as usize], wo.map(|x| x as f32));
        (there.map(f64::from), worth)
    }

    /// Rule by which lobes move with the incoming direction, for outgoing directions whose z coordinate has the sign of
    /// `z`. Light transmitted through a surface rotates with the incoming direction. The flag is true for a phase
    /// function, which alone rotates on the whole sphere and has no horizon.
    #[inline]
    fn way(&self, z: f64) -> (Alignment, bool) {
        let is_whole = self.domain == Domain::Sphere;
        let alignment = if is_whole && z < 0.0 { Alignment::Rotation } else { self.alignment };
        (alignment, is_whole && self.alignment == Alignment::Rotation)
    }

    /// Finds the samples around the outgoing direction `wo` that were measured under incoming direction number `node`,
    /// before samples of coinciding incoming directions are averaged.
    fn under(&self, entry: usize, node: usize, wo: Direction) -> Found {
        let patch = self.outgoing.as_ref().and_then(|sphere| sphere.patch(wo.xyz()));
        Found::one(entry * self.values.incoming() + self.incoming.stated(node), patch)
    }

    /// Finds the measured pair of directions nearest to a query, for piecewise constant interpolation; `None` if `wi`
    /// is outside the measured incoming directions.
    pub(super) fn nearest(&self, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        let nodes = self.nodes(wi)?;
        let heaviest = (0..AROUND).max_by(|&a, &b| nodes.weights[a].total_cmp(&nodes.weights[b])).unwrap_or(0);
        let table = entry * self.values.incoming() + nodes.places[heaviest] as usize;
        let patch = self.outgoing.as_ref().and_then(|sphere| sphere.nearest(Direction::from_unit(wo)));
        Some(Found::one(table, patch))
    }

    /// Measured incoming directions around a queried one, with interpolation weights that sum to 1; `None` outside the
    /// measured directions.
    #[inline(always)]
    fn nodes(&self, wi: Vector) -> Option<Nodes> {
        match &self.incoming.0 {
            Kind::None => Some(Nodes::ONE),
            Kind::Elevations(_, line) => Some(nodes_between(line, elevation(wi))),
            Kind::Grid(sphere) => nodes_around(sphere, wi),
        }
    }

    /// Writes the smoothly interpolated spectrum for a pair of directions, equal to that of [`Lines::smooth`] and
    /// [`Lines::spectrum`]; `None` if `wi` is outside the measured incoming directions.
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

    /// Interpolates the value at the first wavelength, or at the first four wavelengths, for a pair of directions;
    /// `None` if `wi` is outside the measured incoming directions. Search results stay in processor registers.
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

    /// Writes the spectrum at a queried pair of directions, one value for each wavelength of the data. It is
    /// interpolated between the samples around the query, listed by `found`.
    #[inline]
    pub(super) fn spectrum(&self, found: &Found, out: &mut [f32]) {
        self.spectrum_with(self.straight, found, out);
    }

    /// Original samples `[outgoing, wavelength]` for one combination of positions on the axes before the outgoing one;
    /// `slice` is its row-major number. The array argument holds the numbers of incoming directions, of outgoing
    /// directions and of samples in a spectrum.
    pub(super) fn slice(&self, [n_in, n_out, lambdas]: [usize; 3], slice: usize) -> Vec<f32> {
        let table = slice / n_in * self.values.incoming() + self.incoming.stated(slice % n_in);
        let place = |entry| self.outgoing.as_ref().map_or(entry, |sphere| sphere.stated(entry));
        let sample = |place, lambda| self.values.sample(self.values.numbers::<f32>(table, place, lambda));
        (0..n_out as u32).flat_map(|o| (0..lambdas).map(move |lambda| sample(place(o), lambda))).collect()
    }

    /// Interpolates at wavelength number `lambda` between the samples around a query, listed by `found`.
    pub(super) fn sample(&self, found: &Found, lambda: usize) -> f32 {
        self.samples(self.straight, found, lambda)
    }
}

/// Angle in degrees between an incoming direction and the normal.
#[inline(always)]
fn elevation([x, y, z]: Vector) -> f64 {
    atan2_degrees((x * x + y * y).sqrt(), z)
}

/// Two measured elevations around the queried one, with linear interpolation weights.
#[inline(always)]
fn nodes_between(line: &Line, elevation: f64) -> Nodes {
    let ([below, above], t) = line.between(elevation);
    Nodes { places: [below, above, 0, 0], weights: [1.0 - t, t, 0.0, 0.0] }
}

/// Four measured directions of a grid around an incoming direction, with interpolation weights; `None` outside what the
/// grid covers.
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
