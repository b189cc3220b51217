//! Reciprocity of a file: the difference of f(wi, wo) and f(wo, wi), both stated or interpolated.

use super::sides::{Mix, Side};
use super::table::Table;
use crate::domain::{Axis, Measurement, Quantity};
use crate::formats::{Acquisition, Scattered};
use crate::notes::CheckNote;
use crate::projection::planes::scattered_samples;
use crate::projection::same_angle::{azimuth_steps, steps};
use std::collections::HashMap;

/// Upper bound on the number of direction pairs whose values f(wi, wo) and f(wo, wi) are compared. Of more pairs some
/// are skipped, always the same ones.
const MOST_PAIRS: usize = 1 << 18;
/// Upper bound on the number of scattered samples that are searched for exchanged pairs f(wi, wo) and f(wo, wi); larger
/// scans are not checked.
const MOST_SCATTERED: usize = 1 << 22;
/// Upper bound on the number of spectral bands in which each pair of directions is compared, evenly spread over all
/// bands.
const MOST_BANDS: usize = 4;
/// Number of comparisons f(wi, wo) with f(wo, wi), both samples of the file, that suffices to measure the deviation
/// from reciprocity. With fewer, values interpolated between samples are compared instead, although interpolation adds
/// an error of its own.
const ENOUGH: usize = 32;
/// Lower bound on the number of compared values for which a median difference is given.
const FEWEST: usize = 8;

/// Deviation of a BRDF from reciprocity, measured on the values of its file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reciprocity {
    /// Median of |f(wi, wo) − f(wo, wi)| relative to the mean of both values: 0.01 is 1 %.
    pub difference: f64,
    /// Number of values f(wi, wo) that were compared with f(wo, wi).
    pub values: u64,
    /// True if the values f(wo, wi) are interpolated between samples, false if they are samples of the file.
    pub is_interpolated: bool,
}

impl Reciprocity {
    /// Measures how far a file deviates from reciprocity. Returns `None` if it is no BRDF, or if too few pairs f(wi,
    /// wo) and f(wo, wi) exist.
    pub(super) fn of(acquisition: &Acquisition) -> Option<Self> {
        if acquisition.quantity != Quantity::Brdf {
            return None;
        }
        if let Some(scattered) = scattered_samples(acquisition) {
            return of_scattered(&scattered);
        }
        of_table(&Table::of(acquisition)?)
    }

    /// Measures how far a measurement deviates from reciprocity, as a file does.
    pub(super) fn of_measurement(measurement: &Measurement) -> Option<Self> {
        if measurement.quantity != Quantity::Brdf {
            return None;
        }
        of_table(&Table::of_tensor(measurement.quantity, &measurement.tensor)?)
    }

    /// Returns a remark for the user on the deviation from reciprocity.
    pub(super) fn remark(&self) -> CheckNote {
        let difference_percent = 100.0 * self.difference;
        CheckNote::Reciprocity { difference_percent, values: self.values, is_interpolated: self.is_interpolated }
    }
}

/// Relative differences between f(wi, wo) and f(wo, wi).
#[derive(Default)]
struct Differences(Vec<f32>);

impl Differences {
    fn add(&mut self, a: f64, b: f64) {
        let mean = 0.5 * (a + b);
        if mean > 0.0 {
            self.0.push(((a - b).abs() / mean) as f32);
        }
    }

    fn finish(mut self, is_interpolated: bool) -> Option<Reciprocity> {
        let values = self.0.len();
        if values < FEWEST {
            return None;
        }
        let difference = f64::from(*self.0.select_nth_unstable_by(values / 2, f32::total_cmp).1);
        Some(Reciprocity { difference, values: values as u64, is_interpolated })
    }
}

/// Returns the indices of the spectral bands in which reciprocity is tested: evenly spread over all `count` bands.
fn bands(count: usize) -> Vec<usize> {
    let few = count.min(MOST_BANDS);
    (0..few).map(|i| (2 * i + 1) * count / (2 * few)).collect()
}

/// Returns the step n by which every n-th of the `pairs` pairs of directions is compared. The step is odd, so that not
/// all compared pairs have one azimuth.
fn every(pairs: usize) -> usize {
    match pairs.div_ceil(MOST_PAIRS) {
        0 | 1 => 1,
        every => every | 1,
    }
}

