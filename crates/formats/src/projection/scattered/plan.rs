//! Plan of the fits: clouds of samples, entries of the incoming axis, levels and numbers of neighbours.

use super::cells::{Fitted, Parts};
use super::cloud::{self, Cloud, Incoming, one_azimuth};
use super::extent::{Joint, incoming_domain, is_one_sided, outgoing_domain, spacing};
use super::rows::{Kind, Rows};
use super::trials;
use crate::domain::vector::Vector;
use crate::domain::{Axis, Direction, Domain, Note, Quantity};
use crate::formats::Scattered;
use crate::notes::{FitNote, ProjectionNote};
use crate::projection::averages::OCTANT_DEGREES;
use crate::projection::error::{LevelError, ProjectionError, Role, ScatteredError};
use crate::projection::levels::{self, Choice, Entries, MAX_CHOSEN_SAMPLES};
use crate::projection::request::AxesRequest;
use rayon::prelude::*;

/// Finest subdivision level of outgoing triangles chosen automatically, with triangles of 0.6°. Raising it resolves
/// finer detail with larger tensors.
const FINEST: u8 = 7;
/// Upper bound on the number of triangles, or of pairs of them, after refinement: a million. Beyond it, files and times
/// grow while errors hardly fall.
const MAX_REFINED_CELLS: usize = 1 << 20;
/// Upper bound on the number of spectral bands from which settings such as the number of neighbours are chosen. Raising
/// it is slower.
const BANDS: usize = 8;
/// Distance that neighbouring incoming directions get if several are fitted together, in spacings of outgoing samples.
/// Raising it mixes fewer incoming directions.
const JOINT_STRETCH: f64 = 1.5;
/// Largest distance of an incoming direction of the tensor from the nearest measured one at which values are computed
/// for it, in spacings of the measured incoming directions. The tensor has no values under incoming directions farther
/// away. Raising it extrapolates farther.
const JOINT_REACH: f64 = 1.5;
/// Upper bound on the size of the parts into which a triangle is split for fits, as a fraction of the radius of a fit.
/// Raising it takes fewer fits.
const PART: f64 = 0.7;

/// Position on the incoming axis of the tensor: its direction, and the number of the group of samples to which the
/// values under this direction are fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) wi: Vector,
    pub(super) cloud: usize,
}

/// Assignment of scattered samples to tensor cells, which are pairs of an incoming position and an outgoing triangle.
#[derive(Clone, Debug)]
pub(super) struct Located {
    /// Index `[incoming position, outgoing triangle]` of the cell of each sample; `None` if the sample is not used or
    /// lies outside the axes.
    pub(super) cells: Vec<Option<usize>>,
    /// One flag for each cell of the tensor: true if the cell contains a sample or a mirror image of one.
    pub(super) has_sample: Vec<bool>,
    /// For each triangle or polar angle on the incoming axis of the tensor, the indices of the samples whose incoming
    /// direction it contains or is nearest to.
    pub(super) rows: Vec<Vec<u32>>,
}

/// Choices for the projection of scattered samples: axes, groups of samples, and settings of the fits.
pub(super) struct Plan {
    pub(super) isotropic: bool,
    /// True if only one side of the plane of incidence was measured, and mirror images of the samples replace the
    /// other.
    pub(super) unfolded: bool,
    pub(super) directions: Vec<(Vector, Vector)>,
    pub(super) clouds: Vec<Cloud>,
    pub(super) entries: Vec<Entry>,
    /// Polar angles of the positions on the incoming axis of the tensor, in degrees.
    pub(super) elevations: Vec<f64>,
    incoming: Option<Choice>,
    pub(super) outgoing: Choice,
    pub(super) parts: Parts,
    pub(super) neighbours: usize,
    /// Fraction of the variance of a value that is independent between bands; the rest is common to all bands of a
    /// sample.
    own_noise: f64,
    incoming_reach: f64,
    /// Usual distance between neighbouring samples under one incoming direction, in radians.
    pub(super) spacing: f64,
    sides_apart: bool,
    /// Values of all samples in [`BANDS`] evenly spread spectral bands; `None` if the samples have no more bands than
    /// that.
    thin: Option<Rows<'static>>,
    pub(super) notes: Vec<Note>,
}

