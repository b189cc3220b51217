//! Samples as a few planes: each cell has a short row of coefficients on a spectral basis that all cells share.
//!
//! Positive data stand as logarithms, so that what is interpolated and expanded stays positive; data with negative values
//! stand as they are. The basis of logarithms begins with a constant: brightness is a plane of its own.

use super::kernel::{LANES, combine, exp, exp_all};
use super::smooth::Mixed;
use crate::transform::Klt;
use rayon::prelude::*;

/// Planes at most; spectra that need more are kept whole.
pub(super) const MOST_PLANES: usize = 16;
/// Spectra up to this length are their own planes.
const SHORT: usize = 4;
/// Logarithms (samples: parts of the largest) may lie this far from what the planes give.
const CLOSE: f64 = 2e-4;
/// Variances below this part of the first are rounding.
const NOTHING: f64 = 1e-13;
/// A logarithm far below that of any number: its exponential is 0.
const DARK: f32 = -1e30;

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    Live,
    Zero,
    Masked,
}

/// Rows of coefficients, and the basis that makes spectra of them.
#[derive(Debug)]
pub(super) struct Planes {
    pub(super) logarithms: bool,
    pub(super) lambdas: usize,
    /// Planes that are used, and how many stand in a row: a multiple of 4.
    pub(super) count: usize,
    pub(super) width: usize,
    /// `[block of wavelengths][mean, then planes][lane]`.
    blocks: Vec<f32>,
    /// `[wavelength][planes]`, and the mean.
    columns: Vec<f32>,
    mean: Vec<f32>,
    /// `[cell][width]`.
    rows: Vec<f32>,
    /// One a cell; empty where all are live.
    pub(super) cells: Vec<Cell>,
    /// The largest deviation from the samples, in logarithms or in parts of the largest sample.
    pub(super) deviation: f64,
}

impl Planes {
    /// Of samples `[cell, lambda]`; `None` where a few planes do not hold them, or where only parts of spectra are masked
    /// or zero.
    pub(super) fn of(samples: &[f32], lambdas: usize) -> Option<Self> {
        let signed = samples.iter().any(|&s| s < 0.0);
        let mut cells: Vec<Cell> = Vec::with_capacity(samples.len() / lambdas);
        for spectrum in samples.chunks_exact(lambdas) {
            let masked = spectrum.iter().filter(|s| s.is_nan()).count();
            cells.push(match masked {
                0 if !signed && spectrum.iter().all(|&s| s == 0.0) => Cell::Zero,
                0 => Cell::Live,
                n if n == lambdas => Cell::Masked,
                _ => return None,
            });
        }
        let live = || samples.chunks_exact(lambdas).zip(&cells).filter(|(_, cell)| **cell == Cell::Live);
        let first = live().next().map(|(spectrum, _)| spectrum)?;
        // A wavelength may be dark in all cells alike, as where a lamp has a spectrum of its own.
        let dark: Vec<bool> = first.iter().map(|&s| !signed && s == 0.0).collect();
        if !signed && live().any(|(spectrum, _)| spectrum.iter().zip(&dark).any(|(&s, &dark)| (s == 0.0) != dark)) {
            return None;
        }
        let value = |s: f32| if signed || s == 0.0 { s } else { libm::log(f64::from(s)) as f32 };
        let values: Vec<f32> = live().flat_map(|(spectrum, _)| spectrum).map(|&s| value(s)).collect();
        let (mean, vectors) = basis(&values, lambdas, &dark, !signed)?;
        let planes = vectors.len();
        let width = planes.next_multiple_of(4);
        let mut built = Self {
            logarithms: !signed,
            lambdas,
            count: planes,
            width,
            blocks: Vec::new(),
            columns: (0..lambdas).flat_map(|l| vectors.iter().map(move |v| v[l] as f32)).collect(),
            mean: mean.iter().zip(&dark).map(|(&m, &dark)| if dark { DARK } else { m as f32 }).collect(),
            rows: vec![0.0; cells.len() * width],
            cells,
            deviation: 0.0,
        };
        for start in (0..lambdas).step_by(LANES) {
            let lane =
                |of: &dyn Fn(usize) -> f32| (0..LANES).map(|i| of((start + i).min(lambdas - 1))).collect::<Vec<_>>();
            built.blocks.extend(lane(&|l| built.mean[l]));
            for k in 0..planes {
                built.blocks.extend(lane(&|l| built.columns[l * planes + k]));
            }
        }
        let mut rows = std::mem::take(&mut built.rows);
        let mut spectra = values.chunks_exact(lambdas);
        for (row, _) in rows.chunks_exact_mut(width).zip(&built.cells).filter(|(_, cell)| **cell == Cell::Live) {
            if let Some(spectrum) = spectra.next() {
                built.project(spectrum, row);
            }
        }
        built.rows = rows;
        built.deviation = built.deviation_from(samples, &values);
        (lambdas <= SHORT || built.deviation <= CLOSE).then_some(built)
    }

