//! Rows of directions and values → axes where there are none of directions, a grid where they make one, else samples at
//! their own directions.

use super::NAME;
use super::columns::Columns;
use super::header::Header;
use super::rows::{Numbered, Rows};
use crate::domain::limits::{MAX_ENTRIES, MAX_SAMPLES};
use crate::domain::{Axis, Quantity, Sampling, Tensor, WavelengthGrid};
use crate::formats::acquisition::{
    AngleGrid, Angles, Azimuths, Modelled, NoteKind, Outside, ParseReport, Samples, Scattered,
};
use crate::formats::azimuth::extended;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::phase_table;
use crate::formats::text::Brief;
use std::collections::HashMap;

/// Directions of the long form: it should repeat each of them for all its wavelengths before the next.
const MAX_DIRECTIONS: usize = 1 << 26;
/// A grid has at most this many places for each direction measured, else the directions are scattered.
const SPARSEST: usize = 4;

fn malformed(message: impl Into<String>) -> FormatError {
    FormatError::new(FormatErrorKind::Malformed, NAME, message)
}

fn over_limit(message: impl Into<String>) -> FormatError {
    FormatError::new(FormatErrorKind::OverLimit, NAME, message)
}

/// What the samples of a file lie on.
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
    let spectral = spectral(&mut rows, columns, header)?;
    let skips_sigma = |report: &mut ParseReport| {
        if columns.has_sigma {
            let message = "the columns of sigma: uncertainties are used at scattered directions only";
            report.note(NoteKind::Skipped, message);
        }
    };
    if columns.angles.iter().all(Option::is_none) {
        skips_sigma(report);
        return without_directions(rows, columns, spectral, report);
    }
    if header.quantity == Quantity::Phase && columns.angles[0].is_none() {
        skips_sigma(report);
        return scattering_angles(&mut rows, spectral, header, report).map(Samples::Function);
    }
    let directions = Directions::of(&mut rows, columns, header);
    match directions.shape(spectral.as_ref().map_or(1, Axis::len), rows.values.len()) {
        Some(shape) => {
            skips_sigma(report);
            grid(&mut rows, &directions, shape, spectral, header, report).map(Samples::Grid)
        }
        None => scattered(&mut rows, &directions, spectral, header, report).map(Samples::Scattered),
    }
}

/// What they are, for people.
pub(super) fn kind(samples: &Samples) -> &'static str {
    match samples {
        Samples::OnAxes { .. } => "spectra",
        Samples::Grid(_) => "a grid of directions",
        Samples::Scattered(_) => "scattered directions",
        Samples::Function(_) => "scattering angles",
    }
}

/// Refuses tables of which most would be missing, or too large.
fn check_density(rows: &Rows, count: usize, of: &str, width: usize) -> Result<(), FormatError> {
    let found = rows.values.len();
    if count.checked_mul(width).is_some_and(|n| n <= MAX_SAMPLES && n / 8 <= found) {
        return Ok(());
    }
    Err(over_limit(format!(
        "{found} values at {count} {of} and {width} wavelengths: expected most {of} to have most wavelengths"
    )))
}

/// The axis of wavelengths; in the long form the numbers of wavelengths become their ranks.
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

/// Distinct values in increasing order, and the rank of each value given.
fn ranked(values: impl Iterator<Item = f64>) -> (Vec<f64>, Vec<u32>) {
    let values: Vec<f64> = values.collect();
    let mut sorted = values.clone();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let ranks = values.iter().map(|v| sorted.partition_point(|s| s < v) as u32).collect();
    (sorted, ranks)
}

