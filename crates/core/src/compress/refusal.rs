//! Refusals of a target, made from what was known where they arose.

use super::error::CompressError;
use super::header::Header;
use super::policy::Policy;
use super::spectral_basis::{SpectralBasis, basis_of};
use super::target::Target;
use super::unreachable_error::UnreachableError;
use crate::codec::CodecError;
use crate::domain::Measurement;

/// An error that a basis does not come down to, however small the step, of logarithms or (`linear`) of the samples.
pub(super) fn cannot_follow(
    (option, wanted): (&'static str, f64),
    closest: f64,
    (basis, linear): (SpectralBasis, bool),
) -> CompressError {
    UnreachableError::CannotFollow { option, wanted, closest, basis: basis.name(), linear }.into()
}

/// A bound on every sample that is below what float32 resolves.
pub(super) fn below_rounding(target: Target, measurement: &Measurement) -> CompressError {
    UnreachableError::BelowRounding { target, largest: largest_magnitude(measurement) }.into()
}

/// A size below the smallest file, or a ratio above the fewest coefficients.
pub(super) fn too_large(
    target: Target,
    least: f64,
    (samples, basis): (usize, SpectralBasis),
    has_metadata: bool,
) -> CompressError {
    UnreachableError::TooLarge { target, least, samples, basis: basis.name(), has_metadata }.into()
}

/// A sample that decodes beyond what float32 holds.
pub(super) fn beyond_float32(header: &Header, index: usize, sample: f32) -> CompressError {
    let basis = basis_of(&header.axes, &header.transforms, header.klt);
    UnreachableError::SampleOverflow { policy: header.policy, basis, index, sample }.into()
}

/// A file that does not come back, whatever its size.
pub(super) fn undecodable(header: &Header, reason: CodecError) -> CompressError {
    let basis = basis_of(&header.axes, &header.transforms, header.klt);
    UnreachableError::Undecodable { policy: header.policy, basis, reason }.into()
}

/// The linear transform of a policy of the paper, out of range.
pub(super) fn transform_overflows(policy: Policy, basis: SpectralBasis, measurement: &Measurement) -> CompressError {
    let largest = largest_magnitude(measurement);
    UnreachableError::TransformOverflow { policy, basis: basis.name(), largest }.into()
}

/// The refusal that came closest to what was asked for.
pub(super) fn nothing_reaches(refused: Vec<(f64, UnreachableError)>) -> CompressError {
    let closest = refused.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    closest.map_or(UnreachableError::NoBasis, |(_, error)| error).into()
}

fn largest_magnitude(measurement: &Measurement) -> f64 {
    let (low, high) = measurement.tensor.range().unwrap_or_default();
    f64::from(low.abs().max(high.abs()))
}
