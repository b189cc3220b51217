//! Arithmetic between rows, and the division of a flat tensor into blocks of rows that fit the cache and are processed
//! in parallel.
//!
//! Every kernel works element by element along the rows, so blocks, lanes and threads do not change any bit of a
//! result.

use rayon::prelude::*;

/// Linear map that belongs to a wavelet transform `W`: the transform, its inverse, or the transpose of either.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    /// Forward transform `W`: samples to coefficients.
    Forward,
    /// Inverse transform `W⁻¹`: coefficients to samples.
    Inverse,
    /// Transpose `Wᵀ` of the forward wavelet transform `W`.
    ForwardTransposed,
    /// Transpose `W⁻ᵀ` of the inverse `W⁻¹` of the wavelet transform `W`.
    InverseTransposed,
}

/// Number of samples below which a row (all samples with one index of the transformed axis, contiguous in memory)
/// counts as narrow. Narrow rows are packed side by side into a scratch buffer, to fill the SIMD lanes.
const NARROW: usize = 16;
const LANES: usize = 32;
/// Number of samples in a block of columns of a large array, chosen to fit the second-level cache.
const BLOCK: usize = 1 << 16;
/// Smallest number of samples per parallel task of a transform; smaller tasks cost more to start than they save.
const TASK: usize = 1 << 15;

/// Runs `kernel` over every block `[n, inner]` of `data` as `n` rows, in parallel over disjoint parts.
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
    // A slab that fits the second-level cache stays whole; larger ones are split into blocks of whole cache lines.
    let width = if slab <= 2 * BLOCK { inner } else { (BLOCK / n / LANES * LANES).max(2 * LANES) };
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

/// Applies one step of a transform, `kernel`, to blocks whose rows have fewer than [`NARROW`] samples. Rows of several
/// blocks are packed side by side, processed together and copied back.
fn packed(slabs: &mut [f32], n: usize, inner: usize, scratch: &mut [f32], kernel: &impl Fn(&mut [&mut [f32]])) {
    let lanes = scratch.len() / n;
    let used = slabs.len() / n;
    if inner == 1 {
        transpose(slabs, n, scratch, lanes);
    } else {
        for (k, source) in slabs.chunks_exact(n * inner).enumerate() {
            for (row, part) in scratch.chunks_exact_mut(lanes).zip(source.chunks_exact(inner)) {
                row[k * inner..][..inner].copy_from_slice(part);
            }
        }
    }
    {
        let mut rows: Vec<&mut [f32]> = scratch.chunks_exact_mut(lanes).map(|row| &mut row[..used]).collect();
        kernel(&mut rows);
    }
    if inner == 1 {
        transpose_back(scratch, lanes, slabs, n);
    } else {
        for (k, target) in slabs.chunks_exact_mut(n * inner).enumerate() {
            for (row, part) in scratch.chunks_exact(lanes).zip(target.chunks_exact_mut(inner)) {
                part.copy_from_slice(&row[k * inner..][..inner]);
            }
        }
    }
}

/// Edge length, in samples, of the square tiles in which a matrix is transposed.
const SQUARE: usize = 4;

/// Transposes rows of `source`, of length `n`, to columns of `target`, whose rows have `lanes` entries.
fn transpose(source: &[f32], n: usize, target: &mut [f32], lanes: usize) {
    let groups = source.chunks(SQUARE * n);
    for (g, group) in groups.enumerate() {
        let full = if group.len() == SQUARE * n { n / SQUARE * SQUARE } else { 0 };
        for j in (0..full).step_by(SQUARE) {
            let square = [0, 1, 2, 3].map(|k| four(group, k * n + j));
            for (l, column) in turned(square).iter().enumerate() {
                target[(j + l) * lanes + g * SQUARE..][..SQUARE].copy_from_slice(column);
            }
        }
        for (k, row) in group.chunks_exact(n).enumerate() {
            for (j, &x) in row.iter().enumerate().skip(full) {
                target[j * lanes + g * SQUARE + k] = x;
            }
        }
    }
}

