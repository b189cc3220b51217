//! Arithmetic between rows, and the cutting of a flat tensor into rows that fit the cache and spread over threads.
//!
//! Every kernel works element by element along the rows, so blocks, lanes and threads change no bit of a result.

use rayon::prelude::*;

/// One of the four linear maps of a transform `W`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    /// `W`: samples to coefficients.
    Forward,
    /// `W⁻¹`.
    Inverse,
    /// `Wᵀ`.
    ForwardTransposed,
    /// `W⁻ᵀ`.
    InverseTransposed,
}

/// Rows narrower than this are packed side by side into lanes of a small scratch.
const NARROW: usize = 16;
const LANES: usize = 32;
/// Samples in a block of columns: small enough for a second-level cache.
const BLOCK: usize = 1 << 16;
/// Samples below which a thread is not worth its start.
const TASK: usize = 1 << 15;

/// Runs `kernel` over every slab `[n, inner]` of `data` as `n` rows, in parallel over disjoint parts.
pub(super) fn for_rows<K>(data: &mut [f32], n: usize, inner: usize, kernel: K)
where
    K: Fn(&mut [&mut [f32]]) + Sync,
{
    let slab = n * inner;
    if slab == 0 {
        return;
    }
    if inner < NARROW {
        let pack = (LANES / inner).max(1);
        let min_len = TASK.div_ceil(pack * slab);
        data.par_chunks_mut(pack * slab)
            .with_min_len(min_len)
            .for_each_init(|| vec![0.0; n * pack * inner], |scratch, slabs| packed(slabs, n, inner, scratch, &kernel));
        return;
    }
    let width = (BLOCK / n / LANES * LANES).max(2 * LANES);
    data.par_chunks_mut(slab).with_min_len(TASK.div_ceil(slab)).for_each(|slab| {
        if inner <= width {
            let mut rows: Vec<&mut [f32]> = slab.chunks_mut(inner).collect();
            kernel(&mut rows);
            return;
        }
        let mut blocks: Vec<Vec<&mut [f32]>> = (0..inner.div_ceil(width)).map(|_| Vec::with_capacity(n)).collect();
        for row in slab.chunks_mut(inner) {
            for (block, part) in blocks.iter_mut().zip(row.chunks_mut(width)) {
                block.push(part);
            }
        }
        blocks.par_iter_mut().for_each(|rows| kernel(rows));
    });
}

/// Slabs with narrow rows: transposed into rows of lanes, transformed together, and put back.
fn packed(slabs: &mut [f32], n: usize, inner: usize, scratch: &mut [f32], kernel: &impl Fn(&mut [&mut [f32]])) {
    let slab = n * inner;
    let lanes = scratch.len() / n;
    for (k, source) in slabs.chunks_exact(slab).enumerate() {
        for (row, part) in scratch.chunks_exact_mut(lanes).zip(source.chunks_exact(inner)) {
            row[k * inner..][..inner].copy_from_slice(part);
        }
    }
    {
        let used = slabs.len() / n;
        let mut rows: Vec<&mut [f32]> = scratch.chunks_exact_mut(lanes).map(|row| &mut row[..used]).collect();
        kernel(&mut rows);
    }
    for (k, target) in slabs.chunks_exact_mut(slab).enumerate() {
        for (row, part) in scratch.chunks_exact(lanes).zip(target.chunks_exact_mut(inner)) {
            part.copy_from_slice(&row[k * inner..][..inner]);
        }
    }
}

/// `target += c·source`.
pub(super) fn axpy(target: &mut [f32], c: f32, source: &[f32]) {
    for (t, s) in target.iter_mut().zip(source) {
        *t += c * s;
    }
}

/// `target += c·(left + right)`.
pub(super) fn axpy2(target: &mut [f32], c: f32, left: &[f32], right: &[f32]) {
    for ((t, l), r) in target.iter_mut().zip(left).zip(right) {
        *t += c * (l + r);
    }
}

/// `row *= c`.
pub(super) fn scale(row: &mut [f32], c: f32) {
    for x in row {
        *x *= c;
    }
}

/// `(a, b) = (α·a + β·b, β·a − α·b)`: its own inverse and transpose when α² + β² = 1.
pub(super) fn reflect(a: &mut [f32], b: &mut [f32], alpha: f32, beta: f32) {
    for (a, b) in a.iter_mut().zip(b) {
        let (x, y) = (*a, *b);
        *a = alpha * x + beta * y;
        *b = beta * x - alpha * y;
    }
}

/// The four rows become `matrix` times them.
pub(super) fn mix(matrix: &[[f32; 4]; 4], a: &mut [f32], b: &mut [f32], c: &mut [f32], d: &mut [f32]) {
    let [m0, m1, m2, m3] = matrix;
    for (((a, b), c), d) in a.iter_mut().zip(b).zip(c).zip(d) {
        let (x, y, z, w) = (*a, *b, *c, *d);
        *a = m0[0] * x + m0[1] * y + m0[2] * z + m0[3] * w;
        *b = m1[0] * x + m1[1] * y + m1[2] * z + m1[3] * w;
        *c = m2[0] * x + m2[1] * y + m2[2] * z + m2[3] * w;
        *d = m3[0] * x + m3[1] * y + m3[2] * z + m3[3] * w;
    }
}

/// `target = Σ weight · source row`; the source rows lie one after another, each as wide as the target.
pub(super) fn combine<T>(target: &mut [f32], source: &[f32], taps: T)
where
    T: Iterator<Item = (usize, f32)> + Clone,
{
    const CHUNK: usize = 32;
    let width = target.len();
    let mut chunks = target.chunks_exact_mut(CHUNK);
    let mut at = 0;
    for chunk in &mut chunks {
        let mut sums = [0.0_f32; CHUNK];
        for (row, w) in taps.clone() {
            for (sum, x) in sums.iter_mut().zip(&source[row * width + at..][..CHUNK]) {
                *sum += w * x;
            }
        }
        chunk.copy_from_slice(&sums);
        at += CHUNK;
    }
    let rest = chunks.into_remainder();
    rest.fill(0.0);
    for (row, w) in taps {
        for (sum, x) in rest.iter_mut().zip(&source[row * width + at..]) {
            *sum += w * x;
        }
    }
}
