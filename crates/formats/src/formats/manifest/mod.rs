//! The axes manifest of an array: JSON ⇄ axes, from full objects and short forms such as `"hemi:4"`.

mod describe;
mod entry;
mod fields;
mod grid;
mod refusal;
#[cfg(feature = "schema")]
mod schema;
#[cfg(test)]
mod tests;

pub use describe::manifest_of;
#[cfg(feature = "schema")]
pub use schema::ArrayManifest;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::FormatError;
use super::interpretation::Interpretation;
use super::npy::about::NAME;
use super::stated::{StatedQuantity, divide_by_pi};
use super::text::snippet;
use crate::domain::{Layout, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
use crate::notes::{ScatteringNote, ValueNote};
use entry::Entry;
use fields::{instrument, named, other_fields, text};
use refusal::unfit;
use serde_json::{Map, Value};

/// Returns the length of each axis that `manifest`, a JSON description of an array's axes, declares. It serves arrays
/// whose values a scattering model provides for these axes.
pub(super) fn shape(manifest: &Value, how: &Interpretation) -> Result<Vec<usize>, FormatError> {
    let Some(axes) = manifest.get("axes").and_then(Value::as_array) else {
        return Err(unfit("no list `axes`, expected {\"quantity\": …, \"axes\": […]}"));
    };
    let bare = how.wavelengths.as_deref().and_then(|range| WavelengthGrid::parse_range(range).ok());
    let length = bare.map_or(1, |grid| grid.len());
    axes.iter().enumerate().map(|(i, axis)| Ok(entry::described(i, axis, length, how)?.len())).collect()
}

/// Combines `samples` of `shape` (row-major) with the axes, quantity and unit that the manifest and the user name.
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
        report.note(ScatteringNote::ReflectanceFactors);
        divide_by_pi(&mut samples);
        false
    } else {
        cosine_included(fields, quantity, &mut report)?
    };
    let instrument = instrument(fields)?;
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
            grid::divide_by_cosine(&mut grid, &mut report)?;
        }
        report.note_negative(&grid.values);
        Samples::Grid(grid)
    } else if cosine {
        return Err(unfit(
            "cosine_included: true for averages over triangles, over which |cos theta_o| varies: expected false, the values \
             divided by it before they are averaged, or angles theta_o",
        ));
    } else {
        report.note_negative(&samples);
        let axes =
            entries.into_iter().filter_map(|entry| if let Entry::Axis(axis) = entry { Some(axis) } else { None });
        let tensor = Tensor::new(axes.collect(), samples).map_err(|e| unfit(e.to_string()))?;
        Layout::of(quantity, tensor.axes()).map_err(|e| unfit(e.to_string()))?;
        Samples::OnAxes { tensor, sampling }
    };
    let dialect = format!("NumPy array of shape {shape:?}");
    Ok(Acquisition { format: NAME, dialect, quantity, unit, samples, spectral_factor: None, instrument, report })
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
            report.note(ValueNote::QuantityAsAsked {
                asked: asked.to_string(),
                stated: stated.to_string(),
                source: "manifest",
            });
            Ok(asked)
        }
        (Some(quantity), _) | (None, Some(quantity)) => Ok(quantity),
        (None, None) => {
            let known = StatedQuantity::names();
            Err(unfit(format!("no quantity, expected the field or the option `quantity`: {known}")))
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
        report.note(ValueNote::UnitAsAsked { asked, stated, source: "manifest" });
    }
    if stated_quantity.is_factor() {
        return match how.unit.or(stated) {
            None | Some(Unit::One) => Ok(Unit::PerSteradian),
            Some(other) => Err(unfit(format!("unit {other} of a reflectance factor, expected 1"))),
        };
    }
    Ok(how.unit.or(stated).unwrap_or_else(|| {
        let unit = quantity.default_unit();
        report.note(ValueNote::UnitNotStated { unit });
        unit
    }))
}

/// Returns true if the values of an array include the factor `|cos theta_o|`.
fn cosine_included(
    fields: &Map<String, Value>,
    quantity: Quantity,
    report: &mut ParseReport,
) -> Result<bool, FormatError> {
    match fields.get("cosine_included") {
        None if quantity.has_cosine() => {
            report.note(ScatteringNote::CosineNotStated);
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
