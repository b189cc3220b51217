//! Options of an export, and the limit on the size of its file.

use super::error::ExportError;
use crate::domain::limits::MAX_SAMPLES;

/// Options of an export that replace its default resolution. An option that has no effect for the format is refused.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportOptions {
    /// Entry (one of several spectra or samples) to export, given by one number for each leading index axis. Without an
    /// index, `csv` writes every entry; `npy` always writes every entry.
    pub index: Option<Vec<usize>>,
    /// Number of nodes along a side of the table (`rgl`), of polar angles (`mbsdf`) or of scattering cosines
    /// (`tabphase`); other formats refuse it.
    pub side: Option<usize>,
    /// Step in degrees between incident directions (`rgl`) or between the angles of a luminaire (`lm63`, `eulumdat`);
    /// other formats refuse it.
    pub step: Option<f64>,
    /// True to write linear sRGB instead of spectra; only the format `rgl` accepts it.
    pub rgb: bool,
    /// Wavelength in nm at which the format `tabphase` is written, instead of the mean over wavelengths.
    pub wavelength: Option<f64>,
    /// Upper bound on the size of the exported file, in bytes.
    pub most_bytes: usize,
}

impl Default for ExportOptions {
    fn default() -> Self {
        Self { index: None, side: None, step: None, rgb: false, wavelength: None, most_bytes: 4 * MAX_SAMPLES }
    }
}

impl ExportOptions {
    /// Returns the names of the stated options that only some formats take.
    pub(super) fn stated(&self) -> impl Iterator<Item = &'static str> {
        let options = [
            ("side", self.side.is_some()),
            ("step", self.step.is_some()),
            ("rgb", self.rgb),
            ("wavelength", self.wavelength.is_some()),
        ];
        options.into_iter().filter(|(_, is_stated)| *is_stated).map(|(name, _)| name)
    }
}

/// Refuses a file of `bytes` bytes before it is generated, if that is over the limit.
pub(super) fn check_size(
    bytes: Option<usize>,
    options: &ExportOptions,
    instead: &'static str,
) -> Result<(), ExportError> {
    match bytes {
        Some(bytes) if bytes <= options.most_bytes => Ok(()),
        found => Err(ExportError::OverLimit { found, most: options.most_bytes, instead }),
    }
}
