//! Nonzero columns of a model's rows: products of cubic B-splines in the coordinates of its kind.
//!
//! Coordinates and splines of several rows are computed side by side. Each row takes the operations that it would take
//! alone.

use super::kind::ChartKind;
use crate::domain::vector::Vector;
use crate::numeric::wide;

/// Number of cubic B-splines that are nonzero at a position; they are consecutive.
pub(super) const RUN: usize = 4;
/// Upper bound on the number of runs (groups of four consecutive B-splines) that are nonzero for one pair of
/// directions.
const MOST_RUNS: usize = 16;
/// Number of direction pairs whose basis functions are computed side by side.
pub(super) const LANES: usize = 8;

/// Numbers for [`LANES`] pairs of an incoming and an outgoing direction, one for each pair, computed side by side.
type Lanes = [f64; LANES];

/// Nonzero basis functions of a scattering model for one direction pair, in ascending order: a constant, then runs of
/// four.
#[derive(Clone, Copy)]
pub(super) struct Entries {
    /// Number of the basis function that is the constant 1; `None` without one.
    constant: Option<usize>,
    length: usize,
    columns: [u32; MOST_RUNS],
    values: [[f64; RUN]; MOST_RUNS],
}

impl Entries {
    pub(super) fn new() -> Self {
        Self { constant: None, length: 0, columns: [0; MOST_RUNS], values: [[0.0; RUN]; MOST_RUNS] }
    }

    #[inline]
    fn push(&mut self, column: usize, values: [f64; RUN]) {
        if self.length < MOST_RUNS {
            self.columns[self.length] = column as u32;
            self.values[self.length] = values;
            self.length += 1;
        }
    }

    #[inline]
    fn runs(&self) -> impl Iterator<Item = (usize, &[f64; RUN])> {
        self.columns.iter().map(|&column| column as usize).zip(&self.values).take(self.length)
    }

    /// Appends to the list of nonzero basis functions the four cubic B-splines of one coordinate; `first` is the index
    /// of the coordinate's first spline.
    #[inline]
    fn single(&mut self, first: usize, (at, values): Place) {
        self.push(first + at as usize, values);
    }

    /// Appends to the list of nonzero basis functions the 4 × 4 products of cubic B-splines in x and y; `ny` is the
    /// number of splines in y, `first` the index of the first product.
    #[inline]
    fn products(&mut self, first: usize, ny: usize, (ax, vx): Place, (ay, vy): Place) {
        for (i, a) in vx.into_iter().enumerate() {
            self.push(first + (ax as usize + i) * ny + ay as usize, vy.map(|b| a * b));
        }
    }

    /// Adds the products of all nonzero basis functions of a direction pair to the lower triangle of an `n` × `n` Gram
    /// matrix.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    pub(super) fn add_products(&self, n: usize, matrix: &mut [f64]) {
        if let Some(constant) = self.constant {
            matrix[constant * n + constant] += 1.0;
        }
        for number in 0..self.length.min(MOST_RUNS) {
            let rows = &mut matrix[self.columns[number] as usize * n..][..RUN * n];
            for (row, a) in rows.chunks_exact_mut(n).zip(self.values[number]) {
                if let Some(constant) = self.constant {
                    row[constant] += a;
                }
                // Entries above the diagonal of the last run are never read.
                for (&column, b) in self.columns[..=number].iter().zip(&self.values) {
                    if let Some(sums) = row[column as usize..].first_chunk_mut::<RUN>() {
                        // Reads the run as a whole before writing any of it.
                        let (own, b) = (*sums, *b);
                        *sums = std::array::from_fn(|k| own[k] + a * b[k]);
                    }
                }
            }
        }
    }

    /// Adds `x` times the value of each basis function of the scattering model, for one pair of incoming and outgoing
    /// direction, to the basis function's element of `sums`. Basis functions of value 0 are skipped.
    #[inline]
    pub(super) fn add(&self, x: f64, sums: &mut [f64]) {
        if let Some(constant) = self.constant {
            sums[constant] += x;
        }
        for (column, values) in self.runs() {
            sums[column..column + RUN].iter_mut().zip(values).for_each(|(sum, value)| *sum += value * x);
        }
    }
}

/// Evaluates a scattering model for several pairs of directions: for each pair, the sum of value · coefficient over
/// basis functions, added in the order of the functions. `coefficients` are by basis function, for up to [`RUN`]
/// spectral vectors.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
pub(super) fn add_up(rows: &[Entries; LANES], coefficients: &[[f64; RUN]]) -> [[f64; RUN]; LANES] {
    let mut sums = [[0.0; RUN]; LANES];
    for (row, sums) in rows.iter().zip(&mut sums) {
        if let Some(constant) = row.constant {
            sums.iter_mut().zip(&coefficients[constant]).for_each(|(sum, c)| *sum += c);
        }
    }
    for run in 0..rows[0].length {
        for (row, sums) in rows.iter().zip(&mut sums) {
            let coefficients = &coefficients[row.columns[run] as usize..][..RUN];
            for (value, coefficients) in row.values[run].into_iter().zip(coefficients) {
                let (own, c) = (*sums, *coefficients);
                *sums = std::array::from_fn(|k| own[k] + value * c[k]);
            }
        }
    }
    sums
}

