//! Estimates the noise of a measurement: the part that neither neighbouring directions nor neighbouring wavelengths
//! predict.
//!
//! # Method
//! Logarithms of positive samples are cut into small blocks along two axes: 16 triangles that share a grandparent, and
//! 8 to 15 neighbours on a line. On each axis an orthonormal basis of the block starts with polynomials of degree 0 to
//! 3 at the samples' own positions (triangles: in the tangent plane). The remaining basis vectors are orthogonal to
//! every cubic. Noise that is independent from sample to sample has the same standard deviation σ in every coefficient
//! of the tensor product of two such bases. The coefficients of a smooth signal, or of a product of two factors, fall
//! with the degree on either axis. Therefore:
//!
//! * The median magnitude of all coefficients of degree > 3 on both axes, divided by 0.6745, is σ. Lobes, edges and
//!   lines in a minority of blocks do not move it. (Donoho & Johnstone 1994, section 4.1, take this median over the
//!   finest wavelet details. Here the coefficients ignore cubics, and anything that is smooth along one axis only.)
//! * The coefficients of degree 3 on one of the axes test whether this is noise. Equal magnitudes confirm noise; if
//!   they are κ = 2.5 times as large, the signal explains everything. In between, the part attributable to a signal of
//!   this decay is subtracted. κ is below the ratio of kinks in linear interpolation (2.8); smooth lobes have 5 and
//!   more. The estimate errs low.
//! * The mean over the block's spectral samples, in coefficients of degree > 3 in direction, gives in the same way the
//!   noise that whole stretches of a spectrum share: gain errors of one direction. Here, and without a second axis,
//!   only the quarter of the blocks with the least curvature (degree 2) is used. κ is 1.5 wherever only one axis has
//!   order.
//!
//! A grid of angles counts as two lines, its polar angles and its azimuths. Axes without order (indices, colours,
//! meshes too coarse for cubics) only lose their mean. There is no estimate without neighbours on any axis, for single
//! spectra (one line cannot distinguish noise from spectral lines), or from few coefficients.
//!
//! No more blocks are sought once [`MAX_BLOCKS`] are found, always the same ones: time and memory are bounded.

use super::figures::two_digits_up;
use super::logarithm::logarithms;
use super::notes::CompressionNote;
use super::target::Target;
use crate::domain::{Axis, Measurement, Note};
use crate::numeric::dense::dot;
use basis::{Basis, Place};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};

mod basis;

/// Noise of a measurement. All standard deviations are those of a sample's logarithm, hence relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Noise {
    /// Standard deviation of the noise that is independent from sample to sample, of a typical (median) sample,
    /// relative to it. 0 if none was found.
    pub relative: f64,
    /// Standard error of the estimated relative noise: its statistical error, combined with the amount that was
    /// attributed to signal and subtracted.
    pub uncertainty: f64,
    /// Relative standard deviation of the noise that neighbouring spectral samples share (a direction's gain error); 0
    /// if none was found or there is no spectral axis.
    pub common: f64,
    /// Number of basis coefficients whose median magnitude gives the noise estimate.
    pub coefficients: u64,
}

impl Noise {
    /// Returns a warning if the error that `target` allows lies below the noise of the measurement. It states the cost
    /// in bytes, and the smallest error worth asking for.
    pub fn warning(&self, target: Target) -> Option<Note> {
        // The largest of a million normal deviates is 5 σ. Below 3 σ so many exceed the bound that each costs bits.
        let (bound, wanted, cliff, enough) = match target {
            Target::ErL2(wanted) => ("er_l2", wanted, 1.0, 1.05),
            Target::MaxRelativeError(wanted) => ("max_relative_error", wanted, 3.0, 5.0),
            // The mean magnitude of normal deviates is 0.8 σ.
            Target::ErL1(wanted) => ("er_l1", wanted, 0.8, 0.84),
            _ => return None,
        };
        if wanted < cliff * self.relative {
            let (noise_percent, enough) = (100.0 * self.relative, two_digits_up(enough * self.relative));
            return Some(CompressionNote::BelowNoise { bound, wanted, noise_percent, enough }.into());
        }
        (wanted < cliff * self.common).then(|| {
            let (noise_percent, enough) = (100.0 * self.common, two_digits_up(enough * self.common));
            CompressionNote::BelowNoiseOfSpectra { bound, wanted, noise_percent, enough }.into()
        })
    }
}

