//! Summary of a material: the content of its header.

use super::between::Between;
use super::policy::Policy;
use crate::domain::{Axis, ErrorReport, Lobe, Quantity, Sampling, Unit};

/// Properties of a material that are known from its header.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Measured quantity.
    pub quantity: Quantity,
    /// The unit of a sample.
    pub unit: Unit,
    /// Meaning of a sample on a triangle axis: point value or average over the triangle.
    pub sampling: Sampling,
    /// Axes, outermost first.
    pub axes: Vec<Axis>,
    /// Coding policy.
    pub policy: Policy,
    /// Name of the spectral basis; `none` without a wavelength axis.
    pub basis: String,
    /// Number of nonzero coefficients; `None` for lossless.
    pub kept_coefficients: Option<u64>,
    /// Quantiser step of normalised coefficients ([`Target::Step`](super::Target::Step)), in natural-log units or, for
    /// targets of absolute errors, in the unit of a sample. `None` for policies other than `rd`.
    pub step: Option<f64>,
    /// Absolute floor in the unit of a sample, 0 if none was declared.
    pub floor: f64,
    /// Share of straight lines between stated directions, 0 (cubics of logarithms) to 1. `None` unless the last
    /// directions are a grid of angles.
    pub straight_lines: Option<f64>,
    /// Interpolation between incidences.
    pub between: Between,
    /// Lobe beside the cells; evaluation adds it to them.
    pub lobe: Option<Lobe>,
    /// Ratio of a sample to the number stated in the measured file, if both were kept (lossless only); else 1.
    pub factor: f64,
    /// Errors of the decoded file against its input tensor (each rounded up by at most 0.007 % when read from a file).
    pub errors: ErrorReport,
    /// Text of the metadata chunk; `None` without one.
    pub metadata: Option<String>,
}
