//! Wavelets on a line of any length, in place: at stride s, even multiples of s become smooth coefficients, odd ones
//! details.
//!
//! Every level is a banded matrix between rows (`level.rs`); lifting and Haar compute it in place. A symmetric lifting
//! scheme mirrors samples at both ends (`x[−1] = x[1]`, `x[n] = x[n − 2]`), so that any length is critically sampled
//! and perfectly reconstructed (Daubechies & Sweldens 1998; ISO 15444-1 annex F).

use super::banded::{Banded, Row, Window};
use super::boundary::Boundary;
use super::level::{self, Level, pair_weights};
use super::lines::{Lifting, LineBasis, Parity, Scheme};
use super::rows::{Pass, axpy, axpy2, combine, reflect, scale};

/// Wavelet transform along an ordered axis: the matrices of its levels, finest first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LinePlan {
    length: usize,
    basis: LineBasis,
    boundary: Boundary,
    levels: Vec<Level>,
}

/// Returns the number of wavelet levels after which a signal of `n` samples has one smooth coefficient.
pub(super) fn levels(n: usize) -> u32 {
    n.next_power_of_two().trailing_zeros()
}

impl LinePlan {
    pub(super) fn new(length: usize, basis: LineBasis, boundary: Boundary, limit: u32) -> Self {
        let (line, own) = (basis.line(), basis.boundary());
        let levels = match (line.scheme, boundary) {
            (Scheme::Pairs, Boundary::Fitted) => level::unbalanced(length, limit),
            _ => level::levels(basis.bank(), own, boundary, basis.info().vanishing_moments, length, limit),
        };
        Self { length, basis, boundary, levels }
    }

    /// Returns the number of levels of the wavelet transform.
    pub(super) fn depth(&self) -> u32 {
        self.levels.len() as u32
    }

    #[cfg(test)]
    pub(super) fn levels(&self) -> &[Level] {
        &self.levels
    }

    /// Applies the wavelet transform, its inverse or a transpose along an axis, in place; `rows` has one row per entry
    /// of the axis.
    pub(super) fn transform(&self, rows: &mut [&mut [f32]], pass: Pass) {
        let mut scratch = Vec::new();
        match pass {
            Pass::Forward | Pass::InverseTransposed => {
                for k in 0..self.levels.len() {
                    self.level(rows, k, pass, &mut scratch);
                }
            }
            Pass::Inverse | Pass::ForwardTransposed => {
                for k in (0..self.levels.len()).rev() {
                    self.level(rows, k, pass, &mut scratch);
                }
            }
        }
    }

    fn level(&self, rows: &mut [&mut [f32]], k: usize, pass: Pass, scratch: &mut Vec<f32>) {
        match (self.basis.line().scheme, self.boundary) {
            (Scheme::Pairs, Boundary::Fitted) => pairs(rows, 1 << k),
            (Scheme::Lifting(lifting), Boundary::WholeSample) => lift(rows, 1 << k, lifting, pass),
            _ => {
                let level = &self.levels[k];
                let matrix = match pass {
                    Pass::Forward => &level.analysis,
                    Pass::ForwardTransposed => &level.analysis_transposed,
                    Pass::Inverse => &level.synthesis,
                    Pass::InverseTransposed => &level.synthesis_transposed,
                };
                apply(matrix, rows, 1 << k, scratch);
            }
        }
    }

    /// Returns the synthesis function of coefficient `index`, and true if the ends of the axis do not affect it.
    pub(super) fn footprint(&self, index: usize) -> (Window, bool) {
        self.descend(index, |level| &level.synthesis_transposed)
    }

    /// Returns the weight of each sample in wavelet coefficient `index`.
    pub(super) fn analysis_row(&self, index: usize) -> Window {
        self.descend(index, |level| &level.analysis).0
    }

