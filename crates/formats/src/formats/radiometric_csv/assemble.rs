//! Conversion of rows to samples: on axes without directions, on a grid of directions, or scattered.

use super::about::NAME;
use super::columns::Columns;
use super::directions::{Directions, Lattice, ranked};
use super::header::Header;
use super::places::{Places, placed, placed_sigma};
use super::rows::Rows;
use crate::domain::limits::{MAX_ENTRIES, MAX_SAMPLES};
use crate::domain::{Axis, Quantity, Sampling, Tensor, WavelengthGrid};
use crate::formats::acquisition::{AngleGrid, Angles, Azimuths, Modelled, Outside, ParseReport, Samples, Scattered};
use crate::formats::azimuth::extended;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::phase_table;
use crate::formats::stated::divide_by_pi;
use crate::formats::text::Brief;
use crate::notes::{ScatteringNote, ValueNote};

/// Upper bound on how often the direction changes from row to row in the long form (one value per row). There all
/// wavelengths of a direction should follow each other.
const MAX_DIRECTIONS: usize = 1 << 26;
/// Largest theta, stated in degrees, that suggests radians, and longest wavelength, stated in nm, that suggests
/// micrometres. Raising them warns more often.
const LIKELY_RADIANS: f64 = 1.6;
const LIKELY_MICROMETRES: f64 = 30.0;
/// Upper bound on the grid positions per measured direction. Sparser directions are treated as scattered; raising it
/// makes more grids with empty positions.
const SPARSEST: usize = 4;

fn malformed(message: impl Into<String>) -> FormatError {
    FormatError::new(FormatErrorKind::Malformed, NAME, message)
}

fn over_limit(message: impl Into<String>) -> FormatError {
    FormatError::new(FormatErrorKind::OverLimit, NAME, message)
}

/// Returns the samples of a radiometric-csv file: spectra, a grid, scattered samples or a phase function, as its
/// directions allow.
pub(super) fn samples(
    mut rows: Rows,
    columns: &Columns,
    header: &Header,
    report: &mut ParseReport,
) -> Result<Samples, FormatError> {
    if rows.values.is_empty() {
        return Err(malformed("no rows of numbers after the names of the columns, expected one or more"));
    }
    if rows.values.len() > MAX_SAMPLES {
        return Err(over_limit(format!("{} values or more, expected at most {MAX_SAMPLES}", rows.values.len())));
    }
    if rows.directions.len() > MAX_DIRECTIONS {
        let message =
            "too many changes of direction: sort the rows by direction, wavelength fastest, or use the wide form";
        return Err(over_limit(message));
    }
    if rows.values.iter().all(|v| v.is_nan()) {
        return Err(malformed("every value is missing, expected numbers"));
    }
    if header.is_percent {
        rows.values.iter_mut().chain(&mut rows.sigma).for_each(|value| *value = (f64::from(*value) / 100.0) as f32);
    }
    if header.is_factor {
        divide_by_pi(&mut rows.values);
        divide_by_pi(&mut rows.sigma);
    }
    let spectral = spectral(&mut rows, columns, header)?;
    doubt_units(&rows, columns, spectral.as_ref(), report);
    if columns.angles.iter().all(Option::is_none) {
        skip_sigma(columns, report);
        return without_directions(rows, columns, spectral, report);
    }
    if header.quantity == Quantity::Phase && columns.angles[0].is_none() {
        skip_sigma(columns, report);
        return scattering_angles(&mut rows, spectral, header, report).map(Samples::Function);
    }
    on_directions(rows, columns, header, spectral, report)
}

/// Returns samples at directions: on a grid if the directions form one, else scattered.
pub(super) fn on_directions(
    mut rows: Rows,
    columns: &Columns,
    header: &Header,
    spectral: Option<Axis>,
    report: &mut ParseReport,
) -> Result<Samples, FormatError> {
    let directions = Directions::of(&mut rows, columns, header);
    let width = spectral.as_ref().map_or(1, Axis::len);
    // In the long form a direction may occur once per wavelength; it counts once.
    let measured = rows.values.len().div_ceil(width);
    match directions.lattice(measured.saturating_mul(SPARSEST).min(MAX_SAMPLES / width)) {
        Some(lattice) => {
            on_lattice(&mut rows, lattice, directions.isotropic, spectral, header, report).map(Samples::Grid)
        }
        None => scattered(&mut rows, directions, spectral, header, report).map(Samples::Scattered),
    }
}

