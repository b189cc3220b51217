//! One level of a line transform as matrices: analysis, synthesis and their transposes, for every basis, boundary rule
//! and length.
//!
//! Rows and columns are interleaved: coefficient m is smooth for even m and a detail for odd m. Banks whose filters do
//! not reconstruct perfectly (`dmey`, the quadrature mirror filter, truncated splines) are nevertheless inverted
//! exactly. Their synthesis is the inverse of the analysis matrix, computed by iterative refinement to 1e-13 that
//! starts from the synthesis filters.

use super::banded::{Banded, Window};
use super::boundary::{Boundary, folded};
use super::ends::{Ends, Sequence, fitted};
use super::filters::{Bank, PERFECT, Taps};

/// Matrices of one wavelet level: analysis, synthesis and their transposes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level {
    /// Analysis matrix: row m contains the weights of the samples in coefficient m.
    pub(super) analysis: Banded,
    pub(super) analysis_transposed: Banded,
    /// Synthesis matrix: row i contains the weights of the coefficients in sample i.
    pub(super) synthesis: Banded,
    /// Transposed synthesis matrix: row m contains the synthesis function of coefficient m.
    pub(super) synthesis_transposed: Banded,
}

/// Computes the matrices of all wavelet levels of a signal of `n` samples, finest first, but at most `limit` levels.
pub(super) fn levels(
    bank: &Bank,
    own: Boundary,
    boundary: Boundary,
    moments: usize,
    n: usize,
    limit: u32,
) -> Vec<Level> {
    let mut levels = Vec::new();
    let mut rule = boundary;
    let mut sequence = Sequence::new(n);
    while sequence.len() > 1 && (levels.len() as u32) < limit {
        let n = sequence.len();
        if rule == Boundary::Periodic && n % 2 == 1 {
            rule = own;
        }
        let level = if rule == Boundary::Periodic || Some(rule) == bank.symmetry {
            sequence.pass_regular();
            Level::extended(bank, rule, n)
        } else {
            let kept = match rule {
                Boundary::Fitted => moments.min(4),
                Boundary::Zero => 0,
                _ => moments.min(1),
            };
            let ends = fitted(bank, rule, kept, &mut sequence);
            Level::completed(bank, &ends, n)
        };
        levels.push(level);
    }
    levels
}

/// Computes the matrices of all levels of the unbalanced Haar transform (Girardi & Sweldens 1997), in which a smooth
/// coefficient of w samples is √w times their mean.
pub(super) fn unbalanced(length: usize, limit: u32) -> Vec<Level> {
    let mut levels = Vec::new();
    let (mut n, mut stride) = (length, 1);
    while n > 1 && (levels.len() as u32) < limit {
        let half = 0.5_f64.sqrt();
        let reflection = |parity: usize, alpha: f64, beta: f64| match parity {
            0 => vec![(0, alpha), (1, beta)],
            _ => vec![(-1, beta), (0, -alpha)],
        };
        let stencils = [reflection(0, half, half), reflection(1, half, half)];
        let edge = |m: usize| {
            let pair = m - m % 2;
            if pair + 1 == n {
                return vec![(m, 1.0)];
            }
            let (alpha, beta) = pair_weights(pair * stride, stride, length);
            let row = reflection(m % 2, alpha, beta);
            row.into_iter().map(|(offset, w)| ((m as i64 + offset) as usize, w)).collect()
        };
        let matrix = Banded::new(n, (0, (n - 1) / 2 * 2), stencils, edge);
        let transposed = matrix.transposed();
        levels.push(Level {
            analysis: matrix.clone(),
            analysis_transposed: transposed.clone(),
            synthesis: transposed,
            synthesis_transposed: matrix,
        });
        n = n.div_ceil(2);
        stride *= 2;
    }
    levels
}

/// Returns the weights `(α, β)` of the Haar reflection of two values `stride` samples apart, the left one of which lies
/// at sample `left`.
pub(super) fn pair_weights(left: usize, stride: usize, length: usize) -> (f64, f64) {
    let right_count = stride.min(length - left - stride);
    let total = (stride + right_count) as f64;
    ((stride as f64 / total).sqrt(), (right_count as f64 / total).sqrt())
}