    /// The coefficients of a spectrum of values (logarithms, or samples), as they stand in planes.
    fn project(&self, values: &[f32], row: &mut [f32]) {
        let mut sums = [0.0_f64; MOST_PLANES];
        for ((value, mean), column) in values.iter().zip(&self.mean).zip(self.columns.chunks_exact(self.count)) {
            if *mean > DARK {
                for (sum, &b) in sums.iter_mut().zip(column) {
                    *sum += f64::from(value - mean) * f64::from(b);
                }
            }
        }
        row.iter_mut().zip(&sums[..self.count]).for_each(|(c, &sum)| *c = sum as f32);
    }

    /// Σ over wavelengths of bᵢ bⱼ bₖ: what the product of planes j and k adds to plane i.
    pub(super) fn coupling(&self) -> Vec<f64> {
        let n = self.count;
        let mut coupling = vec![0.0; n * n * n];
        for (column, _) in self.columns.chunks_exact(n).zip(&self.mean).filter(|(_, mean)| **mean > DARK) {
            for (place, sum) in coupling.iter_mut().enumerate() {
                let [i, j, k] = [place / (n * n), place / n % n, place % n].map(|plane| f64::from(column[plane]));
                *sum += i * j * k;
            }
        }
        coupling
    }

    fn deviation_from(&self, samples: &[f32], values: &[f32]) -> f64 {
        let largest = if self.logarithms { 1.0 } else { samples.iter().fold(0.0_f32, |m, s| m.max(s.abs())) };
        let live: Vec<&[f32]> = self
            .rows
            .chunks_exact(self.width)
            .zip(&self.cells)
            .filter(|(_, c)| **c == Cell::Live)
            .map(|(r, _)| r)
            .collect();
        let worst = live
            .par_iter()
            .zip(values.par_chunks_exact(self.lambdas))
            .map(|(row, values)| {
                values.iter().enumerate().fold(0.0_f32, |worst, (l, value)| {
                    if self.mean[l] > DARK { worst.max((self.value(row, l) - value).abs()) } else { worst }
                })
            })
            .reduce(|| 0.0, f32::max);
        f64::from(worst / largest.max(f32::MIN_POSITIVE))
    }

    /// The coefficients of a cell.
    #[inline]
    pub(super) fn row(&self, cell: usize) -> &[f32] {
        &self.rows[cell * self.width..][..self.width]
    }

    /// A cell as it is found.
    #[inline]
    pub(super) fn mixed(&self, cell: usize) -> Mixed {
        let mut row = [0.0; MOST_PLANES];
        row[..self.width].copy_from_slice(self.row(cell));
        let presence = match self.cell(cell) {
            Cell::Live => 1.0,
            Cell::Zero => 0.0,
            Cell::Masked => f32::NAN,
        };
        Mixed { row, presence }
    }

    /// What is known of a cell.
    #[inline]
    pub(super) fn cell(&self, cell: usize) -> Cell {
        self.cells.get(cell).copied().unwrap_or(Cell::Live)
    }

    /// Logarithm or sample of one wavelength.
    #[inline]
    pub(super) fn value(&self, row: &[f32], lambda: usize) -> f32 {
        let column = &self.columns[lambda * self.count..][..self.count];
        self.mean[lambda] + row.iter().zip(column).map(|(c, b)| c * b).sum::<f32>()
    }

    /// The sample of one wavelength.
    #[inline]
    pub(super) fn sample(&self, row: &[f32], lambda: usize) -> f32 {
        let value = self.value(row, lambda);
        if self.logarithms { exp(value) } else { value }
    }

