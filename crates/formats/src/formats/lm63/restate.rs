//! Writes a luminaire as LM-63 with the planes, keywords, multipliers and header of its source file.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::restated::{Restatement, unfit};
use super::super::windows_1252::encoded;
use super::about::NAME;
use super::labels::Revision;
use super::lines::list;
use crate::domain::limits::MAX_ENTRIES;
use crate::domain::{Frame, Unit};
use std::fmt::Write as _;

/// Revisions of LM-63 and the first lines that name them; the oldest revision has none.
const REVISIONS: [(Revision, &str); 5] = [
    (Revision::Lm63_1986, ""),
    (Revision::Lm63_1991, "IESNA91\n"),
    (Revision::Lm63_1995, "IESNA:LM-63-1995\n"),
    (Revision::Lm63_2002, "IESNA:LM-63-2002\n"),
    (Revision::Lm63_2019, "IES:LM-63-2019\n"),
];
/// Keywords that LM-63 requires from the revision of 2002 on.
const REQUIRED: [&str; 4] = ["TEST", "TESTLAB", "ISSUEDATE", "MANUFAC"];

/// Writes a luminaire on planes of type A, B or C as LM-63. If `names_unit` is true, the keyword `[_INTENSITYUNITS]`
/// states the unit, because the kept keywords do not.
pub fn restate_lm63(grid: &Restatement<'_>, names_unit: bool) -> Result<Vec<u8>, FormatError> {
    let directions = grid.directions;
    let azimuths = directions.azimuths().map_or(&[0.0][..], |azimuths| &azimuths.angles);
    let polar = directions.polar();
    let columns = azimuths.len();
    let (kind, vertical, horizontal) = match directions.frame() {
        Frame::TypeC => (1, polar, azimuths),
        Frame::TypeB => (2, azimuths, polar),
        Frame::TypeA => (3, polar, azimuths),
        Frame::Surface => {
            return unfit(NAME, "directions in the frame of a surface, expected planes of type A, B or C");
        }
    };
    if polar.len().saturating_mul(columns) > MAX_ENTRIES || grid.values.len() != directions.len() {
        let message = format!("{} × {columns} intensities, expected at most {MAX_ENTRIES}", polar.len());
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let is_of = |(revision, _): &&(Revision, &str)| grid.dialect.starts_with(revision.name());
    let (revision, tag) = *REVISIONS.iter().find(is_of).unwrap_or(&REVISIONS[3]);
    let mut text = tag.to_owned();
    // The reader keeps keywords before the TILT line and the header after it.
    let head = grid.metadata.iter().position(|(key, _)| key == "tilt");
    let keywords = head.map_or(&[][..], |end| &grid.metadata[..end]);
    for (key, value) in keywords {
        // Metadata may contain arbitrary text: control characters must not start new lines.
        let mut lines = value.split('\n').map(|line| line.replace(char::is_control, " "));
        let (key, first) = (key.replace(char::is_control, " "), lines.next().unwrap_or_default());
        let _ = if key == "LABEL" { writeln!(text, "{first}") } else { writeln!(text, "[{key}] {first}") };
        lines.for_each(|line| {
            let _ = writeln!(text, "[MORE] {line}");
        });
    }
    if head.is_none() {
        for key in REQUIRED {
            let _ = writeln!(text, "[{key}] not stated");
        }
    }
    if names_unit {
        let _ = writeln!(text, "[_INTENSITYUNITS] {}", grid.unit);
    }
    tilt(grid, &mut text);
    let value = |key: &str, default: &str| grid.kept(key).unwrap_or(default).to_owned();
    let length = |key: &str| value(key, "0").split_whitespace().next().unwrap_or("0").to_owned();
    let units = if grid.kept("luminous_width").is_some_and(|width| width.ends_with("ft")) { 1 } else { 2 };
    let opening = ["luminous_width", "luminous_length", "luminous_height"].map(length).join(" ");
    let lumens = value("lumens_per_lamp", if grid.unit == Unit::CandelaPerKilolumen { "1000" } else { "-1" });
    let _ = writeln!(
        text,
        "{} {lumens} {} {} {} {kind} {units} {opening}",
        value("lamps", "1"),
        value("candela_multiplier", "1"),
        vertical.len(),
        horizontal.len()
    );
    let field_12 = value(revision.field_12_name(), "1");
    let _ = writeln!(text, "{} {field_12} {}", value("ballast_factor", "1"), value("input_watts", "0"));
    list(&mut text, vertical.iter().map(f64::to_string));
    list(&mut text, horizontal.iter().map(f64::to_string));
    let factor = factor(grid, revision);
    for h in 0..horizontal.len() {
        let entry = |v: usize| if kind == 2 { h * columns + v } else { v * columns + h };
        list(&mut text, (0..vertical.len()).map(|v| grid.spelled(entry(v), factor)));
    }
    Ok(encoded(&text.replace('\n', "\r\n")))
}

/// Returns the factor from listed numbers to intensities: the product of the multipliers in the header, in the order in
/// which the reader multiplies them.
fn factor(grid: &Restatement<'_>, revision: Revision) -> f64 {
    let of = |key: &str| grid.number(key).unwrap_or(1.0);
    let factor = of("candela_multiplier") * of("ballast_factor");
    if revision.field_12_multiplies() { factor * of(revision.field_12_name()) } else { factor }
}

/// Writes the TILT line and the tilt factors, if the source file has them. A list that the reader shortened is left
/// out.
fn tilt(grid: &Restatement<'_>, text: &mut String) {
    let tilt = grid.kept("tilt").unwrap_or("NONE");
    let parts = ["tilt_geometry", "tilt_angles", "tilt_factors"].map(|key| grid.kept(key));
    match parts {
        [Some(geometry), Some(angles), Some(factors)] if !angles.contains('…') => {
            let count = angles.split(' ').count();
            let _ = writeln!(text, "TILT=INCLUDE\n{geometry}\n{count}");
            list(text, angles.split(' ').map(str::to_owned));
            list(text, factors.split(' ').map(str::to_owned));
        }
        _ => {
            let is_included = tilt.eq_ignore_ascii_case("INCLUDE");
            let _ = writeln!(text, "TILT={}", if is_included { "NONE" } else { tilt });
        }
    }
}
