//! Description of a writer: its format, the materials that the format holds, its options, and the function that writes.

use super::error::ExportError;
use super::exported::Exported;
use super::options::ExportOptions;
use crate::domain::Measurement;
use crate::evaluate::Material;

/// Writer of a format.
pub(super) struct Writer {
    /// Stable name.
    pub(super) name: &'static str,
    /// Other names of the format that are accepted.
    pub(super) other_names: &'static [&'static str],
    /// Description in one line, without a full stop.
    pub(super) description: &'static str,
    /// Usual file extension.
    pub(super) extension: &'static str,
    /// Media type of the bytes.
    pub(super) media_type: &'static str,
    /// Materials that the format holds, in words.
    pub(super) holds: &'static str,
    /// Returns true if the format holds the material.
    pub(super) fits: fn(&Material) -> bool,
    /// Options that have an effect, each with its meaning for this format.
    pub(super) options: &'static [(&'static str, &'static str)],
    /// Function that writes.
    pub(super) write: Write,
}

/// Function that writes a file.
#[derive(Clone, Copy)]
pub(super) enum Write {
    /// Writes one entry of an opened material.
    Entry(fn(&Material, &ExportOptions) -> Result<Exported, ExportError>),
    /// Writes every entry of an opened material, or the one that an index selects.
    Entries(fn(&Material, &ExportOptions) -> Result<Exported, ExportError>),
    /// Writes every sample of a decoded material.
    Samples(fn(&Measurement, &ExportOptions) -> Result<Exported, ExportError>),
}
