//! Materials as the files that other programs open, each with the error that the file itself adds, measured on its bytes.
//!
//! # What is written
//! The smooth form of a material ([`Interpolation::Smooth`]) at the resolution that its own axes ask for, which options
//! replace:
//! * `rgl`: incident elevations are the material's own, at most 3.75° apart, 0° and 90° among them; incident azimuths of
//!   anisotropic materials a quarter of an incoming cell (90°/2^level) apart, at least 5°; `4 · 2^level` nodes of the outgoing
//!   level along a side, 32 to 128. Where that is more than 2²⁶ numbers, incident
//!   directions up to 7.5° and 10° apart, then fewer nodes have to do.
//! * `merl`: 90 × 90 × 180 cells, always.
//! * `mbsdf`: `4 · 2^level` polar angles, 32 to 128, and twice as many azimuths.
//! * `lm63`, `eulumdat`: gamma every 5°, 2.5°, 1° or 0.5°, the first that is at most a quarter of an outgoing cell; C planes
//!   every 15°, 10°, 5°, 2.5° or 1°, the first that is at most half of one.
//! * `tabphase`: `8 · 4^level + 1` cosines, 257 to 16,385: half an outgoing cell around the forward direction has one.
//! * `spd`, `csv`, `npy`: the samples themselves.
//!
//! # Colours
//! RGB formats hold linear sRGB of the spectra as [`crate::preview`] has it: under D65, seen by the CIE 1931 observer, the
//! perfect diffuser white, so that f = 1/π is (1/π, 1/π, 1/π). RGB data are taken as linear sRGB, data without a spectral
//! axis as grey.
//!
//! # The error
//! The bytes are read back by the reader of their format and compared with the material at 10,000 pairs of directions drawn
//! from a fixed seed: on the sides of a surface in proportion to the cosine, else uniformly. `er(L1)` and `er(L2)` are the
//! mean and the root mean square of the relative errors of samples > 0, as everywhere ([`ErrorReport`]).

mod array;
mod brdf;
mod fits;
mod luminaire;
mod measure;
mod phase;
mod read_back;
mod resolution;
mod spectra;
mod subject;
#[cfg(test)]
mod tests;

pub use array::{array, check_whole};
pub use fits::fitting;
pub use measure::{AddedError, PAIRS};

#[cfg(doc)]
use crate::domain::ErrorReport;
use crate::domain::limits::MAX_SAMPLES;
use crate::domain::{UnknownName, named};
#[cfg(doc)]
use crate::evaluate::Interpolation;
use crate::evaluate::{EvaluateError, Material};
use crate::formats::{FormatError, FormatErrorKind};
use crate::preview::PreviewError;
use serde::Serialize;

/// The formats that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ExportFormat {
    /// RGL tensor file: a BRDF, spectral or RGB, isotropic or not.
    Rgl,
    /// MERL table: an isotropic BRDF in RGB.
    Merl,
    /// MDL measured BSDF: isotropic, RGB or scalar.
    Mbsdf,
    /// IES LM-63-2002: a luminaire.
    Lm63,
    /// EULUMDAT: a luminaire in candela.
    Eulumdat,
    /// One spectrum in two columns.
    Spd,
    /// Spectra in columns.
    Csv,
    /// A phase function over the cosine.
    Tabphase,
    /// The samples as a `NumPy` array, beside a manifest of its axes.
    Npy,
}
named!(ExportFormat, "export format", {
    Rgl = "rgl",
    Merl = "merl",
    Mbsdf = "mbsdf",
    Lm63 = "lm63",
    Eulumdat = "eulumdat",
    Spd = "spd",
    Csv = "csv",
    Tabphase = "tabphase",
    Npy = "npy",
});

impl ExportFormat {
    /// The format of a name; those of the table of formats and the usual extensions of luminaires mean the same.
    pub fn of_name(name: &str) -> Result<Self, UnknownName> {
        match name {
            "lm-63" | "ies" => Ok(Self::Lm63),
            "ldt" => Ok(Self::Eulumdat),
            _ => name.parse(),
        }
    }

