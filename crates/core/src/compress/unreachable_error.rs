//! Reasons why no file keeps a promise: the option, the conflict with the data, and a remedy.

use super::figures::{shown, two_digits_up};
use super::policy::Policy;
use super::settings::ALBEDO_ERROR;
use super::target::Target;
use crate::codec::CodecError;

/// Reasons why no file of a measurement meets its target.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnreachableError {
    /// Measurement on axes for which no spectral basis is available.
    #[error("found no spectral basis for the axes of the measurement; name one with the option basis, or use lossless")]
    NoBasis,
    /// Error bound that a basis does not reach, however small the quantiser step.
    #[error("{}", cannot_follow((option, *wanted), *closest, (basis, *vectors, *another), (*linear, *corrects_light)))]
    CannotFollow {
        /// Name of the option with the error bound.
        option: &'static str,
        /// Requested upper bound on the error that `option` names: a fraction for relative errors, in the unit of the
        /// samples for absolute ones.
        wanted: f64,
        /// Smallest error of the decoded samples that the search over quantiser steps found; infinite if samples
        /// exceeded float32 with every step.
        closest: f64,
        /// Name of the spectral basis whose files all miss the bound.
        basis: &'static str,
        /// Largest number of vectors of the data's own spectral basis that a file can hold; `None` for other bases.
        vectors: Option<usize>,
        /// Setting that lets more bases compete for the file, for example `basis auto`; `None` if all of them did.
        another: Option<&'static str>,
        /// True if samples are coded, false if their logarithms are.
        linear: bool,
        /// True if larger samples make up for the light of negative ones or of those below a floor, because the
        /// directional albedo or flux is kept within a bound, too.
        corrects_light: bool,
    },
    /// Bound on the error of every sample, too small for float32 to resolve.
    #[error("{}", below_rounding(*target, *largest))]
    BelowRounding {
        /// Compression target that bounds the error of every sample.
        target: Target,
        /// Largest magnitude found among the samples of the measurement.
        largest: f64,
    },
    /// Error bound below the smallest error that a file can state.
    #[error(
        "{option} {wanted:e} is below 3.6e-43, the smallest error that a file can state; ask for a larger one, or lossless"
    )]
    BelowStated {
        /// Name of the option with the error bound.
        option: &'static str,
        /// Requested upper bound on the error that `option` names: a fraction for relative errors, in the unit of the
        /// samples for absolute ones.
        wanted: f64,
    },
    /// Requested size below that of the smallest file, or requested ratio above that of the fewest coefficients.
    #[error("{}", too_large(*target, *least, (*samples, basis), *has_metadata))]
    TooLarge {
        /// Compression target that the user requested: a file size in bytes, or a ratio of samples to kept
        /// coefficients.
        target: Target,
        /// Smallest possible size of the file: bytes, or coefficients if a ratio was requested.
        least: f64,
        /// Number of samples of the measurement.
        samples: usize,
        /// Name of the spectral basis whose smallest file has the size `least`.
        basis: &'static str,
        /// True if the file contains metadata, which count towards its size.
        has_metadata: bool,
    },
    /// Requested ratio of samples to kept coefficients that the policy `adaptive` does not reach. It scales thresholds
    /// by √(max − min) of a function, so that it keeps all coefficients of functions that are constant.
    #[error(
        "ratio {ratio}: the adaptive rule keeps {kept} of {count} coefficients, those of functions that are constant; ask for \
         ratio {} or less, or for another policy",
        shown((*count as f64 / (*kept).max(1) as f64).floor())
    )]
    ConstantFunctions {
        /// Requested number of samples per kept coefficient.
        ratio: f64,
        /// Number of coefficients that the policy `adaptive` keeps whatever the thresholds: those of constant
        /// functions.
        kept: usize,
        /// Number of all coefficients, kept or dropped.
        count: usize,
    },
    /// Error or size that exceeds its bound even in the file that came closest to it.
    #[error("{}", missed(option, (*wanted, *found), basis))]
    Missed {
        /// Name of the option whose bound is missed.
        option: &'static str,
        /// Requested upper bound on the error or the size that `option` names.
        wanted: f64,
        /// Value of the bounded quantity, an error or a size in bytes as `option` says, in the file that came closest
        /// to the bound.
        found: f64,
        /// Name of the spectral basis of the file that came closest to the requested bound on its error or size.
        basis: String,
    },
    /// Samples below the floor (the smallest sample whose relative error counts) that would decode with an absolute
    /// error larger than the floor.
    #[error(
        "floor {}: samples below the floor of {} (in the unit of the samples) are to be kept within it, but the error asked for \
         lets one be off by {}; ask for a smaller error, or leave the floor out",
        shown(*wanted), shown(*floor), shown(*found)
    )]
    Floor {
        /// Requested floor, the smallest sample whose relative error counts, as a fraction of the largest sample.
        wanted: f64,
        /// Requested floor, the smallest sample whose relative error counts, in the unit of the samples.
        floor: f64,
        /// Largest absolute error of a sample below the floor (the smallest sample whose relative error counts), in the
        /// unit of the samples.
        found: f64,
    },
    /// Samples that decode as masked although measured, or as numbers although masked.
    #[error(
        "policy {policy}, basis {basis}: {count} samples would decode as masked, or masked ones as numbers, because the samples \
         leave the range in which this transform works in float32; use lossless, or store the measurement in another unit"
    )]
    Mask {
        /// Compression policy (method of choosing and coding coefficients) of the rejected file.
        policy: Policy,
        /// Name of the spectral basis of the rejected file.
        basis: String,
        /// Number of samples that decode as masked although measured, or as numbers although masked.
        count: u64,
    },
    /// Samples that decode beyond the largest float32 with every quantiser step.
    #[error(
        "samples would decode beyond 3.4e38, the largest float32: the samples come close to it; ask for a larger file, a \
         smaller ratio or step, an error to keep instead (for example er_l2 0.01), or lossless, or store the measurement in a \
         larger unit"
    )]
    Overflow,
    /// Sample that decodes beyond the largest float32.
    #[error(
        "policy {policy}, basis {basis}: sample {index} of the measurement is {sample:e} and would decode beyond 3.4e38, the \
         largest float32; ask for a smaller error or step, more bytes or a smaller ratio, or lossless, or store the \
         measurement in a larger unit"
    )]
    SampleOverflow {
        /// Compression policy (method of choosing and coding coefficients) of the rejected file.
        policy: Policy,
        /// Name of the spectral basis of the rejected file.
        basis: String,
        /// Row-major index of the sample that decodes beyond float32.
        index: usize,
        /// Measured value of the sample that decodes beyond float32, in the unit of the samples.
        sample: f32,
    },
    /// Samples so large that their transform exceeds float32, in a policy that transforms the samples themselves.
    #[error(
        "policy {policy}, basis {basis}: samples as large as {} leave the range of float32 in the transform; use policy rd, \
         lossless, or store the measurement in a larger unit", shown(*largest)
    )]
    TransformOverflow {
        /// Compression policy (method of choosing and coding coefficients) whose transform coefficients exceed float32.
        policy: Policy,
        /// Name of the spectral basis whose transform coefficients exceed float32.
        basis: &'static str,
        /// Largest magnitude found among the samples of the measurement.
        largest: f64,
    },
    /// Coefficient, supplied by the caller, that float32 cannot hold.
    #[error("coefficient {index} is {found}, expected a number that an f32 holds")]
    Coefficient {
        /// Row-major index of the coefficient that float32 cannot hold.
        index: usize,
        /// Rejected coefficient as converted to float32: infinite or not a number.
        found: f32,
    },
    /// File that its own decoder rejects, and that is therefore not written.
    #[error(
        "policy {policy}, basis {basis}: no file was written, because its decoder would refuse it ({reason}): the samples leave \
         the range in which this transform works in float32; use lossless, or store the measurement in another unit"
    )]
    Undecodable {
        /// Compression policy (method of choosing and coding coefficients) of the rejected file.
        policy: Policy,
        /// Name of the spectral basis of the rejected file.
        basis: String,
        /// Reason why the decoder rejects the file.
        reason: CodecError,
    },
    /// File that does not decode, so that its colour differences cannot be checked.
    #[error(
        "delta_e: no colour difference can be computed, because the compressed file does not decode ({0}); use lossless"
    )]
    Colours(CodecError),
}

