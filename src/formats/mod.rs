//! Bytes of instruments and archives to measurements: one file a format, one visible table, probing by content.

mod acquisition;
mod error;

pub use acquisition::{
    Acquisition, AngleGrid, Angles, AzimuthExtent, Azimuths, Note, NoteKind, Outside, ParseReport, Samples,
    SpectralFactor,
};
pub use error::{FormatError, FormatErrorKind, Position};

use crate::domain::{Quantity, Unit, UnknownName};
use serde::{Deserialize, Serialize};

/// What the user says about a file beyond its bytes; all optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Interpretation {
    /// The quantity, where the file does not say or says it wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<Quantity>,
    /// The unit of a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The unit of wavelengths in a spectral table: `nm`, `um`, `angstrom` or `1/cm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength_unit: Option<String>,
    /// The column of a spectral table, by name or by number from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// The axes of an array, as the manifest that may lie beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<serde_json::Value>,
}

/// One format of the table.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Format {
    /// Its stable name.
    pub name: &'static str,
    /// What it is, for people.
    pub description: &'static str,
    /// Usual file extensions, without the dot; a hint only.
    pub extensions: &'static [&'static str],
    /// Whether it is read.
    pub reads: bool,
    /// Whether it is written.
    pub writes: bool,
}

/// Every format known, in the order they are probed.
pub fn formats() -> Vec<Format> {
    unimplemented!()
}

/// Reads a measurement from `bytes`, whatever its format; `file_name` is only a hint for messages.
pub fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let _ = (bytes, how);
    unimplemented!()
}

/// Joins `spectrum` (one column of wavelengths and values) with the luminaire in `acquisition`.
pub fn attach_spectrum(acquisition: &mut Acquisition, spectrum: &Acquisition) -> Result<(), FormatError> {
    let _ = (acquisition, spectrum);
    unimplemented!()
}

#[allow(dead_code)]
type Unused = UnknownName;
