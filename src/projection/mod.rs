//! Samples as the instrument took them → a tensor of cell averages on chosen axes, with a coverage report.

use crate::domain::{AxisError, ErrorReport, Measurement, TensorError, WavelengthGrid};
use crate::formats::Acquisition;
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
}

/// A projected measurement.
#[derive(Clone, Debug)]
pub struct Projected {
    /// The tensor and what it is.
    pub measurement: Measurement,
    /// What the cells stand on.
    pub coverage: Coverage,
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
    /// Cells outside what was measured: masked, or 0 where the format's standard says so.
    pub empty: u64,
    /// Why these axes: one sentence each.
    pub notes: Vec<String>,
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
pub fn project(acquisition: &Acquisition, request: &AxesRequest) -> Result<Projected, ProjectionError> {
    let _ = (acquisition, request);
    unimplemented!()
}

/// The errors of `measurement` (projected, or decoded) at the original samples of the file, looked up piecewise constant;
/// `None` where the file's samples are the tensor's own.
pub fn error_at_samples(acquisition: &Acquisition, measurement: &Measurement) -> Option<ErrorReport> {
    let _ = (acquisition, measurement);
    unimplemented!()
}
