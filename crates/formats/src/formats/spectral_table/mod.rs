//! Spectral tables: text with wavelengths and one or more columns of values, from CSV to instrument exports.
//!
//! The result is `[lambda]`, or `[index, lambda]` for several columns. A missing value is masked; a negative one is
//! kept. Reflectance factors (BRF, HCRF) are divided by π, which gives a BRDF in 1/sr without its directions.

mod about;
pub(super) mod cells;
pub(super) mod layouts;
mod library;
pub(super) mod lines;
pub(super) mod pairs;
pub(super) mod rows;
mod suffixed;
mod table;
pub(super) mod wavelength_unit;
mod wide;
mod write;

pub use write::{write_spd, write_spectra};

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::reader::{FACTOR, Reader, Sample};
use super::stated::{StatedQuantity, divide_by_pi, names_factor};
use super::text::{Brief, Source, is_text, snippet};
use super::turned::turned;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::domain::{Axis, Sampling, Tensor, Unit, WavelengthGrid};
use crate::notes::{SpectrumNote, TextNote, ValueNote};
use about::{ABOUT, NAME};
use table::Table;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &["wavelength_unit", "column", FACTOR],
    probe: |sample: &Sample<'_>| if is_text(&sample.head) { layouts::probe(&sample.head) } else { 0 },
    read,
};

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    if let Some(encoding) = source.odd_encoding() {
        report.note(TextNote::DecodedAs { encoding });
    }
    let mut table = layouts::read(&source, &mut report)?;
    refuse_summary(&table, how)?;
    if let Some(column) = &how.column {
        table.pick(column)?;
    }
    let stated = quantity(&table, how, &mut report)?;
    let (quantity, unit) = (stated.quantity(), unit(stated, how)?);
    let grid = wavelengths(&mut table, how, &source, &mut report)?;
    if let Some(library) = &table.library {
        library.check(table.wavelengths.len(), &mut report);
    }
    percent(&mut table, stated, &mut report);
    if stated.is_factor() {
        divide_by_pi(&mut table.values);
    }
    remarks(&table, &source, &mut report)?;
    let lambda = Axis::Wavelength(grid);
    let (n, columns) = (table.wavelengths.len(), table.names.len());
    let dialect = format!("{}, {columns} column(s)", table.dialect);
    let (axes, samples) = if columns == 1 {
        (vec![lambda], table.values)
    } else {
        let samples = turned(&table.values, columns, n);
        (vec![Axis::Index { count: columns, labels: table.names }, lambda], samples)
    };
    let tensor =
        Tensor::new(axes, samples).map_err(|e| FormatError::new(FormatErrorKind::OverLimit, NAME, e.to_string()))?;
    let samples = Samples::OnAxes { tensor, sampling: Sampling::default() };
    Ok(Acquisition {
        format: NAME,
        dialect,
        quantity,
        unit,
        samples,
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

const REFLECTANCE_WORDS: [&str; 4] = ["reflectance", "reflectivity", "transmittance", "transmissivity"];

/// Refuses a table with a single row of named figures (CCT, CRI, illuminance): a spectrum does not have one wavelength
/// and many columns.
fn refuse_summary(table: &Table, how: &Interpretation) -> Result<(), FormatError> {
    const FEWEST: usize = 2;
    let Some(first) = table.wavelength_name.as_deref().filter(|name| !wavelength_unit::names_wavelength(name)) else {
        return Ok(());
    };
    if table.wavelengths.len() > 1 || table.names.len() < FEWEST || how.wavelength_unit.is_some() {
        return Ok(());
    }
    let message = format!(
        "one row of named figures ({}, {}), expected a spectrum: export the table of wavelengths and values (if {} is a \
         wavelength, name its unit with wavelength_unit)",
        snippet(first),
        table.column_list(),
        snippet(first)
    );
    Err(FormatError::new(FormatErrorKind::Unsupported, NAME, message))
}

fn quantity(table: &Table, how: &Interpretation, report: &mut ParseReport) -> Result<StatedQuantity, FormatError> {
    use StatedQuantity::{Reflectance, ReflectanceFactor, Spectrum};
    match how.quantity {
        Some(stated @ (Spectrum | Reflectance)) => return Ok(stated),
        Some(ReflectanceFactor) => {
            report.note(SpectrumNote::FactorsAsAsked);
            return Ok(ReflectanceFactor);
        }
        Some(other) => {
            let message = format!(
                "quantity {other} was asked for, expected spectrum, reflectance or reflectance-factor: the file is a spectral table"
            );
            return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
        }
        None => {}
    }
    if let Some(library) = &table.library {
        return Ok(library.quantity().into());
    }
    if holds_factors(table)? {
        report.note(SpectrumNote::FactorsNamed);
        return Ok(ReflectanceFactor);
    }
    if table.says(|prose| REFLECTANCE_WORDS.iter().any(|word| prose.contains(word))) {
        if table.says(|prose| prose.contains("reflectance factor")) {
            report.note(SpectrumNote::FactorsKept);
        }
        return Ok(Reflectance);
    }
    report.note(SpectrumNote::QuantityNotStated);
    Ok(Spectrum)
}

/// Returns true if the columns or the text around the table name reflectance factors. Refuses a table in which only
/// some columns are reflectance factors.
fn holds_factors(table: &Table) -> Result<bool, FormatError> {
    let (factors, others): (Vec<&String>, Vec<&String>) = table.names.iter().partition(|name| names_factor(name));
    match (factors.first(), others.first()) {
        (Some(_), None) => Ok(true),
        (None, _) => Ok(names_factor(&table.prose)),
        (Some(factor), Some(other)) => {
            let message = format!(
                "column {} is a reflectance factor and {} is not, expected one kind: name a column (column), or what all are \
                 (quantity: reflectance-factor, reflectance or spectrum)",
                snippet(factor),
                snippet(other)
            );
            Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message))
        }
    }
}

