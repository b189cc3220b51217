//! Directions of one side of a measured table, the solid angles that they represent, and interpolation between them.

use crate::domain::{self, Axis, Direction, DirectionGrid, Frame, TriangleMesh};
use crate::formats::{Angles, AzimuthExtent, Azimuths};
use crate::projection::angles::{self, HORIZON, Interpolant, check};
use crate::projection::error::Role;
use crate::projection::planes::has_area;
use std::borrow::Cow;

/// Number of parts into which the interval between two polar angles is split to integrate a weight over it.
const PARTS: usize = 16;
/// Degrees by which a polar angle may lie outside the first or last angle of a table and still count as equal to it.
const ROUNDING: f64 = 1e-6;
/// Weight of a single sample above which an interpolated value counts as the measured value of that sample.
const STATED: f64 = 1.0 - 1e-6;

/// Incoming or outgoing directions of a measured table.
pub(super) enum Side<'a> {
    /// A grid of polar angles, with or without azimuths.
    Angles(Cow<'a, Angles>),
    /// Triangles of a triangulated sphere of directions.
    Triangles(TriangleMesh),
}

/// Interpolated value as a weighted sum of samples: (sample, weight) pairs.
pub(super) struct Mix {
    pub(super) samples: [(usize, f64); 4],
    /// True if one sample has all the weight, up to rounding: the interpolated value then is a measured value.
    pub(super) is_stated: bool,
}

impl<'a> Side<'a> {
    /// Creates the incoming or outgoing directions of a measured table from polar angles and azimuths; `None` if they
    /// form no grid.
    pub(super) fn of_angles(angles: Cow<'a, Angles>) -> Option<Self> {
        check(Role::Incoming, &angles).ok().map(|()| Self::Angles(angles))
    }

    /// Creates the directions of a tensor axis; `None` for axes that are neither triangles nor angles.
    pub(super) fn of_axis(axis: &Axis) -> Option<Self> {
        let angles = match axis {
            Axis::Triangles(mesh) => return Some(Self::Triangles(*mesh)),
            Axis::Elevation(theta) => {
                let (first, last) = (*theta.first()?, *theta.last()?);
                Angles { theta: theta.clone(), covers: (first, last), phi: None }
            }
            Axis::Grid(grid) => angles_of(grid)?,
            _ => return None,
        };
        check(Role::Incoming, &angles).ok().map(|()| Self::Angles(Cow::Owned(angles)))
    }