impl UnreachableError {
    /// Returns the error, or the size in bytes or coefficients, that came closest to the one asked for; infinite if
    /// unknown.
    pub(super) fn closest(&self) -> f64 {
        match *self {
            Self::CannotFollow { closest, .. } => closest,
            Self::TooLarge { least, .. } => least,
            Self::Missed { found, .. } => found,
            _ => f64::INFINITY,
        }
    }

    /// Names the bound `asked` by the user in the place of `wanted`, which was rounded down for the search.
    pub(super) fn naming(mut self, asked: f64, rounded: f64) -> Self {
        if let Self::CannotFollow { wanted, .. } | Self::Missed { wanted, .. } = &mut self
            && *wanted == rounded
        {
            *wanted = asked;
        }
        self
    }
}

fn cannot_follow(
    (name, wanted): (&str, f64),
    closest: f64,
    (basis, vectors, another): (&str, Option<usize>, Option<&str>),
    (linear, corrects_light): (bool, bool),
) -> String {
    let off = if closest.is_finite() { shown(closest) } else { "more than float32 holds".to_owned() };
    let found = format!("{name} {}: with basis {basis} the closest file is off by {off}", shown(wanted));
    if corrects_light {
        return format!(
            "{found}: to keep the light within albedo_error, larger samples make up for those that are negative or below the \
             floor; ask for a larger error, leave albedo_error out, or lossless"
        );
    }
    let what = if linear { "float32 samples" } else { "logarithms in float32" };
    let why = match vectors {
        Some(most) => format!("at most {most} spectral vectors, and {what}, follow this measurement no closer"),
        None => format!("{what} follow this measurement no closer"),
    };
    let instead = if closest.is_finite() && closest <= 10.0 {
        format!("{name} {} or more", shown(two_digits_up(closest * 1.05)))
    } else {
        "a larger error".to_owned()
    };
    let another = another.map_or_else(String::new, |another| format!(", {another}"));
    format!("{found}: {why}; ask for {instead}{another}, or lossless")
}