impl Level {
    /// Computes the analysis and synthesis matrices of one wavelet level for a signal that is continued beyond its
    /// ends: periodically, or by the symmetric extension that suits the filters.
    fn extended(bank: &Bank, rule: Boundary, n: usize) -> Self {
        let analysis = {
            let edge = |m: usize| {
                let taps = &bank.analysis[m % 2];
                let start = (m - m % 2) as i64;
                gathered(taps.iter().map(|(k, w)| (folded(start + k, n, rule), w)))
            };
            Banded::new(n, (0, n), rows(&bank.analysis), edge)
        };
        let synthesis = {
            let edge = |i: usize| {
                let i = i as i64;
                let mut entries = Vec::new();
                for (parity, taps) in bank.synthesis.iter().enumerate() {
                    // Coefficients o that satisfy first ≤ i − 2o ≤ last.
                    for o in (i - taps.last()).div_euclid(2)..=(i - taps.first).div_euclid(2) {
                        let w = taps.at(i - 2 * o);
                        if let Some((m, sign)) = coefficient(o, parity, n, rule) {
                            entries.push((m, sign * w));
                        }
                    }
                }
                gathered(entries.into_iter())
            };
            Banded::new(n, (0, n), columns(&bank.synthesis), edge)
        };
        Self::of(analysis, synthesis.transposed(), synthesis, bank)
    }

    /// Computes the analysis and synthesis matrices of one wavelet level with unmodified filters inside the signal and
    /// the special filters `ends` near its ends.
    fn completed(bank: &Bank, ends: &Ends, n: usize) -> Self {
        let inner = (2 * ends.inner.start, 2 * ends.inner.end);
        let pick = |rows: &[(usize, Window)], m: usize| -> Vec<(usize, f64)> {
            let row = rows.iter().find(|(at, _)| *at == m).map(|(_, row)| row.iter().collect());
            row.unwrap_or_default()
        };
        let outside = |taps: &[Taps; 2], rows: &[(usize, Window)], m: usize| {
            if (inner.0..inner.1).contains(&m) {
                let start = (m - m % 2) as i64;
                taps[m % 2].iter().map(|(k, w)| ((start + k) as usize, w)).collect()
            } else {
                pick(rows, m)
            }
        };
        let analysis = Banded::new(n, inner, rows(&bank.analysis), |m| outside(&bank.analysis, &ends.analysis, m));
        let dual = Banded::new(n, inner, rows(&bank.synthesis), |m| outside(&bank.synthesis, &ends.synthesis, m));
        let synthesis = dual.transposed();
        Self::of(analysis, dual, synthesis, bank)
    }

    fn of(analysis: Banded, dual: Banded, synthesis: Banded, bank: &Bank) -> Self {
        let (dual, synthesis) = if bank.error > PERFECT {
            let dual = inverted(&analysis, &dual);
            let synthesis = dual.transposed();
            (dual, synthesis)
        } else {
            (dual, synthesis)
        };
        Self { analysis_transposed: analysis.transposed(), analysis, synthesis, synthesis_transposed: dual }
    }
}

