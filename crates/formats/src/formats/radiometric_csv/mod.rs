//! `radiometric-csv`: self-describing text of measurements, long (one value per row) or wide (one spectrum per row).
//!
//! A file has `# key: value` lines, one row of column names, then rows of numbers. It is UTF-8 with `,` between cells
//! and `.` in numbers; lines with `##` are remarks. Required keys: `quantity` and `value_unit`; `angle_unit` if there
//! are angles; `cosine_included` for a BSDF, whose values are divided by `|cos theta_o|` if it is true.
//!
//! Columns come in any order. The angles are `theta_i`, `phi_i`, `theta_o`, `phi_o`; for emission `theta`, `phi`, or
//! `gamma`, `c` from nadir. A phase function may have `theta` alone, the scattering angle. Values are `wavelength` and
//! `value`, or one `v550` for each wavelength. A blank cell, or `nan`, is a missing value. `sigma`, or one `s550` for
//! each `v550`, are standard uncertainties (k = 1) of the values. Directions that form a grid are read as a grid.

mod about;
pub(super) mod arrow;
mod assemble;
mod columns;
mod directions;
mod head;
mod header;
mod in_plane;
mod loose;
mod names;
mod places;
mod problems;
mod remarks;
mod rows;
#[cfg(test)]
mod tests;
pub(super) mod unmarked;
mod written;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::reader::{FACTOR, HEAD_BYTES, Reader, Sample};
use super::text::{self, Source, is_text};
use super::text_table::cells::Delimiter;
use crate::domain::{Axis, Quantity};
use crate::notes::TextNote;
use about::{ABOUT, NAME};
use columns::{Angle, Cell, Columns};
use head::Head;
use header::Header;
use loose::Body;
use problems::Problems;
use remarks::remarks;
use rows::Rows;
use std::borrow::Cow;
use unmarked::Constants;
use written::Marks;

pub(super) const READER: Reader =
    Reader { about: ABOUT, options: &["wavelength_unit", "normalization", "in_plane_sign", FACTOR], probe, read };

/// Upper bound on the number of lines, including comments, that are searched for the line that names the format.
const LOOKED_AT: usize = 20;

/// Confidence that a table is one of directions by the names of its columns alone: below that of a format that is known
/// and not read, above that of a spectral table.
const BY_NAMES: u8 = 45;

fn probe(sample: &Sample<'_>) -> u8 {
    if is_marked(&sample.head) {
        100
    } else if is_text(&sample.head) && unmarked::claims(&sample.head, sample.quantity) {
        BY_NAMES
    } else {
        0
    }
}

/// Returns true if one of the first lines of a file names the format.
fn is_marked(head: &str) -> bool {
    let names_it = |line: &str| {
        let key = line.trim().trim_start_matches('#').split(':').next().unwrap_or_default();
        line.trim().starts_with('#') && key.trim().eq_ignore_ascii_case(NAME)
    };
    head.split(['\n', '\r']).take(LOOKED_AT).any(names_it)
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let mut report = ParseReport::default();
    if is_marked(&text::head(bytes, HEAD_BYTES)) {
        let text = head::plain(bytes, &mut report);
        let head = Head::read(&text, &mut report)?;
        let body = &text[head.end..];
        return table(&head, body, None, how, report);
    }
    let source = Source::decode(bytes, NAME);
    report.note_encoding(&source);
    let (head, constants) = unmarked::head(&source, how, &mut report)?;
    let body = &source.text()[head.end..];
    let has_lone_returns = !body.contains('\n') && body.contains('\r');
    let body = if has_lone_returns { Cow::Owned(body.replace('\r', "\n")) } else { Cow::Borrowed(body) };
    table(&head, body.as_bytes(), Some(&constants), how, report)
}

