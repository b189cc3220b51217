//! Conversion between rows of a tensor and planes of the representative blocks of a symmetry group.

use super::super::values::Values;
use super::shape::Shape;
use super::spectrum::Basis;
use super::symmetry::{Group, Representatives};
use crate::codec::Class;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Averages the spectra of all direction pairs that a symmetry group maps to each other. The result is `[block,
/// triangle, wavelength]`, with one block (incoming direction) for all that are equal by symmetry.
pub(super) fn fold_rows(shape: &Shape, group: &Group, representatives: &Representatives, logs: &[f32]) -> Vec<f32> {
    let (n, leaves) = (shape.length(), shape.leaves());
    if group.order() == 1 && shape.inner() == 1 {
        return logs.to_vec();
    }
    let mut folded = vec![0.0; representatives.len() * leaves * n];
    let share = 1.0 / group.order() as f64;
    folded.par_chunks_mut(leaves * n).enumerate().for_each(|(k, block)| {
        let blocks: Vec<usize> = (0..group.order()).map(|m| group.block(m, representatives.block(k))).collect();
        let mut sums = vec![0.0_f64; n];
        for (leaf, target) in block.chunks_exact_mut(n).enumerate() {
            sums.fill(0.0);
            for (m, &block) in blocks.iter().enumerate() {
                let row = shape.row(block, group.leaf(m, leaf));
                sums.iter_mut().zip(&logs[row * n..][..n]).for_each(|(sum, &x)| *sum += f64::from(x));
            }
            target.iter_mut().zip(&sums).for_each(|(x, sum)| *x = (sum * share) as f32);
        }
    });
    folded
}

/// Expands the spectral coefficients `[block, channel, triangle]` of coded blocks (incoming directions) to the
/// logarithms of all samples. A block that is not coded takes the spectra of a coded one, with triangles permuted by
/// the first symmetry that maps the coded block to the other. With `finish` the result is magnitudes, computed once for
/// equal spectra.
pub(super) fn synthesise(
    shape: &Shape,
    group: &Group,
    representatives: &Representatives,
    (basis, planes): (Option<&Basis>, &[f32]),
    finish: Option<Values>,
    logs: &mut [f32],
) {
    let (n, leaves, inner) = (shape.length(), shape.leaves(), shape.inner());
    let finish = |rows: &mut [f32]| {
        if let Some(values) = finish {
            values.finish(rows);
        }
    };
    if group.order() == 1 && inner == 1 {
        synthesise_rows(basis, leaves, planes, logs);
        return finish(logs);
    }
    let mut rows = vec![0.0; representatives.len() * leaves * n];
    synthesise_rows(basis, leaves, planes, &mut rows);
    finish(&mut rows);
    let sources = representatives.by_block(group, shape.blocks());
    logs.par_chunks_mut(inner * leaves * n).zip(sources.par_chunks(inner)).with_min_len(16).for_each(
        |(logs, sources)| {
            for (between, &(k, m)) in sources.iter().enumerate() {
                for (leaf, row) in rows[k as usize * leaves * n..][..leaves * n].chunks_exact(n).enumerate() {
                    let at = group.leaf(usize::from(m), leaf) * inner + between;
                    logs[at * n..][..n].copy_from_slice(row);
                }
            }
        },
    );
}

/// Converts spectral coefficients `[block, channel, triangle]` to spectra `[block, triangle, wavelength]`.
pub(super) fn synthesise_rows(basis: Option<&Basis>, leaves: usize, planes: &[f32], rows: &mut [f32]) {
    let Some(basis) = basis else { return rows.copy_from_slice(planes) };
    let vectors = basis.rank();
    let plane = vectors * leaves;
    let block = rows.len() / (planes.len() / plane);
    rows.par_chunks_mut(block).zip(planes.par_chunks(plane)).for_each(|(rows, planes)| {
        basis.synthesise(&transposed(planes, vectors, leaves), rows);
    });
}

