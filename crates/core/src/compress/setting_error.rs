//! Reasons why settings are rejected, before any file is made.

use super::policy::Policy;
use crate::domain::colour::ColourError;
use crate::domain::{Axis, Limits, TensorError};
use crate::transform::{KltError, LineBasis, PlanError};

/// Settings that are out of range, contradict each other, or do not fit the measurement.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// Option whose number is outside its range.
    #[error("{option} is {found}, expected {}", limits.expected())]
    Range {
        /// Name of the option that is out of range.
        option: &'static str,
        /// Value given for the option, outside its range.
        found: f64,
        /// Range of numbers that the option accepts.
        limits: Limits,
    },
    /// Policy lossless combined with a target that allows errors.
    #[error(
        "policy lossless: found a target that allows errors, expected target lossless; ask for it, or use another policy"
    )]
    LosslessTarget,
    /// Name of a spectral basis that does not exist.
    #[error(
        "unknown basis `{found}`, expected auto, klt, identity or one of {}",
        LineBasis::all().map(LineBasis::name).collect::<Vec<_>>().join(", ")
    )]
    UnknownBasis {
        /// Name in the settings that names no spectral basis.
        found: String,
    },
    /// Option that only policy `rd` has, used with another policy.
    #[error("{}", option.refusal(*policy))]
    NeedsRd {
        /// Option in the settings that only the rate–distortion policy (`rd`) supports.
        option: RdOption,
        /// Compression policy in the settings, with which an option that only policy `rd` supports was given.
        policy: Policy,
    },
    /// Requested bound on the error of albedos that cannot be kept with the other settings, or that the target already
    /// implies.
    #[error("the option albedo_error cannot be used: {0}")]
    Albedo(AlbedoConflict),
    /// Random access requested where single incoming directions cannot be coded separately.
    #[error(
        "random_access: {0}; expected policy rd, basis auto or klt, no bound on the error of every sample, and incoming \
         directions or an index axis before the outgoing directions"
    )]
    RandomAccess(RandomAccessConflict),
    /// Straight-line interpolation requested between directions that are not on a grid of angles.
    #[error(
        "straight lines between directions: found no grid of outgoing angles in the measurement, expected one; keep the \
         interpolation cubic, or keep the directions on the grid of the measured file (domain grid)"
    )]
    StraightLines,
    /// Interpolation between incoming directions that does not suit the measurement's quantity or axes.
    #[error(
        "interpolation between incoming directions: a divisor or retro-reflection needs a BRDF of several incoming directions, \
         a cubic any measurement of several; leave the interpolation at its default"
    )]
    Between,
    /// Analytic lobe that does not suit the measurement's quantity or axes.
    #[error(
        "analytic lobe beside the cells (triangles) of a material: found a measurement that cannot have one, expected \
         a BRDF of incoming directions over triangles of the upper hemisphere with one colour of the lobe for each \
         sample of a spectrum, and incoming azimuths where its widths differ"
    )]
    Lobe,
    /// Metadata text that is not a JSON object.
    #[error("metadata is no JSON object, expected text such as {{\"name\": \"value\"}}")]
    MetadataObject,
    /// Metadata text longer than the limit of 16 MiB.
    #[error("metadata has {found} bytes, expected at most 16 MiB; leave it out (--no-metadata, \"metadata\": false)")]
    MetadataLength {
        /// Length of the metadata text in bytes, labels of index axes included.
        found: usize,
    },
    /// Requested bound on colour differences of spectra whose colours cannot be computed.
    #[error("delta_e: colour differences of this measurement cannot be computed: {0}")]
    Colour(#[from] ColourError),
    /// Measurement whose noise cannot be estimated.
    #[error(
        "er_l2 auto: the noise of this measurement cannot be estimated: that takes at least about a hundred samples with \
         neighbours in direction or wavelength, and noise above the rounding of float32; give an explicit error, for example \
         er_l2 0.01"
    )]
    NoNoise,
    /// Measurement on axes for which no spectral basis is available.
    #[error("found no spectral basis for the axes of the measurement; name one with the option basis, or use lossless")]
    NoBasis,
    /// Transforms that do not suit the axes of the measurement.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Failure to compute the principal components of the data.
    #[error("cannot compute the principal components of the data (basis klt): {0}")]
    Klt(#[from] KltError),
    /// Symmetry that does not map the directions of the measurement to themselves.
    #[error("the symmetry does not map the directions of the measurement to themselves")]
    Symmetry,
    /// Scattering model on axes that lack the directions it needs.
    #[error(
        "the scattering model needs incoming and outgoing directions, which the axes of the measurement do not have"
    )]
    Model,
    /// Compression target that bounds no error of the samples, such as a size, where the search needs an error bound.
    #[error("this target bounds no error of the samples; give one that does, for example er_l2 0.01")]
    Unbounded,
    /// Lossless target combined with a policy that allows errors.
    #[error("found target lossless with policy rd, which allows errors; use policy lossless")]
    NotLossless,
    /// Subset of the spectra, selected for comparing spectral bases, that forms no valid tensor.
    #[error("the spectral bases cannot be compared on a subset of the spectra, which forms no valid tensor: {0}")]
    Sample(TensorError),
    /// Samples that do not form a valid tensor.
    #[error(transparent)]
    Tensor(#[from] TensorError),
}

/// Options that only policy `rd` has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RdOption {
    /// Spectral basis of the data's own principal components.
    Klt,
    /// Target whose error is as small as the noise of the measurement.
    Auto,
    /// Target that fixes the quantiser step.
    Step,
    /// Target that bounds colour differences.
    DeltaE,
    /// Compression target, other than `er_l2` auto, `step` and `delta_e`, that only the rate–distortion policy `rd` can
    /// meet.
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

/// Reasons why a bound on the error of albedos conflicts with other settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AlbedoConflict {
    /// Policy or target that does not correct the light (albedo, flux) of the decoded samples.
    #[error(
        "only policy rd with a target that allows errors corrects albedos; use policy rd, or leave albedo_error out"
    )]
    Uncorrected,
    /// Target that already bounds the error of the light (albedo, flux).
    #[error(
        "a bound on every sample, or in the unit of the samples, bounds the light already; leave albedo_error out, or ask \
         for er_l2 or er_l1"
    )]
    Bounded,
    /// Measurement without outgoing directions, so that there is no albedo or flux to bound.
    #[error("the axes of the measurement have no directions over which to integrate an albedo; leave albedo_error out")]
    NoDirections,
}

/// Reasons why random access to single incoming directions conflicts with other settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RandomAccessConflict {
    /// Compression policy that codes all incoming directions together, so that none can be decoded alone as random
    /// access needs.
    #[error("policy {0} codes all incoming directions together and thus allows no random access to one of them")]
    Policy(Policy),
    /// Spectral basis with which all incoming directions are coded together: any but the data's own principal
    /// components.
    #[error("basis {0} codes all incoming directions together and thus allows no random access to one of them")]
    Basis(String),
    /// Target that bounds the error of every sample: corrections of samples are coded for all incoming directions
    /// together, so that none can be decoded alone.
    #[error(
        "a target that bounds the error of every sample needs corrections coded for all incoming directions together and \
         thus allows no random access to one of them"
    )]
    EverySample,
    /// Axes with neither incoming directions nor numbered entries before the outgoing directions: there are no parts
    /// that could be decoded singly.
    #[error(
        "found neither incoming directions nor numbered entries (an index axis) for random access in the axes [{}]",
        .0.iter().map(Axis::describe).collect::<Vec<_>>().join(", ")
    )]
    Axes(Vec<Axis>),
}
