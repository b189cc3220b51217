//! Description of a writer: its format, the materials that the format holds, its options, and the function that writes.

use super::error::ExportError;
use super::exported::Exported;
use super::options::ExportOptions;
use crate::domain::Measurement;
use crate::evaluate::Material;

/// Description of an export format: its name, the materials that it can hold, its options, and the function that writes
/// a material to a file.
pub(super) struct Writer {
    /// Permanent name of the export format on the command line and over HTTP.
    pub(super) name: &'static str,
    /// Other names of the export format that are accepted.
    pub(super) other_names: &'static [&'static str],
    /// Description of the export format in one line, without a full stop.
    pub(super) description: &'static str,
    /// Usual extension of files in the export format, without a dot.
    pub(super) extension: &'static str,
    /// Media type of files in the export format.
    pub(super) media_type: &'static str,
    /// Materials that the export format holds, in words.
    pub(super) holds: &'static str,
    /// Returns true if the export format holds the material.
    pub(super) fits: fn(&Material) -> bool,
    /// Name of the file, in words, if it defines values in all directions, so that all must have been measured.
    pub(super) whole: Option<&'static str>,
    /// Names of the export options that the format accepts, each with the meaning of its value in this format.
    pub(super) options: &'static [(&'static str, &'static str)],
    /// Function that writes a material to a file in the export format.
    pub(super) write: Write,
}

/// Function that writes a material, or its decoded samples, to a file in an export format.
#[derive(Clone, Copy)]
pub(super) enum Write {
    /// Function that writes one entry (one of several spectra or specimens) of an opened material to an exported file.
    Entry(fn(&Material, &ExportOptions) -> Result<Exported, ExportError>),
    /// Function that writes every entry (spectrum or specimen) of an opened material to an exported file, or the one
    /// entry that an index selects.
    Entries(fn(&Material, &ExportOptions) -> Result<Exported, ExportError>),
    /// Function that writes every sample of a decoded material to an exported file.
    Samples(fn(&Measurement, &ExportOptions) -> Result<Exported, ExportError>),
}
