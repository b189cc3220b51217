//! Filters for the ends of a line: the orthogonal complement of the inner filters, split into smooth and detail rows.
//!
//! Inner coefficients are those whose filters lie wholly inside. Analysis rows of the others must be orthogonal to all
//! inner synthesis functions. They form a basis of that orthogonal complement, which is confined to the ends.
//!
//! Smooth rows first span the polynomials to be preserved, then the directions nearest to the truncated (or folded)
//! low-pass filters. Detail rows span the rest, so that preserved polynomials have no details. The coefficients of the
//! polynomials are tracked from level to level, so that this is true at every level.
//!
//! All spans are built in f64 by Gram–Schmidt with the largest remainder first, ties to the lowest index, which gives
//! identical rows on every machine.
//!
//! Herley & Vetterli 1994, *Orthogonal time-varying filter banks and wavelet packets*, section III; Cohen, Daubechies &
//! Vial 1993, *Wavelets on the interval and fast wavelet transforms*, section 4 (theirs preserve all moments and need
//! tables).

use super::banded::Window;
use super::boundary::{Boundary, folded};
use super::filters::{Bank, Taps};
use crate::numeric::dense::{dot, norm, reduce, scale};
use crate::numeric::orthogonal::{take_away, take_one_away};
use std::ops::Range;

/// Special filters of one wavelet level near the ends of the signal.
#[derive(Debug)]
pub(super) struct Ends {
    /// Range of coefficient positions, in the low-pass and in the high-pass channel, that use the unmodified filters.
    pub(super) inner: Range<usize>,
    /// Analysis filters of the coefficients near the ends of the signal: interleaved index of the coefficient (2o for
    /// smooth, 2o + 1 for detail o), and weights of the samples.
    pub(super) analysis: Vec<(usize, Window)>,
    /// Synthesis functions of the coefficients near the ends of the signal: interleaved index of the coefficient (2o
    /// for smooth, 2o + 1 for detail o), and values at the samples.
    pub(super) synthesis: Vec<(usize, Window)>,
}

/// Description of the smooth coefficients that enter a wavelet level (number, and values for polynomial signals), from
/// which the filters near the ends of the signal are computed.
#[derive(Debug)]
pub(super) struct Sequence {
    length: usize,
    /// Number of smooth coefficients at each end of the signal that special filters of earlier levels produced.
    margins: [usize; 2],
    /// Smooth coefficients of polynomials of degree 0, 1, 2, … for each end of the signal (in a basis that is
    /// well-conditioned near that end); computed on first use.
    polynomials: Option<[Vec<Vec<f64>>; 2]>,
}

impl Sequence {
    pub(super) fn new(length: usize) -> Self {
        Self { length, margins: [0; 2], polynomials: None }
    }

    pub(super) fn len(&self) -> usize {
        self.length
    }

    /// Replaces the number of smooth coefficients at one level of a wavelet transform by that at the next coarser
    /// level: half as many, rounded up. For a level without special filters near the ends of the signal.
    pub(super) fn pass_regular(&mut self) {
        *self = Self::new(self.length.div_ceil(2));
    }

    /// Advances this description (number of smooth coefficients, and their values for polynomial signals) from the
    /// input of a wavelet level to that of the next coarser one. The level just passed has the low-pass filter `low`,
    /// and special filters `ends` near the ends of the signal.
    ///
    /// Values for polynomial signals are advanced only if `keeps` is true.
    fn pass(&mut self, low: &Taps, ends: &Ends, keeps: bool) {
        let n = self.length;
        let length = n.div_ceil(2);
        if !keeps {
            *self = Self::new(length);
            return;
        }
        for polynomial in self.polynomials.iter_mut().flatten().flatten() {
            let mut next = vec![0.0; length];
            for o in ends.inner.clone() {
                next[o] = low.iter().map(|(k, w)| w * polynomial[(2 * o as i64 + k) as usize]).sum();
            }
            for (m, row) in ends.analysis.iter().filter(|(m, _)| m % 2 == 0) {
                next[m / 2] = row.iter().map(|(i, w)| w * polynomial[i]).sum();
            }
            *polynomial = next;
        }
        self.margins = if ends.inner.is_empty() { [length, 0] } else { [ends.inner.start, length - ends.inner.end] };
        self.length = length;
    }
}

