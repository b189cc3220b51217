//! Description of a measurement, which the user sees before anything is compressed.

use crate::domain::{Axis, WavelengthGrid};
use crate::formats::{Acquisition, AngleGrid, Angles, AzimuthExtent, Modelled, Note, NoteKind, Outside, Samples};
use crate::projection;
use serde_json::{Map, Value, json};

/// Upper bound on the header fields of a file that are stored with its measurement.
const MAX_FIELDS: usize = 200;

/// Describes an acquisition: format, dialect, quantity, unit, axes, samples, range, coverage, warnings and header
/// fields.
pub(crate) fn describe(acquisition: &Acquisition) -> Map<String, Value> {
    let (mut axes, values, coverage) = match &acquisition.samples {
        Samples::OnAxes { tensor, sampling } => {
            let axes: Vec<Value> = tensor.axes().iter().map(axis).collect();
            (axes, tensor.samples(), json!({ "sampling": sampling, "outside": "masked" }))
        }
        Samples::Grid(grid) => (grid_axes(grid), grid.values.as_slice(), grid_coverage(grid)),
        Samples::Scattered(scattered) => {
            let mut axes = vec![json!({ "kind": "directions", "count": scattered.directions() })];
            axes.extend(scattered.spectral.as_ref().map(axis));
            let coverage = json!({
                "isotropic": scattered.isotropic,
                "stated_uncertainties": scattered.sigma.is_some(),
                "outside": "masked",
            });
            (axes, scattered.values.as_slice(), coverage)
        }
        // The range of a function is known once it is projected.
        Samples::Function(modelled) => (function_axes(modelled), &[][..], function_coverage(modelled)),
    };
    let (samples, missing) = match &acquisition.samples {
        Samples::Function(modelled) => (modelled.numbers, modelled.missing),
        _ => (values.len(), values.iter().filter(|s| s.is_nan()).count()),
    };
    let mut range = extremes(values.iter().map(|&s| f64::from(s)));
    if let Some(factor) = &acquisition.spectral_factor {
        axes.push(wavelengths(&factor.grid));
        // value = sample · factor is bilinear: its extremes are products of extremes.
        let factors = extremes(factor.factors.iter().copied());
        range = range.zip(factors).and_then(|((a, b), (c, d))| extremes([a * c, a * d, b * c, b * d]));
    }
    let fields: Vec<Value> = acquisition
        .report
        .metadata
        .iter()
        .take(MAX_FIELDS)
        .map(|(name, value)| json!({ "name": name, "value": value }))
        .collect();
    let checked = projection::plausibility(acquisition).remarks().into_iter();
    let checked = checked.map(|message| Note { kind: NoteKind::Checked, message });
    let warnings: Vec<Note> = acquisition.report.notes.iter().cloned().chain(checked).collect();
    let described = json!({
        "format": acquisition.format,
        "dialect": acquisition.dialect,
        "quantity": acquisition.quantity,
        "unit": acquisition.unit,
        "axes": axes,
        "samples": samples,
        "range": range.map(|(low, high)| [low, high]),
        "coverage": merged(coverage, json!({ "missing_samples": missing })),
        "instrument": acquisition.instrument,
        "warnings": warnings,
        "fields": fields,
        "needs": [],
    });
    into_map(described)
}

/// Describes a file that needs an option before it can be read.
pub(crate) fn describe_needy(format: &str, need: &str) -> Map<String, Value> {
    into_map(json!({
        "format": format,
        "dialect": null,
        "quantity": null,
        "unit": null,
        "axes": [],
        "samples": null,
        "range": null,
        "coverage": null,
        "instrument": {},
        "warnings": [{ "kind": NoteKind::Warning, "message": need }],
        "fields": [],
        "needs": [need],
    }))
}

fn axis(axis: &Axis) -> Value {
    match axis {
        Axis::Triangles(mesh) => {
            json!({ "kind": "triangles", "domain": mesh.domain(), "level": mesh.level(), "count": mesh.len() })
        }
        Axis::Grid(grid) => {
            let [polar, azimuths] = grid.shape();
            let (first, last) = grid.covers();
            json!({
                "kind": "directions", "frame": grid.frame(), "count": grid.len(), "polar": polar, "azimuths": azimuths,
                "first": first, "last": last, "unit": "degree",
            })
        }
        Axis::Elevation(values) => angles("elevation", values),
        Axis::Wavelength(grid) => wavelengths(grid),
        Axis::Index { count, labels } => json!({ "kind": "index", "count": count, "labels": labels }),
        Axis::Rgb => json!({ "kind": "rgb", "count": 3 }),
    }
}

