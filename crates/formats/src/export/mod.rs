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
mod lamp_errors;
mod luminaire;
mod measure;
mod options;
mod phase;
mod read_back;
mod resolution;
mod spectra;
mod subject;
#[cfg(test)]
mod tests;

pub use array::{array, check_whole};
pub use error::{ExportError, OptionError, UnfitError};
pub use exported::{Exported, Summary};
pub use fits::fitting;
pub use format::ExportFormat;
pub use lamp_errors::LampErrors;
pub(crate) use lamp_errors::zonal_flux;
pub use measure::{AddedError, PAIRS};
pub use options::ExportOptions;

#[cfg(doc)]
use crate::domain::ErrorReport;
#[cfg(doc)]
use crate::evaluate::Interpolation;
use crate::evaluate::Material;
use error::setting;

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
        ExportFormat::Npy => setting(OptionError::Undecoded),
    }
}