/// Number of blocks of samples that suffices for the noise estimate, so that no more are sought; raising it costs time
/// and memory.
const MAX_BLOCKS: usize = 2048;
/// Upper bound on the rounds of [`MAX_BLOCKS`] candidate blocks for the noise estimate; later rounds replace blocks
/// that have zeros or masks.
const ROUNDS: usize = 6;
/// Smallest number of coefficients for a noise estimate; 96 give it a standard error of 12 %.
const FEWEST: usize = 96;
/// Smallest ratio assumed between standard deviations of a noise-free signal: coefficients of polynomial degree 3 to
/// those of higher degrees. Raising it attributes more to noise.
const DECAY: f64 = 2.5;
/// Smallest ratio assumed between standard deviations of a noise-free signal, compared along one axis only:
/// coefficients of polynomial degree 3 to those of higher degrees. Raising it attributes more to noise.
///
/// Rough signals decay slowly along a single axis.
const DECAY_ALONE: f64 = 1.5;
/// Divisor of the number of blocks of samples: only the 1/`QUIETEST` of them with the least curvature serve to estimate
/// noise along a single axis.
const QUIETEST: usize = 4;
/// Lower bound on the number of blocks of samples, those of least curvature, that serve to estimate noise along a
/// single axis.
const FEWEST_QUIET: usize = 64;
/// Median magnitude of a standard normal deviate.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;
/// Standard error of a σ estimated from the median magnitude of n normal deviates, relative to σ, times √n.
const ERROR_OF_MEDIAN: f64 = 1.166;
/// Relative noise below which an estimate is only the rounding of f32 samples, and is reported as 0.
const ROUNDING: f64 = 2e-7;

/// Estimates the noise of `measurement` from its positive samples of at least `floor` (absolute; 0 for all of them).
///
/// `None` if there is too little data, or no noise beyond the rounding of f32. Then no target is known to spend bytes
/// on noise. Tolerates up to a few per cent of scattered zeros and masks, and any number of contiguous ones.
pub fn estimate(measurement: &Measurement, floor: f32) -> Option<Noise> {
    let axes = lines(measurement.tensor.axes());
    let samples = measurement.tensor.samples();
    let (rows, columns) = fits(&axes)?;
    let blocks = |columns: Option<&Fit>| gather(&axes, samples, floor, &rows, columns);
    let both = columns.as_ref().and_then(|columns| {
        let ordered = !matches!(columns.place, Place::Unordered);
        on_two_axes(blocks(Some(columns)), if ordered { DECAY } else { DECAY_ALONE })
    });
    // Scattered masks may leave no complete block on two axes, but some on triangles alone.
    let alone = || if matches!(rows.place, Place::Plane(_)) { on_triangles_alone(blocks(None)) } else { None };
    both.or_else(alone).filter(|noise| noise.relative > 0.0 || noise.common > 0.0)
}

/// Replaces each axis that is a grid of angles by two axes: polar angles and azimuths.
fn lines(axes: &[Axis]) -> Vec<Axis> {
    let line = |angles: &[f64]| Axis::Elevation(angles.to_vec());
    let of_axis = |axis: &Axis| match axis {
        Axis::Grid(grid) => {
            let azimuths = grid.azimuths().map(|azimuths| line(&azimuths.angles));
            [line(grid.polar())].into_iter().chain(azimuths).collect()
        }
        other => vec![other.clone()],
    };
    axes.iter().flat_map(of_axis).collect()
}

