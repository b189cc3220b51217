//! `radiometric-csv`: measurements as text that says what they are, long (one value a row) or wide (one spectrum a row).
//!
//! `# key: value` lines, one row of column names, rows of numbers; UTF-8, `,` between cells, `.` in numbers; lines with
//! `##` are remarks. Required: `quantity`, `value_unit`; `angle_unit` where there are angles; `cosine_included` for a
//! BSDF, whose values are divided by `|cos theta_o|` if it is true. Columns in any order: `theta_i`, `phi_i`, `theta_o`,
//! `phi_o` (emission: `theta`, `phi`, or `gamma`, `c` from nadir; a phase function may have `theta` alone, the scattering
//! angle), then `wavelength` and `value`, or one `v550` for each wavelength. A blank cell, or `nan`, is a missing value.
//! `sigma`, or one `s550` for each `v550`, are standard uncertainties (k = 1) of the values. Directions that form a grid
//! are read as one.

pub(super) mod arrow;
mod assemble;
mod columns;
mod directions;
mod header;
pub(super) mod number;
mod places;
mod problems;
mod rows;
#[cfg(test)]
mod tests;

use super::acquisition::{Acquisition, NoteKind, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::text::{Source, unmarked, unmarked_utf16};
use super::{FACTOR, Format, Interpretation, Reader, Sample};
use crate::domain::Axis;
use columns::{Angle, Columns, Row};
use header::{Field, Header};
use problems::Problems;
use rows::Rows;
use std::borrow::Cow;

const NAME: &str = "radiometric-csv";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "radiometric-csv: measurements as text that says what they are, long or wide (.csv)",
        extensions: &["csv"],
        reads: true,
        writes: false,
    },
    options: &["wavelength_unit", "normalization", FACTOR],
    probe,
    read,
};

/// The lines of the header, and the characters of each, beyond which nothing is a header.
const MAX_HEADER_LINES: usize = 1000;
const MAX_HEADER_LINE: usize = 1 << 16;
/// Lines before the one that names the format, for comments.
const LOOKED_AT: usize = 20;

fn probe(sample: &Sample<'_>) -> u8 {
    let names_it = |line: &str| {
        let key = line.trim().trim_start_matches('#').split(':').next().unwrap_or_default();
        line.trim().starts_with('#') && key.trim().eq_ignore_ascii_case(NAME)
    };
    if sample.head.split(['\n', '\r']).take(LOOKED_AT).any(names_it) { 100 } else { 0 }
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let mut report = ParseReport::default();
    let text = plain(bytes, &mut report);
    let head = Head::read(&text, &mut report)?;
    let mut problems = Problems::default();
    let header = header::read(&head.fields, how, &mut report, &mut problems)?;
    let row = Row { text: &head.names, line: head.lines };
    let columns = header.as_ref().and_then(|header| columns::read(&row, header, &mut report, &mut problems));
    let (Some(header), Some(columns)) = (header, columns) else {
        return Err(problems.into_error().unwrap_or_else(|| {
            FormatError::new(FormatErrorKind::Malformed, NAME, "the header does not say what the columns are")
        }));
    };
    let rows = rows::read(&text[head.end..], head.lines, &columns, header.cosine_included, &mut problems);
    if let Some(error) = problems.into_error() {
        return Err(error);
    }
    remarks(&header, &columns, rows.grazing, &mut report);
    let form = if columns.is_wide() { "wide" } else { "long" };
    let count = rows.values.len() / columns.width();
    let samples = assemble::samples(rows, &columns, &header, &mut report)?;
    Ok(Acquisition {
        format: NAME,
        dialect: format!("version 1, {form} form, {count} rows, {}", assemble::kind(&samples)),
        quantity: header.quantity,
        unit: header.unit_of(&samples),
        samples,
        spectral_factor: None,
        report,
    })
}

/// Samples at pairs of directions, `[theta_i, phi_i, theta_o, phi_o]` in degrees, values row-major `[pair, spectral]`, as
/// they are read from a table of this format: a grid where the directions make one, repeated ones averaged.
pub(super) fn of_pairs(
    pairs: Vec<[f64; 4]>,
    isotropic: bool,
    values: Vec<f32>,
    spectral: Option<Axis>,
    report: &mut ParseReport,
) -> Result<Samples, FormatError> {
    let angle = Some(Angle { radians: false, range: (0.0, 180.0), from_nadir: false });
    let rows = Rows { directions: pairs, values, ..Rows::default() };
    let columns = Columns {
        cells: Vec::new(),
        names: Vec::new(),
        angles: [angle; 4],
        wavelengths: Vec::new(),
        has_wavelength: false,
        has_sigma: false,
    };
    let header = Header::of_brdf(isotropic);
    assemble::on_directions(rows, &columns, &header, spectral, report)
}

