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

use super::material::Form;
use super::planes::{Cell, Planes};
use super::{EvaluateError, Material, unfit};
use crate::domain::{Axis, Direction, Domain, Layout, Measurement, Tensor};

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
        let layout = Layout::of(self.quantity(), self.axes()).ok()?;
        Some(&self.axes()[layout.incoming?])
    }

    /// The direction that an entry of the incoming axis stands for: a centroid, an elevation at azimuth 0.
    fn incoming_direction(&self, entry: usize) -> Option<Direction> {
        match self.incoming_axis()? {
            Axis::Triangles(mesh) => Some(mesh.centroid(entry)),
            Axis::Elevation(values) => Some(Direction::from_degrees(values[entry], 0.0)),
            _ => None,
        }
    }

    fn indices(&self) -> Vec<usize> {
        let layout = Layout::of(self.quantity(), self.axes());
        layout.map(|layout| self.axes()[..layout.indices].iter().map(Axis::len).collect()).unwrap_or_default()
    }

    /// The index that `entry` is the row-major number of.
    fn index_of(&self, mut entry: usize) -> Vec<usize> {
        let mut index = self.indices();
        for i in index.iter_mut().rev() {
            let length = *i;
            *i = entry % length;
            entry /= length;
        }
        index
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

    /// The samples as they are opened: those decoded, but for the deviation that [`Material::report`] states.
    pub fn measurement(&self) -> Result<Measurement, EvaluateError> {
        let lambdas = self.lambdas();
        let samples = match &self.form {
            Form::Samples { samples, .. } => samples.clone(),
            Form::Planes { planes, .. } => {
                let mut samples = vec![0.0; self.axes().iter().map(Axis::len).product()];
                for (cell, spectrum) in samples.chunks_exact_mut(lambdas).enumerate() {
                    fill(planes, cell, spectrum);
                }
                samples
            }
        };
        let tensor = Tensor::new(self.axes().to_vec(), samples);
        let tensor = tensor.map_err(|error| EvaluateError::Unfit(error.to_string()))?;
        Ok(Measurement { quantity: self.quantity(), unit: self.unit(), sampling: self.sampling, tensor })
    }

    /// The mesh of the outgoing axis, or why there is nothing to ask.
    fn needs_outgoing(&self, what: &str) -> Result<crate::domain::TriangleMesh, EvaluateError> {
        match &self.outgoing {
            Some(lookup) => Ok(lookup.mesh()),
            None => unfit(format!("this {} has no outgoing axis: there is no {what} to report", self.quantity())),
        }
    }
}

/// The spectrum of one cell.
fn fill(planes: &Planes, cell: usize, spectrum: &mut [f32]) {
    match planes.cell(cell) {
        Cell::Live => {
            let mut row = [0.0; super::planes::MOST_PLANES];
            let coefficients = planes.row(cell);
            row[..coefficients.len()].copy_from_slice(coefficients);
            planes.spectrum(&row, 1.0, spectrum);
        }
        Cell::Zero => spectrum.fill(0.0),
        Cell::Masked => spectrum.fill(f32::NAN),
    }
}

/// Whether a domain has both hemispheres.
fn is_whole(domain: Domain) -> bool {
    domain == Domain::Sphere
}
