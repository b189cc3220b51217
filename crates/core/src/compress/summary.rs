//! Summary of a material: everything that its header says.

use super::between::Between;
use super::policy::Policy;
use crate::domain::{Axis, ErrorReport, Lobe, Quantity, Sampling, Unit};

/// What is known of a material from its header.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The quantity.
    pub quantity: Quantity,
    /// The unit of a sample.
    pub unit: Unit,
    /// What a sample on a triangle axis stands for.
    pub sampling: Sampling,
    /// The axes.
    pub axes: Vec<Axis>,
    /// The policy.
    pub policy: Policy,
    /// The spectral basis; `none` where there is no wavelength axis.
    pub basis: String,
    /// Coefficients that are not zero; `None` for lossless.
    pub kept_coefficients: Option<u64>,
    /// Quantiser step of normalised coefficients, in natural logarithms or, for targets of absolute errors, in the unit of a
    /// sample: what [`Target::Step`](super::Target::Step) takes. `None` for policies other than `rd`.
    pub step: Option<f64>,
    /// Absolute floor, 0 if none was declared.
    pub floor: f64,
    /// Share of straight lines between stated directions, 0 (cubics of logarithms) to 1, where the last directions are a grid of
    /// angles.
    pub straight_lines: Option<f64>,
    /// Interpolation between incidences.
    pub between: Between,
    /// Lobe beside the cells: what is evaluated is the sum of both.
    pub lobe: Option<Lobe>,
    /// A sample is this times a number of the file that was measured, where both were kept (lossless only); else 1.
    pub factor: f64,
    /// The errors of the decoded file against its input tensor (each rounded up by at most 0.007 % when read from a file).
    pub errors: ErrorReport,
    /// The metadata chunk's text, if there is one.
    pub metadata: Option<String>,
}