/// Returns the values on the grid that their directions form, with the grid of their uncertainties if the file states
/// them.
fn on_lattice(
    rows: &mut Rows,
    lattice: Lattice,
    isotropic: bool,
    spectral: Option<Axis>,
    header: &Header,
    report: &mut ParseReport,
) -> Result<AngleGrid, FormatError> {
    if rows.sigma.is_empty() {
        return grid(rows, lattice, isotropic, spectral, header, report);
    }
    let sigma = std::mem::take(&mut rows.sigma);
    let mut values = grid(rows, lattice.clone(), isotropic, spectral.clone(), header, report)?;
    rows.values = sigma;
    // Notes on the directions were already made with the values.
    let sigma = grid(rows, lattice, isotropic, spectral, header, &mut ParseReport::default())?;
    values.sigma = Some(Box::new(sigma));
    Ok(values)
}

fn skip_sigma(columns: &Columns, report: &mut ParseReport) {
    if columns.has_sigma {
        report.note(ValueNote::UncertaintiesWithoutDirections);
    }
}

/// Returns the kind of samples in words for people, for example `a grid of directions`.
pub(super) fn kind(samples: &Samples) -> &'static str {
    match samples {
        Samples::OnAxes { .. } => "spectra",
        Samples::Grid(_) => "a grid of directions",
        Samples::Scattered(_) => "scattered directions",
        Samples::Function(_) => "scattering angles",
    }
}

/// Refuses a table of values over directions and wavelengths that is mostly missing or too large.
fn check_density(rows: &Rows, count: usize, of: &str, width: usize) -> Result<(), FormatError> {
    let found = rows.values.len();
    if count.checked_mul(width).is_some_and(|n| n <= MAX_SAMPLES && n / 8 <= found) {
        return Ok(());
    }
    Err(over_limit(format!(
        "{found} values for {count} {of} and {width} wavelengths, expected at most {MAX_SAMPLES} pairs of these, and a \
         value for an eighth of them or more"
    )))
}

/// Returns the wavelength axis of the samples. In the long form (one value per row), wavelengths numbered in order of
/// appearance are renumbered in increasing order.
fn spectral(rows: &mut Rows, columns: &Columns, header: &Header) -> Result<Option<Axis>, FormatError> {
    let wavelengths = if columns.is_wide() {
        columns.wavelengths.clone()
    } else if columns.has_wavelength {
        let (sorted, ranks) = ranked(rows.wavelengths.values.iter().map(|&v| header.wavelength_unit.to_nanometres(v)));
        rows.lambdas.iter_mut().for_each(|lambda| *lambda = ranks[*lambda as usize]);
        sorted
    } else {
        return Ok(None);
    };
    let grid = WavelengthGrid::listed(wavelengths).map_err(|e| over_limit(e.to_string()))?;
    Ok(Some(Axis::Wavelength(grid)))
}

/// Adds a note if the largest theta or the longest wavelength suggests another unit than the stated one.
fn doubt_units(rows: &Rows, columns: &Columns, spectral: Option<&Axis>, report: &mut ParseReport) {
    let largest = |k: usize| rows.directions.iter().map(|direction| direction[k]).fold(0.0, f64::max);
    let is_degrees = |k: usize| columns.angles[k].is_some_and(|angle| !angle.radians);
    let theta = [0, 2].into_iter().filter(|&k| is_degrees(k)).map(largest).fold(0.0, f64::max);
    if theta > 0.0 && theta <= LIKELY_RADIANS {
        report.note(ValueNote::ThetaLikelyInRadians { largest_degrees: Brief(theta) });
    }
    if let Some(Axis::Wavelength(grid)) = spectral {
        let last = grid.at(grid.len() - 1);
        if last <= LIKELY_MICROMETRES {
            report.note(ValueNote::WavelengthsLikelyInMicrometres { largest_nm: Brief(last) });
        }
    }
}