/// Returns the role (incoming or outgoing) of the directions that become triangles, and the level requested for them.
/// Fails if a level is requested for directions that do not exist.
fn asked(of: &Scattered, request: &AxesRequest, lone: bool) -> Result<(Role, Option<u8>), ProjectionError> {
    let (role, level, other, unused) = if lone {
        (Role::Incoming, request.incoming_level, Role::Outgoing, request.outgoing_level)
    } else {
        let unused = if of.incoming.is_empty() { request.incoming_level } else { None };
        (Role::Outgoing, request.outgoing_level, Role::Incoming, unused)
    };
    if unused.is_some() {
        return Err(ProjectionError::Level { role: other, level: LevelError::NoDirections });
    }
    Ok((role, level))
}

/// Treats the incoming directions of a hemispherical reflectance as outgoing ones, which triangles represent; `None`
/// for other data.
fn turned(quantity: Quantity, scattered: &Scattered) -> Option<Scattered> {
    (quantity == Quantity::Reflectance && scattered.outgoing.is_empty()).then(|| Scattered {
        incoming: Vec::new(),
        outgoing: scattered.incoming.clone(),
        isotropic: scattered.isotropic,
        spectral: None,
        values: Vec::new(),
        sigma: None,
    })
}

impl Plan {
    /// Chooses axes, groups of samples and settings of the local fits for projecting samples at scattered directions.
    /// `rows` are the values of the samples, `channels` the number of spectral values per direction of the result.
    pub(super) fn new(
        quantity: Quantity,
        scattered: &Scattered,
        rows: &Rows<'_>,
        request: &AxesRequest,
        channels: usize,
    ) -> Result<Self, ProjectionError> {
        let turned = turned(quantity, scattered);
        let lone = turned.is_some();
        let of = turned.as_ref().unwrap_or(scattered);
        let mut notes = Vec::new();
        let single = !of.isotropic && one_azimuth(of);
        if single {
            notes.push(ProjectionNote::OneAzimuthIsotropic.into());
        }
        let isotropic = !of.incoming.is_empty() && (of.isotropic || single);
        let domain = outgoing_domain(quantity);
        let directions = cloud::directions(of, isotropic);
        let inside = |row: u32| match domain {
            Domain::Hemisphere => directions[row as usize].1[2] >= 0.0,
            Domain::Lower => directions[row as usize].1[2] <= 0.0,
            Domain::Sphere => true,
        };
        let live: Vec<u32> = (0..rows.kinds.len() as u32)
            .filter(|&row| rows.kinds[row as usize] != Kind::Missing && inside(row))
            .collect();
        let outside = (0..rows.kinds.len() as u32).filter(|&row| !inside(row)).count();
        if outside > 0 {
            notes.push(FitNote::SamplesBeyond { samples: outside, domain }.into());
        }
        if live.is_empty() {
            return Err(ScatteredError::Beside { count: rows.kinds.len(), domain, quantity }.into());
        }
        let unfolded = isotropic && is_one_sided(&live, &directions);
        if unfolded {
            notes.push(FitNote::OneSideMirrored.into());
        }
        let groups = cloud::incoming(of, isotropic, &live);
        let joint = Joint::of(&groups, live.len());
        let area = if domain == Domain::Sphere { 2.0 } else { 1.0 } * std::f64::consts::TAU;
        let stretch = joint.as_ref().map_or(0.0, |joint| {
            let outgoing = (area * joint.count as f64 / live.len() as f64).sqrt();
            JOINT_STRETCH * outgoing / joint.spacing
        });
        let cloud = |rows: &[u32]| {
            let cloud = Cloud::new(rows.iter().copied(), &directions, quantity, stretch);
            if unfolded { cloud.mirrored() } else { cloud }
        };
        let (clouds, elevations) = clouds(groups, &live, cloud);
        let spacing = joint.as_ref().map_or_else(
            || spacing(&clouds),
            |joint| (area * joint.count as f64 / live.len() as f64).sqrt().to_degrees(),
        );
        let (role, level) = asked(of, request, lone)?;
        if let (true, Some(_)) = (isotropic, request.incoming_level) {
            let level = LevelError::Isotropic { elevations: elevations.len() };
            return Err(ProjectionError::Level { role: Role::Incoming, level });
        }
        let outgoing = levels::choose_by_distance(role, domain, spacing, level)?;
        let incoming = match (&joint, isotropic) {
            (Some(joint), false) => {
                let degrees = joint.spacing.to_degrees();
                Some(levels::choose_by_distance(
                    Role::Incoming,
                    incoming_domain(&live, &directions),
                    degrees,
                    request.incoming_level,
                )?)
            }
            _ => None,
        };
        let mut plan = Self {
            isotropic,
            unfolded,
            entries: Vec::new(),
            elevations,
            incoming,
            outgoing,
            parts: Parts::Divided(0),
            neighbours: 1,
            own_noise: 0.0,
            incoming_reach: joint.as_ref().map_or(f64::INFINITY, |joint| JOINT_REACH * joint.spacing),
            spacing: spacing.to_radians(),
            sides_apart: quantity == Quantity::Bsdf,
            thin: rows.thinned(scattered.sigma.as_deref(), BANDS),
            directions,
            clouds,
            notes,
        };
        plan.own_noise = trials::own_noise(&plan.clouds, plan.fitted(plan.few(rows), 0));
        plan.neighbours = trials::neighbours(&plan.clouds, plan.fitted(plan.few(rows), 0), domain);
        plan.lower_to_fit(channels);
        plan.refine(request.finer, channels);
        plan.entries = plan.entries();
        let reach = (plan.neighbours as f64 / std::f64::consts::PI).sqrt() * spacing;
        let parts = libm::log2(OCTANT_DEGREES / (PART * reach)).ceil().clamp(0.0, 8.0) as u32;
        let level = u32::from(plan.outgoing.mesh.level());
        plan.parts = if parts < level { Parts::Shared } else { Parts::Divided(parts - level) };
        plan.describe(role, of);
        Ok(plan)
    }

