//! Places of a material that reports refer to, and the rows of its axes.

use crate::domain::{Axis, Direction, TriangleMesh};
use crate::evaluate::error::{EvaluateError, Need, QueryError, unfit};
use crate::evaluate::material::Material;

/// Value and its place in a material.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Spot {
    /// Value found.
    pub value: f64,
    /// One entry for each leading index axis.
    pub index: Vec<usize>,
    /// Theta and phi of the incoming direction in degrees; `None` for quantities without.
    pub wi: Option<[f64; 2]>,
    /// Index of the sample in a spectrum.
    pub lambda: usize,
    /// Wavelength of the sample in nm; `None` for data without wavelengths.
    pub wavelength: Option<f64>,
}

/// Theta and phi of a direction in degrees.
pub(super) fn degrees(direction: Direction) -> [f64; 2] {
    [direction.theta_degrees(), direction.phi_degrees()]
}

impl Material {
    /// Incoming axis; `None` for quantities without.
    pub(super) fn incoming_axis(&self) -> Option<&Axis> {
        self.layout().incoming.map(|axis| &self.axes()[axis])
    }

    /// Direction of an entry of the incoming axis: a centroid, or an elevation at azimuth 0.
    pub(super) fn incoming_direction(&self, entry: usize) -> Option<Direction> {
        let geometry = self.geometry();
        geometry.has_incoming().then(|| Direction::from_unit(geometry.incoming_direction(entry)))
    }

    /// Wavelength of a sample in nm.
    pub(super) fn wavelength(&self, lambda: usize) -> Option<f64> {
        self.geometry().grid().map(|grid| grid.at(lambda))
    }

    /// Describes `value` at sample `lambda` of row `[entry of the index axes, incoming entry]`.
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

    /// Mesh of the outgoing axis; fails, with a reason that depends on `need`, if there is none.
    pub(super) fn needs_outgoing(&self, need: Need) -> Result<TriangleMesh, EvaluateError> {
        match self.geometry().mesh() {
            Some(lookup) => Ok(lookup.mesh()),
            None => unfit(QueryError::NoOutgoing { need, quantity: self.quantity() }),
        }
    }
}