    /// The usual file extension.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Rgl => "bsdf",
            Self::Merl => "binary",
            Self::Mbsdf => "mbsdf",
            Self::Lm63 => "ies",
            Self::Eulumdat => "ldt",
            Self::Spd => "spd",
            Self::Csv => "csv",
            Self::Tabphase => "txt",
            Self::Npy => "npy",
        }
    }

    /// The media type of the bytes.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Rgl | Self::Merl | Self::Mbsdf | Self::Npy => "application/octet-stream",
            Self::Csv => "text/csv",
            Self::Lm63 | Self::Eulumdat | Self::Spd | Self::Tabphase => "text/plain",
        }
    }
}

/// What replaces the rules; an option that a format does not know is refused.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportOptions {
    /// One entry for each leading index axis; `csv` without it has them all, `npy` always.
    pub index: Option<Vec<usize>>,
    /// `rgl`: nodes along a side; `mbsdf`: polar angles; `tabphase`: cosines.
    pub side: Option<usize>,
    /// `rgl`: degrees between incident directions; `lm63`, `eulumdat`: between angles.
    pub step: Option<f64>,
    /// `rgl`: linear sRGB instead of spectra.
    pub rgb: bool,
    /// `tabphase`: the wavelength in nm, instead of the mean over wavelengths.
    pub wavelength: Option<f64>,
    /// The largest file, in bytes.
    pub most_bytes: usize,
}

impl Default for ExportOptions {
    fn default() -> Self {
        Self { index: None, side: None, step: None, rgb: false, wavelength: None, most_bytes: 4 * MAX_SAMPLES }
    }
}

/// A file, and what is to be known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// What of the material it holds, and how densely.
    pub about: Summary,
}

/// What of a material a file holds, and how densely.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The format.
    pub format: ExportFormat,
    /// Where the material was evaluated, for people.
    pub resolution: String,
    /// The unit of the numbers.
    pub unit: String,
    /// What the file does not hold of the material.
    pub lost: Vec<String>,
    /// Numbers that are 0 because everything is masked there.
    pub filled: usize,
    /// Numbers that are 0 because the format knows no negative ones.
    pub clipped: usize,
    /// The flux of the file relative to that of the material, less 1, of luminaires.
    pub flux_error: Option<f64>,
    /// The error that the file adds to that of the material.
    pub error: AddedError,
}

/// Why there is no file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// The format does not hold what the material is.
    #[error("{0}")]
    Unfit(String),
    /// An option is out of its range, or one that the format does not know, or one is missing.
    #[error("{0}")]
    Setting(String),
    /// The file would be larger than is allowed.
    #[error("{0}")]
    OverLimit(String),
    /// The material has values that the format cannot hold.
    #[error("{0}")]
    Values(String),
    /// The material did not answer.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The material has no colours.
    #[error(transparent)]
    Colour(#[from] PreviewError),
}

impl From<FormatError> for ExportError {
    fn from(error: FormatError) -> Self {
        match error.kind {
            FormatErrorKind::OverLimit => Self::OverLimit(error.to_string()),
            _ => Self::Values(error.to_string()),
        }
    }
}

/// Writes `material` as `format`. `npy` holds the samples of a decoded material instead: see [`array()`].
pub fn export(material: &Material, format: ExportFormat, options: &ExportOptions) -> Result<Exported, ExportError> {
    fits::check(material, format, options)?;
    match format {
        ExportFormat::Rgl => brdf::rgl(material, options),
        ExportFormat::Merl => brdf::merl(material, options),
        ExportFormat::Mbsdf => brdf::mbsdf(material, options),
        ExportFormat::Lm63 => luminaire::lm63(material, options),
        ExportFormat::Eulumdat => luminaire::eulumdat(material, options),
        ExportFormat::Spd => spectra::spd(material, options),
        ExportFormat::Csv => spectra::csv(material, options),
        ExportFormat::Tabphase => phase::tabphase(material, options),
        ExportFormat::Npy => setting("npy holds the samples of a decoded material, expected those"),
    }
}

fn setting<T>(message: impl Into<String>) -> Result<T, ExportError> {
    Err(ExportError::Setting(message.into()))
}

/// Refuses a file of `bytes` bytes, before it is made.
fn check_size(bytes: Option<usize>, options: &ExportOptions, less: &str) -> Result<(), ExportError> {
    match bytes {
        Some(bytes) if bytes <= options.most_bytes => Ok(()),
        _ => {
            let size = bytes.map_or_else(|| "far more bytes than fit".to_owned(), |bytes| format!("{bytes} bytes"));
            let message = format!("a file of {size}, expected at most {}: {less}", options.most_bytes);
            Err(ExportError::OverLimit(message))
        }
    }
}
