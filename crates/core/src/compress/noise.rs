//! How noisy a measurement is: what neither neighbouring directions nor neighbouring wavelengths predict.
//!
//! # Method
//! Logarithms of positive samples are cut into small blocks along two axes: 16 triangles that share a grandparent, and
//! 8 to 15 neighbours on a line. On each axis an orthonormal basis of the block starts with the polynomials at the samples' own
//! positions (triangles: in the tangent plane), degree by degree to 3; what completes it is blind to every cubic. Noise
//! that is independent from sample to sample has the same standard deviation σ in every coefficient of the tensor product
//! of two such bases; a smooth signal, or one that is a product of two factors, dies away with the degree of either. So
//!
//! * the median magnitude over all coefficients of degree > 3 on both axes, divided by 0.6745, is σ, and lobes, edges and
//!   lines in a minority of blocks do not move it (Donoho & Johnstone 1994, section 4.1: the same median over the finest
//!   wavelet details; here they are blind to cubics, and to what is smooth along one axis only);
//! * the coefficients of degree 3 on one of the axes tell whether it *is* noise: equal magnitudes say yes, and where they
//!   are κ = 2.5 times as large the signal explains everything. In between, the part that decays so fast is taken off.
//!   κ is below what kinks of linear interpolation reach (2.8), smooth lobes have 5 and more. The estimate errs low.
//! * the mean over the block's spectral samples, seen in coefficients of degree > 3 in direction, gives in the same way the
//!   noise that whole stretches of a spectrum have in common: gain errors of one direction. Here, and where there is no second
//!   axis, only the quarter of the blocks that bends least (in degree 2) is asked. κ is 1.5 wherever only one axis has order.
//!
//! A grid of angles counts as two lines, its polar angles and its azimuths. Axes without order (indices, colours, meshes too
//! coarse for cubics) only lose their mean. Nothing is estimated where no axis has neighbours, for single spectra (one line
//! cannot tell noise from lines), or from few coefficients.
//!
//! At most [`MAX_BLOCKS`] blocks are looked at, the same ones every time: time and memory are bounded.

use super::figures::two_digits_up;
use super::logarithm::logarithms;
use super::target::Target;
use crate::domain::{Axis, Measurement};
use crate::numeric::dense::dot;
use basis::{Basis, Place};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, OnceLock};

mod basis;

/// The noise of a measurement. All numbers are standard deviations of a sample's logarithm, hence relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Noise that is independent from sample to sample, of a typical (median) sample. 0 where none was found.
    pub relative: f64,
    /// The standard error of `relative`, with what may be signal instead.
    pub uncertainty: f64,
    /// Noise that neighbouring spectral samples have in common (a direction's gain error); 0 where none was found or
    /// there is no spectral axis.
    pub common: f64,
    /// How many coefficients `relative` is the median of.
    pub coefficients: u64,
}

impl Noise {
    /// What someone who asks for `target` should know: whether it lies below the noise, what that costs, and what to ask for
    /// instead.
    pub fn warning(&self, target: Target) -> Option<String> {
        // Of a million normal deviates the largest has 5 σ; below 3 σ so many exceed the bound that each costs bits.
        let (name, wanted, cliff, enough) = match target {
            Target::ErL2(wanted) => ("er_l2", wanted, 1.0, 1.05),
            Target::MaxRelativeError(wanted) => ("max_relative_error", wanted, 3.0, 5.0),
            // The mean magnitude of normal deviates is 0.8 σ.
            Target::ErL1(wanted) => ("er_l1", wanted, 0.8, 0.84),
            _ => return None,
        };
        if wanted < cliff * self.relative {
            return Some(format!(
                "{name} {wanted} lies below the noise of the samples, whose standard deviation is about {:.2} %: the file spends \
                 its bytes on noise, about one bit a sample more for every halving of the error; ask for {name} {} or more",
                100.0 * self.relative,
                two_digits_up(enough * self.relative),
            ));
        }
        (wanted < cliff * self.common).then(|| {
            format!(
                "{name} {wanted} lies below the noise that whole spectra have in common, whose standard deviation is \
                 about {:.2} %: every direction's own error costs bytes; ask for {name} {} or more",
                100.0 * self.common,
                two_digits_up(enough * self.common),
            )
        })
    }
}

/// Blocks that are looked at.
const MAX_BLOCKS: usize = 2048;
/// Rounds of as many candidates, where blocks have zeros and masks.
const ROUNDS: usize = 6;
/// Coefficients below which nothing is said: a standard error of 12 %.
const FEWEST: usize = 96;
/// How fast a signal decays at least from degree 3 to the degrees above.
const DECAY: f64 = 2.5;
/// The same where only one axis has neighbours to tell by: rough signals decay as slowly there.
const DECAY_ALONE: f64 = 1.5;
/// One block in so many is quiet enough to be asked about one axis alone.
const QUIETEST: usize = 4;
/// So many are asked at least.
const FEWEST_QUIET: usize = 64;
/// The median magnitude of a standard normal deviate.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;
/// The standard error of that estimate from one deviate, relative to σ.
const ERROR_OF_MEDIAN: f64 = 1.166;
/// Below this only the rounding of f32 samples is seen.
const ROUNDING: f64 = 2e-7;

