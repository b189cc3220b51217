//! Reasons why settings are rejected, before any file is made.

use super::policy::Policy;
use crate::domain::colour::ColourError;
use crate::domain::{Axis, TensorError};
use crate::transform::{KltError, LineBasis, PlanError};

/// Settings that are out of range, contradict each other, or do not fit the measurement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// Number outside its range.
    #[error("{option} is {found}, expected {expected}")]
    Range {
        /// Name of the option.
        option: &'static str,
        /// Number found.
        found: f64,
        /// Expected range, in words.
        expected: &'static str,
    },
    /// Policy lossless with a target that allows errors.
    #[error("policy lossless keeps every bit and has no error to aim at: ask for lossless instead of another target")]
    LosslessTarget,
    /// Unknown basis name.
    #[error(
        "unknown basis `{found}`, expected auto, klt, identity or one of {}",
        LineBasis::all().map(LineBasis::name).collect::<Vec<_>>().join(", ")
    )]
    UnknownBasis {
        /// Name found.
        found: String,
    },
    /// Option that only policy `rd` has, with another policy.
    #[error("{}", option.refusal(*policy))]
    NeedsRd {
        /// The option.
        option: RdOption,
        /// The policy found.
        policy: Policy,
    },
    /// Bound on the error of albedos that cannot be kept, or that the target already implies.
    #[error("albedo_error: {0}")]
    Albedo(AlbedoConflict),
    /// Random access where blocks cannot be coded separately.
    #[error(
        "random_access: found {0}, expected policy rd with basis auto or klt, another target, and incoming directions or an \
         index in front of the outgoing directions"
    )]
    RandomAccess(RandomAccessConflict),
    /// Straight lines between directions that are not on a grid of angles.
    #[error(
        "straight lines between stated directions: the measurement has no outgoing grid of angles; keep the interpolation \
         cubic, or the directions on the grid of the file (domain grid)"
    )]
    StraightLines,
    /// Interpolation between incidences that the measurement cannot have.
    #[error(
        "interpolation between incidences: divisors and the direction back to the source are for BRDFs of several incoming \
         directions, cubics for measurements of such; leave it at its default"
    )]
    Between,
    /// Lobe that the measurement cannot have.
    #[error(
        "lobe beside the cells: found a measurement without place for it, expected a BRDF of incoming directions over \
         triangles of the upper hemisphere with one colour of the lobe for each sample of a spectrum, and incoming azimuths where \
         its widths differ"
    )]
    Lobe,
    /// Metadata that are not a JSON object.
    #[error("metadata is no JSON object, expected text such as {{\"name\": \"value\"}}")]
    MetadataObject,
    /// Metadata above the limit of 16 MiB.
    #[error("metadata has {found} bytes, expected at most 16 MiB; leave it out (--no-metadata, \"metadata\": false)")]
    MetadataLength {
        /// Length in bytes, with the labels of index axes.
        found: usize,
    },
    /// Bound on colour differences for spectra without colours.
    #[error("delta_e: {0}")]
    Colour(#[from] ColourError),
    /// Measurement whose noise cannot be estimated.
    #[error(
        "er_l2 auto: the noise of this measurement cannot be estimated: that takes at least about a hundred samples with \
         neighbours in direction or wavelength, and noise above the rounding of float32; give an explicit error, for example \
         er_l2 0.01"
    )]
    NoNoise,
    /// No spectral basis to try.
    #[error("no spectral basis fits these axes: name one with the option basis, or use lossless")]
    NoBasis,
    /// Transforms that do not fit the axes.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Principal components that cannot be computed.
    #[error("basis klt: {0}")]
    Klt(#[from] KltError),
    /// Symmetry that the domain of the directions does not have.
    #[error("the symmetry does not map the directions of the measurement to themselves")]
    Symmetry,
    /// Model of appearance on axes that it does not support.
    #[error("the model of the lobe needs incoming and outgoing directions, which these axes do not have")]
    Model,
    /// Target that bounds no error where an error bound is needed.
    #[error("this target promises no error of the samples; give one that does, for example er_l2 0.01")]
    Unbounded,
    /// The lossless target with a policy that allows errors.
    #[error("the rd policy is not lossless")]
    NotLossless,
    /// Spectra, sampled for ranking bases, that do not form a measurement.
    #[error("the spectral bases cannot be ranked, as the spectra drawn for it form no measurement: {0}")]
    Sample(TensorError),
    /// Samples that do not form a tensor.
    #[error(transparent)]
    Tensor(#[from] TensorError),
}

/// Options that need policy `rd`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RdOption {
    /// The data's own spectral basis.
    Klt,
    /// Target that stops at the noise.
    Auto,
    /// A step of the quantiser.
    Step,
    /// A bound on colour differences.
    DeltaE,
    /// Target that the policy cannot aim at.
    Target,
}

impl RdOption {
    fn refusal(self, policy: Policy) -> String {
        match self {
            Self::Klt => format!("basis klt is for policy rd; policy {policy} takes auto, identity or a wavelet"),
            Self::Auto => {
                format!("er_l2 auto: policy {policy} does not weigh noise; use policy rd, or name an error")
            }
            Self::Step => format!("step: policy {policy} has no quantiser; use policy rd, or another target"),
            Self::DeltaE => {
                format!("delta_e: policy {policy} bounds errors of samples, not of colours; use policy rd")
            }
            Self::Target => format!("policy {policy} cannot aim at this target; use policy rd"),
        }
    }
}

/// Conflicts of a bound on the error of albedos with other settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AlbedoConflict {
    /// Policy or target without light corrections.
    #[error("only policy rd with an error to keep corrects light; use that, or leave albedo_error out")]
    Uncorrected,
    /// Target that already bounds the light.
    #[error(
        "a bound on every sample, or in the unit of the samples, bounds the light already; leave albedo_error out, or ask \
         for er_l2 or er_l1"
    )]
    Bounded,
    /// Axes without outgoing directions.
    #[error("the axes have no directions to add light over; leave albedo_error out")]
    NoDirections,
}

/// Conflicts of random access with other settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RandomAccessConflict {
    /// Policy without independent blocks.
    #[error("policy {0}")]
    Policy(Policy),
    /// Basis other than the data's own.
    #[error("basis {0}")]
    Basis(String),
    /// Target whose corrections are coded for all samples together.
    #[error("a target that bounds every sample: its corrections are coded for all samples together")]
    EverySample,
    /// Axes without blocks.
    #[error("no incoming directions and no index in [{}]", .0.iter().map(Axis::describe).collect::<Vec<_>>().join(", "))]
    Axes(Vec<Axis>),
}