/// Division of one axis into blocks of neighbouring entries for the noise estimate.
struct Fit {
    axis: usize,
    place: Place,
    /// Index of the first axis entry of each block for the noise estimate, then the length of the axis. Each block is a
    /// run of neighbouring entries; together they cover the axis.
    starts: Vec<usize>,
    spectral: bool,
    /// One polynomial basis for each block of neighbouring entries of the axis, computed when first needed. Each serves
    /// where no entry of its block is left out because of zero or masked samples.
    whole: Vec<OnceLock<Option<Arc<Basis>>>>,
}

/// Returns the two axes along which samples predict their neighbours best, the best first. `None` if no axis has
/// neighbours.
fn fits(axes: &[Axis]) -> Option<(Fit, Option<Fit>)> {
    let mut ranked: Vec<(u8, Fit)> = axes.iter().enumerate().rev().filter_map(|(i, axis)| fit(i, axis)).collect();
    // The last mesh is the outgoing one; an incoming one comes after wavelengths.
    for (rank, _) in ranked.iter_mut().filter(|(rank, _)| *rank == OUTGOING).skip(1) {
        *rank = INCOMING;
    }
    ranked.sort_by_key(|(rank, _)| *rank);
    let mut ranked = ranked.into_iter().map(|(_, fit)| fit);
    let first = ranked.next().filter(|first| !matches!(first.place, Place::Unordered))?;
    Some((first, ranked.next()))
}

/// Rank of an axis kind by how well neighbours along it predict a sample, 0 = best.
const OUTGOING: u8 = 0;
const WAVELENGTH: u8 = 1;
const INCOMING: u8 = 2;
const UNORDERED: u8 = 3;

fn fit(axis: usize, what: &Axis) -> Option<(u8, Fit)> {
    let len = what.len();
    let line = |values: Vec<f64>| if len >= 6 { Place::Line(values) } else { Place::Unordered };
    let (rank, place) = match what {
        Axis::Triangles(mesh) if mesh.level() >= 2 => (OUTGOING, Place::Plane(*mesh)),
        Axis::Wavelength(grid) => (WAVELENGTH, line(grid.values())),
        Axis::Elevation(values) => (INCOMING, line(values.clone())),
        Axis::Triangles(_) | Axis::Grid(_) | Axis::Rgb | Axis::Index { .. } => (UNORDERED, Place::Unordered),
    };
    let rank = if matches!(place, Place::Unordered) { UNORDERED } else { rank };
    let blocks = match (&place, what) {
        (Place::Plane(_), _) => len / 16,
        (_, Axis::Triangles(_)) => len / 4,
        _ => (len / 8).max(1),
    };
    let starts = (0..=blocks).map(|b| b * len / blocks.max(1)).collect();
    let whole = (0..blocks).map(|_| OnceLock::new()).collect();
    (len >= 2).then(|| (rank, Fit { axis, place, starts, spectral: what.is_spectral(), whole }))
}

/// Coefficients for the noise estimate: the logarithms of a rectangle of samples, expanded in polynomials along both of
/// its axes. Names give the degrees on the first and the second axis: `third` is 3, `high` above 3.
struct Block {
    high_high: Vec<f64>,
    third_high: Vec<f64>,
    high_third: Vec<f64>,
    /// Coefficients of polynomial degree above 3 along the first axis of a block of samples, each averaged over the
    /// wavelengths on the second axis. Empty if the second axis is not spectral; without a second axis nothing is
    /// averaged.
    high_mean: Vec<f64>,
    third_mean: Vec<f64>,
    /// Curvature of a block of samples along its first axis: the sum of squares of its polynomial coefficients of
    /// degree 2, after they are averaged over wavelengths. Estimates along one axis use only the blocks of least
    /// curvature, because coefficients of higher degree contain signal in the others.
    second_mean: f64,
    /// Reciprocal of the number n of entries on the second axis of a block of samples. The mean over this axis has 1/n
    /// of the noise variance of single samples.
    inverse_width: f64,
}

