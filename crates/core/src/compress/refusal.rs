//! Builds the errors of unreachable targets from the values at hand where they arise.

use super::error::CompressError;
use super::header::Header;
use super::policy::Policy;
use super::spectral_basis::{SpectralBasis, basis_of};
use super::target::Target;
use super::unreachable_error::UnreachableError;
use crate::codec::CodecError;
use crate::domain::Measurement;

/// Reasons why the files of a spectral basis may follow a measurement no closer, and a remedy.
#[derive(Clone, Copy, Default)]
pub(super) struct Limits {
    /// True if larger samples make up for the light of negative ones or of those below a floor.
    pub(super) corrects_light: bool,
    /// Largest number of vectors of the data's own spectral basis that a file can hold; `None` for other bases.
    pub(super) vectors: Option<usize>,
    /// Setting that lets more bases compete; `None` if all of them did.
    pub(super) another: Option<&'static str>,
}

/// Builds the error for a bound on the error of the samples that no file with this spectral basis keeps, however small
/// the quantiser step. `linear` is true if samples are coded, false if their logarithms are.
pub(super) fn cannot_follow(
    (option, wanted): (&'static str, f64),
    closest: f64,
    (basis, linear): (SpectralBasis, bool),
    Limits { corrects_light, vectors, another }: Limits,
) -> CompressError {
    let basis = basis.name();
    UnreachableError::CannotFollow { option, wanted, closest, basis, vectors, another, linear, corrects_light }.into()
}

/// Builds the error that a requested bound on each sample's error is too small for float32 to resolve.
pub(super) fn below_rounding(target: Target, measurement: &Measurement) -> CompressError {
    UnreachableError::BelowRounding { target, largest: largest_magnitude(measurement) }.into()
}

/// Builds the error that a requested file size is below the smallest possible, or a requested ratio of samples to kept
/// coefficients above the largest possible.
pub(super) fn too_large(
    target: Target,
    least: f64,
    (samples, basis): (usize, SpectralBasis),
    has_metadata: bool,
) -> CompressError {
    UnreachableError::TooLarge { target, least, samples, basis: basis.name(), has_metadata }.into()
}

/// Builds the error for a sample that decodes beyond the largest float32.
pub(super) fn beyond_float32(header: &Header, index: usize, sample: f32) -> CompressError {
    let basis = basis_of(&header.axes, &header.transforms, header.klt);
    UnreachableError::SampleOverflow { policy: header.policy, basis, index, sample }.into()
}

/// Builds the error for a newly compressed file that is not written, because the decoder rejects it.
pub(super) fn undecodable(header: &Header, reason: CodecError) -> CompressError {
    let basis = basis_of(&header.axes, &header.transforms, header.klt);
    UnreachableError::Undecodable { policy: header.policy, basis, reason }.into()
}

/// Builds the error for samples whose transform exceeds float32, under a policy that transforms the samples themselves
/// rather than their logarithms.
pub(super) fn transform_overflows(policy: Policy, basis: SpectralBasis, measurement: &Measurement) -> CompressError {
    let largest = largest_magnitude(measurement);
    UnreachableError::TransformOverflow { policy, basis: basis.name(), largest }.into()
}

/// Returns the failure of the spectral basis that came closest to the requested target. Each element of `refused`
/// describes a basis that missed the target: the error or size it reached, and the failure to report.
pub(super) fn nothing_reaches(refused: Vec<(f64, UnreachableError)>) -> CompressError {
    let closest = refused.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    closest.map_or(UnreachableError::NoBasis, |(_, error)| error).into()
}

fn largest_magnitude(measurement: &Measurement) -> f64 {
    let (low, high) = measurement.tensor.range().unwrap_or_default();
    f64::from(low.abs().max(high.abs()))
}