    /// Returns the nonzero weights of the wavelet coefficients in the sum that reconstructs sample `index` of the
    /// signal, as pairs of coefficient index and weight.
    pub(super) fn synthesis_row(&self, index: usize) -> Vec<(u32, f64)> {
        let mut row = Vec::new();
        let mut smooth = Window::unit(index);
        for (k, level) in self.levels.iter().enumerate() {
            let (all, _) = smooth.through(&level.synthesis, |j| j);
            row.extend(all.iter().filter(|(m, w)| m % 2 == 1 && *w != 0.0).map(|(m, w)| ((m << k) as u32, w)));
            let first = all.first.div_ceil(2);
            smooth = Window { first, values: all.values.into_iter().skip(2 * first - all.first).step_by(2).collect() };
        }
        row.extend(smooth.iter().filter(|(_, w)| *w != 0.0).map(|(m, w)| ((m << self.levels.len()) as u32, w)));
        row.sort_unstable_by_key(|&(i, _)| i);
        row
    }

    fn descend(&self, index: usize, matrix: impl Fn(&Level) -> &Banded) -> (Window, bool) {
        let depth = self.levels.len();
        let height = if index == 0 { depth } else { depth.min(index.trailing_zeros() as usize) };
        let (mut window, mut inner) = (Window::unit(index >> height), true);
        if let Some(level) = self.levels.get(height) {
            // A detail enters at its own level; at finer levels the result is treated as smooth coefficients.
            (window, inner) = window.through(matrix(level), |m| m);
        }
        for level in self.levels[..height].iter().rev() {
            let (next, clear) = window.through(matrix(level), |o| 2 * o);
            window = next;
            inner &= clear;
        }
        (window, inner)
    }

    /// Returns the L2 norms of all synthesis functions, with equal weights of the samples.
    pub(super) fn norms(&self) -> Vec<f64> {
        let n = self.length;
        let orthogonal = self.basis.info().orthogonal
            && (self.boundary == Boundary::Fitted || Some(self.boundary) != self.basis.bank().symmetry);
        if orthogonal {
            return vec![1.0; n];
        }
        let mut norms = vec![0.0; n];
        let depth = self.levels.len() as u32;
        for height in 0..=depth {
            let (first, step) = if height == depth { (0, 1 << depth) } else { (1 << height, 2 << height) };
            let places: Vec<usize> = (first..n).step_by(step).collect();
            let measure = |place: usize| {
                let (footprint, inner) = self.footprint(place);
                (libm::sqrt(footprint.values.iter().map(|x| x * x).sum()), inner)
            };
            // Functions not affected by the ends are shifts of each other, so one norm serves all.
            let mut from = 0;
            let mut same = None;
            while from < places.len() && same.is_none() {
                let (norm, inner) = measure(places[from]);
                norms[places[from]] = norm;
                same = inner.then_some(norm);
                from += 1;
            }
            let mut to = places.len();
            while to > from {
                let (norm, inner) = measure(places[to - 1]);
                if inner {
                    break;
                }
                to -= 1;
                norms[places[to]] = norm;
            }
            if let Some(norm) = same {
                places[from..to.max(from)].iter().for_each(|&place| norms[place] = norm);
            }
        }
        norms
    }
}

/// Replaces every `stride`-th row of samples by a linear combination of these rows, with the weights in row m of
/// `matrix` for the m-th of them.
fn apply(matrix: &Banded, rows: &mut [&mut [f32]], stride: usize, scratch: &mut Vec<f32>) {
    let width = rows.first().map_or(0, |row| row.len());
    scratch.resize(matrix.len() * width, 0.0);
    for (copy, row) in scratch.chunks_exact_mut(width).zip(rows.iter().step_by(stride)) {
        copy.copy_from_slice(row);
    }
    for (m, target) in rows.iter_mut().step_by(stride).enumerate() {
        match matrix.row(m) {
            Row::Edge(entries) => combine(target, scratch, entries.iter().map(|&(c, w)| (c, w as f32))),
            Row::Inner(row, entries) => {
                let row = row as i64;
                combine(target, scratch, entries.iter().map(|&(c, w)| ((row + c) as usize, w as f32)));
            }
        }
    }
}