/// Estimates the noise from blocks of samples along two axes, whose logarithms are expanded in orthonormal bases that
/// start with polynomials of degree 0 to 3 along each axis.
fn on_two_axes(mut blocks: Vec<Block>, decay: f64) -> Option<Noise> {
    let mut high_high: Vec<f64> = blocks.iter().flat_map(|block| &block.high_high).copied().collect();
    let all = deviation(&mut high_high)?;
    let lower = |pick: fn(&Block) -> &Vec<f64>| {
        deviation(&mut blocks.iter().flat_map(pick).copied().collect::<Vec<f64>>()).unwrap_or(all)
    };
    let lower = lower(|block| &block.third_high).max(lower(|block| &block.high_third)).max(all);
    let relative = without_signal(all * all, lower * lower, decay).sqrt();
    let common = on_one_axis(&mut blocks, all * all).map_or(0.0, |common| common.0);
    // The mean of a block's samples scatters by a third of `all`; values below half of it are uncertain.
    let common = if common < all / 2.0 { 0.0 } else { common };
    Some(noise(relative, all, high_high.len(), common))
}

/// Estimates the noise of samples on a triangle mesh from how samples of neighbouring triangles differ, without
/// comparing them along a second axis such as wavelength.
fn on_triangles_alone(mut blocks: Vec<Block>) -> Option<Noise> {
    let (relative, all, coefficients) = on_one_axis(&mut blocks, 0.0)?;
    Some(noise(relative, all, coefficients, 0.0))
}

/// Estimates the noise that neighbouring wavelengths share: the standard deviation of means of logarithms over them,
/// beyond what noise of variance `own` in single samples explains.
///
/// Returns it, the standard deviation of the means' polynomial coefficients of degree above 3 (noise and signal), and
/// the number of these coefficients.
///
/// One axis explains little. Only the quietest blocks are used, and their signal is assumed to decay slowly.
fn on_one_axis(blocks: &mut Vec<Block>, own: f64) -> Option<(f64, f64, usize)> {
    blocks.retain(|block| !block.third_mean.is_empty());
    blocks.sort_by(|a, b| a.second_mean.total_cmp(&b.second_mean));
    blocks.truncate(blocks.len().div_ceil(QUIETEST).max(FEWEST_QUIET));
    let own = own * blocks.iter().map(|block| block.inverse_width).sum::<f64>() / blocks.len().max(1) as f64;
    let of = |pick: fn(&Block) -> &Vec<f64>| {
        let mut values: Vec<f64> = blocks.iter().flat_map(pick).copied().collect();
        deviation(&mut values).map(|deviation| (deviation, values.len()))
    };
    let ((high, n), (third, _)) = (of(|block| &block.high_mean)?, of(|block| &block.third_mean)?);
    let common = without_signal(high * high - own, third * third - own, DECAY_ALONE);
    // A difference of two variances counts as 0 until it exceeds their errors.
    let least = if own > 0.0 { 8.0 * ERROR_OF_MEDIAN * high * high / (n as f64).sqrt() } else { 0.0 };
    Some((if common < least { 0.0 } else { common.sqrt() }, high, n))
}

/// Assembles the noise report: `relative` is the standard deviation of the noise, `all` that of noise and signal
/// together. Their difference and the number of basis coefficients evaluated give the uncertainty.
fn noise(relative: f64, all: f64, coefficients: usize, common: f64) -> Noise {
    let unless_rounding = |noise: f64| if noise < ROUNDING { 0.0 } else { noise };
    let statistical = ERROR_OF_MEDIAN * all / (coefficients as f64).sqrt();
    Noise {
        relative: unless_rounding(relative),
        uncertainty: libm::hypot(statistical, all - relative),
        common: unless_rounding(common),
        coefficients: coefficients as u64,
    }
}

