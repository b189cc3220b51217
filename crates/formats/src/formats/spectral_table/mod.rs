//! Spectral tables: text with wavelengths and one or more columns of values, from CSV to instrument exports.
//!
//! The result is `[lambda]`, or `[index, lambda]` for several columns. A missing value is masked; a negative one is
//! kept. Reflectance factors (BRF, HCRF) are divided by π, which gives a BRDF in 1/sr without its directions.

mod about;
mod columns;
mod fills;
pub(super) mod holds;
pub(super) mod layouts;
mod library;
pub(super) mod order;
pub(super) mod pairs;
mod rows;
mod suffixed;
pub(super) mod table;
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
use crate::notes::{Quoted, SpectrumNote};
use about::{ABOUT, NAME};
use holds::Holds;
use table::Table;

pub(super) const READER: Reader = Reader {
    about: ABOUT,
    options: &["wavelength_unit", "wavelength_column", "column", "overlap", FACTOR],
    probe: |sample: &Sample<'_>| if is_text(&sample.head) { layouts::probe(&sample.head) } else { 0 },
    read,
};

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let mut table = layouts::read(&source, how, &mut report)?;
    if table.wavelengths.is_empty() {
        return Err(source.malformed(0, "no row with a wavelength, expected one at least"));
    }
    refuse_summary(&table, how)?;
    match &how.column {
        Some(column) if table.names.len() > 1 => table.pick(column)?,
        Some(_) => {}
        None => leave_out(&mut table, how, &mut report)?,
    }
    fills::mask(&mut table, &mut report);
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
    let dialect = format!("{}, {columns} column{}", table.dialect, if columns == 1 { "" } else { "s" });
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

