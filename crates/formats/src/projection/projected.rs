//! A projected measurement, and the coverage of its cells.

use super::scattered::at_samples::ScatteredSamples;
use super::scattered::lobe::carried::CarriedLobe;
use super::scattered::report::ScatterReport;
use crate::domain::{Measurement, Tensor};
use crate::formats::Contradictions;
use serde::{Deserialize, Serialize};

/// A projected measurement.
#[derive(Clone, Debug)]
pub struct Projected {
    /// The tensor with its quantity and unit.
    pub measurement: Measurement,
    /// Coverage of the cells by samples.
    pub coverage: Coverage,
    /// Marks filled cells (continued, mirrored or exchanged, not measured): one entry for each spectrum of the tensor,
    /// row-major. Empty if no cell is filled.
    pub filled: Vec<bool>,
    /// Numbers of a file that states a separate factor, on the axes of the measurement. `None` if the factor is 1 or
    /// the numbers were resampled.
    pub numbers: Option<Numbers>,
    /// Samples at scattered directions, with which a material made of the measurement is compared.
    pub scattered: Option<ScatteredSamples>,
    /// Lobe narrower than the cells; the measurement is the sum of both.
    pub lobe: Option<CarriedLobe>,
}

/// Numbers as the file writes them. A value of the measurement is `factor` times its number.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// The numbers as stated.
    pub tensor: Tensor,
    /// Product of all multipliers that the file states once for all numbers.
    pub factor: f64,
}

/// Coverage of a projection: how many cells are measured, interpolated, filled or empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Coverage {
    /// Number of cells of directions (spectra, not samples).
    pub cells: u64,
    /// Number of cells that contain a sample, or all cells for data already on their final axes.
    pub measured: u64,
    /// Number of cells between samples.
    pub interpolated: u64,
    /// Number of cells in holes or beyond the outermost samples, filled by a rule that the notes declare.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub filled: u64,
    /// Number of cells outside the measured range: masked, or 0 if the format's standard says so.
    pub empty: u64,
    /// Reasons for the chosen axes, one sentence each.
    pub notes: Vec<String>,
    /// Differences between values that the file states for one direction; measured on the file's own grid only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contradictions: Option<Contradictions>,
    /// Noise and outliers of samples at scattered directions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scatter: Option<Box<ScatterReport>>,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_zero(count: &u64) -> bool {
    *count == 0
}
