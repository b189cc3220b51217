//! Readers and writers of the file formats of instruments and archives: one file per format, one table, recognition by
//! content.

mod acquisition;
mod alta;
mod analytic;
mod archive;
mod asd;
mod azimuth;
mod bsdf_xml;
mod error;
mod eulumdat;
mod foreign;
mod in_plane;
mod instrument;
mod intensities;
mod interpretation;
mod lit_side;
mod lm63;
mod manifest;
mod mbsdf;
mod merl;
mod normalization;
mod npy;
mod number;
mod overlap;
mod phase_table;
mod photometry;
mod planes;
mod probing;
mod radiometric_csv;
mod reader;
mod restated;
mod rgl;
mod rounding;
mod sekonic;
mod spectra;
mod spectral_table;
mod speos;
mod stated;
mod stated_grid;
mod svc;
mod tabphase;
mod template;
mod text;
mod text_table;
mod tm27;
mod tm33;
mod turned;
mod type_c;
mod windows_1252;
mod xml;
mod zemax;

pub use crate::domain::{Note, NoteKind, NoteValue};
pub use acquisition::{
    Acquisition, AngleGrid, Angles, AzimuthExtent, Azimuths, DirectionalFunction, Modelled, Outside, ParseReport,
    Samples, Scattered, SpectralFactor, Written,
};
pub use archive::{Archive, Member, is_archive};
pub use error::{FormatError, FormatErrorKind, Position};
pub use eulumdat::{restate_eulumdat, write_eulumdat};
pub use in_plane::InPlaneSign;
pub use instrument::{Instrument, not_wider};
pub use interpretation::Interpretation;
pub use lit_side::LitSide;
pub use lm63::{restate_lm63, write_lm63};
#[cfg(feature = "schema")]
pub use manifest::ArrayManifest;
pub use manifest::manifest_of;
pub use mbsdf::{MbsdfGrid, restate_mbsdf, write_mbsdf};
pub use merl::write_merl;
pub use normalization::Normalization;
pub use npy::{ArrayRows, npy_header, write_npy};
pub use overlap::Overlap;
pub use photometry::attach_spectrum;
pub use planes::CPlanes;
pub use probing::formats;
pub use reader::Format;
pub use restated::{Digits, Restatement};
pub use rgl::{RglGrid, write_rgl};
pub(crate) use rounding::with_digits;
pub use spectral_table::{write_spd, write_spectra};
pub use stated::StatedQuantity;
pub use stated_grid::{Contradictions, Repeated, StatedGrid, StatedGridError};
pub use tabphase::{TabulatedPhase, write_tabphase};
pub use template::{TEMPLATES, Template, template};
pub(crate) use type_c::flux as flux_of_planes;
pub(crate) use windows_1252::changes as changed_in_windows;

/// Reads a measurement from `bytes` in any known format.
pub fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    if is_archive(bytes) { archive::read(bytes, how) } else { probing::read_file(bytes, how) }
}

/// Returns true if the beginning of `bytes` matches some known format; the rest may be malformed.
pub fn recognises(bytes: &[u8]) -> bool {
    is_archive(bytes) || probing::recognises_file(bytes)
}
