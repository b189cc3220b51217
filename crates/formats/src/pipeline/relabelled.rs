//! Conversion of a luminaire to the header and the planes of another file format.

use super::keywords::{self, Keywords};
use super::origin::Origin;
use crate::domain::{Axis, AzimuthExtent, Azimuths, DirectionGrid, Frame, Measurement, Quantity, Tensor, Unit};
use crate::export::{ExportFormat, zonal_flux};

/// A luminaire converted to the header fields and the C planes of another file format.
#[derive(Debug)]
pub(super) struct Relabelled {
    /// Samples of the luminaire on the C planes of the format to which it is converted.
    pub(super) measurement: Measurement,
    /// Header fields of the luminaire, under the names that the parser of the format to which it is converted uses.
    pub(super) metadata: Vec<(String, String)>,
    /// Contents of the luminaire that the format to which it is converted cannot hold, one phrase each.
    pub(super) lost: Vec<String>,
}

/// Upper bound on the text of a header field, in characters, because old EULUMDAT readers accept no more. Raising it
/// keeps longer texts.
const LONGEST: usize = 78;
/// Largest difference between steps of angles that count as evenly spaced, in degrees. Raising it accepts less even
/// angles.
const STEP: f64 = 1e-9;

/// Converts a luminaire to the header and C planes of `format`, if its source has another format. Returns `None` if it
/// is not on C planes, or if `format` cannot hold its unit.
pub(super) fn relabelled(measurement: &Measurement, origin: &Origin<'_>, format: ExportFormat) -> Option<Relabelled> {
    let [Axis::Grid(directions)] = measurement.tensor.axes() else { return None };
    if measurement.quantity != Quantity::Edf || directions.frame() != Frame::TypeC {
        return None;
    }
    match format {
        ExportFormat::Eulumdat => {
            let is_luminous = matches!(measurement.unit, Unit::Candela | Unit::CandelaPerKilolumen);
            is_luminous.then(|| eulumdat(measurement, directions, origin)).flatten()
        }
        ExportFormat::Lm63 => lm63(measurement, directions, origin),
        _ => None,
    }
}

/// Returns a header text as one line of printable characters, cut to the longest allowed.
fn line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(LONGEST).collect()
}

/// Returns the total flux of a luminaire, and the fraction of it below the horizon (0 to 1).
fn flux(directions: &DirectionGrid, values: &[f32]) -> (f64, f64) {
    let all = zonal_flux(directions, values);
    let rows = directions.polar().partition_point(|&gamma| gamma <= 90.0);
    let below = DirectionGrid::new(Frame::TypeC, directions.polar()[..rows].to_vec(), directions.azimuths().cloned())
        .map_or(0.0, |below| zonal_flux(&below, &values[..rows * directions.shape()[1]]));
    (all, if all > 0.0 { below / all } else { 0.0 })
}

/// Returns the step of evenly spaced angles in degrees, or 0 if they are uneven.
fn step(angles: &[f64]) -> f64 {
    let first = angles.get(1).map_or(0.0, |second| second - angles[0]);
    if angles.array_windows().all(|[a, b]| (b - a - first).abs() < STEP) { first } else { 0.0 }
}

/// Puts a luminaire on the C planes `azimuths`. `column` gives the index of the old plane for that of each new plane.
fn on_planes(
    measurement: &Measurement,
    directions: &DirectionGrid,
    azimuths: Azimuths,
    column: impl Fn(usize) -> usize,
) -> Option<Measurement> {
    let (low, high) = directions.covers();
    let (before, after) = (directions.shape()[1], azimuths.angles.len());
    let grid = DirectionGrid::new(directions.frame(), directions.polar().to_vec(), Some(azimuths)).ok()?;
    let grid = grid.covering(low, high).ok()?.with_outside(directions.outside());
    let rows = measurement.tensor.samples().chunks_exact(before);
    let samples = rows.flat_map(|row| (0..after).map(|i| row[column(i)]).collect::<Vec<_>>()).collect();
    Some(Measurement { tensor: Tensor::new(vec![Axis::Grid(grid)], samples).ok()?, ..measurement.clone() })
}

