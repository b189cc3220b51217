//! Writes a luminaire as EULUMDAT with the planes, symmetry, lamps and texts of its source file.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::restated::{Restatement, unfit};
use super::super::windows_1252::encoded;
use super::about::NAME;
use super::header::{DIMENSIONS, MOST_PLANES, ROOM_INDICES, even_planes};
use super::planes::{LISTED, SYMMETRIES, decimal_angle};
use crate::domain::limits::MAX_ENTRIES;
use crate::domain::{AzimuthExtent, Frame, Unit};

/// Metadata keys of the six lines with which an EULUMDAT file describes one set of lamps. The reader stores the text of
/// each line under its key.
const LAMP: [&str; 6] = ["lamps", "lamp", "lumens", "colour", "colour_rendering", "watts"];

/// Writes a luminaire on C planes as EULUMDAT, with the header fields that the reader of its source file kept.
pub fn restate_eulumdat(grid: &Restatement<'_>) -> Result<Vec<u8>, FormatError> {
    let directions = grid.directions;
    if directions.frame() != Frame::TypeC {
        return unfit(NAME, "directions that are no C planes, expected type C");
    }
    let gamma = directions.polar();
    let azimuths = directions.azimuths();
    let stored = azimuths.map_or(&[0.0][..], |azimuths| &azimuths.angles);
    if gamma.len().saturating_mul(stored.len()) > MAX_ENTRIES || grid.values.len() != directions.len() {
        let message = format!("{} × {} intensities, expected at most {MAX_ENTRIES}", gamma.len(), stored.len());
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let Some((symmetry, listed)) = planes(grid, azimuths.map(|azimuths| azimuths.extent), stored) else {
        return unfit(NAME, "C planes with a symmetry that the format does not have, or not with these planes");
    };
    let factor = factor(grid)?;
    let mut lines: Vec<String> = Vec::new();
    let kept = |key: &str| grid.kept(key).unwrap_or_default().to_owned();
    lines.extend([kept("company"), grid.kept("luminaire_type").unwrap_or("3").to_owned(), symmetry.to_string()]);
    lines.extend([listed.len().to_string(), kept("c_step"), gamma.len().to_string(), kept("gamma_step")]);
    lines.extend(["report", "luminaire", "luminaire_number", "file_name", "date"].map(kept));
    lines.extend(DIMENSIONS.map(kept));
    lines
        .extend(["downward_flux_percent", "light_output_ratio_percent", "conversion_factor", "tilt_degrees"].map(kept));
    let sets = sets(grid);
    lines.push(sets.len().to_string());
    for set in sets {
        lines.extend(LAMP.map(|field| kept(&format!("{set}{field}"))));
    }
    lines.extend(ROOM_INDICES.map(|index| kept(&format!("direct_ratio_k{index}"))));
    lines.extend(listed.iter().chain(gamma).map(f64::to_string));
    let columns = stored.len();
    for plane in 0..columns {
        // Symmetry 3 stores C270 over C0 to C90: the planes C(180 − C) of C90 to C270, in reverse order.
        let column = if symmetry == 3 { columns - 1 - plane } else { plane };
        lines.extend((0..gamma.len()).map(|row| grid.spelled(row * columns + column, factor)));
    }
    let mut text = lines.join("\r\n");
    text.push_str("\r\n");
    Ok(encoded(&text))
}

/// Returns the number `Isym` of the symmetry, and the azimuths C of all planes on the circle: the stored ones and their
/// mirror images. `None` if EULUMDAT has no such symmetry, or cannot list these planes with it.
fn planes(grid: &Restatement<'_>, extent: Option<AzimuthExtent>, stored: &[f64]) -> Option<(u8, Vec<f64>)> {
    let ends = (stored[0], stored[stored.len() - 1]);
    let mut listed = stored.to_vec();
    let symmetry = match (extent, ends) {
        (None, _) if grid.dialect.starts_with("EULUMDAT") && grid.dialect.ends_with(SYMMETRIES[0]) => {
            return Some((0, vec![0.0]));
        }
        (None, _) => {
            // The other planes, which have no values, are listed as well.
            let angles = grid.kept(LISTED).unwrap_or_default().split_whitespace().map(str::parse::<f64>);
            let angles: Vec<f64> = angles.map_while(Result::ok).take(MOST_PLANES).collect();
            if !angles.is_empty() {
                return Some((1, angles));
            }
            let (count, step) = (grid.number("c_planes").unwrap_or(1.0), grid.number("c_step").unwrap_or(0.0));
            return Some((1, even_planes(count, step).unwrap_or_else(|| vec![0.0])));
        }
        (Some(AzimuthExtent::Quadrant), (0.0, 90.0)) => {
            listed.extend(stored.iter().rev().skip(1).map(|c| decimal_angle(180.0 - c)));
            let half = listed.clone();
            listed.extend(half[1..half.len() - 1].iter().rev().map(|c| decimal_angle(360.0 - c)));
            4
        }
        (Some(AzimuthExtent::Mirrored), (0.0, 180.0)) => {
            listed.extend(stored[1..stored.len() - 1].iter().rev().map(|c| decimal_angle(360.0 - c)));
            2
        }
        (Some(AzimuthExtent::MirroredAt90), (90.0, 270.0)) => {
            listed.extend(stored[1..stored.len() - 1].iter().map(|c| decimal_angle((540.0 - c) % 360.0)));
            listed.sort_by(f64::total_cmp);
            // C90 and C270 are found by their number in the list of all planes.
            let quarter = listed.len() / 4;
            if !listed.len().is_multiple_of(4) || (listed[quarter], listed[3 * quarter]) != (90.0, 270.0) {
                return None;
            }
            3
        }
        (Some(AzimuthExtent::Circle | AzimuthExtent::Closed), _) => 0,
        _ => return None,
    };
    Some((symmetry, listed))
}

/// Returns the factor from the numbers in the EULUMDAT file to intensities, as the reader applies it.
fn factor(grid: &Restatement<'_>) -> Result<f64, FormatError> {
    let conversion = grid.number("conversion_factor").unwrap_or(1.0);
    if grid.unit == Unit::CandelaPerKilolumen {
        return Ok(conversion);
    }
    let lumens = grid.number("lumens").or_else(|| grid.number("set_1_lumens")).filter(|lumens| *lumens > 0.0);
    match lumens {
        Some(lumens) => Ok(conversion * lumens / 1000.0),
        None if grid.unit == Unit::Relative => Ok(conversion),
        None => unfit(
            NAME,
            format!(
                "the intensities are in {}, but the file does not state the lumens of its lamps, expected them",
                grid.unit
            ),
        ),
    }
}

/// Returns the prefixes of the names of metadata, one for each lamp set.
fn sets(grid: &Restatement<'_>) -> Vec<String> {
    if grid.kept("lamps").is_some() {
        return vec![String::new()];
    }
    let prefixes = (1..).map(|set| format!("set_{set}_"));
    prefixes.take_while(|prefix| grid.kept(&format!("{prefix}lamps")).is_some()).collect()
}
