//! An exported file, and a summary of what it holds of the material.

use super::format::ExportFormat;
use super::lamp_errors::LampErrors;
use super::measure::AddedError;
use serde::Serialize;

/// Exported file with a summary of its contents.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// Contents, resolution and errors of the file.
    pub about: Summary,
}

/// Contents, resolution and errors of an exported file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The format.
    pub format: ExportFormat,
    /// Sampling of the material, as text for people: for example the number of angles.
    pub resolution: String,
    /// The unit of the numbers.
    pub unit: String,
    /// Properties of the material that the file does not hold, one sentence each.
    pub lost: Vec<String>,
    /// Number of values written as 0 because the material is masked there.
    pub filled: usize,
    /// Number of values written as 0 because the format cannot hold negative numbers.
    pub clipped: usize,
    /// Luminaires: flux of the file divided by that of the material, minus 1.
    pub flux_error: Option<f64>,
    /// Luminaires: error added by the file in photometric terms: peak, flux, rms relative to the peak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lamp: Option<LampErrors>,
    /// Error that the file adds to that of the material.
    pub error: AddedError,
}