/// Returns the samples of Legendre polynomials of degree below `count`, scaled to the first 64 of `n` samples and
/// continued beyond. With `flip`, samples count from the last one.
fn polynomials(n: usize, count: usize, flip: bool) -> Vec<Vec<f64>> {
    let scale = n.min(64) as f64;
    let t = |i: usize| {
        let i = if flip { n - 1 - i } else { i };
        (2 * i + 1) as f64 / scale - 1.0
    };
    let mut all: Vec<Vec<f64>> = Vec::with_capacity(count);
    for degree in 0..count {
        let values = (0..n)
            .map(|i| match degree {
                0 => 1.0,
                1 => t(i),
                d => ((2 * d - 1) as f64 * t(i) * all[d - 1][i] - (d - 1) as f64 * all[d - 2][i]) / d as f64,
            })
            .collect();
        all.push(values);
    }
    all
}

/// Computes filters for the ends of the signal, where the ordinary filters of a wavelet level reach beyond it. They
/// preserve polynomials of degree below `kept`.
///
/// Changes `sequence`, the description of the level's input, to that of the next coarser level.
pub(super) fn fitted(bank: &Bank, rule: Boundary, kept: usize, sequence: &mut Sequence) -> Ends {
    let n = sequence.length;
    let (lows, highs) = (n.div_ceil(2), n / 2);
    let (first, last) = bank.reach();
    let [left, right] = sequence.margins;
    // Inner coefficients o satisfy left ≤ 2o + first and 2o + last < n − right, and leave room for the preserved
    // polynomials.
    let start = (left as i64 - first + 1).div_euclid(2).max(kept as i64);
    let end = ((n as i64 - right as i64 - 1 - last).div_euclid(2) + 1).min(highs as i64 - kept as i64);
    let inner = if start < end { start as usize..end as usize } else { 0..0 };
    let given = sequence.polynomials.get_or_insert_with(|| [false, true].map(|flip| polynomials(n, kept, flip)));
    // Columns at each end that the inner filters do not span completely.
    let reach_left = (2 * inner.start as i64 - 1 + last).clamp(0, n as i64) as usize;
    let reach_right = (2 * inner.end as i64 + first).clamp(0, n as i64) as usize;
    let sides = if inner.is_empty() || reach_left > reach_right {
        let slots = |count: usize| (0..count).filter(|o| !inner.contains(o)).collect();
        vec![Side { columns: 0..n, slots: [slots(lows), slots(highs)], polynomials: &given[0] }]
    } else {
        let slots = |range: Range<usize>| range.collect::<Vec<_>>();
        vec![
            Side {
                columns: 0..reach_left,
                slots: [slots(0..inner.start), slots(0..inner.start)],
                polynomials: &given[0],
            },
            Side {
                columns: reach_right..n,
                slots: [slots(inner.end..lows), slots(inner.end..highs)],
                polynomials: &given[1],
            },
        ]
    };
    let mut ends = Ends { inner, analysis: Vec::new(), synthesis: Vec::new() };
    for side in &sides {
        side.rows(bank, rule, n, &mut ends);
    }
    sequence.pass(&bank.analysis[0], &ends, kept > 0);
    ends
}

/// Samples near one end of a wavelet level, or all samples of a short level, with the coefficients that need special
/// filters.
struct Side<'a> {
    columns: Range<usize>,
    /// Positions of the smooth and of the detail coefficients that need special filters.
    slots: [Vec<usize>; 2],
    polynomials: &'a [Vec<f64>],
}

