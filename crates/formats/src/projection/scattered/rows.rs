//! Values of scattered samples as rows: logarithms, means over bands, and weighted means of rows.

use crate::numeric::exponential::exp_horner;
use crate::numeric::wide;
use rayon::prelude::*;
use std::borrow::Cow;

/// Number of points within a triangle at which a local fit is evaluated and averaged. Raising it is more accurate and
/// slower.
pub(super) const PARTS: usize = 4;
/// Number of spectral bands in which the weighted sums over samples of a local fit are formed at a time. Raising it
/// uses more memory.
const BLOCK: usize = 256;

/// Values of scattered samples `[sample, band]`, prepared for local fits.
pub(super) struct Rows<'a> {
    pub(super) width: usize,
    values: Cow<'a, [f32]>,
    /// Natural logarithms of the sample values `[sample, band]`; NaN if a value is missing or not positive.
    logs: Vec<f32>,
    pub(super) kinds: Vec<Kind>,
    /// Means over the bands of each sample: of the logarithms (NaN unless all values are positive) and of the values
    /// (NaN if some are missing).
    pub(super) light: Vec<[f64; 2]>,
    /// Pair of numbers for each sample: the inverse of its stated variance, averaged over bands, and this inverse times
    /// the mean square of its values. Empty if the file states no uncertainty.
    pub(super) certainty: Vec<[f64; 2]>,
}

/// Completeness of the values of a sample over the bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// The sample has a positive value in every spectral band.
    Positive,
    /// The sample has a value in every spectral band, but some of them are zero or negative.
    Whole,
    /// The sample has no value in some of the spectral bands.
    Partial,
    /// The sample has no value in any spectral band.
    Missing,
}

impl<'a> Rows<'a> {
    pub(super) fn new(values: Cow<'a, [f32]>, sigma: Option<&[f32]>, width: usize) -> Self {
        let logs: Vec<f32> = values
            .par_chunks(1 << 14)
            .flat_map_iter(|chunk| chunk.iter().map(|&v| if v > 0.0 { libm::logf(v) } else { f32::NAN }))
            .collect();
        let about: Vec<(Kind, [f64; 2])> =
            values.par_chunks(width).zip(logs.par_chunks(width)).map(|(row, logs)| look(row, logs)).collect();
        let certainty = sigma.map_or_else(Vec::new, |sigma| {
            values.par_chunks(width).zip(sigma.par_chunks(width)).map(|(row, sigma)| certainty(row, sigma)).collect()
        });
        let (kinds, light) = about.into_iter().unzip();
        Self { width, values, logs, kinds, light, certainty }
    }

    /// Returns the values of all samples in `count` evenly spread bands; `None` if the samples have no more than
    /// `count` bands.
    pub(super) fn thinned(&self, sigma: Option<&[f32]>, count: usize) -> Option<Rows<'static>> {
        if self.width <= count {
            return None;
        }
        let chosen: Vec<usize> = (0..count).map(|i| (2 * i + 1) * self.width / (2 * count)).collect();
        let thin = |values: &[f32]| -> Vec<f32> {
            values.chunks(self.width).flat_map(|row| chosen.iter().map(|&band| row[band])).collect()
        };
        let sigma = sigma.map(thin);
        Some(Rows::new(Cow::Owned(thin(&self.values)), sigma.as_deref(), chosen.len()))
    }

    pub(super) fn row(&self, row: u32) -> &[f32] {
        &self.values[row as usize * self.width..][..self.width]
    }

    fn log_row(&self, row: u32) -> &[f32] {
        &self.logs[row as usize * self.width..][..self.width]
    }

    /// Writes into `out`, for each band, the value of a local fit averaged over points with the weights `shares`.
    /// `weights` `[sample, point]` are the weights of the samples `rows` at each point. Bands in which all these
    /// samples are positive average logarithms, others values. Bands that some sample lacks become NaN.
    pub(super) fn combine(&self, rows: &[u32], weights: &[[f32; PARTS]], shares: [f32; PARTS], out: &mut [f32]) {
        let positive = rows.iter().all(|&row| self.kinds[row as usize] == Kind::Positive);
        let total: f32 = shares.iter().sum();
        let (first, base) = (self.row(rows[0]), self.log_row(rows[0]));
        for start in (0..self.width).step_by(BLOCK) {
            let range = start..(start + BLOCK).min(self.width);
            let (first, base) = (&first[range.clone()], &base[range.clone()]);
            let out = &mut out[range.clone()];
            let mut sums = [[0.0_f32; BLOCK]; PARTS];
            self.sum(&self.logs, (rows, weights), base, start, &mut sums);
            wide(
                #[inline(always)]
                || {
                    let [a, b, c, d] = &sums;
                    for (k, (out, &first)) in out.iter_mut().zip(first).enumerate() {
                        let mean = shares[0] * exp_horner(a[k])
                            + shares[1] * exp_horner(b[k])
                            + shares[2] * exp_horner(c[k])
                            + shares[3] * exp_horner(d[k]);
                        *out = first * (mean / total);
                    }
                },
            );
            if positive {
                continue;
            }
            let logs = sums;
            sums = [[0.0; BLOCK]; PARTS];
            self.sum(&self.values, (rows, weights), first, start, &mut sums);
            for (k, (out, &first)) in out.iter_mut().zip(first).enumerate() {
                if logs[0][k].is_nan() {
                    let mean: f32 = (0..PARTS).map(|p| shares[p] * sums[p][k]).sum();
                    *out = first + mean / total;
                }
            }
        }
    }

    /// Returns the average of a local fit over [`PARTS`] points with the weights `shares`, for data with a single band:
    /// the value of sample `row` times the weighted mean of exp(`logs`). `logs` are the fitted natural logarithms at
    /// the points minus that of the sample.
    pub(super) fn mean_of(&self, row: u32, logs: [f64; PARTS], shares: [f32; PARTS]) -> f32 {
        let total: f32 = shares.iter().sum();
        let mean: f32 = shares.iter().zip(logs).map(|(share, log)| share * exp_horner(log as f32)).sum();
        self.values[row as usize] * (mean / total)
    }

    /// Returns the value of a local fit in one spectral band, averaged over [`PARTS`] points with the weights `shares`.
    /// All samples in `rows` must have a value in this band.
    pub(super) fn combine_band(
        &self,
        band: usize,
        rows: &[u32],
        weights: &[[f32; PARTS]],
        shares: [f32; PARTS],
    ) -> f32 {
        let total: f32 = shares.iter().sum();
        let sums = |from: &[f32]| {
            let at = |row: u32| from[row as usize * self.width + band];
            let mut sums = [0.0_f32; PARTS];
            for (&row, weights) in rows.iter().zip(weights) {
                let difference = at(row) - at(rows[0]);
                sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * difference);
            }
            sums
        };
        let (logs, first) = (sums(&self.logs), self.row(rows[0])[band]);
        if logs[0].is_nan() {
            let sums = sums(&self.values);
            first + (0..PARTS).map(|p| shares[p] * sums[p]).sum::<f32>() / total
        } else {
            first * ((0..PARTS).map(|p| shares[p] * exp_horner(logs[p])).sum::<f32>() / total)
        }
    }

    /// Adds up the weighted differences of the samples from the reference spectrum `base`, into `sums`: for each of the
    /// four directions at which a local fit is evaluated, and each spectral band from `start` on.
    fn sum(
        &self,
        from: &[f32],
        (rows, weights): (&[u32], &[[f32; PARTS]]),
        base: &[f32],
        start: usize,
        sums: &mut [[f32; BLOCK]; PARTS],
    ) {
        wide(
            #[inline(always)]
            || {
                let [a, b, c, d] = sums;
                for (&row, weights) in rows.iter().zip(weights) {
                    let row = &from[row as usize * self.width + start..][..base.len()];
                    let [a, b, c, d] =
                        [&mut a[..base.len()], &mut b[..base.len()], &mut c[..base.len()], &mut d[..base.len()]];
                    for k in 0..base.len() {
                        let difference = row[k] - base[k];
                        a[k] += weights[0] * difference;
                        b[k] += weights[1] * difference;
                        c[k] += weights[2] * difference;
                        d[k] += weights[3] * difference;
                    }
                }
            },
        );
    }
}