/// Applies one level of the unbalanced Haar transform to all pairs of values `stride` samples apart. The last value of
/// a level of odd length has no partner and passes unchanged. Only the last pair can represent unequal numbers of
/// samples.
fn pairs(rows: &mut [&mut [f32]], stride: usize) {
    let n = rows.len();
    for left in (0..n).step_by(2 * stride) {
        let right = left + stride;
        if right >= n {
            break;
        }
        let (alpha, beta) = pair_weights(left, stride, n);
        let (before, after) = rows.split_at_mut(right);
        reflect(before[left], after[0], alpha as f32, beta as f32);
    }
}

fn lift(rows: &mut [&mut [f32]], stride: usize, lifting: &Lifting, pass: Pass) {
    let &Lifting { steps, low } = lifting;
    let high = -1.0 / low;
    match pass {
        Pass::Forward => {
            for &(parity, c) in steps {
                gather(rows, stride, parity, c);
            }
            scale_both(rows, stride, low, high);
        }
        Pass::Inverse => {
            scale_both(rows, stride, 1.0 / low, 1.0 / high);
            for &(parity, c) in steps.iter().rev() {
                gather(rows, stride, parity, -c);
            }
        }
        Pass::ForwardTransposed => {
            scale_both(rows, stride, low, high);
            for &(parity, c) in steps.iter().rev() {
                scatter(rows, stride, parity, c);
            }
        }
        Pass::InverseTransposed => {
            for &(parity, c) in steps {
                scatter(rows, stride, parity, -c);
            }
            scale_both(rows, stride, 1.0 / low, 1.0 / high);
        }
    }
}

fn scale_both(rows: &mut [&mut [f32]], stride: usize, low: f32, high: f32) {
    for (i, row) in rows.iter_mut().step_by(stride).enumerate() {
        scale(row, if i % 2 == 0 { low } else { high });
    }
}

/// Returns the even or the odd positions of a wavelet level (multiples of `stride`) with their left and right
/// neighbours, `None` beyond the ends.
fn places(n: usize, stride: usize, parity: Parity) -> impl Iterator<Item = (Option<usize>, usize, Option<usize>)> {
    let first = if parity == Parity::Even { 0 } else { stride };
    (first..n).step_by(2 * stride).map(move |i| (i.checked_sub(stride), i, Some(i + stride).filter(|&r| r < n)))
}

/// Applies one lifting step to rows counted in steps of `stride`: adds `c` times the sum of both neighbours to every
/// second row, starting at row 0 or 1 as `parity` says. At the ends the only neighbour counts twice.
fn gather(rows: &mut [&mut [f32]], stride: usize, parity: Parity, c: f32) {
    for (left, i, right) in places(rows.len(), stride, parity) {
        let (before, rest) = rows.split_at_mut(i);
        let Some((target, after)) = rest.split_first_mut() else { continue };
        match (left, right) {
            (Some(l), Some(r)) => axpy2(target, c, before[l], after[r - i - 1]),
            (Some(l), None) => axpy(target, 2.0 * c, before[l]),
            (None, Some(r)) => axpy(target, 2.0 * c, after[r - i - 1]),
            (None, None) => {}
        }
    }
}

/// Applies a transposed lifting step: adds `c` times each even (or each odd) sample to both its neighbours. It is the
/// transpose of [`gather`].
fn scatter(rows: &mut [&mut [f32]], stride: usize, parity: Parity, c: f32) {
    for (left, i, right) in places(rows.len(), stride, parity) {
        let (before, rest) = rows.split_at_mut(i);
        let Some((source, after)) = rest.split_first_mut() else { continue };
        match (left, right) {
            (Some(l), Some(r)) => {
                axpy(before[l], c, source);
                axpy(after[r - i - 1], c, source);
            }
            (Some(l), None) => axpy(before[l], 2.0 * c, source),
            (None, Some(r)) => axpy(after[r - i - 1], 2.0 * c, source),
            (None, None) => {}
        }
    }
}