fn wavelengths(grid: &WavelengthGrid) -> Value {
    let (first, last) = grid.range();
    json!({ "kind": "wavelength", "count": grid.len(), "first": first, "last": last, "unit": "nm" })
}

fn angles(kind: &str, values: &[f64]) -> Value {
    json!({ "kind": kind, "count": values.len(), "first": values.first(), "last": values.last(), "unit": "degree" })
}

fn grid_axes(grid: &AngleGrid) -> Vec<Value> {
    let mut axes: Vec<Value> = grid.index.iter().map(axis).collect();
    for (direction, theta, phi) in [(&grid.incoming, "theta_i", "phi_i"), (&grid.outgoing, "theta_o", "phi_o")] {
        axes.extend(direction.iter().flat_map(|direction| direction_axes(direction, theta, phi)));
    }
    axes.extend(grid.spectral.as_ref().map(axis));
    axes
}

fn direction_axes(direction: &Angles, theta: &str, phi: &str) -> Vec<Value> {
    let azimuths = direction.phi.iter().map(|azimuths| angles(phi, &azimuths.phi));
    std::iter::once(angles(theta, &direction.theta)).chain(azimuths).collect()
}

fn function_axes(modelled: &Modelled) -> Vec<Value> {
    let mut axes = direction_axes(&modelled.incoming, "theta_i", "phi_i");
    axes.push(json!({ "kind": "outgoing", "spacing": modelled.outgoing_spacing, "unit": "degree" }));
    axes.extend(modelled.spectral.as_ref().map(axis));
    axes
}

fn function_coverage(modelled: &Modelled) -> Value {
    json!({ "incoming": direction_coverage(&modelled.incoming), "outside": "masked" })
}

fn grid_coverage(grid: &AngleGrid) -> Value {
    json!({
        "incoming": grid.incoming.as_ref().map(direction_coverage),
        "outgoing": grid.outgoing.as_ref().map(direction_coverage),
        "stated_uncertainties": grid.sigma.is_some(),
        "outside": match grid.outside {
            Outside::Zero => "zero",
            Outside::Masked => "masked",
        },
    })
}

fn direction_coverage(angles: &Angles) -> Value {
    let phi = angles.phi.as_ref().map(|azimuths| {
        json!({
            "first": azimuths.phi.first(),
            "last": azimuths.phi.last(),
            "extent": match azimuths.extent {
                AzimuthExtent::Circle => "circle",
                AzimuthExtent::Mirrored => "mirrored",
                AzimuthExtent::Sector => "sector",
            },
        })
    });
    json!({ "theta": [angles.covers.0, angles.covers.1], "phi": phi })
}

/// Returns the smallest and the largest of the values that are not masked.
fn extremes(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|v| !v.is_nan()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((low.min(v), high.max(v))),
    })
}

fn merged(a: Value, b: Value) -> Value {
    let mut map = into_map(a);
    map.extend(into_map(b));
    Value::Object(map)
}

fn into_map(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Quantity, Unit};
    use crate::formats::{Azimuths, Instrument, ParseReport, SpectralFactor};

    #[test]
    fn a_luminaire_with_a_spectrum_has_its_axes_and_range() {
        let grid = AngleGrid {
            index: vec![],
            incoming: None,
            outgoing: Some(Angles {
                theta: vec![90.0, 180.0],
                covers: (90.0, 180.0),
                phi: Some(Azimuths { phi: vec![0.0, 120.0, 240.0], extent: AzimuthExtent::Circle }),
            }),
            spectral: None,
            outside: Outside::Zero,
            values: vec![1.0, 2.0, 3.0, 4.0, f32::NAN, 0.5],
            stated: None,
            sigma: None,
        };
        let factor = SpectralFactor { grid: WavelengthGrid::even(400.0, 10.0, 2).unwrap(), factors: vec![0.5, 2.0] };
        let described = describe(&Acquisition {
            format: "ies",
            dialect: "LM-63-2002".to_owned(),
            quantity: Quantity::Edf,
            unit: Unit::Relative,
            samples: Samples::Grid(grid),
            spectral_factor: Some(factor),
            instrument: Instrument::default(),
            report: ParseReport::default(),
        });
        let kinds: Vec<&str> =
            described["axes"].as_array().unwrap().iter().map(|axis| axis["kind"].as_str().unwrap()).collect();
        assert_eq!(kinds, ["theta_o", "phi_o", "wavelength"]);
        assert_eq!(described["range"], json!([0.25, 8.0]));
        assert_eq!(described["coverage"]["missing_samples"], 1);
        assert_eq!(described["coverage"]["outgoing"]["phi"]["extent"], "circle");
    }
}