    /// Returns the number of incoming or outgoing directions on this side of the table.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Angles(angles) => angles::count(angles),
            Self::Triangles(mesh) => mesh.len(),
        }
    }

    /// Returns true if the directions are polar angles without azimuths.
    pub(super) fn is_isotropic(&self) -> bool {
        matches!(self, Self::Angles(angles) if angles.phi.is_none())
    }

    /// Returns polar angle and azimuth, in degrees, of the direction with index `number` in a measured table. The
    /// azimuth is 0 if the directions of the table have none.
    pub(super) fn degrees(&self, number: usize) -> [f64; 2] {
        match self {
            Self::Angles(angles) => {
                let phi = angles.phi.as_ref().map_or(&[0.0][..], |azimuths| &azimuths.phi);
                [angles.theta[number / phi.len()], phi[number % phi.len()]]
            }
            Self::Triangles(mesh) => {
                let direction = mesh.centroid(number);
                [direction.theta_degrees(), direction.phi_degrees()]
            }
        }
    }

    /// Returns the integral of |cos θ| over the solid angle that each direction represents, in sr. Returns `None` if
    /// the directions cover no area, as in scan planes.
    pub(super) fn projected_solid_angles(&self) -> Option<Vec<f64>> {
        let angles = match self {
            Self::Triangles(mesh) => return Some((0..mesh.len()).map(|i| mesh.projected_solid_angle(i)).collect()),
            Self::Angles(angles) => angles,
        };
        if !has_area(angles) {
            return None;
        }
        let around = match &angles.phi {
            Some(Azimuths { phi, extent: AzimuthExtent::Sector }) => (phi[phi.len() - 1] - phi[0]).to_radians(),
            _ => std::f64::consts::TAU,
        };
        let interpolant = Interpolant::new(angles, true);
        let mean = interpolant.azimuth_mean();
        Some(rings(angles).into_iter().flat_map(|ring| mean.iter().map(move |share| ring * around * share)).collect())
    }

    /// Interpolates a table at polar angle and azimuth, in degrees; `None` outside the samples.
    pub(super) fn at(&self, [theta, phi]: [f64; 2]) -> Option<Mix> {
        let direction = Direction::from_degrees(theta, phi);
        let angles = match self {
            Self::Triangles(mesh) => {
                let cell = mesh.locate(direction)?;
                return Some(Mix { samples: [(cell, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)], is_stated: true });
            }
            Self::Angles(angles) => angles,
        };
        let (first, last) = (angles.theta[0], angles.theta[angles.theta.len() - 1]);
        if theta < first - ROUNDING || theta > last + ROUNDING {
            return None;
        }
        let interpolant = Interpolant::new(angles, true);
        let stencil = interpolant.at(Direction::from_degrees(theta.clamp(first, last), phi))?;
        let columns = interpolant.columns();
        let weight = |row: usize, column: usize| {
            let ((row, a), (column, b)) = (stencil.rows[row], stencil.columns[column]);
            (row * columns + column, a * b)
        };
        let samples = [weight(0, 0), weight(0, 1), weight(1, 0), weight(1, 1)];
        let is_stated = samples.iter().any(|(_, weight)| *weight > STATED);
        Some(Mix { samples, is_stated })
    }
}

/// Returns, for each polar angle, the integral of |cos θ| sin θ dθ times the piecewise linear function that is 1 at
/// this angle. Beyond the outermost angles the function is constant to the ends of the covered range, and to the
/// horizon between two sides.
fn rings(angles: &Angles) -> Vec<f64> {
    let theta = &angles.theta;
    let mut weights = vec![0.0; theta.len()];
    let mut add = |from: f64, to: f64, [low, high]: [usize; 2]| {
        let step = (to - from).to_radians() / PARTS as f64;
        for part in 0..PARTS {
            let share = (part as f64 + 0.5) / PARTS as f64;
            let (sin, cos) = libm::sincos((from + share * (to - from)).to_radians());
            let weight = sin * cos.abs() * step;
            weights[low] += (1.0 - share) * weight;
            weights[high] += share * weight;
        }
    };
    let last = theta.len() - 1;
    add(angles.covers.0, theta[0], [0, 0]);
    add(theta[last], angles.covers.1, [last, last]);
    for (i, &[a, b]) in theta.array_windows().enumerate() {
        if a <= HORIZON && b > HORIZON {
            add(a, HORIZON, [i, i]);
            add(HORIZON, b, [i + 1, i + 1]);
        } else {
            add(a, b, [i, i + 1]);
        }
    }
    weights
}

/// Returns the angles of a grid whose polar axis is the surface normal; `None` for grids in other frames and for
/// mirrored polar angles.
fn angles_of(grid: &DirectionGrid) -> Option<Angles> {
    if grid.frame() != Frame::Surface || grid.is_polar_mirrored() {
        return None;
    }
    let phi = match grid.azimuths() {
        None => None,
        Some(azimuths) => {
            let extent = match azimuths.extent {
                domain::AzimuthExtent::Circle => AzimuthExtent::Circle,
                domain::AzimuthExtent::Mirrored => AzimuthExtent::Mirrored,
                domain::AzimuthExtent::Sector => AzimuthExtent::Sector,
                _ => return None,
            };
            Some(Azimuths { phi: azimuths.angles.clone(), extent })
        }
    };
    Some(Angles { theta: grid.polar().to_vec(), covers: grid.covers(), phi })
}
