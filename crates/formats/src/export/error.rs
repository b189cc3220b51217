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
    /// The file would exceed the size limit.
    #[error(
        "a file of {}, expected at most {most}: {instead}",
        found.map_or_else(|| "far more bytes than fit".to_owned(), |bytes| format!("{bytes} bytes"))
    )]
    OverLimit {
        /// Size of the file in bytes; `None` if it overflows `usize`.
        found: Option<usize>,
        /// The limit in bytes.
        most: usize,
        /// Advice on how to make it smaller.
        instead: &'static str,
    },
    /// The material has values that the format cannot hold, or more of them than its limits allow.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The material could not be evaluated.
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
    /// The material is of a kind that the format cannot hold.
    #[error(
        "{format} holds {holds}, this is {found}: it can be written as {}",
        fitting.iter().map(|format| format.name()).collect::<Vec<_>>().join(" or ")
    )]
    Material {
        /// The requested format.
        format: ExportFormat,
        /// Materials that the format holds, in words.
        holds: &'static str,
        /// Description of the material, in words.
        found: String,
        /// Formats that can hold the material.
        fitting: Vec<ExportFormat>,
    },
    /// The format has no writer for the angles of the source; it is only written resampled.
    #[error("{format} is not written on the grid of its source, expected lm63, eulumdat or mbsdf")]
    NoGridWriter {
        /// Name of the format.
        format: String,
    },
    /// The measurement is not on a grid of angles that the format can hold.
    #[error(
        "the angles of this material are not those of a {format} file, and {format} cannot hold others; export it by step instead"
    )]
    OffGrid {
        /// The requested format.
        format: ExportFormat,
    },
    /// The material is not a luminaire.
    #[error("this is no luminaire")]
    NoLuminaire,
}

/// Invalid or missing options of an export.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// The option has no effect for the format.
    #[error("the option `{option}` does nothing for {format}")]
    Unused {
        /// Name of the option.
        option: &'static str,
        /// Name of the format.
        format: &'static str,
    },
    /// An index was given for a format that holds every entry.
    #[error("the option `index` does nothing for {format}, which holds every entry")]
    UnusedIndex {
        /// Name of the format.
        format: &'static str,
    },
    /// No index was given, but the format holds a single entry.
    #[error(
        "{} entries, expected an index: one entry to write as {format}",
        shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" × ")
    )]
    MissingIndex {
        /// Lengths of the index axes.
        shape: Vec<usize>,
        /// The requested format.
        format: ExportFormat,
    },
    /// The angular step is out of range.
    #[error("step: found {found} degrees, expected 0.1 to 45")]
    Step {
        /// The step in degrees.
        found: f64,
    },
    /// The number of nodes along a side is out of range.
    #[error("side: found {found} nodes along a side of the table, expected {low} to {high}")]
    Side {
        /// Requested number.
        found: usize,
        /// Smallest allowed number.
        low: usize,
        /// Largest allowed number.
        high: usize,
    },
    /// The number of cosines of a phase function is out of range.
    #[error("side: found {found} cosines, expected 2 to {most}")]
    Cosines {
        /// Requested number.
        found: usize,
        /// Largest allowed number.
        most: usize,
    },
    /// A wavelength was given for a material without a wavelength axis.
    #[error("a wavelength was asked for, this material has none")]
    UnusedWavelength,
    /// The wavelength is outside the measured range.
    #[error("wavelength {found} nm, expected {first} to {last} nm")]
    Wavelength {
        /// The wavelength in nm.
        found: f64,
        /// The first measured wavelength in nm.
        first: f64,
        /// The last measured wavelength in nm.
        last: f64,
    },
    /// The format needs wavelengths and the material has none.
    #[error("the material has no wavelengths, which this format needs")]
    NoWavelengths,
    /// The format takes decoded samples, not a material.
    #[error("format npy takes decoded samples, not a material; decode the material first")]
    Undecoded,
}

/// Refuses an option.
pub(super) fn setting<T>(error: OptionError) -> Result<T, ExportError> {
    Err(ExportError::Setting(error))
}