fn below_rounding(target: Target, largest: f64) -> String {
    match target {
        Target::MaxAbsoluteError(wanted) => {
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
    }
}

fn too_large(target: Target, least: f64, (samples, basis): (usize, &str), has_metadata: bool) -> String {
    let mut text = match target {
        Target::Ratio(ratio) => format!(
            "ratio {}: basis {basis} keeps {least} coefficients of the {samples} samples at least, its own vectors included; \
             ask for ratio {} or less",
            shown(ratio),
            shown((samples as f64 / least.max(1.0)).floor().max(1.0)),
        ),
        Target::Bytes(bytes) => {
            let (what, enough) =
                if has_metadata { (", its metadata included", with_longer_request(bytes, least)) } else { ("", least) };
            format!(
                "bytes {bytes}: the smallest file of this material has {least} bytes{what}; ask for {enough} or more"
            )
        }
        _ => "the smallest file is larger than the size asked for".to_owned(),
    };
    match target {
        Target::Ratio(_) if basis == "klt" => text.push_str(", or for another basis (auto, haar)"),
        Target::Bytes(_) if has_metadata => {
            text.push_str(", or leave the metadata out (--no-metadata, \"metadata\": false)");
        }
        _ => {}
    }
    text
}

/// Estimates how large the smallest possible file, now of `least` bytes, becomes if the user asks for just that size.
/// Metadata of the file repeat the size asked for, now `bytes`, and numbers computed from it, which may get more
/// digits.
fn with_longer_request(bytes: u64, least: f64) -> f64 {
    let digits = |number: u64| number.max(1).ilog10();
    least + f64::from(4 + 2 * digits(least as u64).saturating_sub(digits(bytes)))
}

fn missed(option: &str, (wanted, found): (f64, f64), basis: &str) -> String {
    let enough = two_digits_up(1.05 * found);
    let is_relative = matches!(option, "er_l1" | "er_l2" | "max_relative_error" | "relative_rmse");
    let more = if option == "albedo_error" && !ALBEDO_ERROR.allow(enough) {
        "a file without a bound on the light".to_owned()
    } else if found.is_finite() && (enough <= 10.0 || !is_relative) {
        format!("{option} {} or more", shown(enough))
    } else {
        "policy rd or a larger error".to_owned()
    };
    let rounded = [wanted, found].map(shown);
    let [wanted, found] = if rounded[0] == rounded[1] { [wanted, found].map(|x| format!("{x:e}")) } else { rounded };
    format!(
        "{option} {wanted}: the closest file found, with basis {basis}, has {found}; ask for {more}, another basis, or lossless"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_name_what_was_asked_for_and_what_helps() {
        let error = |wanted: f64, corrects_light| UnreachableError::CannotFollow {
            option: "er_l2",
            wanted,
            closest: 0.119,
            basis: "identity",
            vectors: None,
            another: None,
            linear: false,
            corrects_light,
        };
        assert_eq!(error(0.223_999, false).naming(0.224, 0.223_999), error(0.224, false));
        assert_eq!(error(0.5, false).naming(0.224, 0.223_999), error(0.5, false));
        assert!(error(0.002, false).to_string().ends_with("ask for er_l2 0.13 or more, or lossless"));
        let light = error(0.002, true).to_string();
        assert!(light.ends_with("ask for a larger error, leave albedo_error out, or lossless"), "{light}");
        let own = UnreachableError::CannotFollow {
            option: "er_l2",
            wanted: 0.002,
            closest: 0.119,
            basis: "klt",
            vectors: Some(64),
            another: Some("basis auto"),
            linear: false,
            corrects_light: false,
        };
        let told = "at most 64 spectral vectors, and logarithms in float32, follow this measurement no closer; ask for er_l2 \
                    0.13 or more, basis auto, or lossless";
        assert!(own.to_string().ends_with(told), "{own}");
        let missed = |option: &'static str, found| {
            UnreachableError::Missed { option, wanted: 0.07, found, basis: "haar".to_owned() }.to_string()
        };
        assert!(missed("er_l2", 2.8e5).contains("ask for policy rd or a larger error, another basis, or lossless"));
        assert!(missed("er_l2", 0.08).contains("ask for er_l2 0.084 or more, another basis, or lossless"));
        assert!(missed("albedo_error", 1.0).contains("ask for a file without a bound on the light"));
    }
}