/// What was assumed and changed.
fn remarks(header: &Header, columns: &Columns, grazing: usize, report: &mut ParseReport) {
    if header.wavelength_unit_assumed && (columns.is_wide() || columns.has_wavelength) {
        report.note(NoteKind::Assumed, "`wavelength_unit` is not stated, taken as nm");
    }
    if header.radians && columns.angles.iter().any(Option::is_some) {
        report.note(NoteKind::Assumed, "angles in radians are rounded to 0.0001 degrees");
    }
    if header.cosine_included {
        report.note(NoteKind::Assumed, "values hold the cosine, as the header says: divided by |cos theta_o|");
    }
    if header.is_factor {
        report.note(NoteKind::Assumed, "reflectance factors, divided by π: a BRDF in 1/sr");
    }
    if grazing > 0 {
        let message = format!("{grazing} values at theta_o of 90 degrees hold a cosine of 0: masked");
        report.note(NoteKind::Warning, message);
    }
    let no_phi_i = columns.angles[0].is_some() && columns.angles[1].is_none();
    if header.quantity.directions() == 2 && no_phi_i && !header.isotropic {
        report.note(NoteKind::Assumed, "no column phi_i: isotropic, phi_o is relative to the incoming azimuth");
    }
}

/// The bytes as ASCII-compatible text with line feeds: UTF-16 is decoded, byte order and end-of-file marks are cut.
fn plain<'a>(bytes: &'a [u8], report: &mut ParseReport) -> Cow<'a, [u8]> {
    let marked = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff");
    let utf16 = marked || unmarked_utf16(bytes).is_some();
    let text = if utf16 {
        let source = Source::decode(bytes, NAME);
        if let Some(encoding) = source.odd_encoding() {
            report.note(NoteKind::Assumed, format!("text decoded as {encoding}"));
        }
        Cow::Owned(source.text().as_bytes().to_vec())
    } else {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let marks = bytes.iter().rev().take_while(|&&b| b == 0x1a || b == 0 || b.is_ascii_whitespace()).count();
        Cow::Borrowed(&bytes[..bytes.len() - marks])
    };
    // Old Macintosh files end their lines with a carriage return alone.
    let end = text.iter().position(|&b| b == b'\n' || b == b'\r');
    let alone = end.is_some_and(|end| text[end] == b'\r' && text.get(end + 1) != Some(&b'\n'));
    if alone {
        return Cow::Owned(text.iter().map(|&b| if b == b'\r' { b'\n' } else { b }).collect());
    }
    text
}

/// The lines before the numbers.
struct Head {
    fields: Vec<Field>,
    /// The row of column names.
    names: String,
    /// How many lines there are with it.
    lines: usize,
    /// Where the next line starts.
    end: usize,
}

impl Head {
    fn read(text: &[u8], report: &mut ParseReport) -> Result<Self, FormatError> {
        let mut fields: Vec<Field> = Vec::new();
        let (mut at, mut lines) = (0, 0);
        let mut odd = None;
        let mut decoded = |bytes: &[u8], report: &mut ParseReport| {
            let (text, encoding) = unmarked(bytes);
            if encoding != "UTF-8" && odd.replace(encoding).is_none() {
                report.note(NoteKind::Assumed, format!("text decoded as {encoding}"));
            }
            text.into_owned()
        };
        while at < text.len() {
            lines += 1;
            let end = text[at..].iter().position(|&b| b == b'\n').map_or(text.len(), |i| at + i);
            let line = text[at..end].trim_ascii();
            at = (end + 1).min(text.len());
            let Some(comment) = line.strip_prefix(b"#") else {
                if line.is_empty() && lines < MAX_HEADER_LINES {
                    continue;
                }
                return Ok(Self { fields, names: decoded(line, report), lines, end: at });
            };
            if lines > MAX_HEADER_LINES || line.len() > MAX_HEADER_LINE {
                let message = format!(
                    "line {lines} of the header, expected at most {MAX_HEADER_LINES} lines of {MAX_HEADER_LINE} bytes"
                );
                return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
            }
            if comment.starts_with(b"#") {
                continue;
            }
            let comment = decoded(comment.trim_ascii_start(), report);
            match comment.split_once(':') {
                // More than one word before the colon is prose.
                Some((key, value)) if !key.trim().is_empty() && !key.trim().contains(char::is_whitespace) => {
                    // Spreadsheets end every line with as many separators as the longest has.
                    let value = value.trim().trim_end_matches([',', ';']).trim_end().chars().take(4096).collect();
                    fields.push(Field { key: key.trim().to_lowercase(), value, line: lines });
                }
                _ if comment.is_empty() => {}
                _ => report.metadata.push(("comment".to_owned(), comment.chars().take(4096).collect())),
            }
        }
        let message = "the file ends in its header, expected a row of column names and rows of numbers";
        Err(FormatError::new(FormatErrorKind::Malformed, NAME, message))
    }
}
