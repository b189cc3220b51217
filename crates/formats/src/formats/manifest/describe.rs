//! Conversion of axes to a manifest, which reads back as the same axes.

use crate::domain::{Axis, DirectionGrid, Measurement, WavelengthGrid};
use serde_json::{Value, json};

/// Returns the manifest that describes the axes of a tensor and reads back as equal axes: `quantity`, `value_unit`,
/// `sampling` and `axes`. Quantities that may include the cosine also get `cosine_included`.
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
        Axis::Grid(grid) => directions(grid),
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

/// Returns the description of a grid of directions for a manifest; fields with default values are left out.
fn directions(grid: &DirectionGrid) -> Value {
    let polar = grid.polar();
    let mut axis = json!({"kind": "directions", "frame": grid.frame(), "polar": polar, "outside": grid.outside()});
    if let Some(azimuths) = grid.azimuths() {
        axis["azimuths"] = json!(azimuths.angles);
        axis["extent"] = json!(azimuths.extent);
    }
    if (Some(&grid.covers().0), Some(&grid.covers().1)) != (polar.first(), polar.last()) {
        axis["covers"] = json!(grid.covers());
    }
    if grid.is_polar_mirrored() {
        axis["mirrored"] = json!(true);
    }
    axis
}
