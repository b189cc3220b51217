//! The axes manifest of an array: JSON ⇄ axes, from full objects and short forms such as `"hemi:4"`.

mod entry;
mod grid;

use super::acquisition::{Acquisition, NoteKind, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::text::snippet;
use super::{Interpretation, npy};
use crate::domain::{Axis, Layout, Measurement, Quantity, Sampling, Tensor, Unit, UnknownName, WavelengthGrid};
use entry::Entry;
use serde_json::{Map, Value, json};
use std::str::FromStr;

/// The manifest of a tensor, which reads back as the same axes: `quantity`, `value_unit`, `sampling` and `axes`.
pub fn manifest_of(measurement: &Measurement) -> Value {
    let axes: Vec<Value> = measurement.tensor.axes().iter().map(describe).collect();
    json!({
        "quantity": measurement.quantity,
        "value_unit": measurement.unit,
        "sampling": measurement.sampling,
        "axes": axes,
    })
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
    samples: Vec<f32>,
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
        return Err(unfit(format!("{} axes for an array of {} (shape {shape:?})", axes.len(), shape.len())));
    }
    let quantity = quantity(fields, how, &mut report)?;
    let unit = unit(fields, how, quantity, &mut report)?;
    let sampling = match text(fields, "sampling")? {
        None => Sampling::default(),
        Some(name) => named(name)?,
    };
    other_fields(fields, &mut report)?;
    let entries: Vec<Entry> = axes
        .iter()
        .zip(shape)
        .enumerate()
        .map(|(i, (axis, &length))| entry::parse(i, axis, length, how))
        .collect::<Result<_, _>>()?;
    let samples = if entries.iter().any(|entry| matches!(entry, Entry::Angle(_))) {
        Samples::Grid(grid::assemble(quantity, entries, samples, &mut report)?)
    } else {
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
) -> Result<Quantity, FormatError> {
    let stated = match text(fields, "quantity")? {
        None => None,
        Some(name) => Some(named::<Quantity>(name)?),
    };
    match (how.quantity, stated) {
        (Some(asked), Some(stated)) if asked != stated => {
            report.note(NoteKind::Warning, format!("taken as {asked} as asked; the manifest says {stated}"));
            Ok(asked)
        }
        (Some(quantity), _) | (None, Some(quantity)) => Ok(quantity),
        (None, None) => {
            let known: Vec<&str> = Quantity::ALL.iter().map(|quantity| quantity.name()).collect();
            Err(unfit(format!("no quantity, expected `quantity` in it or as an option: {}", known.join(", "))))
        }
    }
}

fn unit(
    fields: &Map<String, Value>,
    how: &Interpretation,
    quantity: Quantity,
    report: &mut ParseReport,
) -> Result<Unit, FormatError> {
    let stated = match text(fields, "value_unit")?.or(text(fields, "unit")?) {
        None => None,
        Some(name) => Some(named::<Unit>(name)?),
    };
    if let (Some(asked), Some(stated)) = (how.unit, stated)
        && asked != stated
    {
        report.note(NoteKind::Warning, format!("unit taken as {asked} as asked; the manifest says {stated}"));
    }
    Ok(how.unit.or(stated).unwrap_or_else(|| {
        let unit = quantity.default_unit();
        report.note(NoteKind::Assumed, format!("no unit stated, taken as {unit}"));
        unit
    }))
}

/// Keeps what does not matter here as metadata, and refuses what would change the meaning of the numbers.
fn other_fields(fields: &Map<String, Value>, report: &mut ParseReport) -> Result<(), FormatError> {
    for (key, value) in fields {
        match (key.as_str(), value) {
            ("axes" | "quantity" | "value_unit" | "unit" | "sampling", _) | ("cosine_included", Value::Bool(false)) => {
            }
            ("cosine_included", _) => {
                return Err(unfit("cosine_included: expected false; divide by |cos theta_o| before sending"));
            }
            ("valid" | "sigma", _) => {
                report.note(NoteKind::Skipped, format!("`{key}` names another file, which is not opened"));
            }
            (_, Value::String(text)) => report.metadata.push((key.clone(), text.clone())),
            _ => report.metadata.push((key.clone(), value.to_string())),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Domain, TriangleMesh};
    use crate::formats::{AngleGrid, AzimuthExtent};

    fn read(manifest: &Value, shape: &[usize], how: &Interpretation) -> Result<Acquisition, FormatError> {
        let samples = (0..shape.iter().product()).map(|i| i as f32).collect();
        interpret(manifest, shape, samples, how, ParseReport::default())
    }

    fn plain(manifest: &Value, shape: &[usize]) -> Result<Acquisition, FormatError> {
        read(manifest, shape, &Interpretation::default())
    }

    fn axes_of(acquisition: &Acquisition) -> Vec<Axis> {
        match &acquisition.samples {
            Samples::OnAxes { tensor, .. } => tensor.axes().to_vec(),
            _ => Vec::new(),
        }
    }

    fn grid_of(manifest: &Value, shape: &[usize]) -> (AngleGrid, ParseReport) {
        let acquisition = plain(manifest, shape).unwrap();
        let Samples::Grid(grid) = acquisition.samples else { panic!("expected a grid") };
        (grid, acquisition.report)
    }

    fn hemisphere(level: u8) -> Axis {
        Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap())
    }

    #[test]
    fn short_and_full_forms_are_the_same_axes() {
        let full = json!({"quantity": "brdf", "axes": [
            {"kind": "triangles", "domain": "hemisphere", "level": 0},
            {"kind": "triangles", "domain": "hemisphere", "level": 1},
            {"kind": "wavelength", "start": 380, "step": 5, "count": 3}]});
        let lambda = Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 3).unwrap());
        let expected = vec![hemisphere(0), hemisphere(1), lambda];
        assert_eq!(axes_of(&plain(&full, &[4, 16, 3]).unwrap()), expected);
        for axes in [
            json!(["hemi:0", "hemisphere:1", "lambda:380:5:3"]),
            json!(["hemi:0", "hemi:1", {"name": "wavelength", "unit": "nm", "values": [380, 385, 390]}]),
            json!(["hemi:0", "hemi:1", {"kind": "lambda", "unit": "um", "values": [0.38, 0.385, 0.39]}]),
        ] {
            let short = json!({"quantity": "brdf", "axes": axes});
            assert_eq!(axes_of(&plain(&short, &[4, 16, 3]).unwrap()), expected, "{short}");
        }
    }

    #[test]
    fn a_bare_lambda_needs_as_many_wavelengths_as_the_array_has() {
        let manifest = json!({"axes": ["hemi:0", "hemi:0", "lambda"], "note": "as generated"});
        let how = |quantity, wavelengths: Option<&str>| Interpretation {
            quantity,
            wavelengths: wavelengths.map(str::to_owned),
            ..Interpretation::default()
        };
        let brdf = Some(Quantity::Brdf);
        let read_with = |how: &Interpretation| read(&manifest, &[4, 4, 2], how);
        let acquisition = read_with(&how(brdf, Some("400:500:100"))).unwrap();
        assert_eq!(axes_of(&acquisition)[2].len(), 2);
        assert_eq!(acquisition.report.metadata, [("note".to_owned(), "as generated".to_owned())]);
        for (how, word) in [
            (how(None, Some("400:500:100")), "quantity"),
            (how(brdf, None), "wavelengths"),
            (how(brdf, Some("400:500:10")), "are 11"),
            (how(brdf, Some("500:400")), "START:STOP:STEP"),
        ] {
            let error = read_with(&how).unwrap_err();
            assert_eq!(error.kind, FormatErrorKind::NeedsOption);
            assert!(error.message.contains(word), "{error}");
        }
    }

    #[test]
    fn manifests_round_trip_through_text() {
        let labels = vec!["a".to_owned(), "b".to_owned()];
        let uneven = WavelengthGrid::listed(vec![199.997_970_581_054_7, 200.167_633_056_640_63]).unwrap();
        let sphere = Axis::Triangles(TriangleMesh::new(Domain::Sphere, 0).unwrap());
        let lower = Axis::Triangles(TriangleMesh::new(Domain::Lower, 0).unwrap());
        let even = Axis::Wavelength(WavelengthGrid::even(380.0, 0.1, 2).unwrap());
        for (quantity, axes) in [
            (Quantity::Spectrum, vec![Axis::Index { count: 2, labels }, Axis::Wavelength(uneven)]),
            (Quantity::Edf, vec![sphere, Axis::Rgb]),
            (Quantity::Btdf, vec![Axis::Elevation(vec![0.0, 33.3]), lower, even]),
            (Quantity::Reflectance, vec![Axis::Index { count: 3, labels: vec![] }]),
        ] {
            let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
            let tensor = Tensor::new(axes.clone(), vec![1.0; shape.iter().product()]).unwrap();
            let measurement = Measurement::new(quantity, Unit::Relative, Sampling::Point, tensor).unwrap();
            let text = manifest_of(&measurement).to_string();
            let back = plain(&serde_json::from_str(&text).unwrap(), &shape).unwrap();
            assert_eq!((back.quantity, back.unit), (quantity, Unit::Relative));
            assert!(back.report.notes.is_empty());
            assert_eq!(axes_of(&back), axes);
            assert!(matches!(back.samples, Samples::OnAxes { sampling: Sampling::Point, .. }));
        }
    }

    #[test]
    fn the_users_word_goes_before_the_manifests() {
        let manifest = json!({"quantity": "brdf", "value_unit": "1/sr", "axes": ["index", "rgb"]});
        let how = Interpretation {
            quantity: Some(Quantity::Reflectance),
            unit: Some(Unit::One),
            ..Interpretation::default()
        };
        let acquisition = read(&manifest, &[2, 3], &how).unwrap();
        assert_eq!((acquisition.quantity, acquisition.unit), (Quantity::Reflectance, Unit::One));
        assert_eq!(acquisition.report.notes.len(), 2);
    }

    #[test]
    fn unfit_manifests_are_refused_with_their_reason() {
        use FormatErrorKind::{NeedsOption, OverLimit};
        let brdf = |axes: Value| json!({"quantity": "brdf", "axes": axes});
        let angles = |name: &str, values: &[f64]| json!({"name": name, "values": values});
        for (manifest, shape, kind, word) in [
            (json!("brdf"), vec![3], NeedsOption, "expected"),
            (json!({"quantity": "brdf"}), vec![3], NeedsOption, "`axes`"),
            (json!({"quantity": "brd", "axes": ["rgb"]}), vec![3], NeedsOption, "unknown quantity"),
            (json!({"quantity": 3, "axes": ["rgb"]}), vec![3], NeedsOption, "expected text"),
            (json!({"quantity": "edf", "value_unit": "lm", "axes": ["rgb"]}), vec![3], NeedsOption, "unknown unit"),
            (json!({"quantity": "edf", "sampling": "x", "axes": ["rgb"]}), vec![3], NeedsOption, "unknown sampling"),
            (json!({"quantity": "brdf", "cosine_included": true, "axes": ["rgb"]}), vec![3], NeedsOption, "cosine"),
            (brdf(json!(["rgb"])), vec![3, 3], NeedsOption, "1 axes for an array of 2"),
            (brdf(json!(["hemi:2"])), vec![63], NeedsOption, "64 entries"),
            (brdf(json!(["hemi:9"])), vec![3], OverLimit, "level 9"),
            (brdf(json!(["hemi:x"])), vec![3], NeedsOption, "expected"),
            (brdf(json!(["ball:1"])), vec![3], NeedsOption, "expected"),
            (brdf(json!([7])), vec![3], NeedsOption, "expected"),
            (brdf(json!([{"level": 1}])), vec![3], NeedsOption, "expected"),
            (brdf(json!([{"kind": "triangles", "level": 1}])), vec![3], NeedsOption, "domain"),
            (brdf(json!([{"kind": "triangles", "domain": "hemisphere"}])), vec![3], NeedsOption, "level"),
            (brdf(json!([{"kind": "triangles", "domain": "hemisphere", "lvl": 1}])), vec![3], NeedsOption, "`lvl`"),
            (brdf(json!(["lambda:380:5"])), vec![3], NeedsOption, "expected"),
            (brdf(json!(["lambda:380:0:3"])), vec![3], NeedsOption, "increasing"),
            (brdf(json!(["lambda:380:5:99999999999"])), vec![3], OverLimit, "limit"),
            (brdf(json!([{"kind": "wavelength", "values": [400, 390, 380]}])), vec![3], NeedsOption, "increasing"),
            (brdf(json!([{"kind": "wavelength", "values": "lambda.npy"}])), vec![3], NeedsOption, "not opened"),
            (brdf(json!([{"kind": "wavelength", "unit": "ft", "values": [1]}])), vec![1], NeedsOption, "unit"),
            (brdf(json!([{"kind": "elevation", "values": [0, 30, 100]}, "hemi:0"])), vec![3, 4], NeedsOption, "100"),
            (brdf(json!([{"kind": "index", "count": 3, "labels": ["a"]}])), vec![3], NeedsOption, "labels"),
            (brdf(json!(["hemi:0", "rgb"])), vec![4, 3], NeedsOption, "directions"),
            (brdf(json!([angles("theta_i", &[0.0, 30.0]), "hemi:0"])), vec![2, 4], NeedsOption, "beside angles"),
            (brdf(json!([angles("theta_o", &[0.0, 30.0])])), vec![2], NeedsOption, "theta_i and theta_o"),
            (
                brdf(json!([angles("theta_o", &[0.0]), angles("theta_i", &[0.0])])),
                vec![1, 1],
                NeedsOption,
                "expected the order",
            ),
            (brdf(json!([angles("theta_i", &[30.0, 0.0])])), vec![2], NeedsOption, "increasing"),
            (
                brdf(json!([angles("theta_i", &[0.0]), angles("theta_o", &[91.0])])),
                vec![1, 1],
                NeedsOption,
                "within 0° to 90°",
            ),
        ] {
            let error = plain(&manifest, &shape).unwrap_err();
            assert_eq!(error.kind, kind, "{manifest}: {error}");
            assert!(error.message.contains(word), "{manifest}: {error}");
        }
    }

    #[test]
    fn angle_grids_know_what_their_azimuths_stand_for() {
        let brdf = |phi: Value| {
            json!({"quantity": "brdf", "axes": [
                {"name": "theta_i", "unit": "deg", "values": [0, 30]},
                {"name": "theta_o", "unit": "deg", "values": [0, 40, 80], "covers": [0, 90]}, phi, "rgb"]})
        };
        let extent = |phi: Value, n: usize| {
            let (grid, report) = grid_of(&brdf(phi), &[2, 3, n, 3]);
            let azimuths = grid.outgoing.unwrap().phi.unwrap();
            assert_eq!(grid.values.len(), 18 * azimuths.phi.len());
            (azimuths.extent, azimuths.phi.len(), report.notes.len())
        };
        // One note is the unit assumed.
        let phi = |values: &[f64]| json!({"name": "phi_o", "values": values});
        assert_eq!(extent(phi(&[0.0, 90.0, 180.0]), 3), (AzimuthExtent::Mirrored, 3, 2));
        assert_eq!(extent(phi(&[0.0, 90.0, 180.0, 270.0]), 4), (AzimuthExtent::Circle, 4, 1));
        assert_eq!(extent(phi(&[0.0, 180.0, 360.0]), 3), (AzimuthExtent::Circle, 2, 2));
        assert_eq!(extent(phi(&[0.0, 10.0]), 2), (AzimuthExtent::Sector, 2, 2));
        let stated = |extent: &str| json!({"name": "phi_o", "values": [0, 90, 180], "extent": extent});
        assert_eq!(extent(stated("sector"), 3), (AzimuthExtent::Sector, 3, 1));
        assert_eq!(extent(stated("circle"), 3), (AzimuthExtent::Circle, 3, 1));
        let (grid, _) = grid_of(&brdf(phi(&[0.0, 90.0, 180.0])), &[2, 3, 3, 3]);
        assert_eq!(grid.outgoing.unwrap().covers, (0.0, 90.0));
        assert_eq!(grid.incoming.unwrap().covers, (0.0, 30.0));
    }

    #[test]
    fn both_circles_close_without_mixing_their_columns() {
        let manifest = json!({"quantity": "brdf", "axes": [
            {"kind": "theta_i", "values": [10]}, {"kind": "phi_i", "values": [0, 180, 360]},
            {"kind": "theta_o", "values": [20, 30]}, {"kind": "phi_o", "values": [0, 120, 240, 360]}]});
        let shape = [1, 3, 2, 4];
        // A value that tells its two azimuths apart, equal at 0° and 360°.
        let samples = (0..24).map(|i| (10 * (i / 8 % 2) + 100 * (i / 4 % 2) + i % 4 % 3) as f32).collect();
        let acquisition =
            interpret(&manifest, &shape, samples, &Interpretation::default(), ParseReport::default()).unwrap();
        let Samples::Grid(grid) = acquisition.samples else { panic!("expected a grid") };
        assert_eq!(grid.values, [0.0, 1.0, 2.0, 100.0, 101.0, 102.0, 10.0, 11.0, 12.0, 110.0, 111.0, 112.0]);
        assert_eq!(acquisition.report.notes.len(), 1);
    }
}