/// A spectrum, or one in each row of the wide form.
fn without_directions(
    rows: Rows,
    columns: &Columns,
    spectral: Option<Axis>,
    report: &mut ParseReport,
) -> Result<Samples, FormatError> {
    let Some(axis) = spectral else {
        return Err(malformed("no wavelengths, expected a column of them or one for each"));
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

/// A phase function over the scattering angle, for each wavelength.
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

/// The directions of the rows, each angle as its rank among the distinct ones.
struct Directions {
    /// Increasing; empty where there is no such column.
    angles: [Vec<f64>; 4],
    /// `[theta_i, phi_i, theta_o, phi_o]` of each direction of the rows.
    ranks: Vec<[u32; 4]>,
    isotropic: bool,
}

impl Directions {
    /// Takes the directions out of `rows`.
    fn of(rows: &mut Rows, columns: &Columns, header: &Header) -> Self {
        let mut present = columns.angles.map(|angle| angle.is_some());
        let mut written = std::mem::take(&mut rows.directions);
        let isotropic = header.isotropic || header.quantity.directions() == 2 && !present[1];
        if isotropic && present[1] {
            for direction in &mut written {
                // Without a column of phi_o there is nothing that it would be relative to.
                if present[3] {
                    // The difference of two decimals, without the last bits of the subtraction.
                    let relative = ((direction[3] - direction[1]) * 1e9).round() / 1e9;
                    direction[3] = relative.rem_euclid(360.0) + 0.0;
                }
                direction[1] = 0.0;
            }
            present[1] = false;
        }
        let mut numbered: [Numbered; 4] = Default::default();
        let mut ranks: Vec<[u32; 4]> = Vec::with_capacity(written.len());
        for direction in &written {
            let mut numbers = [0; 4];
            for ((number, numbered), &angle) in numbers.iter_mut().zip(&mut numbered).zip(direction) {
                *number = numbered.number(angle);
            }
            ranks.push(numbers);
        }
        drop(written);
        let ordered = numbered.map(|numbered| ranked(numbered.values.into_iter()));
        for rank in &mut ranks {
            for (k, number) in rank.iter_mut().enumerate() {
                *number = ordered[k].1[*number as usize];
            }
        }
        let mut angles = ordered.map(|(values, _)| values);
        for (values, present) in angles.iter_mut().zip(present) {
            if !present {
                values.clear();
            }
        }
        Self { angles, ranks, isotropic }
    }

    /// The lengths of the grid that the directions of so many `values` make, or nearly so; `None` where they are scattered.
    fn shape(&self, width: usize, values: usize) -> Option<[usize; 4]> {
        let shape = [0, 1, 2, 3].map(|k| self.angles[k].len().max(1));
        let places = shape.iter().try_fold(1_usize, |product, &n| product.checked_mul(n))?;
        let whole = places.checked_mul(width)?;
        // In the long form a direction may come once for each wavelength: it counts once.
        let measured = values.div_ceil(width);
        (places <= measured.saturating_mul(SPARSEST) && whole <= MAX_SAMPLES).then_some(shape)
    }

    /// `[theta, phi]` of one side at the direction of `ranks`.
    fn at(&self, ranks: [u32; 4], theta: usize) -> [f64; 2] {
        let angle = |k: usize| self.angles[k].get(ranks[k] as usize).copied().unwrap_or(0.0);
        [angle(theta), angle(theta + 1)]
    }
}

/// Values at their places; one that comes twice is averaged.
struct Places {
    values: Vec<f32>,
    /// Sum and count where there are several.
    repeated: HashMap<usize, (f64, u32)>,
}

impl Places {
    fn new(count: usize) -> Self {
        Self { values: vec![f32::NAN; count], repeated: HashMap::new() }
    }

    fn put(&mut self, place: usize, value: f32) {
        if value.is_nan() {
            return;
        }
        let found = self.values[place];
        if found.is_nan() {
            self.values[place] = value;
        } else {
            let (sum, count) = self.repeated.entry(place).or_insert((f64::from(found), 1));
            *sum += f64::from(value);
            *count += 1;
        }
    }

    fn finish(mut self, report: &mut ParseReport) -> Vec<f32> {
        for (&place, &(sum, count)) in &self.repeated {
            self.values[place] = (sum / f64::from(count)) as f32;
        }
        if !self.repeated.is_empty() {
            let message = format!("{} samples were measured more than once: averaged", self.repeated.len());
            report.note(NoteKind::Warning, message);
        }
        self.values
    }
}

/// Takes every value to its place; `place` is the number of a direction's row among rows of `width` values.
fn placed(rows: &mut Rows, places: &[usize], count: usize, width: usize, report: &mut ParseReport) -> Vec<f32> {
    let values = std::mem::take(&mut rows.values);
    match ordered(rows, values, places, count, width) {
        Ok(placed) => placed,
        Err(values) => put(rows, &values, places, count, width).finish(report),
    }
}

/// The values at their places, if they come in that order, each place at most once: most files are so. Else as given.
fn ordered(
    rows: &Rows,
    mut values: Vec<f32>,
    places: &[usize],
    count: usize,
    width: usize,
) -> Result<Vec<f32>, Vec<f32>> {
    let in_order = |lambdas: &[u32]| lambdas.iter().enumerate().all(|(i, &lambda)| i == lambda as usize);
    let whole_rows = rows.lengths.is_empty()
        || rows.lengths.iter().all(|&length| length as usize == width)
            && (width == 1 || rows.lambdas.chunks(width).all(in_order));
    if !whole_rows || !places.is_sorted_by(|a, b| a < b) {
        return Err(values);
    }
    if places.last().is_some_and(|&last| last + 1 == places.len()) {
        values.resize(count * width, f32::NAN);
        return Ok(values);
    }
    let mut placed = vec![f32::NAN; count * width];
    for (row, &place) in values.chunks_exact(width).zip(places) {
        placed[place * width..(place + 1) * width].copy_from_slice(row);
    }
    Ok(placed)
}

/// `values`, one for each of `rows`, at their places.
fn put(rows: &Rows, values: &[f32], places: &[usize], count: usize, width: usize) -> Places {
    let mut target = Places::new(count * width);
    if rows.lengths.is_empty() {
        for (row, &place) in values.chunks_exact(width).zip(places) {
            row.iter().enumerate().for_each(|(lambda, &value)| target.put(place * width + lambda, value));
        }
    } else {
        let mut at = 0;
        for (&length, &place) in rows.lengths.iter().zip(places) {
            for (i, &value) in values.iter().enumerate().skip(at).take(length as usize) {
                let lambda = rows.lambdas.get(i).map_or(0, |&lambda| lambda as usize);
                target.put(place * width + lambda, value);
            }
            at += length as usize;
        }
    }
    target
}

fn count_missing(values: &[f32], what: &str, report: &mut ParseReport) {
    let missing = values.iter().filter(|v| v.is_nan()).count();
    if missing > 0 {
        report.note(NoteKind::Warning, format!("{missing} of {} {what} have no sample: masked", values.len()));
    }
    let negative = values.iter().filter(|v| **v < 0.0).count();
    if negative > 0 {
        let lowest = values.iter().copied().filter(|v| *v < 0.0).fold(0.0, f32::min);
        report.note(NoteKind::Warning, format!("{negative} values are negative, down to {lowest}; kept as they are"));
    }
}

fn grid(
    rows: &mut Rows,
    directions: &Directions,
    shape: [usize; 4],
    spectral: Option<Axis>,
    header: &Header,
    report: &mut ParseReport,
) -> Result<AngleGrid, FormatError> {
    let width = spectral.as_ref().map_or(1, Axis::len);
    let place = |r: &[u32; 4]| r.iter().zip(shape).fold(0, |place, (&rank, n)| place * n + rank as usize);
    let places: Vec<usize> = directions.ranks.iter().map(place).collect();
    let mut values = placed(rows, &places, shape.iter().product(), width, report);
    let filled = fill_poles(&mut values, directions, shape, width);
    if filled > 0 {
        report.note(
            NoteKind::Filled,
            format!("{filled} samples at a pole, where all azimuths are one direction, from the others there"),
        );
    }
    count_missing(&values, "places of the grid", report);
    let [theta_i, phi_i, theta_o, phi_o] = directions.angles.clone();
    let [_, _, n_theta_o, n_phi_o] = shape;
    // The inner azimuths first: closing them changes the stride of the outer ones.
    let mut azimuths = |k: usize, phi: Vec<f64>, inner: usize| -> Result<Option<Azimuths>, FormatError> {
        if phi.is_empty() {
            return Ok(None);
        }
        let mirror = k == 1 && directions.isotropic;
        let what = ["phi_i", "phi_o"][k];
        extended(what, phi, header.extents[k], mirror, (&mut values, inner), report).map(Some).map_err(malformed)
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
    Ok(AngleGrid {
        index: Vec::new(),
        incoming: side(0, theta_i, phi_i)?,
        outgoing: side(1, theta_o, phi_o)?,
        spectral,
        outside: Outside::Masked,
        values,
    })
}

/// At theta 0 and 180 all azimuths are one direction, of which instruments take one sample: the others are the mean of
/// those there are.
fn fill_poles(values: &mut [f32], directions: &Directions, shape: [usize; 4], width: usize) -> usize {
    let mut filled = 0;
    for (theta, phi) in [(0, 1), (2, 3)] {
        if directions.angles[phi].len() < 2 {
            continue;
        }
        let inner: usize = shape[phi + 1..].iter().product::<usize>() * width;
        let (n_theta, n_phi) = (shape[theta], shape[phi]);
        for (row, &angle) in directions.angles[theta].iter().enumerate() {
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

/// `[phi, inner]` at a pole.
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
    directions: &Directions,
    spectral: Option<Axis>,
    header: &Header,
    report: &mut ParseReport,
) -> Result<Scattered, FormatError> {
    let width = spectral.as_ref().map_or(1, Axis::len);
    let mut known: HashMap<[u32; 4], usize> = HashMap::new();
    let mut distinct: Vec<[u32; 4]> = Vec::new();
    let places: Vec<usize> = directions
        .ranks
        .iter()
        .map(|&ranks| {
            *known.entry(ranks).or_insert_with(|| {
                distinct.push(ranks);
                distinct.len() - 1
            })
        })
        .collect();
    drop(known);
    let count = distinct.len();
    check_density(rows, count, "directions", width)?;
    let values = placed(rows, &places, count, width, report);
    count_missing(&values, "pairs of direction and wavelength", report);
    // The uncertainty of an average is at most the average uncertainty.
    let sigma = std::mem::take(&mut rows.sigma);
    let sigma = (!sigma.is_empty()).then(|| {
        let put = |sigma: Vec<f32>| put(rows, &sigma, &places, count, width).finish(&mut ParseReport::default());
        ordered(rows, sigma, &places, count, width).unwrap_or_else(put)
    });
    let side = |theta: usize| -> Vec<[f64; 2]> {
        if directions.angles[theta].is_empty() {
            return Vec::new();
        }
        distinct.iter().map(|&ranks| directions.at(ranks, theta)).collect()
    };
    if header.extents.iter().any(Option::is_some) || header.covers.iter().any(Option::is_some) {
        report.note(NoteKind::Skipped, "extents and covers of angles: the directions make no grid");
    }
    Ok(Scattered { incoming: side(0), outgoing: side(2), isotropic: directions.isotropic, spectral, values, sigma })
}
