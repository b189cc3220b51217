//! Places of a material that reports refer to, and the rows of its axes.

use crate::domain::{Axis, Direction, TriangleMesh};
use crate::evaluate::error::{EvaluateError, Need, QueryError, unfit};
use crate::evaluate::material::Material;

/// Value that a physical check of a material reports, such as the largest albedo, with its indices, incoming direction
/// and wavelength.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Spot {
    /// Value that the report found, for example an albedo.
    pub value: f64,
    /// Position of the reported value on each index axis (axis of the samples before those of directions and
    /// wavelength).
    pub index: Vec<usize>,
    /// Polar angle and azimuth of the incoming direction in degrees; `None` for quantities without an incoming
    /// direction.
    pub wi: Option<[f64; 2]>,
    /// Index, counted from 0, of the spectral sample to which the reported value belongs.
    pub lambda: usize,
    /// Wavelength in nm at which the report found its value, for example an albedo; `None` for data without
    /// wavelengths.
    pub wavelength: Option<f64>,
}

/// Polar angle and azimuth of a direction in degrees.
pub(super) fn degrees(direction: Direction) -> [f64; 2] {
    [direction.theta_degrees(), direction.phi_degrees()]
}

impl Material {
    /// Axis of the incoming directions; `None` for quantities without one.
    pub(super) fn incoming_axis(&self) -> Option<&Axis> {
        self.layout().incoming.map(|axis| &self.axes()[axis])
    }

    /// Sampled incoming direction number `entry`: a triangle's centroid, or an elevation at azimuth 0.
    pub(super) fn incoming_direction(&self, entry: usize) -> Option<Direction> {
        let geometry = self.geometry();
        geometry.has_incoming().then(|| Direction::from_unit(geometry.incoming_direction(entry)))
    }

    /// Wavelength in nm of spectral sample number `lambda`.
    pub(super) fn wavelength(&self, lambda: usize) -> Option<f64> {
        self.geometry().grid().map(|grid| grid.at(lambda))
    }

    /// Describes where a report found `value`: adds the indices (positions on the axes before the directions), the
    /// incoming direction and the wavelength. `row` is the row-major position `[combination of indices, incoming
    /// direction]`, `lambda` the number of the spectral sample.
    pub(super) fn spot(&self, value: f64, row: usize, lambda: usize) -> Spot {
        let [n_in, ..] = self.geometry().shape();
        let (entry, incoming) = (row / n_in, row % n_in);
        Spot {
            value,
            index: self.index_of(entry),
            wi: self.incoming_direction(incoming).map(degrees),
            lambda,
            wavelength: self.wavelength(lambda),
        }
    }

    /// Triangle mesh of the outgoing directions. If there is none, fails with a message that says which request,
    /// `need`, cannot be met without it.
    pub(super) fn needs_outgoing(&self, need: Need) -> Result<TriangleMesh, EvaluateError> {
        match self.geometry().mesh() {
            Some(lookup) => Ok(lookup.mesh()),
            None => unfit(QueryError::NoOutgoing { need, quantity: self.quantity() }),
        }
    }
}
