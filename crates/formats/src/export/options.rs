//! Options of an export, and the limit on the size of its file.

use super::error::ExportError;
use crate::domain::limits::MAX_SAMPLES;

/// Overrides of the default resolution of an export. An option that has no effect for the format is refused.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportOptions {
    /// Entry to export, one number for each leading index axis. `csv` without an index writes every entry, `npy` always
    /// does.
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