impl Side<'_> {
    fn rows(&self, bank: &Bank, rule: Boundary, n: usize, ends: &mut Ends) {
        let count = self.slots[0].len() + self.slots[1].len();
        let free = self.complement(&bank.synthesis, &ends.inner, count);
        let mut low: Vec<Vec<f64>> = Vec::new();
        for polynomial in self.polynomials {
            let given = &polynomial[self.columns.clone()];
            let mut part = projected(given, &free);
            let whole = norm(given);
            take_away(&mut part, &low);
            take_away(&mut part, &low);
            let rest = norm(&part);
            if rest > 1e-10 * whole && low.len() < self.slots[0].len() {
                scale(&mut part, 1.0 / rest);
                low.push(part);
            }
        }
        let cut = [0, 1].map(|channel| self.cut_filters(&bank.analysis[channel], rule, n, &ends.inner));
        complete(&mut low, &[], &cut[0], &free, self.slots[0].len());
        let mut high = Vec::new();
        complete(&mut high, &low, &cut[1], &free, self.slots[1].len());
        let low = self.placed(low, 0, &cut[0]);
        let high = self.placed(high, 1, &cut[1]);
        let rows: Vec<(usize, Vec<f64>)> = low.into_iter().chain(high).collect();
        let window = |values: Vec<f64>| Window { first: self.columns.start, values };
        if bank.orthogonal {
            ends.synthesis.extend(rows.iter().map(|(m, row)| (*m, window(row.clone()))));
        } else {
            let functions = self.complement(&bank.analysis, &ends.inner, count);
            let duals = dual(&rows, &functions);
            ends.synthesis.extend(rows.iter().zip(duals).map(|((m, _), dual)| (*m, window(dual))));
        }
        ends.analysis.extend(rows.into_iter().map(|(m, row)| (m, window(row))));
    }

    /// Returns `count` orthonormal vectors, over the samples near one end of the signal, that are orthogonal to all
    /// filters of the coefficients `inner`. These coefficients lie away from the ends and use the ordinary filters
    /// `taps`.
    fn complement(&self, taps: &[Taps; 2], inner: &Range<usize>, count: usize) -> Vec<Vec<f64>> {
        let width = self.columns.len();
        let mut filters = Vec::new();
        let first = taps.iter().map(|t| t.first).min().unwrap_or(0);
        let last = taps.iter().map(Taps::last).max().unwrap_or(0);
        // Filters that overlap these columns.
        let from = (self.columns.start as i64 - last).div_euclid(2).max(inner.start as i64) as usize;
        let to = ((self.columns.end as i64 - first).div_euclid(2) + 1).clamp(0, inner.end as i64) as usize;
        for o in from..to {
            for taps in taps {
                let row = self.cut(taps, o as i64, |i| usize::try_from(i).ok());
                if row.iter().any(|&w| w != 0.0) {
                    filters.push(row);
                }
            }
        }
        let taken = greedy(filters, &[], width - count);
        let units = (0..width).map(|i| (0..width).map(|j| if i == j { 1.0 } else { 0.0 }).collect());
        greedy(units.collect(), &taken, count)
    }

    /// Returns the low-pass or high-pass analysis filters that reach beyond an end of the signal, with the positions of
    /// their coefficients. Taps beyond the end are dropped or mirrored, as the boundary rule says.
    fn cut_filters(&self, taps: &Taps, rule: Boundary, n: usize, inner: &Range<usize>) -> Vec<(i64, Vec<f64>)> {
        let (from, to) = match self.columns.start {
            0 if self.columns.len() == n => (-taps.last(), n as i64 - taps.first),
            0 => (-taps.last(), 2 * inner.start as i64),
            _ => (2 * inner.end as i64, n as i64 - taps.first),
        };
        let place = |i: i64| match rule {
            Boundary::HalfSample | Boundary::WholeSample => Some(folded(i, n, rule)),
            _ => usize::try_from(i).ok(),
        };
        (from.div_euclid(2)..=to.div_euclid(2))
            .filter(|o| !usize::try_from(*o).is_ok_and(|o| inner.contains(&o)))
            .map(|o| (o, self.cut(taps, o, place)))
            .filter(|(_, row)| row.iter().any(|&w| w != 0.0))
            .collect()
    }

    /// Returns the weights that the filter of coefficient `o` gives to the samples near one end of the signal.
    fn cut(&self, taps: &Taps, o: i64, place: impl Fn(i64) -> Option<usize>) -> Vec<f64> {
        let mut row = vec![0.0; self.columns.len()];
        for (k, w) in taps.iter() {
            if let Some(i) = place(2 * o + k)
                && self.columns.contains(&i)
            {
                row[i - self.columns.start] += w;
            }
        }
        row
    }

    /// Rotates orthonormal filters near an end of the signal within their span, so that each is as near as possible to
    /// the ordinary filter of its coefficient, cut off or mirrored at the end.
    fn placed(&self, rows: Vec<Vec<f64>>, channel: usize, cut: &[(i64, Vec<f64>)]) -> Vec<(usize, Vec<f64>)> {
        let slots = &self.slots[channel];
        let near: Vec<&(i64, Vec<f64>)> =
            cut.iter().filter(|(o, _)| usize::try_from(*o).is_ok_and(|o| slots.contains(&o))).collect();
        let mut rest: Vec<Vec<f64>> = near.iter().map(|(_, filter)| projected(filter, &rows)).collect();
        let mut placed: Vec<(usize, Vec<f64>)> = Vec::new();
        let mut basis = Vec::new();
        while let Some((pick, mut row)) = largest(&mut rest, 1e-2) {
            finish(&mut row, &basis);
            for other in &mut rest {
                take_one_away(other, &row);
            }
            basis.push(row.clone());
            placed.push((near[pick].0 as usize, row));
        }
        let missing = slots.len() - placed.len();
        let free: Vec<usize> = slots.iter().copied().filter(|o| !placed.iter().any(|(used, _)| used == o)).collect();
        placed.extend(free.into_iter().zip(greedy(rows, &basis, missing)));
        placed.sort_by_key(|(o, _)| *o);
        for (o, row) in &mut placed {
            let filter = near.iter().find(|(at, _)| *at == *o as i64).map(|(_, filter)| filter);
            // A single smooth row represents the mean: its sum is made positive, whatever the sign of the filter here.
            let sum = match filter {
                Some(filter) if channel == 1 || slots.len() > 1 => dot(row, filter),
                _ => row.iter().sum(),
            };
            if sum < 0.0 {
                scale(row, -1.0);
            }
        }
        placed.into_iter().map(|(o, row)| (2 * o + channel, row)).collect()
    }
}