/// Index of the first of the four cubic B-splines that are nonzero at a position, and their values.
type Place = (u32, [f64; RUN]);

/// Evaluates the `count` ≥ 4 cubic B-splines of the interval from 0 to 1 at each position in `x`; four of them are
/// nonzero there.
///
/// The knots are evenly spaced, and repeated at both ends (de Boor 1978, chapter X). Positions beyond the interval
/// count as its ends.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn splines(count: usize, x: &Lanes) -> [Place; LANES] {
    let spans = count as i32 - 3;
    let mut scaled = [0.0; LANES];
    let mut span = [0_i32; LANES];
    // Knots relative to the span, starting with the second before it; repeated at both ends.
    let mut knots = [[0.0; LANES]; 6];
    for lane in 0..LANES {
        scaled[lane] = x[lane].clamp(0.0, 1.0) * f64::from(spans);
        span[lane] = (scaled[lane] as i32).min(spans - 1);
    }
    for (k, knots) in (-2..).zip(&mut knots) {
        for lane in 0..LANES {
            knots[lane] = f64::from((span[lane] + k).clamp(0, spans));
        }
    }
    let mut values = [[1.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]];
    for degree in 1..=3 {
        let mut saved = [0.0; LANES];
        for r in 0..degree {
            for lane in 0..LANES {
                let (right, left) = (knots[r + 3][lane], knots[r + 3 - degree][lane]);
                let share = values[r][lane] / (right - left);
                values[r][lane] = saved[lane] + (right - scaled[lane]) * share;
                saved[lane] = (scaled[lane] - left) * share;
            }
        }
        values[degree] = saved;
    }
    std::array::from_fn(|lane| (span[lane] as u32, std::array::from_fn(|k| values[k][lane])))
}

/// Basis functions of a scattering model: the coordinates in which they are written, such as half-vector coordinates,
/// and the number of constants among them.
pub(super) struct Columns {
    pub(super) kind: ChartKind,
    /// Number of incoming directions for each of which the model has a constant of its own.
    pub(super) constants: usize,
}

/// Direction pair: number of the incoming direction (block), incoming direction, outgoing direction.
pub(super) type Row = (usize, Vector, Vector);

impl Columns {
    /// Number of basis functions of the scattering model.
    pub(super) fn count(&self) -> usize {
        self.constants
            + match self.kind {
                ChartKind::Zonal => 32,
                ChartKind::Isotropic => 14 + 6 + 7 + 7 + 10 * 5 + 4 * 5,
                ChartKind::Anisotropic => 7 + 7 + 6 + 3 * 10 * 10,
            }
    }