fn look(row: &[f32], logs: &[f32]) -> (Kind, [f64; 2]) {
    let missing = row.iter().filter(|v| v.is_nan()).count();
    let kind = match missing {
        0 if row.iter().all(|&v| v > 0.0) => Kind::Positive,
        0 => Kind::Whole,
        _ if missing < row.len() => Kind::Partial,
        _ => Kind::Missing,
    };
    let mean = |values: &[f32]| values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
    (kind, [mean(logs), mean(row)])
}

/// Returns the inverse of the mean variance over the bands of a sample, absolute and relative to the mean square of its
/// values; 0 if no uncertainty is stated.
fn certainty(row: &[f32], sigma: &[f32]) -> [f64; 2] {
    let (mut variance, mut square, mut count) = (0.0, 0.0, 0.0);
    for (&value, &sigma) in row.iter().zip(sigma) {
        if sigma > 0.0 && sigma.is_finite() && !value.is_nan() {
            variance += f64::from(sigma).powi(2);
            square += f64::from(value).powi(2);
            count += 1.0;
        }
    }
    if variance > 0.0 { [count / variance, square / variance] } else { [0.0; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_told_by_what_they_hold() {
        let values = [1.0, 2.0, 1.0, 0.0, f32::NAN, 1.0, f32::NAN, f32::NAN];
        let rows = Rows::new(Cow::Borrowed(&values), Some(&[0.1, 0.1, 0.5, 0.5, 1.0, 0.5, 1.0, 1.0]), 2);
        assert_eq!(rows.kinds, [Kind::Positive, Kind::Whole, Kind::Partial, Kind::Missing]);
        assert!((rows.light[0][0] - 0.5 * libm::log(2.0)).abs() < 1e-7 && rows.light[1][1] == 0.5);
        assert!((rows.certainty[0][1] - 250.0).abs() < 1e-3 && rows.certainty[3] == [0.0; 2]);
    }

    #[test]
    fn equal_rows_stay_and_signs_choose_the_sum() {
        let values = [0.3, -0.3, 0.3, -0.3, 0.3, -0.3];
        let rows = Rows::new(Cow::Borrowed(&values), None, 2);
        let mut out = [0.0; 2];
        rows.combine(&[0, 1, 2], &[[0.7; PARTS], [0.5; PARTS], [-0.2; PARTS]], [0.1, 0.2, 0.3, 0.4], &mut out);
        assert_eq!(out, [0.3, -0.3]);
        let values = [1.0, 1.0, 4.0, -1.0];
        let rows = Rows::new(Cow::Borrowed(&values), None, 2);
        rows.combine(&[0, 1], &[[0.5; PARTS]; 2], [1.0; PARTS], &mut out);
        assert!((out[0] - 2.0).abs() < 1e-6 && out[1].abs() < 1e-6, "{out:?}");
    }
}