fn unit(stated: StatedQuantity, how: &Interpretation) -> Result<Unit, FormatError> {
    match (stated, how.unit) {
        (StatedQuantity::ReflectanceFactor, None | Some(Unit::One | Unit::PerSteradian)) => Ok(Unit::PerSteradian),
        (StatedQuantity::ReflectanceFactor, Some(other)) => {
            let message = format!("unit {other} of reflectance factors, expected 1");
            Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message))
        }
        (_, Some(unit)) => Ok(unit),
        (StatedQuantity::Reflectance, None) => Ok(Unit::One),
        _ => Ok(Unit::Relative),
    }
}

/// Converts the wavelengths of a table to nm and sorts its rows by increasing wavelength.
fn wavelengths(
    table: &mut Table,
    how: &Interpretation,
    source: &Source,
    report: &mut ParseReport,
) -> Result<WavelengthGrid, FormatError> {
    let n = table.wavelengths.len();
    if n > MAX_WAVELENGTHS {
        let message = format!("{n} wavelengths, expected at most {MAX_WAVELENGTHS}");
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let falling = n > 1 && table.wavelengths[1].0 < table.wavelengths[0].0;
    for pair in table.wavelengths.array_windows() {
        let [(a, _), (b, offset)] = *pair;
        if a == b {
            return Err(source.malformed(offset, format!("wavelength {b} twice, expected each once", b = Brief(b))));
        }
        if (b < a) != falling {
            let direction = if falling { "decreasing" } else { "increasing" };
            return Err(source.malformed(
                offset,
                format!("wavelength {b} after {a}, expected {direction} wavelengths", a = Brief(a), b = Brief(b)),
            ));
        }
    }
    let stated: Vec<f64> = table.wavelengths.iter().map(|&(value, _)| value).collect();
    let unit = wavelength_unit::of(&stated, table.wavelength_name.as_deref(), how, report)?;
    if let Some(&(value, offset)) = table.wavelengths.iter().find(|(value, _)| *value <= 0.0) {
        return Err(
            source.malformed(offset, format!("wavelength {value}, expected a positive number", value = Brief(value)))
        );
    }
    let mut nanometres: Vec<f64> = stated.iter().map(|&value| unit.to_nanometres(value)).collect();
    if n > 1 && nanometres[1] < nanometres[0] {
        nanometres.reverse();
        table.reverse();
        report.note(SpectrumNote::RowsTurnedRound);
    }
    WavelengthGrid::listed(nanometres).map_err(|e| FormatError::new(FormatErrorKind::Malformed, NAME, e.to_string()))
}

/// Converts reflectance and transmittance in percent to fractions; other spectra are unchanged. Reflectance factors of
/// glossy samples exceed 1.5, so that percent is taken from the header only.
fn percent(table: &mut Table, stated: StatedQuantity, report: &mut ParseReport) {
    let in_percent = |name: &String| name.contains('%') || name.to_lowercase().contains("percent");
    let declared =
        table.names.iter().any(in_percent) || table.library.as_ref().is_some_and(library::Library::is_percent);
    if !matches!(stated, StatedQuantity::Reflectance | StatedQuantity::ReflectanceFactor) {
        if declared {
            report.note(SpectrumNote::PercentKept);
        }
        return;
    }
    let largest = table.values.iter().copied().filter(|v| !v.is_nan()).fold(f32::MIN, f32::max);
    let are_factors = stated.is_factor() || table.says(names_factor);
    let looks_like_it = largest > 1.5 && largest <= 120.0 && !are_factors;
    if declared || looks_like_it {
        for value in &mut table.values {
            *value = (f64::from(*value) / 100.0) as f32;
        }
        report.note(if declared { SpectrumNote::PercentDivided } else { SpectrumNote::PercentGuessed { largest } });
    } else if largest > 1.5 {
        report.note(SpectrumNote::LargeReflectance { largest });
    }
}

/// Adds notes on the number of missing values and on that of negative values.
fn remarks(table: &Table, source: &Source, report: &mut ParseReport) -> Result<(), FormatError> {
    let masked = table.values.iter().filter(|v| v.is_nan()).count();
    if masked == table.values.len() {
        return Err(source.malformed(0, "every value is missing (blank, NaN or --), expected numbers"));
    }
    if masked > 0 {
        report.note(SpectrumNote::MissingMasked { values: masked });
    }
    let negative = table.values.iter().filter(|v| **v < 0.0).count();
    if negative > 0 {
        let lowest = table.values.iter().copied().filter(|v| *v < 0.0).fold(0.0, f32::min);
        report.note(ValueNote::Negative { values: negative, lowest });
    }
    Ok(())
}