/// Extends a list of orthonormal filters near an end of the signal, `rows`, to `count` vectors within the span of
/// `free`, all orthogonal to `against`.
///
/// Each step adds the candidate with the largest part outside the span of `against` and `rows`. The first candidates
/// are `cut`, the ordinary filters cut off at the end of the signal, projected to the span of `free`; then come those
/// in `free`.
fn complete(rows: &mut Vec<Vec<f64>>, against: &[Vec<f64>], cut: &[(i64, Vec<f64>)], free: &[Vec<f64>], count: usize) {
    let remainder = |rows: &[Vec<f64>], vector: &[f64]| {
        let mut rest = vector.to_vec();
        take_away(&mut rest, against);
        take_away(&mut rest, rows);
        rest
    };
    let mut rest: Vec<Vec<f64>> = cut.iter().map(|(_, filter)| remainder(rows, &projected(filter, free))).collect();
    while rows.len() < count {
        let Some((_, mut row)) = largest(&mut rest, 1e-3) else { break };
        take_away(&mut row, against);
        finish(&mut row, rows);
        for other in &mut rest {
            take_one_away(other, &row);
        }
        rows.push(row);
    }
    let missing = count - rows.len();
    let taken: Vec<Vec<f64>> = against.iter().chain(rows.iter()).cloned().collect();
    rows.extend(greedy(free.to_vec(), &taken, missing));
}

/// Returns `count` orthonormal vectors from the span of `candidates`, all orthogonal to `against`. Each step takes the
/// candidate with the largest part outside the span of `against` and of those taken before.
fn greedy(candidates: Vec<Vec<f64>>, against: &[Vec<f64>], count: usize) -> Vec<Vec<f64>> {
    let mut rest = candidates;
    for row in &mut rest {
        take_away(row, against);
    }
    let mut chosen: Vec<Vec<f64>> = Vec::with_capacity(count);
    while chosen.len() < count {
        let Some((_, mut row)) = largest(&mut rest, 0.0) else { break };
        take_away(&mut row, against);
        finish(&mut row, &chosen);
        for other in &mut rest {
            take_one_away(other, &row);
        }
        chosen.push(row);
    }
    chosen
}

/// Returns the vector of largest norm in `rest` with its index, if that norm exceeds `least`.
fn largest(rest: &mut [Vec<f64>], least: f64) -> Option<(usize, Vec<f64>)> {
    let mut best = (0, least);
    for (i, row) in rest.iter().enumerate() {
        let size = norm(row);
        if size > best.1 * (1.0 + 1e-9) {
            best = (i, size);
        }
    }
    let (at, size) = best;
    (size > least).then(|| (at, rest[at].clone()))
}

/// Makes the vector `row` orthogonal to `basis` to the last digit and normalises it.
fn finish(row: &mut [f64], basis: &[Vec<f64>]) {
    scale(row, 1.0 / norm(row));
    take_away(row, basis);
    scale(row, 1.0 / norm(row));
}

/// Returns the dual vectors of `rows` within the span of `functions`: `F·(R·F)⁻¹` for the functions F and the rows R.
fn dual(rows: &[(usize, Vec<f64>)], functions: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let n = rows.len();
    // Augmented [R·F | 1]; column j of the inverse combines the functions into the dual of row j.
    let mut matrix: Vec<Vec<f64>> = rows
        .iter()
        .enumerate()
        .map(|(r, (_, row))| {
            let products = functions.iter().map(|f| dot(row, f));
            products.chain((0..n).map(|c| if c == r { 1.0 } else { 0.0 })).collect()
        })
        .collect();
    reduce(&mut matrix);
    let width = functions.first().map_or(0, Vec::len);
    (0..n)
        .map(|j| {
            let mut sum = vec![0.0; width];
            for (function, row) in functions.iter().zip(&matrix) {
                sum.iter_mut().zip(function).for_each(|(s, f)| *s += row[n + j] * f);
            }
            sum
        })
        .collect()
}

fn projected(vector: &[f64], basis: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = vec![0.0; vector.len()];
    for b in basis {
        let c = dot(vector, b);
        sum.iter_mut().zip(b).for_each(|(s, b)| *s += c * b);
    }
    sum
}