fn eulumdat(measurement: &Measurement, directions: &DirectionGrid, origin: &Origin<'_>) -> Option<Relabelled> {
    let fields = Keywords(origin.metadata);
    let mut lost = Vec::new();
    // EULUMDAT lists C0 once.
    let closed = directions.azimuths().filter(|azimuths| azimuths.extent == AzimuthExtent::Closed);
    let measurement = match closed {
        Some(azimuths) => {
            let kept = azimuths.angles.len() - 1;
            let differs = measurement.tensor.samples().chunks_exact(kept + 1).any(|row| row[0] != row[kept]);
            if differs {
                lost.push("the values at C360, which differ from those at C0".to_owned());
            }
            let circle = Azimuths { angles: azimuths.angles[..kept].to_vec(), extent: AzimuthExtent::Circle };
            on_planes(measurement, directions, circle, |i| i)?
        }
        None => measurement.clone(),
    };
    let [Axis::Grid(directions)] = measurement.tensor.axes() else { return None };
    let (flux, downward) = flux(directions, measurement.tensor.samples());
    let count = fields.number(keywords::LAMPS).filter(|count| *count >= 1.0).unwrap_or(1.0);
    let rated = fields.number(keywords::LUMENS_PER_LAMP).filter(|lumens| *lumens > 0.0).map(|lumens| count * lumens);
    let (lamps, lumens, ratio) = match (measurement.unit, rated) {
        (Unit::CandelaPerKilolumen, rated) => (count, rated.unwrap_or(1000.0), flux / 10.0),
        (_, Some(rated)) => (count, rated, 100.0 * flux / rated),
        (_, None) if flux > 0.0 => (-1.0, rounded(flux), 100.0),
        _ => return None,
    };
    let millimetres = |key: &str| {
        let unit = if fields.text(&[key]).is_some_and(|text| text.ends_with("ft")) { 304.8 } else { 1000.0 };
        rounded(fields.number(&[key]).unwrap_or(0.0) * unit)
    };
    // C0 runs across the lamps, along the X axis of LM-63.
    let (along_x, along_y) = (millimetres("luminous_length"), millimetres("luminous_width"));
    let is_round = along_x < 0.0 || along_y < 0.0;
    let (length, width) = if is_round { (along_x.min(along_y).abs(), 0.0) } else { (along_y, along_x) };
    let height = millimetres("luminous_height").abs();
    let gamma_step = step(directions.polar());
    let azimuths = directions.azimuths();
    let c_step = azimuths.map_or(0.0, |azimuths| match azimuths.extent {
        AzimuthExtent::Circle => step(&[&azimuths.angles[..], &[azimuths.angles[0] + 360.0]].concat()),
        _ => step(&azimuths.angles),
    });
    let mut metadata = Vec::new();
    let mut add = |key: &str, value: String| metadata.push((key.to_owned(), value));
    for (key, keys) in [
        ("company", keywords::MAKER),
        ("report", keywords::REPORT),
        ("luminaire", keywords::NAME),
        ("luminaire_number", keywords::CATALOGUE_NUMBER),
        ("date", keywords::DATE),
        ("lamp", keywords::LAMP),
        ("colour", keywords::COLOUR),
        ("colour_rendering", keywords::COLOUR_RENDERING),
    ] {
        add(key, fields.text(keys).map(line).unwrap_or_default());
    }
    add("luminaire_type", if azimuths.is_none() { "1" } else { "3" }.to_owned());
    for (key, value) in [
        ("c_step", c_step),
        ("gamma_step", gamma_step),
        ("luminaire_length_mm", length),
        ("luminaire_width_mm", width),
        ("luminaire_height_mm", height),
        ("luminous_length_mm", length),
        ("luminous_width_mm", width),
        ("luminous_height_c0_mm", height),
        ("luminous_height_c90_mm", height),
        ("luminous_height_c180_mm", height),
        ("luminous_height_c270_mm", height),
        ("downward_flux_percent", rounded(100.0 * downward)),
        ("light_output_ratio_percent", rounded(ratio)),
        ("conversion_factor", 1.0),
        ("tilt_degrees", 0.0),
        ("lamps", lamps),
        ("lumens", lumens),
        ("watts", fields.number(keywords::WATTS).unwrap_or(0.0)),
    ] {
        add(key, value.to_string());
    }
    for index in ["0.6", "0.8", "1", "1.25", "1.5", "2", "2.5", "3", "4", "5"] {
        add(&format!("direct_ratio_k{index}"), "0".to_owned());
    }
    Some(Relabelled { measurement, metadata, lost })
}

fn lm63(measurement: &Measurement, directions: &DirectionGrid, origin: &Origin<'_>) -> Option<Relabelled> {
    let fields = Keywords(origin.metadata);
    // LM-63 repeats the first plane of a full circle as the last.
    let circle = directions.azimuths().filter(|azimuths| azimuths.extent == AzimuthExtent::Circle);
    let measurement = match circle {
        Some(azimuths) if azimuths.angles[0] == 0.0 => {
            let count = azimuths.angles.len();
            let angles = azimuths.angles.iter().copied().chain([360.0]).collect();
            let closed = Azimuths { angles, extent: AzimuthExtent::Closed };
            on_planes(measurement, directions, closed, |i| i % count)?
        }
        _ => measurement.clone(),
    };
    let mut metadata = Vec::new();
    let mut add = |key: &str, value: String| metadata.push((key.to_owned(), value));
    for (key, keys) in [
        ("TEST", keywords::REPORT),
        ("TESTLAB", keywords::LABORATORY),
        ("ISSUEDATE", keywords::DATE),
        ("MANUFAC", keywords::MAKER),
        ("LUMCAT", keywords::CATALOGUE_NUMBER),
        ("LUMINAIRE", keywords::NAME),
        ("LAMP", keywords::LAMP),
    ] {
        add(key, fields.text(keys).map_or_else(|| "not stated".to_owned(), line));
    }
    add("tilt", "NONE".to_owned());
    let lamps = fields.number(keywords::LAMPS).unwrap_or(-1.0);
    let lumens = fields.number(keywords::LUMENS).filter(|lumens| *lumens > 0.0 && lamps >= 1.0);
    add("lamps", lamps.max(1.0).to_string());
    add("lumens_per_lamp", lumens.map_or(-1.0, |lumens| rounded(lumens / lamps)).to_string());
    let metres = |key: &str| rounded(fields.number(&[key]).unwrap_or(0.0) / 1000.0);
    let (length, width) = (metres("luminous_length_mm"), metres("luminous_width_mm"));
    // A width of 0 is a disk. C0 runs across the lamps, along the X axis of LM-63.
    let (along_x, along_y) = if width == 0.0 { (-length, -length) } else { (width, length) };
    add("luminous_width", format!("{} m", along_y + 0.0));
    add("luminous_length", format!("{} m", along_x + 0.0));
    add("luminous_height", format!("{} m", metres("luminous_height_c0_mm")));
    add("input_watts", fields.number(keywords::WATTS).unwrap_or(0.0).to_string());
    Some(Relabelled { measurement, metadata, lost: Vec::new() })
}

/// Returns the number rounded to 6 significant digits.
fn rounded(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}