/// Computes the transposed inverse of the matrix `analysis` by iterative refinement of the approximation `dual`.
fn inverted(analysis: &Banded, dual: &Banded) -> Banded {
    let n = analysis.len();
    let transposed = analysis.transposed();
    // Row m of A⁻ᵀ solves A·x = e, by x ← x + S(e − A·x). A row computed from inner rows alone repeats.
    let solve = |m: usize| -> (Window, bool) {
        let unit = Window::unit(m);
        let (mut x, mut inner) = unit.through(dual, |j| j);
        for _ in 0..60 {
            let (image, a) = x.through(&transposed, |j| j);
            let rest = unit.plus(-1.0, &image).trimmed(1e-14);
            inner &= a;
            if rest.largest() < 1e-13 {
                break;
            }
            let (step, b) = rest.through(dual, |j| j);
            x = x.plus(1.0, &step).trimmed(1e-15);
            inner &= b;
        }
        (x, inner)
    };
    let entries = |x: &Window| -> Vec<(usize, f64)> { x.iter().filter(|(_, w)| *w != 0.0).collect() };
    let mut head = Vec::new();
    let mut stencils = [Vec::new(), Vec::new()];
    while head.len() < n {
        let m = head.len();
        let (even, even_inner) = solve(m);
        if even_inner && m + 1 < n {
            let (odd, odd_inner) = solve(m + 1);
            if odd_inner {
                for (parity, x) in [even, odd].iter().enumerate() {
                    let row = (m + parity) as i64;
                    stencils[parity] = entries(x).into_iter().map(|(c, w)| (c as i64 - row, w)).collect();
                }
                break;
            }
        }
        head.push(entries(&even));
        if m + 1 < n {
            head.push(entries(&solve(m + 1).0));
        }
    }
    let start = head.len();
    let mut tail = Vec::new();
    while n - tail.len() > start {
        let (x, inner) = solve(n - tail.len() - 1);
        if inner {
            break;
        }
        tail.push(entries(&x));
    }
    let end = n - tail.len();
    let edge = |m: usize| {
        if m < start {
            head[m].clone()
        } else if m >= end {
            tail[n - 1 - m].clone()
        } else {
            entries(&solve(m).0)
        }
    };
    Banded::new(n, (start, end), stencils, edge)
}

/// Returns the repeating rows of an analysis matrix (weights of samples in coefficients), as pairs of (column − row,
/// weight).
fn rows(taps: &[Taps; 2]) -> [Vec<(i64, f64)>; 2] {
    let relative = |parity: usize| {
        let entries = taps[parity].iter().map(|(k, w)| (k - parity as i64, w));
        entries.filter(|(_, w)| *w != 0.0).collect()
    };
    [relative(0), relative(1)]
}

/// Returns the repeating rows of a synthesis matrix (weights of coefficients in samples), as pairs of (column − row,
/// weight).
fn columns(taps: &[Taps; 2]) -> [Vec<(i64, f64)>; 2] {
    let mut stencils = [Vec::new(), Vec::new()];
    for (parity, taps) in taps.iter().enumerate() {
        for (k, w) in taps.iter().filter(|(_, w)| *w != 0.0) {
            // Weight of coefficient 2o + parity in sample 2o + k.
            stencils[k.rem_euclid(2) as usize].push((parity as i64 - k, w));
        }
    }
    for stencil in &mut stencils {
        stencil.sort_by_key(|&(offset, _)| offset);
    }
    stencils
}

/// Returns the position and sign of the stored wavelet coefficient that equals coefficient `o` of the signal as
/// extended beyond its ends; `None` if that is 0. Smooth and detail coefficients (`parity` 0 and 1) alternate in
/// storage.
fn coefficient(o: i64, parity: usize, n: usize, rule: Boundary) -> Option<(usize, f64)> {
    let at = 2 * o + parity as i64;
    match rule {
        Boundary::HalfSample => {
            // Smooth coefficients are half-sample symmetric, details antisymmetric: o ↔ −1 − o, o ↔ n − 1 − o.
            let o = o.rem_euclid(n as i64);
            let count = if parity == 0 { n.div_ceil(2) } else { n / 2 } as i64;
            if o < count {
                return Some((2 * o as usize + parity, 1.0));
            }
            let mirrored = n as i64 - 1 - o;
            let sign = if parity == 0 { 1.0 } else { -1.0 };
            (mirrored < count).then_some((2 * mirrored as usize + parity, sign))
        }
        // Interleaved coefficients are mirrored like the samples.
        _ => Some((folded(at, n, rule), 1.0)),
    }
}

/// Sums matrix entries of the same column and returns the sums by rising column.
fn gathered(entries: impl Iterator<Item = (usize, f64)>) -> Vec<(usize, f64)> {
    let mut entries: Vec<_> = entries.collect();
    entries.sort_by_key(|&(column, _)| column);
    let mut sums: Vec<(usize, f64)> = Vec::with_capacity(entries.len());
    for (column, w) in entries {
        match sums.last_mut() {
            Some((last, sum)) if *last == column => *sum += w,
            _ => sums.push((column, w)),
        }
    }
    sums.retain(|(_, w)| *w != 0.0);
    sums
}
