//! Bytes of instruments and archives to measurements: one file a format, one visible table, probing by content.

mod acquisition;
mod alta;
mod analytic;
mod archive;
mod azimuth;
mod error;
mod eulumdat;
mod foreign;
mod lm63;
mod manifest;
mod mbsdf;
mod merl;
mod npy;
mod phase_table;
mod photometry;
mod planes;
mod radiometric_csv;
mod rgl;
mod spectral_table;
mod stated;
mod tabphase;
mod template;
mod text;
mod tm27;
mod turned;
mod type_c;

pub use acquisition::{
    Acquisition, AngleGrid, Angles, AzimuthExtent, Azimuths, DirectionalFunction, Modelled, Note, NoteKind, Outside,
    ParseReport, Samples, Scattered, SpectralFactor, Written,
};
pub use archive::{Archive, Member, is_archive};
pub use error::{FormatError, FormatErrorKind, Position};
pub use eulumdat::write_eulumdat;
pub use lm63::write_lm63;
pub use manifest::manifest_of;
pub use mbsdf::{MbsdfGrid, write_mbsdf};
pub use merl::write_merl;
pub use npy::write_npy;
pub use phase_table::Normalization;
pub use photometry::attach_spectrum;
pub use planes::CPlanes;
pub use rgl::{RglGrid, write_rgl};
pub use spectral_table::{write_spd, write_spectra};
pub use stated::StatedQuantity;
pub use tabphase::{TabulatedPhase, write_tabphase};
pub use template::{TEMPLATES, Template, template};
pub(crate) use type_c::flux as flux_of_planes;

use crate::domain::{Quantity, Unit};
use serde::{Deserialize, Serialize};

/// What the user says about a file beyond its bytes; all optional.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Interpretation {
    /// The quantity, where the file does not say or says it wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
    /// The unit of a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The unit of wavelengths in a spectral table: `nm`, `um`, `angstrom` or `1/cm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength_unit: Option<String>,
    /// The column of values of a spectral table, by name or by number from 1 (the wavelengths are not counted).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// What the values of a phase table integrate to over the sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalization: Option<Normalization>,
    /// The file of an archive that is read, by its name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub member: Option<String>,
    /// The axes of an array, as the manifest that may lie beside it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes: Option<serde_json::Value>,
    /// The wavelengths of an array whose manifest says only `"lambda"`: `START:STOP:STEP` in nm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelengths: Option<String>,
}

impl Interpretation {
    /// The quantity of the measurement that the user asks for.
    fn quantity(&self) -> Option<Quantity> {
        self.quantity.map(StatedQuantity::quantity)
    }

    /// Returns true where the user calls the values reflectance factors.
    fn is_factor(&self) -> bool {
        self.quantity.is_some_and(StatedQuantity::is_factor)
    }
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

/// Every format that is read, in the order of probing. A new one is its file and its line here.
const TABLE: &[Reader] = &[
    archive::READER,
    npy::READER,
    mbsdf::READER,
    rgl::READER,
    merl::READER,
    lm63::READER,
    eulumdat::READER,
    radiometric_csv::READER,
    radiometric_csv::arrow::READER,
    tm27::READER,
    alta::READER,
    analytic::READER,
    phase_table::READER,
    spectral_table::READER,
];

/// A format as data, a probe and a function.
struct Reader {
    about: Format,
    /// The options it understands besides quantity and unit.
    options: &'static [&'static str],
    /// How sure the content makes us, 0 (not this format) to 100 (a unique signature).
    probe: fn(&Sample<'_>) -> u8,
    read: fn(&[u8], &Interpretation) -> Result<Acquisition, FormatError>,
}

/// What a probe sees.
struct Sample<'a> {
    bytes: &'a [u8],
    /// The beginning, decoded as text whatever it is.
    head: String,
    /// The quantity that the user named.
    quantity: Option<Quantity>,
}

/// A probe that is at least this sure goes before the signatures of formats that are not read.
const SURE: u8 = 50;
/// The name under which a reader lists that it takes reflectance factors.
const FACTOR: &str = "quantity reflectance-factor";
const HEAD_BYTES: usize = 1 << 16;

/// Formats that are only written.
const WRITTEN: &[Format] = &[tabphase::ABOUT];

/// Every format known: those that are read in the order they are probed, then those that are only written.
pub fn formats() -> Vec<Format> {
    TABLE.iter().map(|reader| reader.about).chain(WRITTEN.iter().copied()).collect()
}

/// Reads a measurement from `bytes`, whatever its format.
pub fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let unrecognised = |message: String| FormatError::new(FormatErrorKind::Unrecognised, "", message);
    if bytes.is_empty() {
        return Err(unrecognised("the file is empty, expected a measurement".to_owned()));
    }
    let sample = Sample { bytes, head: text::head(bytes, HEAD_BYTES), quantity: how.quantity() };
    let reader = probed(&sample).map_err(|message| FormatError::new(FormatErrorKind::Unsupported, "", message))?;
    let Some(reader) = reader else {
        let known: Vec<&str> = TABLE.iter().map(|reader| reader.about.name).collect();
        return Err(unrecognised(format!(
            "the content is of no format known here, expected one of {} (`wavelume formats` explains them)",
            known.join(", ")
        )));
    };
    refuse_idle_options(reader, how)?;
    (reader.read)(bytes, how)
}

/// The reader that is most sure of a sample, if any is; else what the sample is that no reader reads, if that is known.
fn probed(sample: &Sample<'_>) -> Result<Option<&'static Reader>, String> {
    let mut best: Option<(u8, &'static Reader)> = None;
    for reader in TABLE {
        let score = (reader.probe)(sample);
        if score > best.map_or(0, |(highest, _)| highest) {
            best = Some((score, reader));
        }
    }
    if best.is_none_or(|(score, _)| score < SURE)
        && let Some(message) = foreign::recognise(sample)
    {
        return Err(message);
    }
    Ok(best.map(|(_, reader)| reader))
}

/// Whether some format of the table recognises `bytes`; they may be malformed all the same.
pub fn recognises(bytes: &[u8]) -> bool {
    let sample = Sample { bytes, head: text::head(bytes, HEAD_BYTES), quantity: None };
    matches!(probed(&sample), Ok(Some(_)))
}

/// An option that does nothing for a format is a misunderstanding that the user should hear of.
fn refuse_idle_options(reader: &Reader, how: &Interpretation) -> Result<(), FormatError> {
    let given = [
        ("wavelength_unit", how.wavelength_unit.is_some()),
        ("column", how.column.is_some()),
        ("axes", how.axes.is_some()),
        ("normalization", how.normalization.is_some()),
        ("member", how.member.is_some()),
        (FACTOR, how.is_factor()),
    ];
    match given.iter().find(|(name, given)| *given && !reader.options.contains(name)) {
        None => Ok(()),
        Some((name, _)) => Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            reader.about.name,
            format!("the option `{name}` was given, which does not apply to this file: {}", reader.about.description),
        )),
    }
}
