//! Parser and checks of the `#KEY value` lines of an ALTA file: coordinates, values, and the number of each.

use super::about::NAME;
use super::coordinates::Coordinates;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::text::{Source, snippet};
use crate::notes::{ScatteringNote, ValueNote};

/// Upper bound on the number of values in a row of an ALTA file: three channels.
pub(super) const MOST_VALUES: usize = 3;
/// Upper bound on the header lines of an ALTA file that are examined. Raising it recognises files with longer comments.
const LOOKED_AT: usize = 200;
/// Advice for the user of an ALTA file that cannot be read.
const CONVERT: &str = "convert it with ALTA (`data2data --param ISOTROPIC_TV_TL_DPHI`, or SPHERICAL_TL_PL_TV_PV where it is \
                       anisotropic), or write its directions and values as radiometric-csv";

/// Contents of the rows of an ALTA file.
pub(super) struct Header {
    pub(super) coordinates: Coordinates,
    /// Number of values in a row of an ALTA file: 1, or 3 for RGB.
    pub(super) values: usize,
}

/// Returns the key and the value of a line `#KEY value`.
fn field(line: &str) -> Option<(&str, &str)> {
    let line = line.trim_start().strip_prefix('#')?.trim_start();
    let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    Some((key, value.trim()))
}

/// Returns true if the first lines of a file name ALTA's coordinates, values or dimensions.
pub(super) fn is_header(head: &str) -> bool {
    let is_dimensions = |value: &str| {
        value.split_whitespace().count() == 2 && value.split_whitespace().all(|n| n.parse::<u32>().is_ok())
    };
    head.lines()
        .take(LOOKED_AT)
        .map_while(|line| if line.trim().is_empty() { Some(None) } else { field(line).map(Some) })
        .flatten()
        .any(|(key, value)| {
            ["PARAM_IN", "PARAM_OUT"].contains(&key)
                || key == "DIM" && is_dimensions(value)
                || key == "ALTA" && value.ends_with("HEADER")
        })
}

fn unsupported(message: impl Into<String>) -> FormatError {
    FormatError::new(FormatErrorKind::Unsupported, NAME, message)
}

/// Reads the header of an ALTA file; refuses files with missing or unsupported fields.
pub(super) fn read(source: &Source, how: &Interpretation, report: &mut ParseReport) -> Result<Header, FormatError> {
    let mut fields: Vec<(&str, &str, usize)> = Vec::new();
    for line in source.lines().take(LOOKED_AT) {
        match field(line.text) {
            Some((key, value)) if !key.is_empty() => fields.push((key, value, line.offset)),
            None if !line.text.trim().is_empty() => break,
            _ => {}
        }
    }
    let value = |key: &str| fields.iter().find(|(found, ..)| *found == key).map(|&(_, value, offset)| (value, offset));
    if let Some((format, _)) = value("FORMAT").filter(|(format, _)| !format.eq_ignore_ascii_case("text")) {
        return Err(unsupported(format!("ALTA data in the format {}, which is not read: {CONVERT}", snippet(format))));
    }
    if value("FUNC").is_some() || value("CMD").is_some() {
        return Err(unsupported("a function that ALTA fitted, which is not read: send the data that it was fitted to"));
    }
    let (dimensions, at) = value("DIM").ok_or_else(|| {
        source
            .malformed(0, "no line `#DIM`, expected the numbers of coordinates and values of a row, such as `#DIM 3 1`")
    })?;
    let numbers: Vec<usize> = dimensions.split_whitespace().filter_map(|n| n.parse().ok()).collect();
    let [n, m] = numbers[..] else {
        return Err(source.malformed(
            at,
            format!("line `#DIM {}`, expected two numbers: of coordinates and of values in a row", snippet(dimensions)),
        ));
    };
    let coordinates = coordinates(value("PARAM_IN").map(|(name, _)| name))?;
    if n != coordinates.dimensions() {
        let message = format!(
            "line `#DIM {n} {m}` states {n} coordinates, but {} has {}: expected {1} coordinates in a row",
            coordinates.name(),
            coordinates.dimensions()
        );
        return Err(source.malformed(at, message));
    }
    check_values(value("PARAM_OUT").map(|(name, _)| name), m, how, report)?;
    for (key, value, _) in &fields {
        report.metadata.push(((*key).chars().take(256).collect(), value.chars().take(4096).collect()));
    }
    report.note(ValueNote::AnglesRounded { stored_as: "radians" });
    Ok(Header { coordinates, values: m })
}

fn coordinates(name: Option<&str>) -> Result<Coordinates, FormatError> {
    let known = Coordinates::names();
    match name {
        Some(name) => Coordinates::of_name(name).ok_or_else(|| {
            unsupported(format!(
                "coordinates {}, which do not fix two directions or are not read, expected one of {known}: {CONVERT}",
                snippet(name)
            ))
        }),
        None => Err(unsupported(format!(
            "no line `#PARAM_IN`, so that the coordinates are not known: write it with one of {known}, or write the directions \
             and values as radiometric-csv"
        ))),
    }
}

/// Refuses an ALTA file whose values are not a BRDF in 1/sr, or that has more values in a row than channels.
fn check_values(
    name: Option<&str>,
    count: usize,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(), FormatError> {
    match (name, count) {
        (Some("INV_STERADIAN"), 1) => Ok(()),
        (Some("RGB_COLOR"), 3) => {
            report.note(ScatteringNote::LinearSrgb);
            Ok(())
        }
        (Some("INV_STERADIAN"), 3) => {
            report.note(ScatteringNote::ThreeValuesAsSrgb);
            Ok(())
        }
        (None | Some("UNKNOWN" | "UNKNOWN_OUTPUT"), 1 | 3) if how.quantity.is_some() => {
            report.note(ScatteringNote::OutputNotStated);
            Ok(())
        }
        (None | Some("UNKNOWN" | "UNKNOWN_OUTPUT"), 1 | 3) => {
            let message = "no line `#PARAM_OUT`, expected INV_STERADIAN or RGB_COLOR, or the option quantity: brdf, where the \
                           values are in 1/sr without the cosine";
            Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message))
        }
        (Some("INV_STERADIAN" | "RGB_COLOR") | None, _) => Err(unsupported(format!(
            "{count} values a row without wavelengths, expected 1, or 3 for RGB: write them as radiometric-csv with a column for \
             each wavelength"
        ))),
        (Some(other), _) => Err(unsupported(format!(
            "values {}, expected INV_STERADIAN or RGB_COLOR (a BRDF in 1/sr without the cosine): convert them",
            snippet(other)
        ))),
    }
}