    /// The whole spectrum of `row`, times `scale`.
    #[inline]
    pub(super) fn spectrum(&self, row: &[f32], scale: f32, out: &mut [f32]) {
        let row = &row[..self.count];
        let stride = (self.count + 1) * LANES;
        for (block, out) in self.blocks.chunks_exact(stride).zip(out.chunks_mut(LANES)) {
            let mut values = combine(row, block);
            if self.logarithms {
                exp_all(&mut values);
            }
            for value in &mut values {
                *value *= scale;
            }
            out.copy_from_slice(&values[..out.len()]);
        }
    }

    /// The samples of up to [`LANES`] wavelengths of `row`, times `scale`.
    #[inline]
    pub(super) fn few(&self, row: &[f32], scale: f32, lambdas: &[usize]) -> [f32; LANES] {
        let mut values = [0.0; LANES];
        for (value, &lambda) in values.iter_mut().zip(lambdas) {
            *value = self.value(row, lambda);
        }
        if self.logarithms {
            exp_all(&mut values);
        }
        values.map(|v| v * scale)
    }

    /// The spectrum of what was found.
    #[inline]
    pub(super) fn expand(&self, mixed: &Mixed, out: &mut [f32]) {
        match mixed.presence {
            presence if presence.is_nan() => out.fill(f32::NAN),
            presence if presence <= 0.0 => out.fill(0.0),
            presence => self.spectrum(&mixed.row, presence, out),
        }
    }

    /// The inner product of the spectrum of what was found with weights.
    pub(super) fn weighted_mixed(&self, mixed: &Mixed, weights: &[f32]) -> f32 {
        if mixed.presence > 0.0 { self.weighted(&mixed.row, weights) * mixed.presence } else { mixed.presence }
    }

    /// The inner product of the whole spectrum with weights.
    fn weighted(&self, row: &[f32], weights: &[f32]) -> f32 {
        let row = &row[..self.count];
        let stride = (self.count + 1) * LANES;
        let mut sum = 0.0;
        for (block, weights) in self.blocks.chunks_exact(stride).zip(weights.chunks(LANES)) {
            let mut values = combine(row, block);
            if self.logarithms {
                exp_all(&mut values);
            }
            sum += values.iter().zip(weights).map(|(v, w)| v * w).sum::<f32>();
        }
        sum
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.blocks)
            + size_of_val(&*self.columns)
            + size_of_val(&*self.mean)
            + size_of_val(&*self.rows)
            + size_of_val(&*self.cells)
    }
}

/// Mean and vectors for rows of `length` values.
fn basis(values: &[f32], length: usize, dark: &[bool], logarithms: bool) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    if length <= SHORT {
        let unit = |k: usize| (0..length).map(|l| f64::from(u8::from(l == k))).collect();
        return Some((vec![0.0; length], (0..length).map(unit).collect()));
    }
    let klt = Klt::leading(values, length, MOST_PLANES).ok()?;
    let most = klt.variances.first().copied().unwrap_or(0.0);
    let mut vectors: Vec<Vec<f64>> = Vec::new();
    if logarithms {
        vectors.push(dark.iter().map(|&dark| f64::from(u8::from(!dark))).collect());
    }
    vectors.extend(klt.vectors.into_iter().zip(klt.variances).filter(|(_, v)| *v > NOTHING * most).map(|(v, _)| v));
    orthonormalise(&mut vectors);
    vectors.truncate(MOST_PLANES);
    Some((klt.mean, vectors))
}

/// Gram and Schmidt, in order; vectors that depend on those before are left out.
fn orthonormalise(vectors: &mut Vec<Vec<f64>>) {
    let mut done: Vec<Vec<f64>> = Vec::new();
    for mut vector in vectors.drain(..) {
        let before: f64 = vector.iter().map(|x| x * x).sum();
        // Twice is enough (Kahan; Parlett 1980).
        for _ in 0..2 {
            for other in &done {
                let along: f64 = vector.iter().zip(other).map(|(a, b)| a * b).sum();
                vector.iter_mut().zip(other).for_each(|(a, b)| *a -= along * b);
            }
        }
        let left: f64 = vector.iter().map(|x| x * x).sum();
        if left > 1e-12 * before && left > 0.0 {
            let length = left.sqrt();
            for x in &mut vector {
                *x /= length;
            }
            done.push(vector);
        }
    }
    *vectors = done;
}
