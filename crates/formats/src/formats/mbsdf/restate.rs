//! Writes a measured BSDF with the tables of its source file, value by value.

use super::about::NAME;
use super::angles::{azimuths, polar_angles};
use super::blocks::{SHORT_LINE, VERSION};
use super::joined::BELOW_HORIZON;
use crate::domain::{Axis, AzimuthExtent, DirectionGrid, Tensor};
use crate::formats::error::FormatError;
use crate::formats::restated::unfit;

/// Writes a measured BSDF file from `tensor`, `[incoming, outgoing]` or `[incoming, outgoing, rgb]` on the angles of
/// the format. `metadata` holds the header lines as the reader keeps them. Masked values become 0.
pub fn restate_mbsdf(tensor: &Tensor, metadata: &[(String, String)]) -> Result<Vec<u8>, FormatError> {
    let axes = tensor.axes();
    let (elevations, directions, is_rgb) = match axes {
        [Axis::Elevation(elevations), Axis::Grid(directions)] => (elevations, directions, false),
        [Axis::Elevation(elevations), Axis::Grid(directions), Axis::Rgb] => (elevations, directions, true),
        _ => {
            return unfit(
                NAME,
                "the axes are not those of a measured BSDF file, expected incoming elevations, an outgoing grid, and \
                 RGB or no channels",
            );
        }
    };
    let (n, m) = (elevations.len(), directions.shape()[1]);
    let sides = sides(directions, n);
    let is_even = elevations.iter().copied().eq(polar_angles(n));
    let phi_fits = match directions.azimuths() {
        None => true,
        Some(listed) => listed.extent == AzimuthExtent::Mirrored && listed.angles == azimuths(m),
    };
    let (Some(sides), true, true) = (sides, is_even, phi_fits) else {
        return unfit(NAME, "angles that are not those of the format, expected i · 90°/n and j · 180°/(m - 1)");
    };
    let mut bytes = VERSION.to_vec();
    let is_short = metadata.iter().any(|(key, _)| key == SHORT_LINE);
    for (key, value) in metadata.iter().filter(|(key, _)| key != SHORT_LINE) {
        let line = if key == "comment" { value.clone() } else { format!("{key}={value}") };
        if line.contains(['\n', '\0']) || line.starts_with("MBSDF_DATA") {
            return unfit(NAME, format!("metadata {line:?}, expected a line of text"));
        }
        bytes.extend(line.bytes().chain([b'\n']));
    }
    let row = m * if is_rgb { 3 } else { 1 };
    let plane = row * directions.polar().len();
    for Side { line, rows } in sides {
        let line = if is_short { "MBSDF_DATA=\n" } else { line };
        bytes.extend(line.as_bytes());
        for word in [u32::from(is_rgb), n as u32, m as u32] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.reserve(4 * n * n * row);
        for table in tensor.samples().chunks_exact(plane) {
            for &at in &rows {
                let values =
                    table[at * row..(at + 1) * row].iter().map(|value| if value.is_nan() { 0.0 } else { *value });
                bytes.extend(values.flat_map(f32::to_le_bytes));
            }
        }
    }
    Ok(bytes)
}

/// One table to write, reflection or transmission: the rows of the grid from the normal to the horizon.
struct Side {
    line: &'static str,
    rows: Vec<usize>,
}

/// Returns the reflection and transmission tables to which the polar angles of a grid belong; `None` if the angles are
/// not those of a measured BSDF file.
fn sides(directions: &DirectionGrid, n: usize) -> Option<Vec<Side>> {
    let polar = directions.polar();
    let up: Vec<f64> = polar_angles(n).collect();
    let down: Vec<f64> = polar_angles(n).rev().map(|theta| 180.0 - theta).collect();
    let side = |is_up: bool, rows: Vec<usize>| Side {
        line: if is_up { "MBSDF_DATA_REFLECTION=\n" } else { "MBSDF_DATA_TRANSMISSION=\n" },
        rows,
    };
    if polar == up {
        return Some(vec![side(true, (0..n).collect())]);
    }
    if polar == down {
        return Some(vec![side(false, (0..n).rev().collect())]);
    }
    // Both sides, with the horizon of each between them.
    let both = [&up[..], &[90.0, BELOW_HORIZON], &down].concat();
    (polar == both).then(|| vec![side(true, (0..n).collect()), side(false, (n + 2..2 * n + 2).rev().collect())])
}
