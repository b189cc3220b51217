//! A measurement that was read, put on axes and compressed.

use super::error::PipelineError;
use super::provenance::provenance;
use super::report::{Report, report};
use super::request::{Curve, Request};
use super::source::Source;
use crate::compress::{self, Settings};
use crate::domain::{Axis, Progress, Silent};
use crate::evaluate::{state_levels, straight_lines_for_flux};
use crate::formats::Acquisition;
use crate::projection::{self, Projected};

/// A material and its report.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/illuminant_D65.csv");
/// use wavelume_formats::pipeline::Request;
/// let compressed = wavelume_formats::read(path)?.compress(&Request::er_l2(0.001))?;
/// let (bytes, report) = (compressed.bytes, compressed.report);
/// println!("{} bytes, {:.0} : 1, er(L2) {}", bytes.len(), report.ratio_bytes, report.errors.er_l2);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The file.
    pub bytes: Vec<u8>,
    /// What was achieved.
    pub report: Report,
}

/// Puts a measurement on the axes that `request` asks for.
pub fn project(acquisition: &Acquisition, request: &Request) -> Result<Projected, PipelineError> {
    Ok(projection::project(acquisition, &request.axes()?)?)
}

/// Projects and compresses a measurement that was read.
pub fn compress(source: &Source, request: &Request, progress: &dyn Progress) -> Result<Outcome, PipelineError> {
    let acquisition = &source.acquisition;
    let Projected { measurement, coverage, filled, .. } = project(acquisition, request)?;
    let on_grid = measurement.tensor.axes().iter().any(|axis| matches!(axis, Axis::Grid(_)));
    let settings = Settings {
        target: request.target,
        policy: request.policy,
        basis: request.basis.clone(),
        floor: request.floor,
        albedo_error: request.albedo_error,
        metadata: request.metadata.then(|| provenance(source, request, &filled, on_grid)),
        random_access: request.random_access,
        // Where no function can be made of the measurement, there is no flux to keep.
        straight_lines: match request.interpolation {
            Curve::Cubic => straight_lines_for_flux(&measurement).unwrap_or(0),
            Curve::Linear => u8::MAX,
        },
    };
    let mut compressed = compress::compress(&measurement, &settings, progress)?;
    if on_grid && let Ok(bytes) = state_levels(compressed.bytes.clone(), &measurement) {
        compressed.bytes = bytes;
    }
    // The measurement is not needed any more, and decoding needs the memory.
    let samples = measurement.tensor.len();
    drop(measurement);
    let report = report(acquisition, request.target, samples, coverage, &compressed);
    Ok(Outcome { bytes: compressed.bytes, report })
}

impl Source {
    /// Puts the measurement on the axes that `request` asks for and compresses it to the promise; the errors in the report
    /// are measured on the decoded file.
    pub fn compress(&self, request: &Request) -> Result<Outcome, PipelineError> {
        compress(self, request, &Silent)
    }
}