/// Refuses a table with a single row of named figures (CCT, CRI, illuminance): a spectrum does not have one wavelength
/// and many columns.
fn refuse_summary(table: &Table, how: &Interpretation) -> Result<(), FormatError> {
    const FEWEST: usize = 2;
    let Some(first) = table.wavelength_name.as_deref().filter(|name| !holds::names_wavelength(name)) else {
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

/// Leaves out raw signals, uncertainties and other quantities beside the columns of one calibrated quantity. Columns of
/// several calibrated quantities are an error, unless the user says what they all are.
fn leave_out(table: &mut Table, how: &Interpretation, report: &mut ParseReport) -> Result<(), FormatError> {
    let columns = |kinds: &[Holds]| -> Vec<usize> {
        (0..table.names.len()).filter(|&i| kinds.contains(&table.holds[i])).collect()
    };
    let calibrated = [Holds::Ratio, Holds::Factor, Holds::Light].map(|kind| columns(&[kind]));
    let mut unstated = columns(&[Holds::Unstated]);
    if !calibrated[0].is_empty() && !columns(&[Holds::Signal]).is_empty() {
        // Beside the scan of a reference that of the sample has no other name.
        unstated.retain(|&i| !holds::names_sample(&table.names[i]));
    }
    let stated: Vec<&Vec<usize>> = calibrated.iter().filter(|columns| !columns.is_empty()).collect();
    let kept = match stated.as_slice() {
        [] if unstated.is_empty() => match columns(&[Holds::Logarithm]) {
            logarithms if logarithms.is_empty() => columns(&[Holds::Signal]),
            logarithms => logarithms,
        },
        // Words such as "dark" and "reference" are parts of the names of samples, too.
        [] => columns(&[Holds::Unstated, Holds::Signal]),
        // All of them are spectra in relative values.
        [one] if unstated.is_empty() && table.holds[one[0]] == Holds::Light => columns(&[Holds::Light, Holds::Signal]),
        [one] if unstated.is_empty() => (*one).clone(),
        _ if how.quantity.is_some() => columns(&[Holds::Ratio, Holds::Factor, Holds::Light, Holds::Unstated]),
        _ => return Err(several_quantities(table)),
    };
    if !kept.is_empty() && kept.len() < table.names.len() {
        let out: Vec<&str> =
            (0..table.names.len()).filter(|i| !kept.contains(i)).map(|i| table.names[i].as_str()).collect();
        report.note(SpectrumNote::ColumnsLeftOut { columns: out.join(", ") });
        table.keep(&kept);
    }
    Ok(())
}

fn several_quantities(table: &Table) -> FormatError {
    const SHOWN: usize = 8;
    let described = |i: usize| {
        let what = match table.holds[i] {
            Holds::Ratio if table.percent[i] => "reflectance or transmittance in percent",
            Holds::Ratio => "reflectance or transmittance",
            Holds::Factor => "a reflectance factor",
            Holds::Light => "light",
            Holds::Logarithm => "a logarithm",
            Holds::Signal => "a raw signal",
            Holds::Uncertainty => "an uncertainty",
            _ => "not stated",
        };
        format!("{} {} ({what})", i + 1, snippet(&table.names[i]))
    };
    let mut list = (0..table.names.len()).take(SHOWN).map(described).collect::<Vec<_>>().join(", ");
    if table.names.len() > SHOWN {
        list.push_str(", …");
    }
    let message = format!(
        "columns of several quantities, expected one: name a column (column), or what all are (quantity: reflectance, \
         reflectance-factor or spectrum): {list}"
    );
    FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
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
    let first = |kind: Holds| table.holds.iter().position(|holds| *holds == kind);
    // Words such as "dark" are part of the names of samples, too.
    let are_signals = table.holds.iter().all(|holds| *holds == Holds::Signal);
    let of_columns = table.holds.iter().copied().find(|holds| !matches!(holds, Holds::Unstated | Holds::Signal));
    let holds = match of_columns {
        Some(holds) => holds,
        None if are_signals => Holds::Signal,
        None => holds::of_prose(&table.lines()).0,
    };
    match holds {
        Holds::Factor => {
            report.note(SpectrumNote::FactorsNamed);
            return Ok(ReflectanceFactor);
        }
        Holds::Ratio => {
            if table.says(|prose| prose.contains("reflectance factor")) {
                report.note(SpectrumNote::FactorsKept);
            }
            return Ok(Reflectance);
        }
        Holds::Logarithm => return Err(logarithm(table)),
        Holds::Index => {
            let message = format!(
                "{} of a material: refractive indices are no spectrum of light, reflectance or transmittance, which are read",
                table.column_list()
            );
            return Err(FormatError::new(FormatErrorKind::Unsupported, NAME, message));
        }
        Holds::Light => {
            let name = first(Holds::Light).map_or("", |column| &table.names[column]);
            report.note(SpectrumNote::LightNamed { name: Quoted::of(name) });
        }
        Holds::Signal => {}
        _ => report.note(SpectrumNote::QuantityNotStated),
    }
    if holds == Holds::Signal || holds == Holds::Light && first(Holds::Signal).is_some() {
        report.note(SpectrumNote::SignalKept);
    }
    Ok(Spectrum)
}

/// Returns the refusal of a logarithm of reflectance or transmittance, with what to do.
fn logarithm(table: &Table) -> FormatError {
    let message = format!(
        "{} is a logarithm of a reflectance or transmittance (absorbance, optical density), expected the reflectance or \
         transmittance itself: write 10^-A for each value A, and name the column so (quantity spectrum keeps the numbers as \
         they are)",
        table.column_list()
    );
    FormatError::new(FormatErrorKind::Unsupported, NAME, message)
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
    // Falling wavelengths and wavenumbers are told apart by their order in the file.
    let stated: Vec<f64> = table.wavelengths.iter().map(|&(value, _)| value).collect();
    let is_named =
        how.wavelength_column.is_some() || table.wavelength_name.as_deref().is_some_and(holds::names_wavelength);
    order::restore(table, how.overlap, is_named, source, report)?;
    let unit = {
        let name = table.wavelength_name.as_deref();
        wavelength_unit::of(&stated, name, name.is_some_and(holds::names_wavelength), how, report)?
    };
    if let Some(&(value, offset)) = table.wavelengths.iter().find(|(value, _)| *value <= 0.0) {
        return Err(
            source.malformed(offset, format!("wavelength {value}, expected a positive number", value = Brief(value)))
        );
    }
    let mut nanometres: Vec<f64> = table.wavelengths.iter().map(|&(value, _)| unit.to_nanometres(value)).collect();
    let n = nanometres.len();
    if n > 1 && nanometres[1] < nanometres[0] {
        nanometres.reverse();
        table.reorder(&(0..n).rev().collect::<Vec<_>>());
    }
    let turned = stated.len() > 1 && unit.to_nanometres(stated[1]) < unit.to_nanometres(stated[0]);
    if turned && stated.len() == n {
        report.note(SpectrumNote::RowsTurnedRound);
    }
    WavelengthGrid::listed(nanometres).map_err(|e| FormatError::new(FormatErrorKind::Malformed, NAME, e.to_string()))
}

/// Converts columns of reflectance and transmittance in percent to fractions; other spectra are unchanged. Reflectance
/// factors of glossy samples exceed 1.5, so that percent is taken from the header only.
fn percent(table: &mut Table, stated: StatedQuantity, report: &mut ParseReport) {
    let is_unstated = table.holds.iter().all(|holds| *holds == Holds::Unstated);
    let all_percent = match &table.library {
        Some(library) => library.is_percent(),
        None => is_unstated && holds::of_prose(&table.lines()).1,
    };
    let declared: Vec<bool> = table.percent.iter().map(|percent| *percent || all_percent).collect();
    if !matches!(stated, StatedQuantity::Reflectance | StatedQuantity::ReflectanceFactor) {
        if declared.contains(&true) {
            report.note(SpectrumNote::PercentKept);
        }
        return;
    }
    let are_factors = stated.is_factor() || table.says(names_factor);
    let (mut guessed, mut large) = (f32::MIN, f32::MIN);
    let mut is_percent = declared.clone();
    for ((_, largest), is_percent) in table.extremes().into_iter().zip(&mut is_percent) {
        let is_declared = *is_percent;
        if !is_declared && largest > 1.5 && largest <= 120.0 && !are_factors {
            *is_percent = true;
            guessed = guessed.max(largest);
        } else if !is_declared && largest > 1.5 {
            large = large.max(largest);
        }
    }
    if is_percent.contains(&true) {
        for row in table.values.chunks_exact_mut(is_percent.len()) {
            for (value, _) in row.iter_mut().zip(&is_percent).filter(|(_, is_percent)| **is_percent) {
                *value = (f64::from(*value) / 100.0) as f32;
            }
        }
    }
    if declared.contains(&true) {
        report.note(SpectrumNote::PercentDivided);
    }
    if guessed > f32::MIN {
        report.note(SpectrumNote::PercentGuessed { largest: guessed });
    }
    if large > f32::MIN {
        report.note(SpectrumNote::LargeReflectance { largest: large });
    }
}

/// Adds notes on the number of missing values and on that of negative values.
fn remarks(table: &Table, source: &Source, report: &mut ParseReport) -> Result<(), FormatError> {
    let masked = table.values.iter().filter(|value| value.is_nan()).count();
    if masked == table.values.len() {
        return Err(source.malformed(0, "every value is missing (blank, NaN or --), expected numbers"));
    }
    if masked > 0 {
        report.note(SpectrumNote::MissingMasked { values: masked });
    }
    report.note_negative(&table.values);
    Ok(())
}
