//! Samples as a few planes: each cell has a short row of coefficients on a spectral basis that all cells share.
//!
//! Positive data are represented by logarithms, so that interpolated and expanded values stay positive. Data with
//! negative values are represented directly. The basis of logarithms starts with a constant: brightness is a plane of
//! its own.

use super::kernel::{LANES, exp_all};
use super::mixed::{MOST_PLANES, Mixed, Row};
use crate::numeric::exponential::exp_estrin;
use crate::numeric::orthogonal::orthonormalise;
use crate::numeric::wide;
use crate::transform::Klt;
use ::wide::f32x4;
use rayon::prelude::*;

/// Number of wavelengths expanded together from spectral coefficients when only a few are needed.
pub(super) const FEW: usize = LANES / 2;
/// Maximum number of samples of a spectrum up to which the samples themselves serve as spectral coefficients.
const SHORT: usize = 4;
/// Maximum deviation of spectra from their spectral coefficients, in logarithms (or as a fraction of the largest
/// sample). If it is exceeded, all samples are stored instead.
const CLOSE: f64 = 2e-4;
/// Fraction of the first principal component's variance below which a component's variance is a rounding error.
const NOTHING: f64 = 1e-13;
/// Logarithm that stands for a wavelength without light: its exponential is 0.
const DARK: f32 = -1e30;

/// State of the spectrum of one pair of sampled directions: live (stored as coefficients), zero or masked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    Live,
    Zero,
    Masked,
}

/// Spectral basis at up to [`FEW`] chosen wavelengths, arranged in SIMD lanes. The first half of the lanes holds the
/// basis at the spectral sample below each wavelength, the second half at the one above.
#[derive(Clone, Copy, Debug)]
pub(super) struct Columns {
    mean: [f32; LANES],
    /// Basis vectors at the chosen wavelengths, one row for each spectral coefficient.
    vectors: [[f32; LANES]; MOST_PLANES],
    shares: [f32; FEW],
}

/// Spectra as a few coefficients each, with the common spectral basis that expands them.
#[derive(Debug)]
pub(super) struct Planes {
    logarithms: bool,
    lambdas: usize,
    /// Number of basis vectors in use, and number of coefficients stored for each spectrum: the next multiple of 4.
    count: usize,
    width: usize,
    /// Spectral basis for whole spectra: `[block of wavelengths][mean, then basis vectors][lane]`.
    blocks: Vec<[f32; LANES]>,
    /// Spectral basis in the order that suits evaluation at one wavelength, `[wavelength][basis vector]`; then the mean
    /// spectrum. Both repeat the last wavelength.
    columns: Vec<f32>,
    mean: Vec<f32>,
    /// Spectral coefficients, `[pair of sampled directions][coefficient]`.
    rows: Vec<f32>,
    /// State of each spectrum: stored as coefficients, zero or masked. Empty if all are stored as coefficients.
    cells: Vec<Cell>,
    /// Largest deviation of the spectra that coefficients represent from the samples, in logarithms or as a fraction of
    /// the largest sample.
    deviation: f64,
}

/// Calls a method that is compiled for each possible number of spectral coefficients.
macro_rules! by_width {
    ($planes:ident.$method:ident($($argument:expr),*)) => {
        match $planes.width {
            4 => $planes.$method::<4>($($argument),*),
            8 => $planes.$method::<8>($($argument),*),
            12 => $planes.$method::<12>($($argument),*),
            _ => $planes.$method::<MOST_PLANES>($($argument),*),
        }
    };
}

