//! The axes manifest of an array: JSON ⇄ axes, from full objects and short forms such as `"hemi:4"`.

mod entry;
mod grid;
#[cfg(test)]
mod tests;

use super::acquisition::{Acquisition, NoteKind, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::stated::divide_by_pi;
use super::text::snippet;
use super::{Interpretation, StatedQuantity, npy};
use crate::domain::{Axis, Layout, Measurement, Quantity, Sampling, Tensor, Unit, UnknownName, WavelengthGrid};
use entry::Entry;
use serde_json::{Map, Value, json};
use std::str::FromStr;

/// The manifest of a tensor, which reads back as the same axes: `quantity`, `value_unit`, `sampling` and `axes`, and
/// `cosine_included` where there could be one.
pub fn manifest_of(measurement: &Measurement) -> Value {
    let axes: Vec<Value> = measurement.tensor.axes().iter().map(describe).collect();
    let mut manifest = json!({
        "quantity": measurement.quantity,
        "value_unit": measurement.unit,
        "sampling": measurement.sampling,
        "axes": axes,
    });
    if measurement.quantity.has_cosine() {
        manifest["cosine_included"] = json!(false);
    }
    manifest
}

fn describe(axis: &Axis) -> Value {
    match axis {
        Axis::Triangles(mesh) => json!({"kind": "triangles", "domain": mesh.domain(), "level": mesh.level()}),
        Axis::Elevation(values) => json!({"kind": "elevation", "values": values}),
        Axis::Wavelength(WavelengthGrid::Even { start, step, count }) => {
            json!({"kind": "wavelength", "start": start, "step": step, "count": count})
        }
        Axis::Wavelength(WavelengthGrid::Uneven(values)) => json!({"kind": "wavelength", "values": values}),
        Axis::Index { count, labels } if labels.is_empty() => json!({"kind": "index", "count": count}),
        Axis::Index { count, labels } => json!({"kind": "index", "count": count, "labels": labels}),
        Axis::Rgb => json!("rgb"),
    }
}

/// The lengths of the axes that `manifest` describes, for data that are made to fit it.
pub(super) fn shape(manifest: &Value, how: &Interpretation) -> Result<Vec<usize>, FormatError> {
    let Some(axes) = manifest.get("axes").and_then(Value::as_array) else {
        return Err(unfit("no list `axes`, expected {\"quantity\": …, \"axes\": […]}"));
    };
    let bare = how.wavelengths.as_deref().and_then(|range| WavelengthGrid::parse_range(range).ok());
    let length = bare.map_or(1, |grid| grid.len());
    axes.iter().enumerate().map(|(i, axis)| Ok(entry::described(i, axis, length, how)?.len())).collect()
}

/// Gives `samples` of `shape` (row-major) the axes, quantity and unit that the manifest and the user name.
pub(super) fn interpret(
    manifest: &Value,
    shape: &[usize],
    mut samples: Vec<f32>,
    how: &Interpretation,
    mut report: ParseReport,
) -> Result<Acquisition, FormatError> {
    let nothing = Map::new();
    let (fields, axes) = match manifest {
        Value::Array(axes) => (&nothing, axes),
        Value::Object(fields) => match fields.get("axes") {
            Some(Value::Array(axes)) => (fields, axes),
            _ => return Err(unfit("no list `axes`, expected {\"quantity\": …, \"axes\": […]}")),
        },
        _ => return Err(unfit("expected {\"quantity\": …, \"axes\": […]}")),
    };
    if axes.len() != shape.len() {
        return Err(unfit(format!("{} axes, expected {} as the array has (shape {shape:?})", axes.len(), shape.len())));
    }
    let stated = quantity(fields, how, &mut report)?;
    let quantity = stated.quantity();
    let unit = unit(fields, how, stated, &mut report)?;
    let sampling = match text(fields, "sampling")? {
        None => Sampling::default(),
        Some(name) => named(name)?,
    };
    let cosine = if stated.is_factor() {
        if matches!(fields.get("cosine_included"), Some(other) if *other != Value::Bool(false)) {
            return Err(unfit("cosine_included of a reflectance factor, which holds no cosine: expected false"));
        }
        report.note(NoteKind::Assumed, "reflectance factors, divided by π: a BRDF in 1/sr");
        divide_by_pi(&mut samples);
        false
    } else {
        cosine_included(fields, quantity, &mut report)?
    };
    other_fields(fields, &mut report)?;
    let entries: Vec<Entry> = axes
        .iter()
        .zip(shape)
        .enumerate()
        .map(|(i, (axis, &length))| entry::parse(i, axis, length, how))
        .collect::<Result<_, _>>()?;
    let samples = if entries.iter().any(|entry| matches!(entry, Entry::Angle(_))) {
        let mut grid = grid::assemble(quantity, entries, samples, &mut report)?;
        if cosine {
            grid::divide_by_cosine(&mut grid, &mut report);
        }
        count_negative(&grid.values, &mut report);
        Samples::Grid(grid)
    } else if cosine {
        return Err(unfit(
            "cosine_included: true for averages over triangles, over which |cos theta_o| varies: expected false, the values \
             divided by it before they are averaged, or angles theta_o",
        ));
    } else {
        count_negative(&samples, &mut report);
        let axes =
            entries.into_iter().filter_map(|entry| if let Entry::Axis(axis) = entry { Some(axis) } else { None });
        let tensor = Tensor::new(axes.collect(), samples).map_err(|e| unfit(e.to_string()))?;
        Layout::of(quantity, tensor.axes()).map_err(|e| unfit(e.to_string()))?;
        Samples::OnAxes { tensor, sampling }
    };
    let dialect = format!("NumPy array of shape {shape:?}");
    Ok(Acquisition { format: npy::NAME, dialect, quantity, unit, samples, spectral_factor: None, report })
}

fn unfit(message: impl std::fmt::Display) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, npy::NAME, format!("manifest: {message}"))
}

