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
mod places;
mod problems;
mod remarks;
mod rows;
#[cfg(test)]
mod tests;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::reader::{FACTOR, Reader, Sample};
use crate::domain::Axis;
use about::{ABOUT, NAME};
use columns::{Angle, Columns, Row};
use head::Head;
use header::Header;
use problems::Problems;
use remarks::remarks;
use rows::Rows;

pub(super) const READER: Reader =
    Reader { about: ABOUT, options: &["wavelength_unit", "normalization", FACTOR], probe, read };

/// Upper bound on the number of lines, including comments, that are searched for the line that names the format.
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
    let text = head::plain(bytes, &mut report);
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
        instrument: header.instrument,
        report,
    })
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
