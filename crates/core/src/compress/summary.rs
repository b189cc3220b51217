//! Summary of a material: the content of its header.

use super::between::Between;
use super::policy::Policy;
use crate::domain::{Axis, ErrorReport, Lobe, Quantity, Sampling, Unit};
use serde_json::Value;

/// Properties of a compressed material that are known from its header.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Measured quantity, for example a BRDF or a reflectance.
    pub quantity: Quantity,
    /// Unit of a sample.
    pub unit: Unit,
    /// Meaning of a sample on a triangle axis: point value or average over the triangle.
    pub sampling: Sampling,
    /// Axes of the samples, outermost first.
    pub axes: Vec<Axis>,
    /// Policy: how coefficients were chosen and coded.
    pub policy: Policy,
    /// Name of the spectral basis; `none` without a wavelength axis.
    pub basis: String,
    /// Number of nonzero coefficients in the file; `None` for a lossless file.
    pub kept_coefficients: Option<u64>,
    /// Quantiser step of normalised coefficients ([`Target::Step`](super::Target::Step)), in natural-log units or, for
    /// targets of absolute errors, in the unit of a sample. `None` for policies other than `rd`.
    pub step: Option<f64>,
    /// Magnitude below which samples do not count in relative errors, in the unit of a sample; 0 if none was declared.
    pub floor: f64,
    /// Share of straight lines in the interpolation between measured directions, from 0 (cubics of logarithms) to 1.
    /// `None` unless the last directions are a grid of angles.
    pub straight_lines: Option<f64>,
    /// Interpolation between incoming directions.
    pub between: Between,
    /// Analytic lobe stored beside the samples; evaluation adds it to them. `None` without one.
    pub lobe: Option<Lobe>,
    /// Ratio of a sample to the number stated in the measured file, if a lossless file stores those numbers; else 1.
    pub factor: f64,
    /// Errors of the decoded file against its input tensor (each rounded up by at most 0.007 % when read from a file).
    pub errors: ErrorReport,
    /// Text of the metadata chunk; `None` without one.
    pub metadata: Option<String>,
}

impl Summary {
    /// Returns the root mean square relative error er(L2) that the material promises: that of the request for its
    /// compression, if the metadata state it and the file keeps it, or else the error that the file reached.
    pub fn promised_er_l2(&self) -> f64 {
        let document: Option<Value> = self.metadata.as_deref().and_then(|text| serde_json::from_str(text).ok());
        let asked = document.and_then(|document| document["request"]["target"]["er_l2"].as_f64());
        asked.map_or(self.errors.er_l2, |asked| asked.max(self.errors.er_l2))
    }
}
