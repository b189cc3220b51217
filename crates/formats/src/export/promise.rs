//! Comparison of the error that an exported file adds with the error that its material promises.

use super::error::ExportError;
use super::exported::Exported;
use super::options::ExportOptions;

/// Error of rounding to float32 that no exported file can avoid, as a relative error. Raising it hides the rounding of
/// text files.
const ROUNDING: f64 = 1e-6;

/// Adds a warning to an exported file that adds more error than its material promises. With the option `strict` it is
/// an error instead. `promised` is the er(L2) of the promise; `None` for a measurement, which promises nothing.
pub(crate) fn kept(
    mut file: Exported,
    promised: Option<f64>,
    options: &ExportOptions,
) -> Result<Exported, ExportError> {
    let added = file.about.error.er_l2;
    let Some(promised) = promised.filter(|promised| added > promised + ROUNDING) else { return Ok(file) };
    let promise = if promised == 0.0 {
        "the material is without loss".to_owned()
    } else {
        format!("more than the {:.2} % that the material promises", 100.0 * promised)
    };
    let found = format!("the file adds er(L2) {:.2} %, {promise}", 100.0 * added);
    if options.strict {
        return Err(ExportError::Strict(found));
    }
    file.about.warning = Some(found);
    Ok(file)
}