fn over_limit(message: impl std::fmt::Display) -> FormatError {
    FormatError::new(FormatErrorKind::OverLimit, npy::NAME, format!("manifest: {message}"))
}

fn text<'a>(fields: &'a Map<String, Value>, key: &str) -> Result<Option<&'a str>, FormatError> {
    match fields.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(other) => Err(unfit(format!("`{key}` is {}, expected text", snippet(&other.to_string())))),
    }
}

/// A name of a closed list; the refusal quotes no more than its beginning.
fn named<T: FromStr<Err = UnknownName>>(name: &str) -> Result<T, FormatError> {
    name.parse()
        .map_err(|error: UnknownName| unfit(UnknownName { found: error.found.chars().take(40).collect(), ..error }))
}

fn quantity(
    fields: &Map<String, Value>,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<StatedQuantity, FormatError> {
    let stated = match text(fields, "quantity")? {
        None => None,
        Some(name) => match StatedQuantity::in_file(name).filter(|stated| stated.is_factor()) {
            Some(factor) => Some(factor),
            None => Some(named::<StatedQuantity>(name)?),
        },
    };
    match (how.quantity, stated) {
        (Some(asked), Some(stated)) if asked != stated => {
            report.note(NoteKind::Warning, format!("taken as {asked} as asked; the manifest says {stated}"));
            Ok(asked)
        }
        (Some(quantity), _) | (None, Some(quantity)) => Ok(quantity),
        (None, None) => {
            let known = StatedQuantity::names();
            Err(unfit(format!("no quantity, expected `quantity` in it or as an option: {known}")))
        }
    }
}

fn unit(
    fields: &Map<String, Value>,
    how: &Interpretation,
    stated_quantity: StatedQuantity,
    report: &mut ParseReport,
) -> Result<Unit, FormatError> {
    let quantity = stated_quantity.quantity();
    let stated = match text(fields, "value_unit")?.or(text(fields, "unit")?) {
        None => None,
        Some(name) => Some(named::<Unit>(name)?),
    };
    if let (Some(asked), Some(stated)) = (how.unit, stated)
        && asked != stated
    {
        report.note(NoteKind::Warning, format!("unit taken as {asked} as asked; the manifest says {stated}"));
    }
    if stated_quantity.is_factor() {
        return match how.unit.or(stated) {
            None | Some(Unit::One) => Ok(Unit::PerSteradian),
            Some(other) => Err(unfit(format!("unit {other} of a reflectance factor, expected 1"))),
        };
    }
    Ok(how.unit.or(stated).unwrap_or_else(|| {
        let unit = quantity.default_unit();
        report.note(NoteKind::Assumed, format!("no unit stated, taken as {unit}"));
        unit
    }))
}

/// Whether the values hold `|cos theta_o|`.
fn cosine_included(
    fields: &Map<String, Value>,
    quantity: Quantity,
    report: &mut ParseReport,
) -> Result<bool, FormatError> {
    match fields.get("cosine_included") {
        None if quantity.has_cosine() => {
            let message = "`cosine_included` is not stated, taken as false: the values do not hold |cos theta_o|";
            report.note(NoteKind::Assumed, message);
            Ok(false)
        }
        None | Some(Value::Bool(false)) => Ok(false),
        Some(Value::Bool(true)) if quantity.has_cosine() => Ok(true),
        Some(other) => {
            let expected = if quantity.has_cosine() { "true or false" } else { "false" };
            let found = snippet(&other.to_string());
            Err(unfit(format!("cosine_included of quantity {quantity}: found {found}, expected {expected}")))
        }
    }
}

/// Negative values are kept; how many there are is told.
fn count_negative(values: &[f32], report: &mut ParseReport) {
    let negative = values.iter().filter(|value| **value < 0.0).count();
    if negative > 0 {
        let lowest = values.iter().copied().fold(0.0, f32::min);
        report.note(NoteKind::Warning, format!("{negative} values are negative, down to {lowest}; kept as they are"));
    }
}

/// Fields that say what the numbers are.
const FIELDS: [&str; 6] = ["axes", "quantity", "value_unit", "unit", "sampling", "cosine_included"];

/// The field that `key` is when one letter, its case or the marks between its words are put right.
///
/// Other keys are metadata: what was measured, and by whom.
fn misspelt(key: &str) -> Option<&'static str> {
    let plain =
        |text: &str| text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect::<String>();
    let differs_once = |a: &str, b: &str| {
        let before = a.chars().zip(b.chars()).take_while(|(x, y)| x == y).count();
        let (a, b) = (a.chars().skip(before).collect::<Vec<_>>(), b.chars().skip(before).collect::<Vec<_>>());
        let after = a.iter().rev().zip(b.iter().rev()).take_while(|(x, y)| x == y).count();
        a.len().max(b.len()) - after <= 1
    };
    let key = plain(key);
    // Whatever else speaks of the cosine means this one.
    let cosine = key.contains("cosin").then_some("cosine_included");
    cosine.or_else(|| FIELDS.into_iter().find(|field| differs_once(&key, &plain(field))))
}

/// Keeps what does not matter here as metadata, and refuses what would change the meaning of the numbers.
fn other_fields(fields: &Map<String, Value>, report: &mut ParseReport) -> Result<(), FormatError> {
    for (key, value) in fields.iter().filter(|(key, _)| !FIELDS.contains(&key.as_str())) {
        if let Some(field) = misspelt(key) {
            return Err(unfit(format!("field {}, expected `{field}`", snippet(key))));
        }
        match (key.as_str(), value) {
            ("valid" | "sigma", _) => {
                report.note(NoteKind::Skipped, format!("`{key}` names another file, which is not opened"));
            }
            (_, Value::String(text)) => report.metadata.push((key.clone(), text.clone())),
            _ => report.metadata.push((key.clone(), value.to_string())),
        }
    }
    Ok(())
}