/// Transposes each of several consecutive matrices of `rows × columns` to `columns × rows`.
pub(super) fn transposed(values: &[f32], rows: usize, columns: usize) -> Cow<'_, [f32]> {
    if columns == 1 || rows == 1 {
        return Cow::Borrowed(values);
    }
    let mut turned = vec![0.0; values.len()];
    let block = rows * columns;
    turned.par_chunks_mut(block).zip(values.par_chunks(block)).for_each(|(turned, values)| {
        for (i, row) in values.chunks_exact(columns).enumerate() {
            for (j, &value) in row.iter().enumerate() {
                turned[j * rows + i] = value;
            }
        }
    });
    Cow::Owned(turned)
}

/// Collects spectra of the coded incoming directions for the principal component analysis. A spectrum occurs once for
/// each incoming direction that the symmetries map to its own, itself included.
///
/// Spectra of only zero or masked samples are left out. Above `most` samples in all, evenly spaced spectra are taken.
pub(super) fn spectra(
    shape: &Shape,
    group: &Group,
    representatives: &Representatives,
    rows: &[f32],
    (live, most): (Option<&[bool]>, usize),
) -> Vec<f32> {
    let (n, leaves) = (shape.length(), shape.leaves());
    // Odd, so that every position among siblings occurs.
    let stride = (shape.rows() * n).div_ceil(most) | 1;
    let mut spectra = Vec::new();
    for k in 0..representatives.len() {
        let times = group.order() / representatives.stabiliser(k).members.len();
        for leaf in (k * leaves..(k + 1) * leaves).step_by(stride) {
            if live.is_none_or(|live| live[leaf]) {
                for _ in 0..times {
                    spectra.extend_from_slice(&rows[leaf * n..][..n]);
                }
            }
        }
    }
    if spectra.is_empty() { rows[..n].to_vec() } else { spectra }
}

/// Marks the triangles, for each coded block (incoming direction) of `range`, that represent a sample neither zero nor
/// masked. `None` if every spectrum has such a sample.
pub(super) fn live_leaves(
    shape: &Shape,
    group: &Group,
    representatives: &Representatives,
    range: Range<usize>,
    classes: Option<&[Class]>,
) -> Option<Vec<bool>> {
    let classes = classes?;
    let is_live = |class: &Class| matches!(class, Class::Positive | Class::Negative);
    let rows: Vec<bool> = classes.chunks_exact(shape.length()).map(|row| row.iter().any(is_live)).collect();
    if rows.iter().all(|&live| live) {
        return None;
    }
    let leaves = shape.leaves();
    // First leaf of each leaf's orbit, by stabiliser.
    let mut firsts: Vec<Option<Vec<u32>>> = vec![None; representatives.stabilisers().len()];
    let mut live = vec![false; range.len() * leaves];
    let mut own = vec![false; leaves];
    for (k, live) in range.zip(live.chunks_exact_mut(leaves)) {
        let stabiliser = representatives.stabiliser(k);
        let block = representatives.block(k);
        own.fill(false);
        for m in stabiliser.leaders.iter().map(|&m| usize::from(m)) {
            let block = group.block(m, block);
            for (leaf, own) in own.iter_mut().enumerate() {
                *own |= rows[shape.row(block, group.leaf(m, leaf))];
            }
        }
        if let [_] = stabiliser.members.as_slice() {
            live.copy_from_slice(&own);
            continue;
        }
        let first = |leaf| stabiliser.members.iter().map(|&m| group.leaf(usize::from(m), leaf) as u32).min();
        let firsts = firsts[usize::from(representatives.kinds()[k])]
            .get_or_insert_with(|| (0..leaves).filter_map(first).collect());
        // Liveness is collected at the first leaf of an orbit, then copied to all of them.
        for (leaf, &first) in firsts.iter().enumerate() {
            live[first as usize] |= own[leaf];
        }
        for (leaf, &first) in firsts.iter().enumerate() {
            live[leaf] = live[first as usize];
        }
    }
    Some(live)
}