/// Variance of the noise alone, from `high`, the variance of coefficients of polynomial degree above 3, and `third`,
/// that of degree 3. The signal's share of `third` is assumed to be `decay`² times its share of `high`.
fn without_signal(high: f64, third: f64, decay: f64) -> f64 {
    (high - (third - high).max(0.0) / (decay * decay - 1.0)).max(0.0)
}

/// Standard deviation of the normal distribution that most of `values` follow, from the median of their magnitudes;
/// `None` for fewer than [`FEWEST`].
fn deviation(values: &mut [f64]) -> Option<f64> {
    if values.len() < FEWEST {
        return None;
    }
    for value in values.iter_mut() {
        *value = value.abs();
    }
    let middle = values.len() / 2;
    let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median / MEDIAN_OF_NORMAL)
}

/// Expands the logarithms of blocks of neighbouring samples, spread over the tensor, in polynomials along their axes.
/// Zero and masked samples are left out. No more blocks are sought once [`MAX_BLOCKS`] are found.
fn gather(axes: &[Axis], samples: &[f32], floor: f32, rows: &Fit, columns: Option<&Fit>) -> Vec<Block> {
    let strides = strides(axes);
    let fitted = |axis| axis == rows.axis || columns.is_some_and(|c| c.axis == axis);
    let others: Vec<usize> = (0..axes.len()).filter(|&axis| !fitted(axis)).collect();
    let row_blocks = rows.starts.len() - 1;
    let column_blocks = columns.map_or(1, |c| c.starts.len() - 1);
    let total = others.iter().map(|&axis| axes[axis].len()).product::<usize>() * row_blocks * column_blocks;
    let stride = scattering_stride(total);
    let coefficients_of = |k: usize| {
        // A candidate's number is small and the stride is below the limit on samples, so their product fits.
        let mut place = (k as u64 * stride as u64 % total as u64) as usize;
        let column_block = place % column_blocks;
        place /= column_blocks;
        let row_block = place % row_blocks;
        place /= row_blocks;
        let mut base = 0;
        for &axis in others.iter().rev() {
            base += place % axes[axis].len() * strides[axis];
            place /= axes[axis].len();
        }
        let row = Line { fit: Some(rows), block: row_block, stride: strides[rows.axis] };
        let column = Line { fit: columns, block: column_block, stride: columns.map_or(0, |c| strides[c.axis]) };
        block_coefficients(samples, base, floor, &row, &column)
    };
    let mut found: Vec<Block> = Vec::new();
    for round in 0..ROUNDS {
        let candidates = round * MAX_BLOCKS..total.min((round + 1) * MAX_BLOCKS);
        if candidates.is_empty() || found.len() >= MAX_BLOCKS {
            break;
        }
        // Collected in order: the result does not depend on the number of threads.
        let blocks: Vec<Option<Block>> = candidates.into_par_iter().map(coefficients_of).collect();
        found.extend(blocks.into_iter().flatten());
    }
    found
}

fn strides(axes: &[Axis]) -> Vec<usize> {
    let mut strides = vec![1; axes.len()];
    for i in (1..axes.len()).rev() {
        strides[i - 1] = strides[i] * axes[i].len();
    }
    strides
}

/// Returns a stride in which a walk visits every index of `0..total` once and jumps far at each step: coprime to
/// `total`, near the golden section. A part of the walk then samples all of the range.
fn scattering_stride(total: usize) -> usize {
    let gcd = |mut a: usize, mut b: usize| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let golden = (total as f64 * 0.618_033_988_749_895) as usize;
    (golden.max(1)..=total).find(|&stride| gcd(stride, total) == 1).unwrap_or(1)
}

/// Extent along one axis of a block of samples for the noise estimate; a single entry if the axis is not divided into
/// blocks.
struct Line<'a> {
    fit: Option<&'a Fit>,
    block: usize,
    stride: usize,
}

