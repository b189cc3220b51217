//! A projected measurement, and what its cells stand on.

use super::scattered::report::ScatterReport;
use super::scattered::{CarriedLobe, ScatteredSamples};
use crate::domain::{Measurement, Tensor};
use crate::formats::Contradictions;
use serde::Serialize;

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
    /// The numbers of a file that states a factor beside them, on the axes of the measurement; `None` where the factor is
    /// 1, or the numbers were resampled: then those of the measurement are all there are.
    pub numbers: Option<Numbers>,
    /// The samples that a material made of the measurement is compared with, where they lie at scattered directions.
    pub scattered: Option<ScatteredSamples>,
    /// A lobe narrower than the cells: the measurement is the sum of both.
    pub lobe: Option<CarriedLobe>,
}

/// Numbers as the file writes them: a value of the measurement is `factor` times one of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers {
    /// The numbers.
    pub tensor: Tensor,
    /// Product of all multipliers that the file states once for all numbers.
    pub factor: f64,
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
    /// Differences between values that the file states for one direction; measured on its own grid only.
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
