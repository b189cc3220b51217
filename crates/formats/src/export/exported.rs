//! An exported file, and a summary of what it holds of the material.

use super::lamp_errors::LampErrors;
use super::measure::AddedError;
use serde::Serialize;

/// Exported file with a summary of its contents.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Contents of the exported file.
    pub bytes: Vec<u8>,
    /// Contents, resolution and errors of the exported file.
    pub about: Summary,
}

/// Contents, resolution and errors of an exported file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Warning that the file adds more error than the material promises; `None` if it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
    /// Name of the export format of the file.
    pub format: &'static str,
    /// Resolution at which the export sampled the material, in words: for example the number of angles.
    pub resolution: String,
    /// Unit of the numbers in the exported file.
    pub unit: String,
    /// Properties of the material that the exported file does not hold, one sentence each.
    pub lost: Vec<String>,
    /// Number of values written as 0 because the material has no measured value there.
    pub filled: usize,
    /// Number of values written as 0 because the format cannot hold negative numbers.
    pub clipped: usize,
    /// Relative error of the luminous or radiant flux of an exported luminaire: flux of the file divided by that of the
    /// material, minus 1.
    pub flux_error: Option<f64>,
    /// Photometric errors that the export of a luminaire adds: peak, flux, and rms relative to the peak. `None` for
    /// other materials.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lamp: Option<LampErrors>,
    /// Error that the export adds to that of the material.
    pub error: AddedError,
}