/// Returns samples without directions: one spectrum, or one per row if each row has a column per wavelength.
fn without_directions(
    rows: Rows,
    columns: &Columns,
    spectral: Option<Axis>,
    report: &mut ParseReport,
) -> Result<Samples, FormatError> {
    let Some(axis) = spectral else {
        return Err(malformed("no wavelengths, expected a column `wavelength` or one column of values for each"));
    };
    let (axes, values) = if columns.is_wide() {
        let count = rows.values.len() / columns.width();
        if count > MAX_ENTRIES {
            return Err(over_limit(format!("{count} rows without directions, expected at most {MAX_ENTRIES}")));
        }
        let index = (count > 1).then(|| Axis::Index { count, labels: Vec::new() });
        (index.into_iter().chain([axis]).collect(), rows.values)
    } else {
        let mut places = Places::new(axis.len());
        rows.lambdas.iter().zip(&rows.values).for_each(|(&lambda, &value)| places.put(lambda as usize, value));
        (vec![axis], places.finish(report))
    };
    count_missing(&values, "values", report);
    let tensor = Tensor::new(axes, values).map_err(|e| over_limit(e.to_string()))?;
    Ok(Samples::OnAxes { tensor, sampling: Sampling::default() })
}

/// Returns the phase function of a radiometric-csv file, for each wavelength, as a table over the scattering angles in
/// its rows.
fn scattering_angles(
    rows: &mut Rows,
    spectral: Option<Axis>,
    header: &Header,
    report: &mut ParseReport,
) -> Result<Modelled, FormatError> {
    let width = spectral.as_ref().map_or(1, Axis::len);
    let (angles, ranks) = ranked(std::mem::take(&mut rows.directions).into_iter().map(|direction| direction[2]));
    check_density(rows, angles.len(), "angles", width)?;
    let places: Vec<usize> = ranks.into_iter().map(|rank| rank as usize).collect();
    let values = placed(rows, &places, angles.len(), width, report);
    count_missing(&values, "pairs of angle and wavelength", report);
    let function = phase_table::tabulated(&angles, &values, spectral, header.normalization, report);
    function.map_err(|error| FormatError { format: NAME, ..error })
}

fn count_missing(values: &[f32], places: &'static str, report: &mut ParseReport) {
    // 32-bit counters vectorise; there are at most 2^28 values.
    let (mut missing, mut negative) = (0_u32, 0_u32);
    for value in values {
        missing += u32::from(value.is_nan());
        negative += u32::from(*value < 0.0);
    }
    if missing > 0 {
        report.note(ValueNote::WithoutSample { missing: missing as usize, of: values.len(), places });
    }
    if negative > 0 {
        let lowest = values.iter().copied().fold(0.0, f32::min);
        report.note(ValueNote::Negative { values: negative as usize, lowest });
    }
}

fn grid(
    rows: &mut Rows,
    lattice: Lattice,
    isotropic: bool,
    spectral: Option<Axis>,
    header: &Header,
    report: &mut ParseReport,
) -> Result<AngleGrid, FormatError> {
    let width = spectral.as_ref().map_or(1, Axis::len);
    let mut values = placed(rows, &lattice.places, lattice.shape.iter().product(), width, report);
    let before = lattice.has_poles() && values.iter().any(|value| value.is_nan());
    let before = before.then(|| values.clone());
    let filled = fill_poles(&mut values, &lattice, width);
    // Original values, kept if some are filled below.
    let mut kept = before.filter(|_| filled > 0);
    if filled > 0 {
        report.note_unfolding(ScatteringNote::PolesFilled { samples: filled });
    }
    // Missing at poles alone, which directions beside them fill, is no fault of the file.
    let is_complete = !values.iter().any(|value| value.is_nan());
    let counted = kept.as_deref().filter(|_| !is_complete).unwrap_or(&values);
    count_missing(counted, "places of the grid", report);
    let [theta_i, phi_i, theta_o, phi_o] = lattice.angles;
    let [_, _, n_theta_o, n_phi_o] = lattice.shape;
    // Inner azimuths first: closing them changes the stride of the outer ones.
    let mut listed = [None, None];
    let mut azimuths = |k: usize, phi: Vec<f64>, inner: usize| -> Result<Option<Azimuths>, FormatError> {
        if phi.is_empty() {
            return Ok(None);
        }
        let mirror = k == 1 && isotropic;
        let (what, before) = (["phi_i", "phi_o"][k], phi.clone());
        let extended = extended(what, phi, header.extents[k], mirror, (&mut values, inner), &mut kept, report);
        let azimuths = extended.map_err(malformed)?;
        listed[k] = (azimuths.phi.len() < before.len()).then_some(before);
        Ok(Some(azimuths))
    };
    let phi_o = azimuths(1, phi_o, width)?;
    let n_phi_o = phi_o.as_ref().map_or(n_phi_o, |azimuths| azimuths.phi.len());
    let phi_i = azimuths(0, phi_i, n_theta_o * n_phi_o * width)?;
    let side = |k: usize, theta: Vec<f64>, phi: Option<Azimuths>| -> Result<Option<Angles>, FormatError> {
        let (Some(&first), Some(&last)) = (theta.first(), theta.last()) else { return Ok(None) };
        let covers = header.covers[k].unwrap_or((first, last));
        if !(covers.0 <= first && last <= covers.1 && covers.0 >= 0.0 && covers.1 <= 180.0) {
            let name = ["theta_i", "theta_o"][k];
            return Err(malformed(format!(
                "{name}_covers {} to {}, expected a range around the angles from {} to {}",
                Brief(covers.0),
                Brief(covers.1),
                Brief(first),
                Brief(last)
            )));
        }
        Ok(Some(Angles { theta, covers, phi }))
    };
    let mut grid = AngleGrid {
        index: Vec::new(),
        incoming: side(0, theta_i, phi_i)?,
        outgoing: side(1, theta_o, phi_o)?,
        spectral,
        outside: Outside::Masked,
        values: values.into(),
        stated: None,
        sigma: None,
    };
    if let Some(values) = kept {
        let stated = grid.stated_as(values, &listed).map_err(|error| malformed(error.to_string()))?;
        grid.stated = Some(Box::new(stated));
    }
    Ok(grid)
}

