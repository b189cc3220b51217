//! Export of a material at the angles of its source file, with the fewest digits that add less than a
//! tenth of the promised error.

use super::keywords::fields;
use super::origin::Origin;
use super::restated::{FORMATS, Restated, restate_as};
use crate::compress::{self, Numbers};
use crate::domain::{Axis, Measurement, Quantity, Tensor};
use crate::evaluate::{EvaluateError, Photometry, measured_share};
use crate::export::{
    AddedError, ExportError, ExportFormat, ExportOptions, Exported, Summary, kept, lost_spectrum, whole_file,
};
use crate::formats::{Digits, FormatErrorKind};
use serde_json::Value;
use std::borrow::Cow;

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
/// Relative rounding of the exported numbers of a lossless material that are sums over wavelengths. It is above the 3
/// ppm between 683 and 683.002 lm/W, so that numbers come back that were candela before a spectrum was joined. Raising
/// it writes fewer digits.
const SUMMED: f64 = 1e-5;
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
    let is_luminaire = summary.quantity == Quantity::Edf;
    let written_axes = summary.axes.iter().filter(|axis| !(is_luminaire && axis.is_spectral()));
    let samples = written_axes.map(Axis::len).product::<usize>();
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
    let promised = decoded.summary.promised_er_l2();
    let mut reason = None;
    for (measurement, lost) in holdable(&decoded.measurement) {
        match written(&measurement, &decoded.summary, numbers.filter(|_| lost.is_none()), format) {
            Ok(file) if file.bytes.len() > *most_bytes => return Err(over_limit(file.bytes.len())),
            Ok(file) => {
                let file = kept(exported(file, &measurement, lost), Some(promised), options)?;
                return Ok(OnGrid::File(Box::new(file)));
            }
            Err(ExportError::Format(error)) if error.kind != FormatErrorKind::NeedsOption => return Err(error.into()),
            Err(refusal) => reason = reason.or(Some(refusal)),
        }
    }
    Ok(OnGrid::Resample(reason.map(|reason| format!("the angles of the source: {reason}"))))
}

/// Returns the measurements that a file with the angles of the source may hold, the preferred one first, each with what
/// is lost in it. They are the measurement itself; of a luminaire with spectra, the intensities that are seen, then
/// those over all wavelengths, for files whose keywords name a unit of radiant intensity.
fn holdable(measurement: &Measurement) -> Vec<(Cow<'_, Measurement>, Option<String>)> {
    let [Axis::Grid(directions), spectral] = measurement.tensor.axes() else {
        return vec![(Cow::Borrowed(measurement), None)];
    };
    let seen = Photometry::of(measurement.quantity, measurement.unit, Some(spectral));
    let total = match spectral {
        Axis::Wavelength(grid) if seen.as_ref().is_some_and(Photometry::is_luminous) => {
            Photometry::total(measurement.unit, grid)
        }
        _ => None,
    };
    let reduced = seen.into_iter().chain(total).filter_map(|photometry| {
        let intensities = photometry.intensities(measurement.tensor.samples());
        let samples = intensities.into_iter().map(|intensity| intensity as f32).collect();
        let tensor = Tensor::new(vec![Axis::Grid(directions.clone())], samples).ok()?;
        let lost = lost_spectrum(spectral.len(), &photometry);
        Some((Cow::Owned(Measurement { tensor, unit: photometry.unit, ..measurement.clone() }), Some(lost)))
    });
    let reduced: Vec<_> = reduced.collect();
    if reduced.is_empty() { vec![(Cow::Borrowed(measurement), None)] } else { reduced }
}

/// Writes the decoded samples at the angles of the source file, with the fewest digits that add less than a tenth of
/// the promised error.
fn written(
    measurement: &Measurement,
    summary: &compress::Summary,
    numbers: Option<Numbers<'_>>,
    format: ExportFormat,
) -> Result<Restated, ExportError> {
    let document = summary.metadata.as_deref().and_then(|text| serde_json::from_str::<Value>(text).ok());
    let document = document.unwrap_or_default();
    let source = &document["source"];
    let metadata = fields(&source["metadata"]);
    let text = |key: &str| source[key].as_str().unwrap_or_default();
    let from = Some(text("format")).filter(|name| !name.is_empty()).unwrap_or(format.name());
    let origin = Origin { format: from, dialect: text("dialect"), metadata: &metadata };
    let stated = summary.errors.er_l2;
    if stated == 0.0 {
        let is_summed = summary.axes.len() > measurement.tensor.axes().len();
        let digits = if is_summed { Digits::Within(SUMMED) } else { Digits::Shortest };
        return restate_as(measurement, numbers, &origin, format, digits);
    }
    let promised = summary.promised_er_l2();
    let scored = summary.errors.scored_samples.clamp(1, measurement.tensor.len().max(1) as u64) as f64;
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

/// Combines the exported file with a summary for the user.
fn exported(file: Restated, measurement: &Measurement, spectrum: Option<String>) -> Exported {
    let Restated { bytes, format, filled, errors, lamp, lost } = file;
    let tensor = &measurement.tensor;
    let axes: Vec<String> = tensor.axes().iter().filter(|axis| !axis.is_spectral()).map(Axis::describe).collect();
    let about = Summary {
        warning: None,
        format: format.name(),
        resolution: format!("{}, as in the source", axes.join(", ")),
        unit: measurement.unit.to_string(),
        lost: spectrum.into_iter().chain(lost).collect(),
        filled,
        clipped: 0,
        flux_error: lamp.map(|lamp| lamp.flux),
        lamp,
        error: AddedError::of("every sample", tensor.len(), &errors),
    };
    Exported { bytes, about }
}
