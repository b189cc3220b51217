//! Export of a material at the angles of its source file, with the fewest digits that add less than a
//! tenth of the promised error.

use super::origin::Origin;
use super::restated::{FORMATS, Restated, restate_as};
use crate::compress::{self, Decoded, Numbers};
use crate::domain::{Axis, Quantity};
use crate::evaluate::{EvaluateError, measured_share};
use crate::export::{AddedError, ExportError, ExportFormat, ExportOptions, Exported, Summary, kept, whole_file};
use crate::formats::{Digits, FormatErrorKind};
use serde_json::Value;

/// Result of an export at the angles of the source file.
#[derive(Clone, Debug, PartialEq)]
pub enum OnGrid {
    /// Exported file at the angles of the source file.
    File(Box<Exported>),
    /// The material must be resampled, because the format cannot hold the source's angles or the options set a
    /// resolution. Holds the reason if the user did not request resampling.
    Resample(Option<String>),
}

/// Rounding errors to try for the numbers of an exported file, as fractions of the promised error, the largest first.
/// Smaller fractions give more digits and larger files.
const ROUNDINGS: [f64; 6] = [0.1, 0.05, 0.025, 0.0125, 0.006, 0.003];
/// Number of standard deviations by which the rounding of exported numbers is assumed to add to the error instead of
/// averaging out. Raising it writes more digits.
const CHANCE: f64 = 2.0;
/// Lower bound on the size in bytes of one number in an exported text file, used to refuse too large files early.
/// Raising it refuses more files.
const LEAST_BYTES: usize = 2;

/// Writes the material in `bytes` as `format`, at the angles and with the keywords of its source file.
///
/// Lossless materials reproduce the numbers of that file. Other numbers are rounded to the fewest digits that change
/// no value by more than a tenth of the promised error. If the file would break the promise, smaller changes are
/// tried, down to 0.3 % of it.
pub fn export_on_grid(bytes: &[u8], format: ExportFormat, options: &ExportOptions) -> Result<OnGrid, ExportError> {
    let ExportOptions { index, side, step, rgb, wavelength, most_bytes, strict: _ } = options;
    let names_resolution = side.is_some() || step.is_some() || *rgb || wavelength.is_some() || index.is_some();
    if names_resolution || !FORMATS.contains(&format) {
        return Ok(OnGrid::Resample(None));
    }
    let evaluated = |error| ExportError::from(EvaluateError::from(error));
    let summary = compress::inspect(bytes).map_err(evaluated)?;
    let on_grid = summary.axes.iter().any(|axis| matches!(axis, Axis::Grid(_)));
    if !on_grid || summary.quantity == Quantity::Phase {
        return Ok(OnGrid::Resample(None));
    }
    let samples = summary.axes.iter().map(Axis::len).product::<usize>();
    let least = samples.saturating_mul(if format == ExportFormat::Mbsdf { 4 } else { LEAST_BYTES });
    let over_limit = |found: usize| ExportError::OverLimit {
        found: Some(found),
        most: *most_bytes,
        instead: "ask for a larger step or a smaller side",
    };
    if least > *most_bytes {
        return Err(over_limit(least));
    }
    let decoded = compress::decode(bytes).map_err(evaluated)?;
    let measured = measured_share(&decoded.measurement, decoded.summary.metadata.as_deref());
    if let (Some(measured), Some(file)) = (measured, whole_file(format)) {
        measured.needs_whole(file)?;
    }
    let numbers = compress::decode_numbers(bytes).map_err(evaluated)?;
    let numbers = numbers.as_ref().map(|values| Numbers { values, factor: summary.factor });
    match written(&decoded, numbers, format) {
        Ok(file) if file.bytes.len() > *most_bytes => Err(over_limit(file.bytes.len())),
        Ok(file) => {
            Ok(OnGrid::File(Box::new(kept(exported(file, &decoded), Some(decoded.summary.promised_er_l2()), options)?)))
        }
        Err(ExportError::Format(error)) if error.kind != FormatErrorKind::NeedsOption => Err(error.into()),
        Err(reason) => Ok(OnGrid::Resample(Some(format!("the angles of the source: {reason}")))),
    }
}

/// Writes the decoded material at the angles of its source file, with the fewest digits that add less than a
/// tenth of the promised error.
fn written(decoded: &Decoded, numbers: Option<Numbers<'_>>, format: ExportFormat) -> Result<Restated, ExportError> {
    let (measurement, summary) = (&decoded.measurement, &decoded.summary);
    let document = summary.metadata.as_deref().and_then(|text| serde_json::from_str::<Value>(text).ok());
    let document = document.unwrap_or_default();
    let source = &document["source"];
    let metadata = fields(&source["metadata"]);
    let text = |key: &str| source[key].as_str().unwrap_or_default();
    let from = Some(text("format")).filter(|name| !name.is_empty()).unwrap_or(format.name());
    let origin = Origin { format: from, dialect: text("dialect"), metadata: &metadata };
    let stated = summary.errors.er_l2;
    if stated == 0.0 {
        return restate_as(measurement, numbers, &origin, format, Digits::Shortest);
    }
    let promised = summary.promised_er_l2();
    let scored = summary.errors.scored_samples.max(1) as f64;
    let is_kept = |added: f64| stated + CHANCE * added / scored.sqrt() + 0.5 * added * added / stated <= promised;
    let mut file = restate_as(measurement, numbers, &origin, format, Digits::Within(ROUNDINGS[0] * promised))?;
    for part in &ROUNDINGS[1..] {
        if is_kept(file.errors.er_l2) {
            break;
        }
        file = restate_as(measurement, numbers, &origin, format, Digits::Within(part * promised))?;
    }
    Ok(file)
}

/// Returns the keywords of the source file with their texts, in the order of that file.
fn fields(metadata: &Value) -> Vec<(String, String)> {
    let pair = |pair: &Value| Some((pair[0].as_str()?.to_owned(), pair[1].as_str()?.to_owned()));
    metadata.as_array().map(|pairs| pairs.iter().filter_map(pair).collect()).unwrap_or_default()
}

/// Combines the exported file with a summary for the user.
fn exported(file: Restated, decoded: &Decoded) -> Exported {
    let Restated { bytes, format, filled, errors, lamp, lost } = file;
    let tensor = &decoded.measurement.tensor;
    let axes: Vec<String> = tensor.axes().iter().filter(|axis| !axis.is_spectral()).map(Axis::describe).collect();
    let about = Summary {
        warning: None,
        format: format.name(),
        resolution: format!("{}, as in the source", axes.join(", ")),
        unit: decoded.measurement.unit.to_string(),
        lost,
        filled,
        clipped: 0,
        flux_error: lamp.map(|lamp| lamp.flux),
        lamp,
        error: AddedError::of("every sample", tensor.len(), &errors),
    };
    Exported { bytes, about }
}