/// Transposes columns of `source`, whose rows have `lanes` entries, to rows of `target`, of length `n`.
fn transpose_back(source: &[f32], lanes: usize, target: &mut [f32], n: usize) {
    for (g, group) in target.chunks_mut(SQUARE * n).enumerate() {
        let full = if group.len() == SQUARE * n { n / SQUARE * SQUARE } else { 0 };
        for j in (0..full).step_by(SQUARE) {
            let square = [0, 1, 2, 3].map(|l| four(source, (j + l) * lanes + g * SQUARE));
            for (k, row) in turned(square).iter().enumerate() {
                group[k * n + j..][..SQUARE].copy_from_slice(row);
            }
        }
        for (k, row) in group.chunks_exact_mut(n).enumerate() {
            for (j, x) in row.iter_mut().enumerate().skip(full) {
                *x = source[j * lanes + g * SQUARE + k];
            }
        }
    }
}

fn four(values: &[f32], at: usize) -> [f32; SQUARE] {
    let v = &values[at..][..SQUARE];
    [v[0], v[1], v[2], v[3]]
}

fn turned(s: [[f32; SQUARE]; SQUARE]) -> [[f32; SQUARE]; SQUARE] {
    [0, 1, 2, 3].map(|j| [s[0][j], s[1][j], s[2][j], s[3][j]])
}

/// Computes `target += c·source`, entry by entry.
pub(super) fn axpy(target: &mut [f32], c: f32, source: &[f32]) {
    for (t, s) in target.iter_mut().zip(source) {
        *t += c * s;
    }
}

/// Computes `target += c·(left + right)`, entry by entry.
pub(super) fn axpy2(target: &mut [f32], c: f32, left: &[f32], right: &[f32]) {
    for ((t, l), r) in target.iter_mut().zip(left).zip(right) {
        *t += c * (l + r);
    }
}

/// Computes `row *= c`, entry by entry.
pub(super) fn scale(row: &mut [f32], c: f32) {
    for x in row {
        *x *= c;
    }
}

/// Computes `(a, b) = (α·a + β·b, β·a − α·b)` entry by entry, which is its own inverse and transpose if α² + β² = 1.
pub(super) fn reflect(a: &mut [f32], b: &mut [f32], alpha: f32, beta: f32) {
    for (a, b) in a.iter_mut().zip(b) {
        let (x, y) = (*a, *b);
        *a = alpha * x + beta * y;
        *b = beta * x - alpha * y;
    }
}

/// Multiplies four rows, entry by entry, by the reflection `H` that maps (1, 1, 1, 1) / 2 to the first unit vector. `H`
/// is its own inverse and transpose.
pub(super) fn reflect_four(a: &mut [f32], b: &mut [f32], c: &mut [f32], d: &mut [f32]) {
    for (((a, b), c), d) in a.iter_mut().zip(b).zip(c).zip(d) {
        let t = 0.5 * ((*b + *c) + (*d - *a));
        *a += t;
        *b -= t;
        *c -= t;
        *d -= t;
    }
}

/// Replaces the first of four rows of samples, entry by entry, by the mean of the four with the weights `w`, and the
/// other three by their differences from that mean.
pub(super) fn mean_and_rest(w: [f32; 4], a: &mut [f32], b: &mut [f32], c: &mut [f32], d: &mut [f32]) {
    for (((a, b), c), d) in a.iter_mut().zip(b).zip(c).zip(d) {
        let mean = (w[0] * *a + w[1] * *b) + (w[2] * *c + w[3] * *d);
        *a = mean;
        *b -= mean;
        *c -= mean;
        *d -= mean;
    }
}

/// Restores four rows of samples from their weighted mean and three differences, the inverse of [`mean_and_rest`]. `w`
/// are the weights of the last three rows in the mean divided by the weight of the first.
pub(super) fn from_mean_and_rest(w: [f32; 3], a: &mut [f32], b: &mut [f32], c: &mut [f32], d: &mut [f32]) {
    for (((a, b), c), d) in a.iter_mut().zip(b).zip(c).zip(d) {
        let mean = *a;
        *a = mean - (w[0] * *b + (w[1] * *c + w[2] * *d));
        *b += mean;
        *c += mean;
        *d += mean;
    }
}

/// Multiplies four rows of equal length by a 4 × 4 `matrix` in place: at each position, it transforms the vector of
/// their four entries.
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

/// Computes the weighted sum of rows `target = Σ weight · source row`; the source rows are contiguous, each as wide as
/// the target.
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