/// Estimates the noise of `measurement` from its positive samples of at least `floor` (absolute; 0 for all of them).
///
/// `None` where nothing can be said or there is no more than the rounding of f32: then any target is reachable without
/// spending bytes on noise, as far as anyone can tell. Up to a few per cent of scattered zeros and masks are borne, and
/// any number of contiguous ones.
pub fn estimate(measurement: &Measurement, floor: f32) -> Option<Noise> {
    let axes = lines(measurement.tensor.axes());
    let samples = measurement.tensor.samples();
    let (rows, columns) = fits(&axes)?;
    let blocks = |columns: Option<&Fit>| gather(&axes, samples, floor, &rows, columns);
    let both = columns.as_ref().and_then(|columns| {
        let ordered = !matches!(columns.place, Place::Unordered);
        on_two_axes(blocks(Some(columns)), if ordered { DECAY } else { DECAY_ALONE })
    });
    // Scattered masks leave no block whole on two axes; triangles alone may do.
    let alone = || if matches!(rows.place, Place::Plane(_)) { on_triangles_alone(blocks(None)) } else { None };
    both.or_else(alone).filter(|noise| noise.relative > 0.0 || noise.common > 0.0)
}

/// The axes, with grids of angles as two lines.
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

/// How one axis is cut into blocks.
struct Fit {
    axis: usize,
    place: Place,
    /// Where each block starts; one longer than there are blocks.
    starts: Vec<usize>,
    spectral: bool,
    /// The bases of whole blocks, made once.
    whole: Vec<OnceLock<Option<Arc<Basis>>>>,
}

/// The axis that predicts best, and the next one. `None` where no axis has neighbours.
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

/// How well axes predict, best first.
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

/// Coefficients of a block by degree: `high` above 3, `third` 3, on the first and the second axis.
struct Block {
    high_high: Vec<f64>,
    third_high: Vec<f64>,
    high_third: Vec<f64>,
    /// On the first axis alone, of means over the spectral samples of the block (without a second axis, of its samples).
    high_mean: Vec<f64>,
    third_mean: Vec<f64>,
    /// The energy of degree 2 in these means. Under noise it says nothing of higher degrees, under signal much.
    second_mean: f64,
    /// 1 / the samples in a mean.
    inverse_width: f64,
}

/// The noise in blocks on two axes.
fn on_two_axes(mut blocks: Vec<Block>, decay: f64) -> Option<Noise> {
    let mut high_high: Vec<f64> = blocks.iter().flat_map(|block| &block.high_high).copied().collect();
    let all = deviation(&mut high_high)?;
    let lower = |pick: fn(&Block) -> &Vec<f64>| {
        deviation(&mut blocks.iter().flat_map(pick).copied().collect::<Vec<f64>>()).unwrap_or(all)
    };
    let lower = lower(|block| &block.third_high).max(lower(|block| &block.high_third)).max(all);
    let relative = without_signal(all * all, lower * lower, decay).sqrt();
    let common = on_one_axis(&mut blocks, all * all).map_or(0.0, |common| common.0);
    // The mean of a block's samples scatters by a third of `all`: below half of it little is certain.
    let common = if common < all / 2.0 { 0.0 } else { common };
    Some(noise(relative, all, high_high.len(), common))
}

/// The noise in blocks without a second axis.
fn on_triangles_alone(mut blocks: Vec<Block>) -> Option<Noise> {
    let (relative, all, coefficients) = on_one_axis(&mut blocks, 0.0)?;
    Some(noise(relative, all, coefficients, 0.0))
}

/// The noise that means have beyond the `own` variance of the samples in them; what they scatter in all; coefficients.
///
/// One axis explains little, so only the quietest blocks are asked, and their signal is taken to decay slowly.
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
    // The difference of two squares is nothing before it stands out of their errors.
    let least = if own > 0.0 { 8.0 * ERROR_OF_MEDIAN * high * high / (n as f64).sqrt() } else { 0.0 };
    Some((if common < least { 0.0 } else { common.sqrt() }, high, n))
}

/// `relative` of `coefficients` that scatter by `all`.
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

/// The variance of noise in `high`, if the signal's is at least `decay`² times as large in `third`.
fn without_signal(high: f64, third: f64, decay: f64) -> f64 {
    (high - (third - high).max(0.0) / (decay * decay - 1.0)).max(0.0)
}

/// The standard deviation of normal deviates that most of `values` are; `None` if there are too few.
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

/// The coefficients of up to [`MAX_BLOCKS`] blocks without zeros and masks, spread over the tensor.
fn gather(axes: &[Axis], samples: &[f32], floor: f32, rows: &Fit, columns: Option<&Fit>) -> Vec<Block> {
    let strides = strides(axes);
    let fitted = |axis| axis == rows.axis || columns.is_some_and(|c| c.axis == axis);
    let others: Vec<usize> = (0..axes.len()).filter(|&axis| !fitted(axis)).collect();
    let row_blocks = rows.starts.len() - 1;
    let column_blocks = columns.map_or(1, |c| c.starts.len() - 1);
    let total = others.iter().map(|&axis| axes[axis].len()).product::<usize>() * row_blocks * column_blocks;
    let stride = scattering_stride(total);
    let coefficients_of = |k: usize| {
        // A candidate's number is small and the stride below the limit on samples: their product fits.
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
        // Collected in order: the result does not depend on threads.
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

/// A step that visits `0..total` once, far from where it was before: coprime, near the golden section.
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

/// One block's extent on one axis; without a fit, a single entry.
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
    // Lines of `width`, one after another.
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

/// Drops the row or column with the largest part of unusable samples until every sample left is usable.
fn keep_whole(rows: &mut Vec<usize>, columns: &mut Vec<usize>, usable: impl Fn(usize, usize) -> bool) {
    let worst = |lines: &[usize], across: &[usize], usable: &dyn Fn(usize, usize) -> bool| {
        let bad = |line: usize| across.iter().filter(|&&other| !usable(line, other)).count();
        let counts = lines.iter().enumerate().map(|(i, &line)| (bad(line), i));
        // Of equals the first.
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