impl Line<'_> {
    fn entries(&self) -> std::ops::Range<usize> {
        self.fit.map_or(0..1, |fit| fit.starts[self.block]..fit.starts[self.block + 1])
    }

    fn basis(&self, entries: &[usize]) -> Option<Arc<Basis>> {
        let Some(fit) = self.fit else { return Some(Arc::new(Basis::single())) };
        let basis = || fit.place.basis(entries).map(Arc::new);
        if entries.len() == self.entries().len() { fit.whole[self.block].get_or_init(basis).clone() } else { basis() }
    }
}

fn block_coefficients(samples: &[f32], base: usize, floor: f32, row: &Line<'_>, column: &Line<'_>) -> Option<Block> {
    let (mut rows, mut columns): (Vec<usize>, Vec<usize>) = (row.entries().collect(), column.entries().collect());
    let sample = |r: usize, c: usize| samples[base + r * row.stride + c * column.stride];
    let usable = |r: usize, c: usize| sample(r, c) > 0.0 && sample(r, c) >= floor;
    keep_whole(&mut rows, &mut columns, usable);
    let (on_rows, on_columns) = (row.basis(&rows)?, column.basis(&columns)?);
    let width = columns.len();
    let mut logs = Vec::with_capacity(rows.len() * width);
    for &r in &rows {
        logs.extend(columns.iter().map(|&c| f64::from(sample(r, c))));
    }
    logarithms(&mut logs);
    // Result: one line of `width` values per vector.
    let transformed = |vectors: &[Vec<f64>]| {
        let mut lines = vec![0.0; vectors.len() * width];
        for (vector, sums) in vectors.iter().zip(lines.chunks_exact_mut(width)) {
            for (&weight, logs) in vector.iter().zip(logs.chunks_exact(width)) {
                for (sum, log) in sums.iter_mut().zip(logs) {
                    *sum += weight * log;
                }
            }
        }
        lines
    };
    let (high, third) = (transformed(&on_rows.high), transformed(&on_rows.third));
    let dots = |lines: &[f64], vectors: &[Vec<f64>]| {
        let mut products = Vec::with_capacity(lines.len() / width * vectors.len());
        for line in lines.chunks_exact(width) {
            products.extend(vectors.iter().map(|v| dot(line, v)));
        }
        products
    };
    let means = |lines: &[f64]| -> Vec<f64> {
        let spectral = column.fit.is_none_or(|fit| fit.spectral);
        let mean = |line: &[f64]| line.iter().sum::<f64>() / width as f64;
        if spectral { lines.chunks_exact(width).map(mean).collect() } else { Vec::new() }
    };
    Some(Block {
        high_high: dots(&high, &on_columns.high),
        third_high: dots(&third, &on_columns.high),
        high_third: dots(&high, &on_columns.third),
        high_mean: means(&high),
        third_mean: means(&third),
        second_mean: means(&transformed(&on_rows.second)).iter().map(|c| c * c).sum(),
        inverse_width: 1.0 / width as f64,
    })
}

/// Drops rows and columns of an array of samples until no zero, negative, masked or too small sample remains. Each time
/// it drops the row or column with the largest fraction of such samples.
fn keep_whole(rows: &mut Vec<usize>, columns: &mut Vec<usize>, usable: impl Fn(usize, usize) -> bool) {
    let worst = |lines: &[usize], across: &[usize], usable: &dyn Fn(usize, usize) -> bool| {
        let bad = |line: usize| across.iter().filter(|&&other| !usable(line, other)).count();
        let counts = lines.iter().enumerate().map(|(i, &line)| (bad(line), i));
        // The first of equals.
        counts.max_by_key(|&(bad, i)| (bad, std::cmp::Reverse(i))).unwrap_or((0, 0))
    };
    loop {
        let (bad_row, row) = worst(rows, columns, &usable);
        if bad_row == 0 {
            return;
        }
        let (bad_column, column) = worst(columns, rows, &|c, r| usable(r, c));
        if bad_row * rows.len() >= bad_column * columns.len() {
            rows.remove(row);
        } else {
            columns.remove(column);
        }
    }
}

#[cfg(test)]
mod tests;