    fn entries(&self) -> Vec<Entry> {
        match (&self.incoming, self.elevations.is_empty()) {
            (Some(choice), _) => {
                let mesh = choice.mesh;
                (0..mesh.len()).map(|i| Entry { wi: mesh.centroid(i).xyz(), cloud: 0 }).collect()
            }
            (None, true) => vec![Entry { wi: [0.0, 0.0, 1.0], cloud: 0 }],
            (None, false) => {
                let one = self.clouds.len() == 1;
                let at = |theta: f64| Direction::from_degrees(theta, 0.0).xyz();
                let entry = |(i, &theta)| Entry { wi: at(theta), cloud: if one { 0 } else { i } };
                self.elevations.iter().enumerate().map(entry).collect()
            }
        }
    }

    /// Returns the values of all samples in [`BANDS`] evenly spread spectral bands. Returns the complete values `rows`
    /// if the samples have no more than [`BANDS`] bands.
    pub(super) fn few<'b>(&'b self, rows: &'b Rows<'b>) -> &'b Rows<'b> {
        self.thin.as_ref().unwrap_or(rows)
    }

    /// Returns the samples and settings for local polynomial fits to group number `cloud` of the samples: those of one
    /// incoming polar angle, or all. `rows` are the values of all samples of the file.
    pub(super) fn fitted<'b>(&'b self, rows: &'b Rows<'b>, cloud: usize) -> Fitted<'b> {
        Fitted {
            rows,
            cloud: &self.clouds[cloud],
            neighbours: self.neighbours,
            noise: 1.0 / (1.0 - self.own_noise + self.own_noise / rows.width as f64),
            incoming_reach: self.incoming_reach,
            sides_apart: self.sides_apart,
        }
    }

    pub(super) fn incoming_axis(&self) -> Option<Axis> {
        let triangles = self.incoming.as_ref().map(|choice| Axis::Triangles(choice.mesh));
        triangles.or_else(|| (!self.elevations.is_empty()).then(|| Axis::Elevation(self.elevations.clone())))
    }

    /// Finds, for each measured sample at scattered directions, the cell of the tensor that contains its incoming and
    /// outgoing direction.
    pub(super) fn located(&self) -> Located {
        let mesh = self.outgoing.mesh;
        let axis = self.incoming_axis();
        let mut located = Located {
            cells: vec![None; self.directions.len()],
            has_sample: vec![false; self.entries.len() * mesh.len()],
            rows: vec![Vec::new(); self.entries.len()],
        };
        for (i, cloud) in self.clouds.iter().enumerate() {
            let place = |(&wi, &wo): (&Vector, &Vector)| {
                let entry = match &axis {
                    _ if self.clouds.len() > 1 => Some(i),
                    None => Some(0),
                    Some(axis) => entry_of(axis, wi, Direction::from_unit(wi).theta_degrees()),
                };
                (entry, mesh.locate(Direction::from_unit(wo)))
            };
            let places: Vec<_> = cloud.wi.par_iter().zip(&cloud.wo).map(place).collect();
            for ((at, &row), &(entry, triangle)) in cloud.rows.iter().enumerate().zip(&places) {
                let Some(entry) = entry.filter(|&entry| entry < self.entries.len()) else { continue };
                let cell = triangle.map(|triangle| entry * mesh.len() + triangle);
                if let Some(cell) = cell {
                    located.has_sample[cell] = true;
                }
                if at < cloud.own() {
                    located.rows[entry].push(row);
                    located.cells[row as usize] = cell;
                }
            }
        }
        located
    }

    fn size(&self, channels: usize) -> usize {
        let entries = self.incoming.as_ref().map_or(self.elevations.len().max(1), |choice| choice.mesh.len());
        entries.saturating_mul(self.outgoing.mesh.len()).saturating_mul(channels)
    }

    fn lower_to_fit(&mut self, channels: usize) {
        let fixed = Entries::Fixed(self.elevations.len().max(1));
        let incoming = self.incoming.as_mut().map_or(fixed, Entries::Chosen);
        levels::lower_to_fit(incoming, Entries::Chosen(&mut self.outgoing), channels);
    }

    /// Refines the outgoing triangles `times` times by one level, or as far as the size limits allow.
    fn refine(&mut self, times: u8, channels: usize) {
        for _ in 0..times {
            let is_small = |limit: usize, inner: usize| self.size(inner).saturating_mul(4) <= limit;
            let fits = is_small(MAX_REFINED_CELLS, 1) && is_small(MAX_CHOSEN_SAMPLES, channels);
            if !fits || self.outgoing.mesh.level() >= FINEST || !self.outgoing.raise() {
                return;
            }
        }
    }

    fn describe(&mut self, role: Role, of: &Scattered) {
        let mut notes = Vec::new();
        if self.isotropic {
            let is_measured = self.clouds.len() == self.elevations.len();
            notes.push(FitNote::Elevations { elevations: self.elevations.len(), is_measured }.into());
        }
        notes.extend(self.incoming.iter().map(|choice| choice.note(Role::Incoming)));
        notes.push(self.outgoing.note(role));
        let fits = FitNote::Quadratic {
            role: role.name(),
            neighbours: self.neighbours,
            is_by_slopes: self.clouds[0].slopes,
            is_by_uncertainty: of.sigma.is_some(),
        };
        notes.push(fits.into());
        notes.append(&mut self.notes);
        self.notes = notes;
    }
}