impl Planes {
    /// Represents samples `[spectrum][wavelength]` by coefficients on a spectral basis. `None` if a few coefficients do
    /// not reach the accuracy [`CLOSE`], or if only parts of spectra are masked or zero.
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
        // A wavelength may be dark in all cells alike, as in the spectrum of a lamp.
        let dark: Vec<bool> = first.iter().map(|&s| !signed && s == 0.0).collect();
        if !signed && live().any(|(spectrum, _)| spectrum.iter().zip(&dark).any(|(&s, &dark)| (s == 0.0) != dark)) {
            return None;
        }
        let value = |s: f32| if signed || s == 0.0 { s } else { libm::log(f64::from(s)) as f32 };
        let values: Vec<f32> = live().flat_map(|(spectrum, _)| spectrum).map(|&s| value(s)).collect();
        let (mean, vectors) = basis(&values, lambdas, &dark, !signed)?;
        let planes = vectors.len();
        let width = planes.next_multiple_of(4);
        let twice = || (0..lambdas).chain([lambdas - 1]);
        let vector = |k: usize, l: usize| vectors.get(k).map_or(0.0, |vector| vector[l] as f32);
        let mean = |l: usize| if dark[l] { DARK } else { mean[l] as f32 };
        let mut built = Self {
            logarithms: !signed,
            lambdas,
            count: planes,
            width,
            blocks: Vec::new(),
            columns: twice().flat_map(|l| (0..width).map(move |k| (k, l))).map(|(k, l)| vector(k, l)).collect(),
            mean: twice().map(mean).collect(),
            rows: vec![0.0; cells.len() * width],
            cells,
            deviation: 0.0,
        };
        for start in (0..lambdas).step_by(LANES) {
            let lane = |i: usize| (start + i).min(lambdas - 1);
            built.blocks.push(std::array::from_fn(|i| mean(lane(i))));
            built.blocks.extend((0..width).map(|k| std::array::from_fn(|i| vector(k, lane(i)))));
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

    /// Returns true if the coefficients represent logarithms of samples.
    pub(super) fn has_logarithms(&self) -> bool {
        self.logarithms
    }

    /// Number of samples in a spectrum.
    pub(super) fn lambdas(&self) -> usize {
        self.lambdas
    }

    /// Number of basis vectors of the spectral basis in use.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Number of coefficients stored for each spectrum: a multiple of 4.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// State of each spectrum: stored as coefficients, zero or masked. Empty if all are stored as coefficients.
    pub(super) fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// Largest deviation of the spectra that coefficients represent from the samples, in logarithms or as a fraction of
    /// the largest sample.
    pub(super) fn deviation(&self) -> f64 {
        self.deviation
    }

    /// Projects a spectrum, given by samples or their logarithms, on the spectral basis.
    fn project(&self, values: &[f32], row: &mut [f32]) {
        let mut sums = [0.0_f64; MOST_PLANES];
        for ((value, mean), column) in values.iter().zip(&self.mean).zip(self.columns.chunks_exact(self.width)) {
            if *mean > DARK {
                for (sum, &b) in sums.iter_mut().zip(column) {
                    *sum += f64::from(value - mean) * f64::from(b);
                }
            }
        }
        row.iter_mut().zip(&sums[..self.count]).for_each(|(c, &sum)| *c = sum as f32);
    }

    /// Spectral coefficients that raise the logarithm of the value by 1 at every wavelength when added to those of a
    /// spectrum. Wavelengths at which all spectra are 0 stay 0.
    pub(super) fn constant(&self) -> Row {
        let mut sums = [0.0_f64; MOST_PLANES];
        for (column, _) in
            self.columns.chunks_exact(self.width).zip(&self.mean[..self.lambdas]).filter(|(_, mean)| **mean > DARK)
        {
            sums.iter_mut().zip(column).for_each(|(sum, &b)| *sum += f64::from(b));
        }
        sums.map(|sum| sum as f32)
    }

    /// Returns the tensor Σ bᵢ bⱼ bₖ of the basis vectors b, summed over the wavelengths that are not dark in all
    /// spectra. It projects the product of two spectra on the basis: entry `[i, j, k]` is the contribution of
    /// coefficient j times coefficient k to coefficient i.
    pub(super) fn coupling(&self) -> Vec<f64> {
        let n = self.count;
        let mut coupling = vec![0.0; n * n * n];
        for (column, _) in
            self.columns.chunks_exact(self.width).zip(&self.mean[..self.lambdas]).filter(|(_, mean)| **mean > DARK)
        {
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

    /// Spectral coefficients of the pair of sampled directions numbered `cell`.
    #[inline]
    pub(super) fn row(&self, cell: usize) -> &[f32] {
        &self.rows[cell * self.width..][..self.width]
    }

    /// State of the spectrum of the pair of sampled directions numbered `cell`: 1 if stored as coefficients, 0 if its
    /// samples are all 0, NaN if masked.
    #[inline]
    pub(super) fn presence(&self, cell: usize) -> f32 {
        match self.cell(cell) {
            Cell::Live => 1.0,
            Cell::Zero => 0.0,
            Cell::Masked => f32::NAN,
        }
    }

    /// Spectral coefficients of the spectrum of the pair of sampled directions numbered `cell`, with its state: 1 if
    /// stored as coefficients, 0 if its samples are all 0, NaN if masked.
    #[inline]
    pub(super) fn mixed(&self, cell: usize) -> Mixed {
        let row = match self.width {
            4 => self.padded::<4>(cell),
            8 => self.padded::<8>(cell),
            12 => self.padded::<12>(cell),
            _ => self.padded::<MOST_PLANES>(cell),
        };
        Mixed { row, presence: self.presence(cell) }
    }

    #[inline]
    fn padded<const WIDTH: usize>(&self, cell: usize) -> Row {
        let mut row = [0.0; MOST_PLANES];
        row[..WIDTH].copy_from_slice(&self.rows.as_chunks::<WIDTH>().0[cell]);
        row
    }

    /// State of the spectrum of the pair of sampled directions numbered `cell`: stored as coefficients, zero or masked.
    #[inline]
    pub(super) fn cell(&self, cell: usize) -> Cell {
        self.cells.get(cell).copied().unwrap_or(Cell::Live)
    }

    /// Expands spectral coefficients at one wavelength; the result is a logarithm if the coefficients represent
    /// logarithms.
    #[inline]
    pub(super) fn value(&self, row: &[f32], lambda: usize) -> f32 {
        let column = &self.columns[lambda * self.width..][..self.count];
        self.mean[lambda] + row.iter().zip(column).map(|(c, b)| c * b).sum::<f32>()
    }

    /// Expands spectral coefficients to the sample at one wavelength.
    #[inline]
    pub(super) fn sample(&self, row: &[f32], lambda: usize) -> f32 {
        let value = self.value(row, lambda);
        if self.logarithms { exp_estrin(value) } else { value }
    }

    /// Expands spectral coefficients to a whole spectrum, times `scale`.
    #[inline]
    pub(super) fn spectrum(&self, row: &[f32], scale: f32, out: &mut [f32]) {
        // Kept apart from the search for the row, whose code would make these loops slower.
        wide(
            #[inline(always)]
            || by_width!(self.spectrum_in(row, scale, out)),
        );
    }

    /// Expands spectral coefficients at up to [`FEW`] wavelengths, linearly between samples, times `scale`. A
    /// wavelength is given by its fractional position among the samples, counted from 0.
    #[inline(always)]
    pub(super) fn few(&self, row: &[f32], scale: f32, positions: &[f64]) -> [f32; FEW] {
        by_width!(self.few_in(row, scale, positions))
    }

    /// Prepares the spectral basis at up to [`FEW`] wavelengths for [`Planes::picked`]. A wavelength is given by its
    /// fractional position among the samples, counted from 0.
    pub(super) fn columns(&self, positions: &[f64]) -> Columns {
        let mut columns = Columns { mean: [0.0; LANES], vectors: [[0.0; LANES]; MOST_PLANES], shares: [0.0; FEW] };
        for (i, &position) in positions.iter().take(FEW).enumerate() {
            let below = (position as usize).min(self.lambdas - 1);
            columns.shares[i] = (position - below as f64) as f32;
            for (lane, lambda) in [(i, below), (FEW + i, below + 1)] {
                columns.mean[lane] = self.mean[lambda];
                for (vector, &value) in
                    columns.vectors.iter_mut().zip(&self.columns[lambda * self.width..][..self.width])
                {
                    vector[lane] = value;
                }
            }
        }
        columns
    }

    /// Expands spectral coefficients to values at up to [`FEW`] wavelengths that [`Planes::columns`] has prepared,
    /// linearly between samples, times `scale`.
    #[inline(always)]
    pub(super) fn picked(&self, row: &[f32], scale: f32, columns: &Columns) -> [f32; FEW] {
        by_width!(self.picked_in(row, scale, columns))
    }

    /// Expands spectral coefficients to a whole spectrum, times `presence`: the fraction of the interpolation weight on
    /// nonzero samples. Values are NaN if `presence` is NaN (masked).
    #[inline]
    pub(super) fn expand(&self, row: &[f32], presence: f32, out: &mut [f32]) {
        if presence > 0.0 {
            self.spectrum(row, presence, out);
        } else {
            out.fill(presence);
        }
    }

    /// Expands many sets of spectral coefficients to whole spectra, one after the other.
    pub(super) fn expand_all(&self, rows: &[Mixed], out: &mut [f32]) {
        wide(
            #[inline(always)]
            || by_width!(self.expand_all_in(rows, out)),
        );
    }

    /// Expands many sets of spectral coefficients to values at the wavelengths that [`Planes::columns`] has prepared,
    /// times the fraction of the interpolation weight on nonzero samples. Values are NaN if masked.
    pub(super) fn picked_all(&self, rows: &[Mixed], columns: &Columns, out: &mut [[f32; FEW]]) {
        wide(
            #[inline(always)]
            || by_width!(self.picked_all_in(rows, columns, out)),
        );
    }

    /// Inner products with `weights` of the spectra that many sets of spectral coefficients represent, times the
    /// fraction of the interpolation weight on nonzero samples. A product is NaN if masked.
    pub(super) fn weighted_all(&self, rows: &[Mixed], weights: &[f32], out: &mut [f32]) {
        wide(
            #[inline(always)]
            || {
                for (mixed, out) in rows.iter().zip(out) {
                    *out = self.weighted(&mixed.row, mixed.presence, weights);
                }
            },
        );
    }

    /// Inner product with `weights` of the spectrum that spectral coefficients represent, times `presence`: the
    /// fraction of the interpolation weight on nonzero samples. It is NaN if `presence` is NaN (masked).
    #[inline(always)]
    pub(super) fn weighted(&self, row: &[f32], presence: f32, weights: &[f32]) -> f32 {
        if presence.is_nan() || presence <= 0.0 {
            return presence;
        }
        presence * by_width!(self.weighted_in(row, weights))
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.blocks)
            + size_of_val(&*self.columns)
            + size_of_val(&*self.mean)
            + size_of_val(&*self.rows)
            + size_of_val(&*self.cells)
    }
}

/// Evaluation of spectra from coefficients. Methods are inlined, so that the compiler makes a version of each for every
/// possible number of coefficients and for every instruction set.
impl Planes {
    /// Returns the samples (or logarithms) that the spectral coefficients `row` represent, at a block of wavelengths or
    /// at chosen ones.
    #[inline(always)]
    fn values<const WIDTH: usize>(
        &self,
        row: &[f32; WIDTH],
        mean: &[f32; LANES],
        vectors: &[[f32; LANES]],
    ) -> [f32; LANES] {
        let mut values = *mean;
        for (coefficient, vector) in row.iter().zip(vectors) {
            for (value, v) in values.iter_mut().zip(vector) {
                *value += coefficient * v;
            }
        }
        if self.logarithms {
            exp_all(&mut values);
        }
        values
    }

    #[inline(always)]
    fn spectrum_in<const WIDTH: usize>(&self, row: &[f32], scale: f32, out: &mut [f32]) {
        let row = fixed::<WIDTH>(row);
        for (block, out) in self.blocks.chunks_exact(WIDTH + 1).zip(out.chunks_mut(LANES)) {
            let mut values = self.values(row, &block[0], &block[1..]);
            for value in &mut values {
                *value *= scale;
            }
            match <&mut [f32; LANES]>::try_from(&mut *out) {
                Ok(whole) => *whole = values,
                Err(_) => out.copy_from_slice(&values[..out.len()]),
            }
        }
    }

    #[inline(always)]
    fn few_in<const WIDTH: usize>(&self, row: &[f32], scale: f32, positions: &[f64]) -> [f32; FEW] {
        let row = fixed::<WIDTH>(row);
        let columns = self.columns.as_chunks::<WIDTH>().0;
        // Samples below, then those above: together a block of wavelengths, in the same loops.
        let mut values = [0.0; LANES];
        let mut shares = [0.0; FEW];
        for (i, &position) in positions.iter().take(FEW).enumerate() {
            let below = position as u32 as usize;
            let (Some([low, high]), Some(&[mean_low, mean_high])) =
                (columns.get(below..below + 2), self.mean.get(below..below + 2))
            else {
                break;
            };
            shares[i] = (position - below as f64) as f32;
            values[i] = mean_low + product(row, low);
            values[FEW + i] = mean_high + product(row, high);
        }
        if self.logarithms {
            exp_all(&mut values);
        }
        between(&values, &shares, scale)
    }

    #[inline(always)]
    fn picked_in<const WIDTH: usize>(&self, row: &[f32], scale: f32, columns: &Columns) -> [f32; FEW] {
        let values = self.values(fixed::<WIDTH>(row), &columns.mean, &columns.vectors);
        between(&values, &columns.shares, scale)
    }

    #[inline(always)]
    fn expand_all_in<const WIDTH: usize>(&self, rows: &[Mixed], out: &mut [f32]) {
        for (mixed, out) in rows.iter().zip(out.chunks_exact_mut(self.lambdas)) {
            if mixed.presence > 0.0 {
                self.spectrum_in::<WIDTH>(&mixed.row, mixed.presence, out);
            } else {
                out.fill(mixed.presence);
            }
        }
    }

    #[inline(always)]
    fn picked_all_in<const WIDTH: usize>(&self, rows: &[Mixed], columns: &Columns, out: &mut [[f32; FEW]]) {
        for (mixed, out) in rows.iter().zip(out) {
            *out = [mixed.presence; FEW];
            if mixed.presence > 0.0 {
                *out = self.picked_in::<WIDTH>(&mixed.row, mixed.presence, columns);
            }
        }
    }

    #[inline(always)]
    fn weighted_in<const WIDTH: usize>(&self, row: &[f32], weights: &[f32]) -> f32 {
        let row = fixed::<WIDTH>(row);
        let mut sums = [0.0; LANES];
        for (block, weights) in self.blocks.chunks_exact(WIDTH + 1).zip(weights.chunks(LANES)) {
            let values = self.values(row, &block[0], &block[1..]);
            for ((sum, value), weight) in sums.iter_mut().zip(values).zip(weights) {
                *sum += value * weight;
            }
        }
        sums.iter().sum()
    }
}

/// Interpolates linearly, for each requested wavelength, between the values at the measured wavelengths below and
/// above, and multiplies by `scale`. `values` holds all values below, then all above; `shares` are the weights of those
/// above.
#[inline(always)]
fn between(values: &[f32; LANES], shares: &[f32; FEW], scale: f32) -> [f32; FEW] {
    let mut between = [0.0; FEW];
    for i in 0..FEW {
        between[i] = scale * (values[i] + shares[i] * (values[FEW + i] - values[i]));
    }
    between
}

/// View of a slice of spectral coefficients as an array of fixed length.
#[inline(always)]
fn fixed<const WIDTH: usize>(row: &[f32]) -> &[f32; WIDTH] {
    row.first_chunk().unwrap_or(&[0.0; WIDTH])
}

/// Inner product of spectral coefficients with the basis at one wavelength, in four partial sums.
#[inline(always)]
fn product<const WIDTH: usize>(row: &[f32; WIDTH], column: &[f32; WIDTH]) -> f32 {
    let mut sums = f32x4::ZERO;
    for (row, column) in row.as_chunks().0.iter().zip(column.as_chunks().0) {
        sums += f32x4::new(*row) * f32x4::new(*column);
    }
    sums.reduce_add()
}

/// Mean spectrum and orthonormal basis vectors of spectra of `length` values, by principal component analysis.
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
    orthonormalise(&mut vectors, |squares| squares.after > 1e-12 * squares.before);
    vectors.truncate(MOST_PLANES);
    Some((klt.mean, vectors))
}
