//! Reordering of values from row order to grid order; repeated measurements are averaged.

use super::rows::Rows;
use crate::formats::acquisition::ParseReport;
use crate::notes::ValueNote;
use std::collections::HashMap;

/// Measured values in the order of a grid; values measured repeatedly at a position are averaged.
pub(super) struct Places {
    values: Vec<f32>,
    /// Sum and number of the values at each grid position that was measured repeatedly.
    repeated: HashMap<usize, (f64, u32)>,
}

impl Places {
    pub(super) fn new(count: usize) -> Self {
        Self { values: vec![f32::NAN; count], repeated: HashMap::new() }
    }

    pub(super) fn put(&mut self, place: usize, value: f32) {
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

    pub(super) fn finish(mut self, report: &mut ParseReport) -> Vec<f32> {
        for (&place, &(sum, count)) in &self.repeated {
            self.values[place] = (sum / f64::from(count)) as f32;
        }
        if !self.repeated.is_empty() {
            report.note(ValueNote::MeasuredRepeatedly { samples: self.repeated.len() });
        }
        self.values
    }
}

/// Moves every measured value from row order to its position in a table of directions. `places` holds the position of
/// each measured direction in this table, which has `width` values per direction, one for each wavelength.
pub(super) fn placed(
    rows: &mut Rows,
    places: &[usize],
    count: usize,
    width: usize,
    report: &mut ParseReport,
) -> Vec<f32> {
    let values = std::mem::take(&mut rows.values);
    match ordered(rows, values, places, count, width) {
        Ok(placed) => placed,
        Err(values) => put(rows, &values, places, count, width).finish(report),
    }
}

/// Moves the uncertainties to their positions on the grid, if there are any. The average of repeated uncertainties is
/// stored, which is an upper bound on the uncertainty of the averaged value.
pub(super) fn placed_sigma(rows: &mut Rows, places: &[usize], count: usize, width: usize) -> Option<Vec<f32>> {
    let sigma = std::mem::take(&mut rows.sigma);
    let put = |sigma: Vec<f32>| put(rows, &sigma, places, count, width).finish(&mut ParseReport::default());
    (!sigma.is_empty()).then(|| ordered(rows, sigma, places, count, width).unwrap_or_else(put))
}

/// Returns the values at their positions on the grid if the directions of the rows are in the order of the grid,
/// without repetition, as in most files. Otherwise returns the values unchanged as an error.
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

/// Stores `values`, the values in the rows of a radiometric-csv file, at the positions of their directions on the
/// file's grid of directions.
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
