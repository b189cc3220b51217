//! What physics asks of a material: energy, flux, normalisation, reciprocity; reports, and functions that keep to it.
//!
//! Nothing is repaired unless it is asked for: [`Material::energy`] and [`Material::reciprocity`] only say, [`Preparation`]
//! changes samples before a material is used and counts what it changed, [`Material::symmetric_spectrum`] is another
//! function than [`Material::spectrum`].

mod energy;
mod flux;
mod preparation;
mod reciprocity;
mod reflectance;
mod symmetric;
#[cfg(test)]
mod tests;

pub use energy::{AlbedoReport, Allowance, EnergyReport, NormalisationReport, Verdict};
pub use flux::FluxReport;
pub use preparation::{Preparation, Prepared};
pub use reciprocity::{ReciprocityReport, WorstPair};
pub use symmetric::Mean;

use super::{EvaluateError, Material, unfit};
use crate::domain::{Axis, Direction, Domain};

/// A value, and where it was found.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Spot {
    /// The value.
    pub value: f64,
    /// One entry for each leading opaque axis.
    pub index: Vec<usize>,
    /// The incoming direction: theta and phi in degrees.
    pub wi: Option<[f64; 2]>,
    /// The number of the sample in a spectrum.
    pub lambda: usize,
    /// Its wavelength in nm.
    pub wavelength: Option<f64>,
}

fn degrees(direction: Direction) -> [f64; 2] {
    [direction.theta_degrees(), direction.phi_degrees()]
}

impl Material {
    /// The incoming axis, if there is one.
    fn incoming_axis(&self) -> Option<&Axis> {
        self.layout().incoming.map(|axis| &self.axes()[axis])
    }

    /// The direction that an entry of the incoming axis stands for: a centroid, an elevation at azimuth 0.
    fn incoming_direction(&self, entry: usize) -> Option<Direction> {
        self.has_incoming().then(|| Direction::from_unit(self.incoming_directions[entry]))
    }

    /// The wavelength of a sample in nm.
    fn wavelength(&self, lambda: usize) -> Option<f64> {
        self.grid().map(|grid| grid.at(lambda))
    }

    /// `value` at sample `lambda` of the row `[entry of the opaque axes, incoming entry]`.
    fn spot(&self, value: f64, row: usize, lambda: usize) -> Spot {
        let (entry, incoming) = (row / self.shape[0], row % self.shape[0]);
        Spot {
            value,
            index: self.index_of(entry),
            wi: self.incoming_direction(incoming).map(degrees),
            lambda,
            wavelength: self.wavelength(lambda),
        }
    }

    /// The mesh of the outgoing axis, or why there is nothing to ask.
    fn needs_outgoing(&self, what: &str) -> Result<crate::domain::TriangleMesh, EvaluateError> {
        match &self.outgoing {
            Some(lookup) => Ok(lookup.mesh()),
            None => unfit(format!("this {} has no outgoing axis: there is no {what} to report", self.quantity())),
        }
    }
}

/// Whether a domain has both hemispheres.
fn is_whole(domain: Domain) -> bool {
    domain == Domain::Sphere
}
