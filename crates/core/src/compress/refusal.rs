//! The words of refusals: the option that was asked for, what in the data conflicts with it, and what would work.

use super::error::CompressError;
use super::figures::{shown, two_digits_up};
use super::header::Header;
use super::policy::Policy;
use super::spectral_basis::{SpectralBasis, basis_of};
use super::target::Target;
use crate::domain::Measurement;

/// No noise to stop at.
pub(super) const NO_NOISE: &str = "er_l2 auto: the noise of this measurement cannot be estimated: that takes at least \
    about a hundred samples with neighbours in direction or wavelength, and noise above the rounding of float32; give an \
    explicit error, for example er_l2 0.01";
/// No candidate at all, which the settings' checks exclude.
pub(super) const NOTHING_TO_TRY: &str =
    "no spectral basis fits these axes: name one with the option basis, or use lossless";
/// Decoded samples above what float32 holds.
pub(super) const OVERFLOWS: &str = "samples would decode beyond 3.4e38, the largest float32: the \
    samples come close to it; ask for a larger file, a smaller ratio or step, an error to keep instead (for example \
    er_l2 0.01), or lossless, or store the measurement in a larger unit";

/// An error that a basis does not come down to, however small the step, of logarithms or (`linear`) of the samples.
pub(super) fn cannot_follow(
    (name, wanted): (&str, f64),
    closest: f64,
    (basis, linear): (SpectralBasis, bool),
) -> CompressError {
    let what = if linear { "float32 samples" } else { "logarithms in float32" };
    let why = match basis {
        SpectralBasis::Klt => {
            format!("at most 24 spectral vectors, and {what}, follow this measurement no closer")
        }
        _ => format!("{what} follow this measurement no closer"),
    };
    let instead = if closest.is_finite() && closest <= 10.0 {
        format!("{name} {} or more", shown(two_digits_up(closest * 1.05)))
    } else {
        "a larger error".to_owned()
    };
    let another = if basis == SpectralBasis::Klt { ", another basis (auto, bior4.4)" } else { "" };
    CompressError::Unreachable(format!(
        "{name} {}: with basis {} the closest file is off by {}: {why}; ask for {instead}{another}, or lossless",
        shown(wanted),
        basis.name(),
        if closest.is_finite() { shown(closest) } else { "more than float32 holds".to_owned() },
    ))
}

/// A bound on every sample that is below what float32 resolves.
pub(super) fn below_rounding(target: Target, measurement: &Measurement) -> CompressError {
    CompressError::Unreachable(match target {
        Target::MaxAbsoluteError(wanted) => {
            let (low, high) = measurement.tensor.range().unwrap_or_default();
            let largest = f64::from(low.abs().max(high.abs()));
            let least =
                two_digits_up((4.0 * largest * f64::from(f32::EPSILON)).max(2.0 * f64::from(f32::MIN_POSITIVE)));
            format!(
                "max_absolute_error {}: float32 is too coarse for it beside samples as large as {}; ask for {} or more, or \
                 lossless",
                shown(wanted),
                shown(largest),
                shown(least)
            )
        }
        Target::MaxRelativeError(wanted) => format!(
            "max_relative_error {}: float32 logarithms resolve about 1e-5 of a sample; ask for 3e-5 or more, or lossless",
            shown(wanted)
        ),
        _ => "the error asked for is below what float32 resolves; ask for a larger one, or lossless".to_owned(),
    })
}

/// A size below the smallest file, or a ratio above the fewest coefficients.
pub(super) fn too_large(
    target: Target,
    least: f64,
    (samples, basis): (usize, SpectralBasis),
    has_metadata: bool,
) -> CompressError {
    let mut text = match target {
        Target::Ratio(ratio) => format!(
            "ratio {}: basis {} keeps {least} coefficients of the {samples} samples at least, its own vectors included; ask \
             for ratio {} or less",
            shown(ratio),
            basis.name(),
            shown((samples as f64 / least.max(1.0)).floor().max(1.0)),
        ),
        Target::Bytes(bytes) => {
            let (what, enough) =
                if has_metadata { (", its metadata included", with_longer_request(bytes, least)) } else { ("", least) };
            format!(
                "bytes {bytes}: the smallest file of this material has {least} bytes{what}; ask for {enough} or more"
            )
        }
        _ => "the file is larger than was asked for".to_owned(),
    };
    match target {
        Target::Ratio(_) if basis == SpectralBasis::Klt => text.push_str(", or for another basis (auto, haar)"),
        Target::Bytes(_) if has_metadata => {
            text.push_str(", or leave the metadata out (--no-metadata, \"metadata\": false)");
        }
        _ => {}
    }
    CompressError::Unreachable(text)
}

/// The size of a file that has `least` bytes and metadata with a request for `bytes`, once the request is for that size: a longer
/// number in the metadata, and in what is computed from it.
fn with_longer_request(bytes: u64, least: f64) -> f64 {
    let digits = |number: u64| number.max(1).ilog10();
    least + f64::from(4 + 2 * digits(least as u64).saturating_sub(digits(bytes)))
}

/// A sample that decodes beyond what float32 holds.
pub(super) fn beyond_float32(header: &Header, at: usize, sample: f32) -> CompressError {
    let basis = basis_of(&header.axes, &header.transforms, header.klt);
    CompressError::Unreachable(format!(
        "policy {}, basis {basis}: sample {at} of the measurement is {sample:e} and would decode beyond 3.4e38, the largest \
         float32; ask for a smaller error or step, more bytes or a smaller ratio, or lossless, or store the measurement in \
         a larger unit",
        header.policy
    ))
}

/// A file that does not come back, whatever its size.
pub(super) fn undecodable(header: &Header, reason: &str) -> CompressError {
    let basis = basis_of(&header.axes, &header.transforms, header.klt);
    CompressError::Unreachable(format!(
        "policy {}, basis {basis}: no file was written, because its decoder would refuse it ({reason}): the samples leave the \
         range in which this transform works in float32; use lossless, or store the measurement in another unit",
        header.policy
    ))
}

/// The linear transform of a policy of the paper, out of range.
pub(super) fn transform_overflows(policy: Policy, basis: SpectralBasis, measurement: &Measurement) -> CompressError {
    let (low, high) = measurement.tensor.range().unwrap_or_default();
    CompressError::Unreachable(format!(
        "policy {policy}, basis {}: samples as large as {} leave the range of float32 in the transform; use policy rd, \
         lossless, or store the measurement in a larger unit",
        basis.name(),
        shown(f64::from(low.abs().max(high.abs()))),
    ))
}

/// The refusal that came closest to what was asked for.
pub(super) fn nothing_reaches(refused: Vec<(f64, String)>) -> CompressError {
    let closest = refused.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    CompressError::Unreachable(closest.map_or_else(|| NOTHING_TO_TRY.to_owned(), |(_, text)| text))
}
