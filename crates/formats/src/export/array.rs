//! The samples of a decoded material as a `NumPy` array.

use super::error::{ExportError, OptionError, setting};
use super::exported::{Exported, Summary};
use super::fits::unused;
use super::measure::AddedError;
use super::options::{ExportOptions, check_size};
use super::writer::{Write, Writer};
use crate::domain::{Axis, ErrorReport, Measurement};
use crate::evaluate::{EvaluateError, QueryError};
use crate::formats::{self, FormatError, FormatErrorKind, Interpretation, Samples, manifest_of, write_npy};

/// Writer of the export format `npy`: the samples of a material as a NumPy array in a file.
pub(super) const NPY: Writer = Writer {
    name: "npy",
    other_names: &[],
    description: "the dense float32 tensor as a NumPy array, NaN = masked, beside a manifest of its axes",
    extension: "npy",
    media_type: "application/octet-stream",
    holds: "everything",
    fits: |_| true,
    whole: None,
    options: &[],
    write: Write::Samples(array),
};

/// Refuses options that have no effect in a format that holds every sample, such as `npy`. `name` is the name of the
/// format.
pub fn check_whole(measurement: &Measurement, name: &'static str, options: &ExportOptions) -> Result<(), ExportError> {
    unused(name, options, &[])?;
    let Some(index) = &options.index else { return Ok(()) };
    let axes = measurement.tensor.axes().iter().filter(|axis| matches!(axis, Axis::Index { .. })).count();
    if index.len() != axes {
        return Err(EvaluateError::from(QueryError::Indices { found: index.len(), expected: axes }).into());
    }
    setting(OptionError::UnusedIndex { format: name })
}

/// Writes the samples of `measurement` as a NumPy array; NaN marks a masked sample. [`manifest_of`] gives the
/// accompanying manifest.
pub fn array(measurement: &Measurement, options: &ExportOptions) -> Result<Exported, ExportError> {
    let tensor = &measurement.tensor;
    check_whole(measurement, NPY.name, options)?;
    check_size(tensor.len().checked_mul(4), options, "decode a coarser level of it")?;
    let shape = tensor.shape();
    let bytes = write_npy(&shape, tensor.samples());
    let how = Interpretation { axes: Some(manifest_of(measurement)), ..Interpretation::default() };
    let acquisition = formats::read(&bytes, &how)?;
    let found = match &acquisition.samples {
        Samples::OnAxes { tensor: found, .. } if found.len() == tensor.len() => found.samples(),
        _ => {
            let message = "the written file does not read back as the same array, a bug of wavelume".to_owned();
            let kind = FormatErrorKind::Malformed;
            return Err(FormatError { kind, format: acquisition.format, position: None, message }.into());
        }
    };
    let report = ErrorReport::measure(tensor.samples(), found, 0.0);
    let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
    let about = Summary {
        warning: None,
        format: NPY.name,
        resolution: format!("{} samples", shape.join(" × ")),
        unit: measurement.unit.to_string(),
        lost: Vec::new(),
        filled: 0,
        clipped: 0,
        flux_error: None,
        lamp: None,
        error: AddedError::of("every sample", tensor.len(), &report),
    };
    Ok(Exported { bytes, about })
}
