//! Export of materials as files that other programs open, with the error that the file itself adds, measured on its
//! bytes.
//!
//! # What is written
//! The smooth form of a material ([`Interpolation::Smooth`]) is sampled. The resolution follows from the material's own
//! axes unless options replace it:
//! * `rgl`: the material's own incident elevations, at most 3.75° apart, including 0° and 90°. Incident azimuths of
//!   anisotropic materials are a quarter of an incoming cell (90°/2^level) apart, but at least 5°. Each side has
//!   `4 · 2^level` nodes of the outgoing level, 32 to 128. If that exceeds 2²⁶ numbers, incident directions are thinned
//!   to steps of up to 7.5° and 10°, then the nodes.
//! * `merl`: always 90 × 90 × 180 cells.
//! * `mbsdf`: `4 · 2^level` polar angles, 32 to 128, and twice as many azimuths.
//! * `lm63`, `eulumdat`: gamma every 5°, 2.5°, 1° or 0.5°, the first that is at most a quarter of an outgoing cell; C
//!   planes every 15°, 10°, 5°, 2.5° or 1°, the first that is at most half of one.
//! * `tabphase`: `8 · 4^level + 1` cosines, 257 to 16,385, so that half an outgoing cell around the forward direction
//!   contains one.
//! * `spd`, `csv`, `npy`: the samples themselves.
//!
//! Materials on the grid of a luminaire or a measured BSDF keep the angles of their source unless options give a
//! resolution: see [`crate::pipeline::export_on_grid`].
//!
//! # Colours
//! RGB formats hold linear sRGB of the spectra, as in [`crate::preview`]: under D65, for the CIE 1931 observer. The
//! perfect diffuser is white, so that f = 1/π is (1/π, 1/π, 1/π). RGB data are taken as linear sRGB, data without a
//! spectral axis as grey.
//!
//! # The error
//! The bytes are read back by the reader of their format and compared with the material at 10,000 direction pairs drawn
//! from a fixed seed. The density is proportional to the cosine for surfaces, else uniform. `er(L1)` and `er(L2)` are
//! the mean and the root mean square of the relative errors of samples > 0 ([`ErrorReport`]).

mod array;
mod brdf;
mod error;
mod exported;
mod fits;
mod format;
mod help;
mod lamp_errors;
mod luminaire;
mod measure;
mod options;
mod phase;
mod promise;
mod read_back;
mod resolution;
mod spectra;
mod subject;
#[cfg(test)]
mod tests;
mod writer;

pub use array::{array, check_whole};
pub use error::{ExportError, OptionError, UnfitError};
pub use exported::{Exported, Summary};
pub use lamp_errors::LampErrors;
pub(crate) use lamp_errors::zonal_flux;
pub(crate) use luminaire::lost_spectrum;
pub use measure::{AddedError, PAIRS};
pub use options::ExportOptions;

#[cfg(doc)]
use crate::domain::ErrorReport;
use crate::domain::{Declared, Measurement};
#[cfg(doc)]
use crate::evaluate::Interpolation;
use crate::evaluate::Material;
use error::setting;
pub(crate) use promise::kept;
use writer::{Write, Writer};

// A new format needs its module and a line here.
format::writers! {
    Rgl = brdf::RGL,
    Merl = brdf::MERL,
    Mbsdf = brdf::MBSDF,
    Lm63 = luminaire::LM63,
    Eulumdat = luminaire::EULUMDAT,
    Spd = spectra::SPD,
    Csv = spectra::CSV,
    Tabphase = phase::TABPHASE,
    Npy = array::NPY,
}

wavelume_core::schema_of_names!(ExportFormat, "export format");

fn writers() -> impl Iterator<Item = &'static Writer> {
    ExportFormat::ALL.iter().map(|format| format.writer())
}

/// Name of the files of a format, in words, if they define values in all directions, so that all must have been
/// measured.
pub(crate) fn whole_file(format: ExportFormat) -> Option<&'static str> {
    format.writer().whole
}

/// Returns the formats to which `material` can be exported.
pub fn fitting(material: &Material) -> Vec<ExportFormat> {
    let is_fit = |writer: &Writer| (writer.fits)(material) && fits::is_whole(material, writer).is_ok();
    ExportFormat::ALL.iter().copied().filter(|format| is_fit(format.writer())).collect()
}

/// Returns the help text of the option that chooses the export format: the name of each format with its description.
pub fn format_help() -> String {
    help::of_formats(writers())
}

/// Returns the help text of an option of [`ExportOptions::OPTIONS`], with its meaning in each format that takes it.
pub fn option_help(option: &Declared) -> String {
    help::of_option(option, writers())
}

/// Writes `material` as `format`. A format that takes decoded samples, such as `npy`, is refused: see [`samples`].
pub fn export(material: &Material, format: ExportFormat, options: &ExportOptions) -> Result<Exported, ExportError> {
    let writer = format.writer();
    fits::check(material, writer, options, writers())?;
    match writer.write {
        Write::Entry(write) | Write::Entries(write) => {
            kept(write(material, options)?, material.promised_er_l2(), options)
        }
        Write::Samples(_) => setting(OptionError::Undecoded { format: writer.name }),
    }
}

/// Writes the samples of a decoded material in a format that takes them.
pub fn samples(
    measurement: &Measurement,
    format: ExportFormat,
    options: &ExportOptions,
) -> Result<Exported, ExportError> {
    match format.writer().write {
        Write::Samples(write) => write(measurement, options),
        Write::Entry(_) | Write::Entries(_) => setting(OptionError::Decoded { format: format.name() }),
    }
}
