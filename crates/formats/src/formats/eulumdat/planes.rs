//! Angles and intensities of an EULUMDAT file. The stored C planes follow from the symmetry and the number of values.

use super::header::Header;
use super::lines::{ANGLE, Lines, decimal};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::FormatError;
use crate::formats::intensities::{Intensities, Stated};
use crate::formats::text::{self, Brief, snippet};
use crate::formats::type_c::Planes;
use crate::notes::{LuminaireNote, Quoted};

/// Symmetries of a luminaire in words, in the order of their number `Isym` in an EULUMDAT file.
pub(super) const SYMMETRIES: [&str; 5] = [
    "no symmetry",
    "axially symmetric",
    "symmetric about the 0-180 plane",
    "symmetric about the 90-270 plane",
    "quadrant symmetric",
];

/// Metadata key of the angles of all C planes that an axially symmetric file lists, in degrees, if their number and
/// distance do not tell them.
pub(super) const LISTED: &str = "c_angles";

/// Returns an angle computed from others, in degrees, without the rounding errors that hide that it has few decimals.
pub(super) fn decimal_angle(angle: f64) -> f64 {
    let near = (angle * 1e9).round() / 1e9;
    if (near - angle).abs() < 1e-11 { near } else { angle }
}

/// Reads the stored C planes of an EULUMDAT file, the azimuths that they represent, and the symmetry in words.
/// Intensities are `scale` times the stored numbers.
pub(super) fn read(
    lines: &mut Lines<'_>,
    header: &Header,
    scale: f64,
    report: &mut ParseReport,
) -> Result<(Stated, Planes, &'static str), FormatError> {
    let (mc, ng) = (header.planes, header.angles);
    let listed = lines.numbers(mc, "a C angle", ANGLE)?;
    let vertical = lines.numbers(ng, "a gamma angle", ANGLE)?;
    let (intensities, rest) = intensities(lines, scale, report)?;
    let found = intensities.values().len();
    let symmetry = stored(header, found, rest, lines, report)?;
    let planes = found / ng;
    let wrong = |found: f64, offset: usize, expected: f64| {
        let message = format!(
            "plane C{}, expected C{expected} in a list of {mc} C planes that is {}",
            Brief(found),
            SYMMETRIES[symmetry]
        );
        Err(lines.refused(offset, message))
    };
    let (horizontal, intensities, stand_for) = match symmetry {
        0 => (listed, intensities, Planes::Circle),
        1 => {
            let angles: Vec<f64> = listed.iter().map(|(angle, _)| *angle).collect();
            if header.even_planes().as_ref() != Some(&angles) {
                // No values tell them again when the file is written anew.
                let angles: Vec<String> = angles.iter().map(f64::to_string).collect();
                report.metadata.push((LISTED.to_owned(), angles.join(" ")));
            }
            (vec![(0.0, listed[0].1)], intensities, Planes::ByAngles)
        }
        3 => {
            // C270 … C0 … C90 is stored; its mirror images C(180 − C) are C270 … C180 … C90.
            let chosen: Vec<(f64, usize)> = (0..planes).map(|i| listed[(3 * mc / 4 + i) % mc]).collect();
            for (i, expected) in [(0, 270.0), (planes - 1, 90.0)] {
                if chosen[i].0 != expected {
                    return wrong(chosen[i].0, chosen[i].1, expected);
                }
            }
            let mirrored = chosen
                .iter()
                .rev()
                .map(|&(c, offset)| (decimal_angle(if c > 180.0 { 540.0 - c } else { 180.0 - c }), offset));
            report.note(LuminaireNote::SymmetryOfHalfPlanes);
            (mirrored.collect(), intensities.reversed(ng), Planes::ByAngles)
        }
        _ => {
            let last = if symmetry == 2 { 180.0 } else { 90.0 };
            for (i, expected) in [(0, 0.0), (planes - 1, last)] {
                if listed[i].0 != expected {
                    return wrong(listed[i].0, listed[i].1, expected);
                }
            }
            (listed[..planes].to_vec(), intensities, Planes::ByAngles)
        }
    };
    Ok((Stated { vertical, horizontal, intensities }, stand_for, SYMMETRIES[symmetry]))
}

/// Returns the symmetry number `Isym` (0 to 4) of an EULUMDAT file that fits `found`, the number of intensities in the
/// file. This is the number in the header if it fits. Otherwise it is 0 (no symmetry) if `found` is the count for all
/// planes, or 1 (axial symmetry) if it is that for one plane. `rest` are the lines after the intensities.
fn stored(
    header: &Header,
    found: usize,
    rest: text::Lines<'_>,
    lines: &Lines<'_>,
    report: &mut ParseReport,
) -> Result<usize, FormatError> {
    let mut others = rest.filter(|line| !line.text.trim().is_empty());
    let first = others.next();
    if let Some(first) = first {
        let further = 1 + others.clone().count();
        report.note(LuminaireNote::LinesAfterIntensities { lines: further, first: Quoted::of(first.text.trim()) });
    }
    let Header { symmetry, planes: mc, angles: ng, .. } = *header;
    let expected = match symmetry {
        0 => Some(mc),
        1 => Some(1),
        2 if mc % 2 == 0 => Some(mc / 2 + 1),
        3 if mc % 4 == 0 => Some(mc / 2 + 1),
        4 if mc % 4 == 0 => Some(mc / 4 + 1),
        _ => None,
    };
    let is = |planes: usize| planes.checked_mul(ng) == Some(found);
    if expected.is_some_and(is) {
        return Ok(symmetry);
    }
    // Numbers that continue after a non-numeric line still count as intensities.
    let broken = others.any(|line| decimal(line.text.trim()).is_some());
    let other = if is(mc) { Some(0) } else { is(1).then_some(1) }.filter(|_| !broken);
    let said = SYMMETRIES[symmetry];
    let Some(other) = other else {
        let planes = expected.map_or_else(
            || format!("a number of C planes divisible by {}", if symmetry == 2 { 2 } else { 4 }),
            |planes| format!("{planes} planes of {ng}"),
        );
        let message = format!("{found} intensities, expected {planes} ({mc} C planes, {said})");
        return Err(match first {
            Some(line) => {
                let line_found = snippet(line.text.trim());
                lines.refused(line.offset, format!("found {line_found}, expected an intensity: {message}"))
            }
            None => lines.refused(lines.at(), message),
        });
    };
    report.note(LuminaireNote::SymmetryContradicted {
        symmetry: said,
        intensities: found,
        planes: if other == 0 { "all planes" } else { "one plane" },
    });
    Ok(other)
}

/// Reads all numbers that follow, one per line, and multiplies them by `scale`. Returns the intensities and the
/// remaining lines, which are not part of the format.
fn intensities<'a>(
    lines: &Lines<'a>,
    scale: f64,
    report: &mut ParseReport,
) -> Result<(Intensities, text::Lines<'a>), FormatError> {
    let mut intensities = Intensities::new(scale, 0);
    let (mut negative, mut lowest) = (0_usize, 0.0_f32);
    let rest = lines.take_numbers(|value, offset| {
        let intensity = intensities.push(value);
        if !intensity.is_finite() {
            let message = format!("intensity {} × {} is too large for float32", Brief(value), Brief(scale));
            return Err(lines.refused(offset, message));
        }
        if intensity < 0.0 {
            negative += 1;
            lowest = lowest.min(intensity);
        }
        Ok(())
    })?;
    if negative > 0 {
        report.note(LuminaireNote::NegativeIntensities { intensities: negative, lowest });
    }
    Ok((intensities, rest))
}
