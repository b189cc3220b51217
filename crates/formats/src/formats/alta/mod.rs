//! Text files of the ALTA library: `#` lines that name the coordinates and the values, then one row per pair of
//! directions.
//!
//! `#DIM n m` gives the numbers of coordinates and values in a row, `#PARAM_IN` the coordinates (angles in radians).
//! `#PARAM_OUT` names the values and `#VS` the number of confidence limits after them. Coordinates that fix two
//! directions are read; parametrisations of fewer dimensions, which leave directions open, are refused by name. Layout:
//! `sources/core/data_storage.cpp` and `params.cpp` of ALTA (L. Belcour, R. Pacanowski, P. Barla and others).

mod about;
mod coordinates;
mod header;
#[cfg(test)]
mod tests;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::radiometric_csv;
use super::reader::{Reader, Sample};
use super::text::{Brief, Source, Token, Tokens, number, snippet};
use crate::domain::limits::MAX_SAMPLES;
use crate::domain::{Axis, Quantity, Unit};
use crate::notes::ScatteringNote;
use about::{ABOUT, NAME};
use coordinates::Pair;
use header::Header;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &[],
    probe: |sample: &Sample<'_>| if header::is_header(&sample.head) { 90 } else { 0 },
    read,
};

/// Number of rounding steps of angles in one degree, so that grids are recognised in numbers of 6 to 15 digits. Raising
/// it keeps more rounding errors of files.
const ROUNDING: f64 = 1e4;
/// Depth, as a cosine, by which a rounded direction may lie below the horizon: 0.006 degrees. Raising it accepts more
/// directions below the horizon.
const HORIZON: f64 = 1e-4;

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let needs = |message: String| FormatError::new(FormatErrorKind::NeedsOption, NAME, message);
    if let Some(other) = how.quantity().filter(|&quantity| quantity != Quantity::Brdf) {
        return Err(needs(format!("quantity {other} was asked for, expected brdf, which the file holds")));
    }
    if let Some(other) = how.unit.filter(|&unit| unit != Unit::PerSteradian) {
        return Err(needs(format!("unit {other} was asked for, expected 1/sr, which the file holds")));
    }
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let header = header::read(&source, how, &mut report)?;
    let rows = rows(&source, &header, &mut report)?;
    let count = rows.pairs.len();
    let spectral = (header.values == 3).then_some(Axis::Rgb);
    let isotropic = header.coordinates.is_isotropic();
    let samples = radiometric_csv::of_pairs(rows.pairs, isotropic, rows.values, spectral, &mut report)
        .map_err(|error| FormatError { format: NAME, ..error })?;
    let kind = if matches!(samples, Samples::Grid(_)) { "a grid of directions" } else { "scattered directions" };
    let channels = if header.values == 3 { "RGB" } else { "one value" };
    Ok(Acquisition {
        format: NAME,
        dialect: format!("{}, {count} rows, {channels}, {kind}", header.coordinates.name()),
        quantity: Quantity::Brdf,
        unit: Unit::PerSteradian,
        samples,
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

/// Pairs of directions of an ALTA file, `[theta_i, phi_i, theta_o, phi_o]` in degrees, and their values.
struct Rows {
    pairs: Vec<[f64; 4]>,
    values: Vec<f32>,
}

fn rows(source: &Source, header: &Header, report: &mut ParseReport) -> Result<Rows, FormatError> {
    let (n, m) = (header.coordinates.dimensions(), header.values);
    let mut rows = Rows { pairs: Vec::new(), values: Vec::new() };
    let (mut below, mut limits) = (0_usize, 0_usize);
    for line in source.lines().filter(|line| !line.text.trim_start().starts_with('#')) {
        if line.text.trim().is_empty() {
            continue;
        }
        let mut numbers = [0.0; coordinates::MOST + header::MOST_VALUES];
        let count = row(source, line, &mut numbers[..n + m], m)?;
        limits += usize::from(count > n + m);
        let Some(pair) = header.coordinates.directions(&numbers[..n]) else {
            let expected = header.coordinates.expected();
            let found = numbers[..n].iter().map(|x| Brief(*x).to_string()).collect::<Vec<_>>().join(" ");
            return Err(source.malformed(line.offset, format!("coordinates {}, expected {expected}", snippet(&found))));
        };
        let Some(pair) = above(&pair) else {
            below += 1;
            continue;
        };
        rows.pairs.push(pair);
        for &value in &numbers[n..n + m] {
            let sample = value as f32;
            if sample.is_infinite() {
                let message = format!("value {}, expected a number within the range of float32", Brief(value));
                return Err(source.malformed(line.offset, message));
            }
            rows.values.push(sample);
        }
        if rows.values.len() > MAX_SAMPLES {
            let message = format!("more than the limit of {MAX_SAMPLES} values");
            return Err(source.error(FormatErrorKind::OverLimit, line.offset, message));
        }
    }
    if below > 0 {
        report.note(ScatteringNote::RowsBelowHorizon { rows: below });
    }
    if limits > 0 {
        report.note(ScatteringNote::ConfidenceLimits { rows: limits });
    }
    if rows.values.iter().all(|value| value.is_nan()) {
        let end = source.text().len();
        return Err(source.malformed(end, "no row with both directions above the surface and a value, expected one"));
    }
    Ok(rows)
}

/// Reads the numbers of a row of an ALTA file; a missing value becomes NaN. Returns the count of numbers in the row,
/// including confidence limits (at most two for each of `values`).
fn row(source: &Source, line: Token<'_>, numbers: &mut [f64], values: usize) -> Result<usize, FormatError> {
    let coordinates = numbers.len() - values;
    let (mut tokens, mut count) = (Tokens::new(line.text, 0), 0);
    loop {
        let (value, at) = match tokens.plain_number() {
            Some((value, at)) => (value, at),
            None => match tokens.next() {
                None => break,
                Some(token) => match number(token.text) {
                    Some(value) => (value, token.offset),
                    None if count >= coordinates && token.text.eq_ignore_ascii_case("nan") => (f64::NAN, token.offset),
                    None => {
                        let message = format!("found {}, expected a number", snippet(token.text));
                        return Err(source.malformed(line.offset + token.offset, message));
                    }
                },
            },
        };
        if let Some(place) = numbers.get_mut(count) {
            *place = value;
        }
        count += 1;
        if count > numbers.len() + 2 * values {
            let message = format!("more than {count} numbers in a row, expected {} as #DIM says", numbers.len());
            return Err(source.malformed(line.offset + at, message));
        }
    }
    if count < numbers.len() {
        let message = format!("a row of {count} numbers, expected {} as #DIM says", numbers.len());
        return Err(source.malformed(line.offset, message));
    }
    Ok(count)
}

/// Returns the angles of a pair of directions, `[theta_i, phi_i, theta_o, phi_o]` in degrees; `None` if a direction is
/// below the horizon.
fn above(pair: &Pair) -> Option<[f64; 4]> {
    let mut angles = [0.0; 4];
    for (direction, angles) in [pair.light, pair.view].into_iter().zip(angles.chunks_exact_mut(2)) {
        if direction.cos_theta() < -HORIZON {
            return None;
        }
        let rounded = |degrees: f64| (degrees * ROUNDING).round() / ROUNDING;
        let theta = rounded(direction.theta_degrees()).min(90.0);
        // All azimuths denote one direction at the pole.
        let phi = if theta == 0.0 { 0.0 } else { rounded(direction.phi_degrees()).rem_euclid(360.0) };
        angles.copy_from_slice(&[theta, phi]);
    }
    Some(angles)
}
