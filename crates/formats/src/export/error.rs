//! Reasons why a material is not exported.

use super::format::ExportFormat;
use crate::evaluate::EvaluateError;
use crate::formats::FormatError;
use crate::preview::PreviewError;

/// Kinds of reasons why there is no file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// The format does not hold what the material is.
    #[error(transparent)]
    Unfit(#[from] UnfitError),
    /// An option is out of its range, does nothing for the format, or is missing.
    #[error(transparent)]
    Setting(#[from] OptionError),
    /// The file would be larger than is allowed.
    #[error(
        "a file of {}, expected at most {most}: {instead}",
        found.map_or_else(|| "far more bytes than fit".to_owned(), |bytes| format!("{bytes} bytes"))
    )]
    OverLimit {
        /// Length of the file in bytes; `None` where that is beyond counting.
        found: Option<usize>,
        /// The limit in bytes.
        most: usize,
        /// Advice on how to make it smaller.
        instead: &'static str,
    },
    /// The material has values that the format cannot hold, or more of them than its limits allow.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The material did not answer.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The material has no colours.
    #[error(transparent)]
    Colour(#[from] PreviewError),
}

/// Materials that a format does not hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnfitError {
    /// A material of another kind.
    #[error(
        "{format} holds {holds}, this is {found}: it can be written as {}",
        fitting.iter().map(|format| format.name()).collect::<Vec<_>>().join(" or ")
    )]
    Material {
        /// The format asked for.
        format: ExportFormat,
        /// The materials that the format holds, in words.
        holds: &'static str,
        /// The material, in words.
        found: String,
        /// The formats that hold the material.
        fitting: Vec<ExportFormat>,
    },
    /// A format that is written from samples of its own choice only.
    #[error("{format} is not written on the grid of its source, expected lm63, eulumdat or mbsdf")]
    NoGridWriter {
        /// Name of the format.
        format: String,
    },
    /// A measurement that is not on the grid of such a file.
    #[error("this is not on the angles of a {format} file, and {format} cannot hold it as it is")]
    OffGrid {
        /// The format asked for.
        format: ExportFormat,
    },
    /// A material that emits no light by direction.
    #[error("this is no luminaire")]
    NoLuminaire,
}

/// Options of an export that do not fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// An option that the format does not know.
    #[error("the option `{option}` does nothing for {format}")]
    Unused {
        /// Name of the option.
        option: &'static str,
        /// Name of the format.
        format: &'static str,
    },
    /// An index for a format that holds every entry.
    #[error("the option `index` does nothing for {format}, which holds every entry")]
    UnusedIndex {
        /// Name of the format.
        format: &'static str,
    },
    /// No index where the format holds a single entry.
    #[error(
        "{} entries, expected an index: one entry to write as {format}",
        shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" × ")
    )]
    MissingIndex {
        /// Lengths of the index axes.
        shape: Vec<usize>,
        /// The format asked for.
        format: ExportFormat,
    },
    /// A step between angles out of its range.
    #[error("step, expected 0.1 to 45 degrees")]
    Step {
        /// The step in degrees.
        found: f64,
    },
    /// A number of nodes along a side out of its range.
    #[error("side {found}, expected {low} to {high}")]
    Side {
        /// The number.
        found: usize,
        /// The least number.
        low: usize,
        /// The largest number.
        high: usize,
    },
    /// A number of cosines of a phase function out of its range.
    #[error("side {found}, expected 2 to {most} cosines")]
    Cosines {
        /// The number.
        found: usize,
        /// The largest number.
        most: usize,
    },
    /// A wavelength for a material without any.
    #[error("a wavelength was asked for, this material has none")]
    UnusedWavelength,
    /// A wavelength outside the measured range.
    #[error("wavelength {found} nm, expected {first} to {last} nm")]
    Wavelength {
        /// The wavelength in nm.
        found: f64,
        /// The first measured wavelength in nm.
        first: f64,
        /// The last measured wavelength in nm.
        last: f64,
    },
    /// A material without the wavelengths that the format needs.
    #[error("no wavelengths")]
    NoWavelengths,
    /// A material where the format takes decoded samples.
    #[error("npy holds the samples of a decoded material, expected those")]
    Undecoded,
}

/// Refuses an option.
pub(super) fn setting<T>(error: OptionError) -> Result<T, ExportError> {
    Err(ExportError::Setting(error))
}
