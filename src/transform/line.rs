//! Wavelets on a line of any length, in place: at stride s the even multiples stay smooth, the odd ones become details.
//!
//! The synthesis of a symmetric lifting scheme mirrors samples at both ends (`x[−1] = x[1]`, `x[n] = x[n − 2]`), so any
//! length is critically sampled and perfectly reconstructed (Daubechies & Sweldens 1998; ISO 15444-1 annex F).

use super::basis::{LineBasis, Parity, Scheme};
use super::rows::{Pass, axpy, axpy2, for_rows, reflect, scale};

/// One pass over the rows of a line.
pub(super) fn transform(rows: &mut [&mut [f32]], basis: LineBasis, pass: Pass) {
    let n = rows.len();
    let levels = levels(n);
    match pass {
        Pass::Forward | Pass::InverseTransposed => {
            for k in 0..levels {
                level(rows, 1 << k, basis, pass);
            }
        }
        Pass::Inverse | Pass::ForwardTransposed => {
            for k in (0..levels).rev() {
                level(rows, 1 << k, basis, pass);
            }
        }
    }
}

/// Unit vectors that are synthesised together.
const UNITS: usize = 16;

/// How many levels a line of `n` samples has until one smooth coefficient is left.
pub(super) fn levels(n: usize) -> u32 {
    n.next_power_of_two().trailing_zeros()
}

/// The norms of the synthesis functions of every index, all samples weighing the same.
pub(super) fn norms(n: usize, basis: LineBasis) -> Vec<f64> {
    if matches!(basis.table().scheme, Scheme::Pairs) {
        return vec![1.0; n];
    }
    let info = basis.info();
    let filter = info.analysis_length.max(info.synthesis_length);
    let mut norms = vec![0.0; n];
    // A synthesis function of stride 2s reaches at most (filter − 1)·s from its place; those that do not reach an end
    // are the same but for a shift, so one of them is measured for all.
    let mut measured = vec![0];
    let mut shifted: Vec<(usize, usize)> = Vec::new();
    for k in 0..levels(n) {
        let s = 1_usize << k;
        let reach = (filter - 1) * s;
        let mut inner = None;
        for place in (s..n).step_by(2 * s) {
            if place < reach || place + reach >= n {
                measured.push(place);
            } else if let Some(same) = inner {
                shifted.push((place, same));
            } else {
                inner = Some(place);
                measured.push(place);
            }
        }
    }
    let mut scratch = vec![0.0_f32; n * UNITS];
    for places in measured.chunks(UNITS) {
        scratch.fill(0.0);
        for (lane, &place) in places.iter().enumerate() {
            scratch[place * UNITS + lane] = 1.0;
        }
        for_rows(&mut scratch, n, UNITS, |rows| transform(rows, basis, Pass::Inverse));
        for (lane, &place) in places.iter().enumerate() {
            let square: f64 = scratch.iter().skip(lane).step_by(UNITS).map(|&x| f64::from(x) * f64::from(x)).sum();
            norms[place] = square.sqrt();
        }
    }
    for (place, same) in shifted {
        norms[place] = norms[same];
    }
    norms
}

fn level(rows: &mut [&mut [f32]], stride: usize, basis: LineBasis, pass: Pass) {
    match basis.table().scheme {
        Scheme::Pairs => pairs(rows, stride),
        Scheme::Lifting { steps, low } => lift(rows, stride, steps, low, pass),
    }
}

/// Unbalanced Haar: a coefficient that stands for w samples holds √w times their mean. The last one of an odd level has
/// no partner and passes unchanged. Only the last pair can be unequal.
fn pairs(rows: &mut [&mut [f32]], stride: usize) {
    let n = rows.len();
    for left in (0..n).step_by(2 * stride) {
        let right = left + stride;
        if right >= n {
            break;
        }
        let right_count = stride.min(n - right);
        let total = (stride + right_count) as f64;
        let alpha = libm::sqrt(stride as f64 / total) as f32;
        let beta = libm::sqrt(right_count as f64 / total) as f32;
        let (before, after) = rows.split_at_mut(right);
        reflect(before[left], after[0], alpha, beta);
    }
}

fn lift(rows: &mut [&mut [f32]], stride: usize, steps: &[(Parity, f32)], low: f32, pass: Pass) {
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

/// The samples of one parity at a stride, each with its left and right neighbour, mirrored at the ends.
fn places(n: usize, stride: usize, parity: Parity) -> impl Iterator<Item = (Option<usize>, usize, Option<usize>)> {
    let first = if parity == Parity::Even { 0 } else { stride };
    (first..n).step_by(2 * stride).map(move |i| (i.checked_sub(stride), i, Some(i + stride).filter(|&r| r < n)))
}

/// Each sample of `parity` gets `c` times the sum of its neighbours.
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

/// The transpose of [`gather`]: each sample of `parity` gives `c` times itself to its neighbours.
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
