//! Reasons why a material is not exported.

use crate::domain::{Limits, readable};
use crate::evaluate::EvaluateError;
use crate::formats::FormatError;
use crate::preview::PreviewError;

/// Reasons why the export of a material produces no file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// The format cannot hold this kind of material.
    #[error(transparent)]
    Unfit(#[from] UnfitError),
    /// An export option is out of its range, has no effect for the format, or is missing.
    #[error(transparent)]
    Setting(#[from] OptionError),
    /// The exported file would exceed the size limit.
    #[error(
        "the exported file would have {size}, expected at most {most} bytes: {advice}",
        advice = instead,
        size = found.map_or_else(|| "far more bytes than fit".to_owned(), |bytes| format!("{bytes} bytes"))
    )]
    OverLimit {
        /// Size that the exported file would have, in bytes; `None` if it overflows `usize`.
        found: Option<usize>,
        /// Upper bound on the size of an exported file, in bytes.
        most: usize,
        /// Advice on how to make the exported file smaller.
        instead: &'static str,
    },
    /// The material has values that the format cannot hold, or more of them than its limits allow.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// Warning that the option `strict` turns into an error: the file adds more error than the material promises.
    #[error("refused by the option `strict`: {0}")]
    Strict(String),
    /// The material could not be evaluated for the export.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The spectra of the material allow no colour, or no colour was computed.
    #[error(transparent)]
    Colour(#[from] PreviewError),
}

/// Reasons why a format cannot hold a material.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnfitError {
    /// The material is of a kind that the format cannot hold.
    #[error(
        "{format} holds {holds}, but the material is {found}: it can be written as {}",
        fitting.join(" or ")
    )]
    Material {
        /// Name of the requested export format.
        format: &'static str,
        /// Materials that the export format holds, in words.
        holds: &'static str,
        /// Description of the material, in words.
        found: String,
        /// Names of the formats that can hold the material.
        fitting: Vec<&'static str>,
    },
    /// The format cannot be written at the angles of the source file, only at resampled angles.
    #[error("{format} cannot be written at the angles of the source file, expected lm63, eulumdat or mbsdf")]
    NoGridWriter {
        /// Name of the requested export format.
        format: String,
    },
    /// The measured angles do not form a grid that the requested format can hold.
    #[error(
        "the format {format} cannot hold the angles of the material; export it at other angles with the option `step`"
    )]
    OffGrid {
        /// Name of the requested export format.
        format: &'static str,
    },
    /// The material is not a luminaire.
    #[error("the material is not a luminaire, expected one for a luminaire format")]
    NoLuminaire,
}

/// Invalid or missing options of an export.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptionError {
    /// An export option has no effect for the requested format.
    #[error("the option `{option}` does nothing for {format}; leave it out")]
    Unused {
        /// Name of the export option that has no effect.
        option: &'static str,
        /// Name of the requested export format.
        format: &'static str,
    },
    /// The user chose one entry by an index, but the format always holds every entry of the index axes.
    #[error("the option `index` does nothing for {format}, which holds every entry; leave it out")]
    UnusedIndex {
        /// Name of the requested export format.
        format: &'static str,
    },
    /// The user chose no entry by an index, but the format holds a single entry of the index axes.
    #[error(
        "the material has {} numbered entries (such as spectra or specimens), but {format} holds one: choose it with the \
         option `index`",
        shape.iter().map(usize::to_string).collect::<Vec<_>>().join(" × ")
    )]
    MissingIndex {
        /// Number of entries on each index axis of the material.
        shape: Vec<usize>,
        /// Name of the requested export format.
        format: &'static str,
    },
    /// The requested step between neighbouring angles in the exported file is out of range.
    #[error("option `step`: found {found} degrees between angles, expected {}", limits.expected())]
    Step {
        /// Requested step in degrees between neighbouring directions in the exported file: the incident directions of a
        /// BRDF or the directions of a luminaire.
        found: f64,
        /// Range of the steps in degrees that the export accepts.
        limits: Limits,
    },
    /// The requested number of nodes along a side of a table of directions is out of range.
    #[error("option `side`: found {found} nodes along a side of the exported table, expected {low} to {high}")]
    Side {
        /// Requested number of nodes along a side of the square table of directions in the exported file.
        found: usize,
        /// Smallest allowed number of nodes along a side of the square table of directions in the exported file.
        low: usize,
        /// Largest allowed number of nodes along a side of the square table of directions in the exported file.
        high: usize,
    },
    /// The number of scattering cosines requested for the exported table of a phase function is out of range.
    #[error("option `side`: found {found} scattering cosines of a phase function, expected 2 to {most}")]
    Cosines {
        /// Number of scattering cosines (table entries) requested for the exported phase function.
        found: usize,
        /// Largest allowed number of scattering cosines (table entries) of an exported phase function.
        most: usize,
    },
    /// The user chose a wavelength for a material without a wavelength axis.
    #[error("found the option `wavelength`, but the material has no wavelength axis; leave it out")]
    UnusedWavelength,
    /// The requested wavelength is outside the measured range.
    #[error(
        "wavelength {found} nm is outside the measured range, expected {} to {} nm",
        readable(*first), readable(*last)
    )]
    Wavelength {
        /// Requested wavelength in nm.
        found: f64,
        /// The first measured wavelength in nm.
        first: f64,
        /// The last measured wavelength in nm.
        last: f64,
    },
    /// The format needs wavelengths and the material has none.
    #[error("the material has no wavelengths, which the requested format needs")]
    NoWavelengths,
    /// The format takes decoded samples, not a material.
    #[error("format {format} takes decoded samples, not a material; decode the material first")]
    Undecoded {
        /// Name of the requested export format.
        format: &'static str,
    },
    /// The format takes a material, not decoded samples.
    #[error("format {format} takes a material, not decoded samples; open the material instead")]
    Decoded {
        /// Name of the requested export format.
        format: &'static str,
    },
}

/// Returns an invalid or missing export option as an error of the export.
pub(super) fn setting<T>(error: OptionError) -> Result<T, ExportError> {
    Err(ExportError::Setting(error))
}