/// Fills missing values at theta 0 and 180, where all azimuths are one direction, with the mean of the measured ones,
/// because instruments take one sample there. Returns the number of filled values.
fn fill_poles(values: &mut [f32], lattice: &Lattice, width: usize) -> usize {
    let (mut filled, shape) = (0, lattice.shape);
    for (theta, phi) in [(0, 1), (2, 3)] {
        if shape[phi] < 2 {
            continue;
        }
        let inner: usize = shape[phi + 1..].iter().product::<usize>() * width;
        let (n_theta, n_phi) = (shape[theta], shape[phi]);
        for (row, &angle) in lattice.angles[theta].iter().enumerate() {
            if angle != 0.0 && angle != 180.0 {
                continue;
            }
            for block in values.chunks_exact_mut(n_theta * n_phi * inner) {
                let pole = &mut block[row * n_phi * inner..][..n_phi * inner];
                filled += fill_row(pole, inner);
            }
        }
    }
    filled
}

/// Fills missing values of one polar angle at a pole, `[phi, inner]`, with the mean over azimuths. Returns the number
/// of filled values.
fn fill_row(pole: &mut [f32], inner: usize) -> usize {
    let mut filled = 0;
    for i in 0..inner {
        let (mut sum, mut count, mut missing) = (0.0, 0_usize, 0_usize);
        for value in pole[i..].iter().step_by(inner) {
            if value.is_nan() {
                missing += 1;
            } else {
                sum += f64::from(*value);
                count += 1;
            }
        }
        if missing > 0 && count > 0 {
            let mean = (sum / count as f64) as f32;
            pole[i..].iter_mut().step_by(inner).filter(|v| v.is_nan()).for_each(|v| *v = mean);
            filled += missing;
        }
    }
    filled
}

fn scattered(
    rows: &mut Rows,
    directions: Directions,
    spectral: Option<Axis>,
    header: &Header,
    report: &mut ParseReport,
) -> Result<Scattered, FormatError> {
    let width = spectral.as_ref().map_or(1, Axis::len);
    let (present, isotropic) = (directions.present, directions.isotropic);
    let (distinct, places) = directions.distinct();
    let count = distinct.len();
    check_density(rows, count, "directions", width)?;
    let values = placed(rows, &places, count, width, report);
    count_missing(&values, "pairs of direction and wavelength", report);
    let sigma = placed_sigma(rows, &places, count, width);
    let side = |theta: usize| -> Vec<[f64; 2]> {
        if !present[theta] {
            return Vec::new();
        }
        distinct.iter().map(|direction| [direction[theta], direction[theta + 1]]).collect()
    };
    if header.extents.iter().any(Option::is_some) || header.covers.iter().any(Option::is_some) {
        report.note(ValueNote::ExtentsWithoutGrid);
    }
    Ok(Scattered { incoming: side(0), outgoing: side(2), isotropic, spectral, values, sigma })
}