    /// Evaluates the nonzero basis functions of the scattering model at several pairs of incoming and outgoing
    /// direction.
    pub(super) fn fill(&self, rows: &[Row; LANES], entries: &mut [Entries; LANES]) {
        for ((block, _, _), entries) in rows.iter().zip(&mut *entries) {
            entries.length = 0;
            entries.constant = (self.kind != ChartKind::Zonal && *block < self.constants).then_some(*block);
        }
        wide(
            #[inline(always)]
            || self.fill_runs(rows, entries),
        );
    }

    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn fill_runs(&self, rows: &[Row; LANES], entries: &mut [Entries; LANES]) {
        let wi: [Lanes; 3] = std::array::from_fn(|axis| rows.map(|(_, wi, _)| wi[axis]));
        let wo: [Lanes; 3] = std::array::from_fn(|axis| rows.map(|(_, _, wo)| wo[axis]));
        let mut angle = [0.0; LANES];
        for lane in 0..LANES {
            let cosine = wi[0][lane] * wo[0][lane] + wi[1][lane] * wo[1][lane] + wi[2][lane] * wo[2][lane];
            angle[lane] = ((1.0 - cosine).max(0.0) / 2.0).sqrt();
        }
        if self.kind == ChartKind::Zonal {
            let places = splines(32, &angle);
            entries.iter_mut().zip(places).for_each(|(entries, place)| entries.single(0, place));
            return;
        }
        let (mut across, mut to_normal) = ([[0.0; LANES]; 2], [0.0; LANES]);
        let (mut difference, mut height) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            // Transmission is mirrored to the upper side.
            let (up_in, up_out) = (wi[2][lane].abs(), wo[2][lane].abs());
            let h = [wi[0][lane] + wo[0][lane], wi[1][lane] + wo[1][lane], up_in + up_out];
            // Opposite directions in the horizon have no half vector; it stays 0.
            let squared = (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).max(f64::MIN_POSITIVE);
            let inverse = 1.0 / squared.sqrt();
            let h = [h[0] * inverse, h[1] * inverse, h[2] * inverse];
            // Sines of half angles, divided by that of 45°.
            to_normal[lane] = (1.0 - h[2]).max(0.0).sqrt();
            let cosine = wi[0][lane] * h[0] + wi[1][lane] * h[1] + up_in * h[2];
            difference[lane] = (1.0 - cosine).max(0.0).sqrt();
            height[lane] = up_out.sqrt();
            for axis in 0..2 {
                // Projection of h, in which splines are denser near the normal.
                across[axis][lane] = 0.5 + 0.5 * h[axis] * 1.06 / (h[axis] * h[axis] + 0.1236).sqrt();
            }
        }
        let first = self.constants;
        let (seven_heights, seven_angles) = (splines(7, &height), splines(7, &angle));
        let six_differences = splines(6, &difference);
        if self.kind == ChartKind::Isotropic {
            let peak = to_normal.map(f64::sqrt);
            let (peaks, ten_peaks) = (splines(14, &peak), splines(10, &peak));
            let (differences, heights) = (splines(5, &difference), splines(4, &height));
            for (lane, entries) in entries.iter_mut().enumerate() {
                entries.single(first, peaks[lane]);
                entries.single(first + 14, six_differences[lane]);
                entries.single(first + 20, seven_heights[lane]);
                entries.single(first + 27, seven_angles[lane]);
                entries.products(first + 34, 5, ten_peaks[lane], differences[lane]);
                entries.products(first + 84, 5, heights[lane], differences[lane]);
            }
            return;
        }
        let (xs, ys) = (splines(10, &across[0]), splines(10, &across[1]));
        for (lane, entries) in entries.iter_mut().enumerate() {
            entries.single(first, seven_heights[lane]);
            entries.single(first + 7, seven_angles[lane]);
            entries.single(first + 14, six_differences[lane]);
            // The products again, times the centred difference angle and times its square.
            entries.products(first + 20, 10, xs[lane], ys[lane]);
            let centred = difference[lane] - 0.5;
            for at in 3..7 {
                let (column, values) = (entries.columns[at] as usize, entries.values[at]);
                entries.push(column + 100, values.map(|value| value * centred));
            }
            for at in 3..7 {
                let (column, values) = (entries.columns[at] as usize, entries.values[at]);
                entries.push(column + 200, values.map(|value| value * centred * centred));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spline(count: usize, x: f64) -> (usize, [f64; RUN]) {
        let (first, values) = splines(count, &[x; LANES])[3];
        (first as usize, values)
    }

    #[test]
    fn splines_add_up_to_one_and_are_not_negative() {
        for count in [4, 5, 7, 14, 32] {
            for k in 0..=200 {
                let (first, values) = spline(count, f64::from(k) / 200.0);
                assert!(first + 4 <= count);
                assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(values.iter().all(|&v| v >= -1e-15));
            }
        }
    }

    #[test]
    fn splines_are_continuous() {
        for count in [4, 7, 14] {
            for k in 1..count - 3 {
                let x = k as f64 / (count - 3) as f64;
                let value = |x: f64, column: usize| {
                    let (first, values) = spline(count, x);
                    column.checked_sub(first).and_then(|k| values.get(k)).copied().unwrap_or(0.0)
                };
                for column in 0..count {
                    assert!((value(x - 1e-9, column) - value(x + 1e-9, column)).abs() < 1e-7);
                }
            }
        }
    }

    #[test]
    fn every_column_is_of_its_kind_and_row() {
        let rows: [Row; LANES] = std::array::from_fn(|k| {
            let t = 0.05 + 0.1 * k as f64;
            (k, [t, 0.0, (1.0 - t * t).sqrt()], [0.0, -t, (1.0 - t * t).sqrt()])
        });
        for (kind, runs) in [(ChartKind::Zonal, 1), (ChartKind::Isotropic, 12), (ChartKind::Anisotropic, 15)] {
            let columns = Columns { kind, constants: if kind == ChartKind::Zonal { 0 } else { 5 } };
            let mut entries = [Entries::new(); LANES];
            columns.fill(&rows, &mut entries);
            for (k, entries) in entries.iter().enumerate() {
                assert_eq!(entries.constant, (k < columns.constants).then_some(k));
                assert_eq!(entries.length, runs);
                assert!(
                    entries.runs().all(|(column, _)| column >= columns.constants && column + RUN <= columns.count())
                );
                assert!(entries.runs().is_sorted_by_key(|(column, _)| column));
            }
        }
    }
}