/// Reads the rows of a table under its names. `constants` are the statements of a file without the lines of
/// radiometric-csv, for all rows.
fn table(
    head: &Head,
    body: &[u8],
    constants: Option<&Constants>,
    how: &Interpretation,
    mut report: ParseReport,
) -> Result<Acquisition, FormatError> {
    let mut problems = Problems::default();
    let header = header::read(&head.fields, how, &mut report, &mut problems)?;
    let columns = header.as_ref().and_then(|header| {
        let stated = constants.and_then(|constants| constants.theta_i);
        columns::read(&head.names, header, stated, &mut report, &mut problems)
    });
    let (Some(mut header), Some(mut columns)) = (header, columns) else {
        return Err(problems.into_error().unwrap_or_else(|| {
            FormatError::new(FormatErrorKind::Malformed, NAME, "the header does not say what the columns are")
        }));
    };
    if let Some(nanometres) = constants.and_then(|constants| constants.wavelength)
        && !columns.is_wide()
        && !columns.has_wavelength
    {
        columns.wavelengths = vec![nanometres];
    }
    let is_plain =
        constants.is_none() && head.delimiter == Delimiter::Comma && memchr::memchr2(b'"', b'%', body).is_none();
    let (mut rows, marks) = if is_plain {
        (rows::read(body, head.lines, &columns, header.cosine_included, &mut problems), None)
    } else {
        let (text, _) = text::unmarked(body);
        let body = Body { text: &text, before: head.lines, delimiter: head.delimiter, names: &head.names.cells };
        let is_read: Vec<bool> = columns.cells.iter().map(|cell| *cell != Cell::Ignored).collect();
        let marks = body.marks(&is_read);
        percent_of_cells(marks, &mut header)?;
        let (rows, after) = body.read(marks, &columns, header.cosine_included, &mut problems);
        if after > 0 {
            report.note(TextNote::LinesAfterData { lines: after });
        }
        (rows, Some(marks))
    };
    if let Some(error) = problems.into_error() {
        return Err(error);
    }
    if let Some(constants) = constants {
        constants.apply(&mut rows, &mut columns, &mut report)?;
    }
    in_plane::turn(&mut rows, &mut columns, &header, constants.is_some(), how, &mut report)?;
    remarks(&header, &columns, rows.grazing, &mut report);
    let form = if columns.is_wide() { "wide" } else { "long" };
    let count = rows.values.len() / columns.width();
    let samples = assemble::samples(rows, &columns, &header, &mut report)?;
    let version = if constants.is_some() { "table of directions" } else { "version 1" };
    let separated = match marks {
        Some(marks) => {
            let decimal = if marks.has_commas { ", decimal comma" } else { "" };
            format!("{}{decimal}, ", head.delimiter.dialect())
        }
        None => String::new(),
    };
    Ok(Acquisition {
        format: NAME,
        dialect: format!("{version}, {separated}{form} form, {count} rows, {}", assemble::kind(&samples)),
        quantity: header.quantity,
        unit: header.unit_of(&samples),
        samples,
        spectral_factor: None,
        instrument: header.instrument,
        report,
    })
}

/// Takes percent signs in the cells of values for the unit of a reflectance factor; other quantities are refused.
fn percent_of_cells(marks: Marks, header: &mut Header) -> Result<(), FormatError> {
    if !marks.has_percent || header.is_percent {
        return Ok(());
    }
    if header.is_factor || header.quantity == Quantity::Reflectance {
        header.is_percent = true;
        return Ok(());
    }
    let message = format!(
        "values with percent signs, expected numbers in {}: a reflectance factor in percent is named by the option quantity: \
         reflectance-factor",
        header.unit
    );
    Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message))
}

/// Converts samples at pairs of directions, `[theta_i, phi_i, theta_o, phi_o]` in degrees, with values row-major
/// `[pair, spectral]`. Returns a grid if the directions form one, else scattered samples. Values at repeated pairs are
/// averaged.
pub(super) fn of_pairs(
    pairs: Vec<[f64; 4]>,
    isotropic: bool,
    values: Vec<f32>,
    spectral: Option<Axis>,
    report: &mut ParseReport,
) -> Result<Samples, FormatError> {
    let angle = Some(Angle { radians: false, range: (0.0, 180.0), from_nadir: false, signed: false });
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
