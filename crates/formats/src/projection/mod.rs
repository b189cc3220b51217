//! Samples as the instrument took them → a tensor of cell averages on chosen axes, with a coverage report.

mod angles;
mod averages;
mod bands;
mod grid;
mod levels;
mod modelled;
mod on_axes;
mod planes;
mod resampling;
mod samples;
mod scattered;
mod spectral;
#[cfg(test)]
mod tests;

pub use samples::error_at_samples;
pub use scattered::{Regions, ScatterReport, Scores};

use crate::domain::{AxisError, Measurement, TensorError, WavelengthGrid};
use crate::formats::{Acquisition, Samples};
use serde::Serialize;

/// The axes the user asks for; what is not given is chosen from the data's own density.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AxesRequest {
    /// Subdivision level of the incoming triangles.
    pub incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    pub outgoing_level: Option<u8>,
    /// Wavelengths to resample to.
    pub wavelengths: Option<WavelengthGrid>,
    /// The relative error that is promised later: levels for scattered directions represent what was measured to half of it
    /// (1 % if none is named).
    pub target: Option<f64>,
}

/// The relative error of which levels take half, if none is named.
const TARGET: f64 = 0.01;

impl AxesRequest {
    fn target(&self) -> f64 {
        self.target.unwrap_or(TARGET)
    }
}

/// A projected measurement.
#[derive(Clone, Debug)]
pub struct Projected {
    /// The tensor and what it is.
    pub measurement: Measurement,
    /// What the cells stand on.
    pub coverage: Coverage,
    /// Which cells are filled (continued, mirrored or exchanged, not measured): one for each spectrum of the tensor, row-major;
    /// empty where none is.
    pub filled: Vec<bool>,
}

/// What the cells of a projection stand on.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// Cells of directions (spectra, not samples).
    pub cells: u64,
    /// Cells with a sample inside, or data that were on their final axes already.
    pub measured: u64,
    /// Cells between samples.
    pub interpolated: u64,
    /// Cells in holes or beyond the outermost samples, filled by a rule that the notes declare.
    #[serde(skip_serializing_if = "is_zero")]
    pub filled: u64,
    /// Cells outside what was measured: masked, or 0 where the format's standard says so.
    pub empty: u64,
    /// Why these axes: one sentence each.
    pub notes: Vec<String>,
    /// Errors at the samples, and at withheld ones, of data at scattered directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scatter: Option<Box<ScatterReport>>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Why a measurement cannot be put on the axes asked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProjectionError {
    /// A request that the data cannot answer.
    #[error("{0}")]
    Unfit(String),
    /// The axes are out of their limits.
    #[error(transparent)]
    Axes(#[from] AxisError),
    /// The tensor cannot be made.
    #[error(transparent)]
    Tensor(#[from] TensorError),
}

/// Projects `acquisition` onto the axes of `request`.
///
/// Samples on angles become averages of their bilinear interpolant over triangles (isotropic incoming elevations stay
/// as they are); samples on final axes stay, or become averages over coarser triangles; a function of the file is averaged
/// over triangles, by |cos θ| of the outgoing direction; samples at scattered directions become averages of local fits
/// (isotropic elevations stay, holes are filled by rules that the notes declare, and marked); wavelengths asked for become averages over their bands. The result is `[index…, incoming, outgoing, spectral]`, NaN where nothing was measured.
pub fn project(acquisition: &Acquisition, request: &AxesRequest) -> Result<Projected, ProjectionError> {
    let instead = match &acquisition.samples {
        Samples::Grid(grid) => planes::instead(acquisition.quantity, grid),
        _ => None,
    };
    if let (Samples::Grid(grid), Some(_)) = (&acquisition.samples, &instead) {
        grid::check_values(grid)?;
    }
    let samples = instead.as_ref().map_or(&acquisition.samples, |(samples, _)| samples);
    let mut projected = project_samples(acquisition, samples, request)?;
    if let Some((_, note)) = &instead {
        projected.coverage.notes.insert(0, (*note).to_owned());
    }
    if matches!(samples, Samples::Grid(_)) {
        projected.coverage.notes.extend(samples::coarseness(acquisition, &projected.measurement, request));
    }
    Ok(projected)
}

fn project_samples(
    acquisition: &Acquisition,
    samples: &Samples,
    request: &AxesRequest,
) -> Result<Projected, ProjectionError> {
    match samples {
        Samples::OnAxes { tensor, sampling } => on_axes::project(acquisition, tensor, *sampling, request),
        Samples::Grid(grid) => grid::project(acquisition, grid, request),
        Samples::Scattered(scattered) => scattered::project(acquisition, scattered, request),
        Samples::Function(modelled) => modelled::project(acquisition, modelled, request),
    }
}