fn of_table(table: &Table<'_>) -> Option<Reciprocity> {
    let Table { incoming, outgoing, .. } = table;
    // Cells of different sizes hold different means.
    if let (Side::Triangles(a), Side::Triangles(b)) = (incoming, outgoing)
        && a.level() != b.level()
    {
        return None;
    }
    let chosen = bands(table.bands());
    let values = |pair: usize, band: usize| f64::from(table.values[pair * table.bands() + band]);
    let (mut stated, mut interpolated) = (Differences::default(), Differences::default());
    let pairs = table.values.len() / table.bands();
    for pair in (0..pairs).step_by(every(pairs)) {
        let (i, o) = (pair / outgoing.len(), pair % outgoing.len());
        let first = i / incoming.len() * incoming.len();
        let ([theta_i, phi_i], [theta_o, phi_o]) = (incoming.degrees(i - first), outgoing.degrees(o));
        if theta_i > 90.0 || theta_o > 90.0 {
            continue;
        }
        // Exchanging the directions of an isotropic surface reverses the azimuth between them.
        let back = if incoming.is_isotropic() { -phi_o } else { phi_i };
        let (Some(from), Some(to)) = (incoming.at([theta_o, phi_o]), outgoing.at([theta_i, back])) else { continue };
        let entries = mixed(&from, &to, first, outgoing.len());
        if entries.iter().any(|&(entry, _)| entry == pair) {
            continue;
        }
        let differences = if from.is_stated && to.is_stated { &mut stated } else { &mut interpolated };
        for &band in &chosen {
            let exchanged: f64 = entries.iter().map(|&(entry, weight)| weight * values(entry, band)).sum();
            differences.add(values(pair, band), exchanged);
        }
    }
    if stated.0.len() >= ENOUGH { stated.finish(false) } else { interpolated.finish(true) }
}

/// Returns the measured pairs of directions from which f(wo, wi) is interpolated, with their weights.
fn mixed(from: &Mix, to: &Mix, first: usize, outgoing: usize) -> Vec<(usize, f64)> {
    let counts = |mix: &Mix| mix.samples.into_iter().filter(|(_, weight)| *weight > 0.0).collect::<Vec<_>>();
    let to = counts(to);
    let of =
        |(i, a): (usize, f64)| to.iter().map(move |&(o, b)| ((first + i) * outgoing + o, a * b)).collect::<Vec<_>>();
    counts(from).into_iter().flat_map(of).collect()
}

fn of_scattered(scattered: &Scattered) -> Option<Reciprocity> {
    let count = scattered.directions();
    let width = scattered.spectral.as_ref().map_or(1, Axis::len);
    let is_paired = scattered.incoming.len() == count && scattered.outgoing.len() == count;
    if !is_paired || count > MOST_SCATTERED || scattered.values.len() != count * width {
        return None;
    }
    let key = |[theta_i, phi_i]: [f64; 2], [theta_o, phi_o]: [f64; 2]| {
        if scattered.isotropic {
            // At either pole the azimuth between the directions is meaningless.
            return [steps(theta_i), 0, steps(theta_o), azimuth_steps(theta_i.min(theta_o), phi_o - phi_i)];
        }
        [steps(theta_i), azimuth_steps(theta_i, phi_i), steps(theta_o), azimuth_steps(theta_o, phi_o)]
    };
    let at = |row: usize| (scattered.incoming[row], scattered.outgoing[row]);
    let mut rows = HashMap::with_capacity(count);
    for row in 0..count {
        let (wi, wo) = at(row);
        rows.entry(key(wi, wo)).or_insert(row);
    }
    let chosen = bands(width);
    let mut differences = Differences::default();
    for row in (0..count).step_by(every(count)) {
        let (wi, wo) = at(row);
        let Some(&other) = rows.get(&key(wo, wi)).filter(|other| **other != row) else { continue };
        if key(wi, wo) == key(wo, wi) {
            continue;
        }
        for &band in &chosen {
            let value = |row: usize| f64::from(scattered.values[row * width + band]);
            differences.add(value(row), value(other));
        }
    }
    differences.finish(false)
}
