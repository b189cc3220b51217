//! An exported file, and a summary of what it holds of the material.

use super::format::ExportFormat;
use super::lamp_errors::LampErrors;
use super::measure::AddedError;
use serde::Serialize;

/// A file, and what is to be known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// What of the material it holds, and how densely.
    pub about: Summary,
}

/// What of a material a file holds, and how densely.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The format.
    pub format: ExportFormat,
    /// Where the material was evaluated, for people.
    pub resolution: String,
    /// The unit of the numbers.
    pub unit: String,
    /// What the file does not hold of the material.
    pub lost: Vec<String>,
    /// Numbers that are 0 because everything is masked there.
    pub filled: usize,
    /// Numbers that are 0 because the format knows no negative ones.
    pub clipped: usize,
    /// The flux of the file relative to that of the material, less 1, of luminaires.
    pub flux_error: Option<f64>,
    /// Errors that the file adds to a luminaire, in the terms of its makers: peak, flux, rms in parts of the peak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lamp: Option<LampErrors>,
    /// The error that the file adds to that of the material.
    pub error: AddedError,
}