/// Creates a k-d tree of the samples under each incoming polar angle, or one of all samples. Also returns the incoming
/// polar angles in degrees if the data are isotropic; otherwise none.
fn clouds(groups: Incoming, live: &[u32], cloud: impl Fn(&[u32]) -> Cloud + Sync) -> (Vec<Cloud>, Vec<f64>) {
    match groups {
        Incoming::None | Incoming::Directions(_) => (vec![cloud(live)], Vec::new()),
        Incoming::Elevations(elevations, groups) => (groups.par_iter().map(|rows| cloud(rows)).collect(), elevations),
        Incoming::AllElevations(elevations) => (vec![cloud(live)], elevations),
    }
}

/// Returns the position on the incoming axis for a direction with polar angle `theta` in degrees: the triangle that
/// contains it, or the nearest polar angle.
pub(super) fn entry_of(axis: &Axis, d: Vector, theta: f64) -> Option<usize> {
    match axis {
        Axis::Triangles(mesh) => mesh.locate(Direction::from_unit(d)),
        Axis::Elevation(values) => {
            let above = values.partition_point(|&v| v < theta);
            let below = above.saturating_sub(1);
            let far = |i: usize| values.get(i).map_or(f64::INFINITY, |v| (v - theta).abs());
            Some(if far(above) < far(below) { above } else { below })
        }
        _ => None,
    }
}
