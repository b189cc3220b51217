//! Spectral basis computed from the data: the Karhunen–Loève transform of rows (principal components).
//!
//! Eigenvectors are computed by Jacobi's method in fixed cyclic order (Golub & Van Loan, *Matrix Computations*, 4th
//! ed., section 8.5). Only square roots and divisions are used, and sums have a fixed order, so that the vectors are
//! identical on every machine and number of threads.

use crate::numeric::orthogonal::{Squares, orthonormalise};
use crate::numeric::wide;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Largest number of samples of a spectrum for the full Karhunen-Loève basis. The covariance of longer spectra would
/// take gigabytes and hours.
const MAX_KLT_LENGTH: usize = 1024;

/// Number of extra vectors in subspace iteration. More of them speed up the convergence of the requested vectors.
const SPARE: usize = 8;
/// Number of rounds of subspace iteration for the principal components of spectra. Raising it takes longer and makes
/// them more exact.
const ITERATIONS: usize = 3;
/// Largest number of spectra used in each round of subspace iteration; of more, evenly spaced ones are taken. Raising
/// it takes longer and represents the data better.
const ITERATED: usize = 4096;
/// Number of spectra per partial sum of the covariance; the partial sums are then added in order.
const CHUNK: usize = 1024;
/// Number of spectra whose products are added to the covariance in one pass over the matrix, one after the other.
const AT_ONCE: usize = 8;
/// Number of samples of a spectrum whose products are added in parallel (SIMD lanes).
const LANES: usize = 8;

/// Karhunen-Loève basis (principal components) of equally long rows of data, such as spectra: their mean and the
/// directions of largest variance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Klt {
    /// Mean of all rows of data, such as the mean of all spectra.
    pub mean: Vec<f64>,
    /// Orthonormal basis vectors (principal components) by falling variance. The entry of largest magnitude of each
    /// vector is positive.
    pub vectors: Vec<Vec<f64>>,
    /// Variance of the data along each basis vector: the mean square of its coefficient.
    pub variances: Vec<f64>,
}

/// Reasons why no Karhunen-Loève basis can be computed from rows of data.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KltError {
    /// The number of samples is 0 or not a multiple of the row length.
    #[error("found {samples} samples in rows of {length}, expected one or more whole rows")]
    Shape {
        /// Number of samples in all rows of data, whose principal components were to be computed.
        samples: usize,
        /// Number of samples in each row of data, such as a spectrum.
        length: usize,
    },
    /// The rows of data have too many samples; contains the number of samples per row.
    #[error("rows of {0} samples, expected at most {MAX_KLT_LENGTH} samples for a Karhunen-Loève basis")]
    Length(usize),
    /// A sample of the data is masked (NaN) or infinite.
    #[error("sample {entry} of row {row} is not a finite number: fill masked samples first")]
    NotFinite {
        /// Index, from 0, of the row of data (such as a spectrum) that contains the masked or infinite sample.
        row: usize,
        /// Position, from 0, of the masked or infinite sample within its row of data (such as a spectrum).
        entry: usize,
    },
}

impl Klt {
    /// Computes the Karhunen-Loève basis of rows of `length` samples, with equal weights of the rows.
    pub fn of(rows: &[f32], length: usize) -> Result<Self, KltError> {
        if length > MAX_KLT_LENGTH {
            return Err(KltError::Length(length));
        }
        let mean = mean_of(rows, length)?;
        let count = (rows.len() / length) as f64;
        let width = length.next_multiple_of(LANES);
        let products = sums(rows, length, length * width, |rows, sum| add_products(rows, &mean, sum));
        let mut covariance = vec![0.0; length * length];
        for i in 0..length {
            for j in 0..=i {
                covariance[i * length + j] = products[i * width + j] / count;
                covariance[j * length + i] = covariance[i * length + j];
            }
        }
        let (mut variances, mut vectors) = eigen(covariance, length);
        let mut order: Vec<usize> = (0..length).collect();
        order.sort_by(|&a, &b| variances[b].total_cmp(&variances[a]).then(a.cmp(&b)));
        variances = order.iter().map(|&i| variances[i].max(0.0)).collect();
        vectors = order.iter().map(|&i| std::mem::take(&mut vectors[i])).collect();
        for vector in &mut vectors {
            // Entries that differ only by rounding are ties: the first of them determines the sign.
            let largest = vector.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let leading = vector.iter().find(|x| x.abs() >= largest * (1.0 - 1e-9));
            if leading.is_some_and(|&x| x < 0.0) {
                for x in vector {
                    *x = -*x;
                }
            }
        }
        Ok(Self { mean, vectors, variances })
    }

    /// Computes the first `rank` vectors of the Karhunen-Loève basis for rows of any length. It uses subspace iteration
    /// (Golub & Van Loan, section 8.2.4) that starts from rows of the data. The result is exact if the rows have no
    /// higher rank, and close if the later variances are small.
    pub fn leading(rows: &[f32], length: usize, rank: usize) -> Result<Self, KltError> {
        let mean = mean_of(rows, length)?;
        let count = rows.len() / length;
        let start = (rank + SPARE).min(length).min(count);
        let mut vectors: Vec<Vec<f64>> = (0..start)
            .map(|k| {
                let row = &rows[k * count / start * length..][..length];
                row.iter().zip(&mean).map(|(&x, m)| f64::from(x) - m).collect()
            })
            .collect();
        orthonormalise(&mut vectors, is_independent);
        let few: Vec<f32> = if count > ITERATED {
            rows.chunks_exact(length).step_by(count.div_ceil(ITERATED)).flatten().copied().collect()
        } else {
            Vec::new()
        };
        for _ in 0..ITERATIONS {
            if vectors.is_empty() {
                // All rows are equal.
                break;
            }
            vectors = covariance_times(if few.is_empty() { rows } else { &few }, &mean, &vectors);
            orthonormalise(&mut vectors, is_independent);
        }
        // The principal components within the subspace are those of the projected rows.
        let found = vectors.len();
        if found == 0 {
            let vectors = (0..rank.min(length)).map(|k| (0..length).map(|i| f64::from(u8::from(i == k))).collect());
            return Ok(Self { mean, vectors: vectors.collect(), variances: vec![0.0; rank.min(length)] });
        }
        let subspace = Self { mean, variances: vec![0.0; found], vectors };
        let within = Self::of(&subspace.forward(rows), found)?;
        let vectors: Vec<Vec<f64>> = within
            .vectors
            .iter()
            .map(|rotation| {
                let mut vector = vec![0.0; length];
                for (&share, own) in rotation.iter().zip(&subspace.vectors) {
                    vector.iter_mut().zip(own).for_each(|(x, v)| *x += share * v);
                }
                vector
            })
            .collect();
        let mut klt = Self { mean: subspace.mean, vectors, variances: within.variances };
        klt.truncate(rank);
        Ok(klt)
    }

    /// Returns the number of samples in each row that the Karhunen–Loève transform accepts, for example the number of
    /// wavelengths of a spectrum.
    pub fn length(&self) -> usize {
        self.mean.len()
    }

    /// Returns the number of basis vectors of the Karhunen–Loève transform, which is the number of coefficients of each
    /// transformed row of samples.
    pub fn rank(&self) -> usize {
        self.vectors.len()
    }

    /// Keeps only the first `rank` basis vectors, the choice of smallest mean square error.
    pub fn truncate(&mut self, rank: usize) {
        self.vectors.truncate(rank);
        self.variances.truncate(rank);
    }

    /// Returns the fraction of the total variance, 0..=1, that is lost if only the first `rank` basis vectors are kept.
    pub fn lost(&self, rank: usize) -> f64 {
        let total: f64 = self.variances.iter().sum();
        let lost: f64 = self.variances.iter().skip(rank).sum();
        if total > 0.0 { lost / total } else { 0.0 }
    }

    /// Transforms rows of [`Klt::length`] samples to rows of [`Klt::rank`] coefficients ⟨row − mean, vector⟩, computed
    /// in f64.
    ///
    /// # Panics
    /// If `rows` does not consist of whole rows.
    pub fn forward(&self, rows: &[f32]) -> Vec<f32> {
        let (n, r) = (self.length(), self.rank());
        assert!(rows.len().is_multiple_of(n), "rows of {n} samples");
        let mut coefficients = vec![0.0; rows.len() / n * r];
        if r == 0 {
            return coefficients;
        }
        let pairs = coefficients.par_chunks_mut(CHUNK * r).zip(rows.par_chunks(CHUNK * n));
        pairs.for_each(|(coefficients, rows)| {
            let mut centred = vec![0.0; n];
            for (target, row) in coefficients.chunks_exact_mut(r).zip(rows.chunks_exact(n)) {
                for ((c, &x), m) in centred.iter_mut().zip(row).zip(&self.mean) {
                    *c = f64::from(x) - m;
                }
                for (target, vector) in target.iter_mut().zip(&self.vectors) {
                    *target = vector.iter().zip(&centred).map(|(v, c)| v * c).sum::<f64>() as f32;
                }
            }
        });
        coefficients
    }

    /// Transforms rows of [`Klt::rank`] coefficients back to rows of [`Klt::length`] samples.
    ///
    /// # Panics
    /// If `coefficients` does not consist of whole rows.
    pub fn inverse(&self, coefficients: &[f32]) -> Vec<f32> {
        let (n, r) = (self.length(), self.rank());
        assert!(r > 0 && coefficients.len().is_multiple_of(r), "rows of {r} coefficients, at least one");
        let mut rows = vec![0.0; coefficients.len() / r * n];
        let pairs = rows.par_chunks_mut(CHUNK * n).zip(coefficients.par_chunks(CHUNK * r));
        pairs.for_each(|(rows, coefficients)| {
            let mut sums = vec![0.0; n];
            for (row, coefficients) in rows.chunks_exact_mut(n).zip(coefficients.chunks_exact(r)) {
                sums.copy_from_slice(&self.mean);
                for (&c, vector) in coefficients.iter().zip(&self.vectors) {
                    sums.iter_mut().zip(vector).for_each(|(s, v)| *s += f64::from(c) * v);
                }
                row.iter_mut().zip(&sums).for_each(|(x, &s)| *x = s as f32);
            }
        });
        rows
    }
}

/// Adds the outer product (row − mean)ᵀ (row − mean) of every row of data, in order, to the lower triangle of a matrix.
/// Matrix rows are padded to whole SIMD lanes; entries above the diagonal are undefined.
fn add_products(rows: &[f32], mean: &[f64], sum: &mut [f64]) {
    let n = mean.len();
    let width = n.next_multiple_of(LANES);
    let mut centred = vec![0.0; AT_ONCE * width];
    for rows in rows.chunks(AT_ONCE * n) {
        for (centred, row) in centred.chunks_exact_mut(width).zip(rows.chunks_exact(n)) {
            centred.iter_mut().zip(row).zip(mean).for_each(|((c, &x), m)| *c = f64::from(x) - m);
        }
        let centred = centred[..rows.len() / n * width].as_chunks().0;
        let (sum, lanes) = (sum.as_chunks_mut().0, width / LANES);
        wide(
            #[inline(always)]
            || {
                if centred.len() == AT_ONCE * lanes {
                    add_products_of::<AT_ONCE>(centred, lanes, sum);
                } else {
                    for row in centred.chunks_exact(lanes) {
                        add_products_of::<1>(row, lanes, sum);
                    }
                }
            },
        );
    }
}

/// Adds the outer products of `ROWS` rows of data minus their mean to a covariance matrix. Each row is padded to
/// `lanes` groups of [`LANES`] entries.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn add_products_of<const ROWS: usize>(centred: &[[f64; LANES]], lanes: usize, sum: &mut [[f64; LANES]]) {
    let rows: [&[[f64; LANES]]; ROWS] = std::array::from_fn(|k| &centred[k * lanes..][..lanes]);
    for (i, target) in sum.chunks_exact_mut(lanes).enumerate() {
        let factors = rows.map(|row| row[i / LANES][i % LANES]);
        for (j, target) in target.iter_mut().enumerate().take(i / LANES + 1) {
            let mut own = *target;
            for (row, factor) in rows.iter().zip(factors) {
                let lane = row[j];
                own = std::array::from_fn(|k| own[k] + factor * lane[k]);
            }
            *target = own;
        }
    }
}

/// Sums a function over the rows of data: chunks of fixed size in parallel, whose sums are then added in order. `add`
/// adds the rows of a chunk in order.
fn sums(rows: &[f32], length: usize, size: usize, add: impl Fn(&[f32], &mut [f64]) + Sync) -> Vec<f64> {
    let mut total = vec![0.0; size];
    // A few chunks at a time, to bound the memory of their sums.
    for group in rows.chunks(16 * CHUNK * length) {
        let parts: Vec<Vec<f64>> = group
            .par_chunks(CHUNK * length)
            .map(|chunk| {
                let mut sum = vec![0.0; size];
                add(chunk, &mut sum);
                sum
            })
            .collect();
        for part in parts {
            total.iter_mut().zip(part).for_each(|(t, p)| *t += p);
        }
    }
    total
}

/// Returns eigenvalues and eigenvectors (as rows) of a symmetric n × n matrix.
fn eigen(mut a: Vec<f64>, n: usize) -> (Vec<f64>, Vec<Vec<f64>>) {
    let mut vectors: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
    let size: f64 = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    // Quadratic convergence: six to ten sweeps in practice.
    for _ in 0..40 {
        let off: f64 = (0..n).map(|i| a[i * n..][..i].iter().map(|x| x * x).sum::<f64>()).sum();
        if off.sqrt() <= 1e-15 * size {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                let apq = a[p * n + q];
                if apq.abs() <= 1e-18 * size {
                    continue;
                }
                // The smaller of the two rotations that make a[p][q] zero.
                let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                let (above, below) = a.split_at_mut(q * n);
                rotate(&mut above[p * n..][..n], &mut below[..n], c, s);
                for row in a.chunks_exact_mut(n) {
                    let (x, y) = (row[p], row[q]);
                    row[p] = c * x - s * y;
                    row[q] = s * x + c * y;
                }
                let (above, below) = vectors.split_at_mut(q);
                rotate(&mut above[p], &mut below[0], c, s);
            }
        }
    }
    ((0..n).map(|i| a[i * n + i]).collect(), vectors)
}

/// Returns the mean row: for each position in a row, the mean over all rows. Fails unless `rows` consists of whole rows
/// of `length` finite numbers.
fn mean_of(rows: &[f32], length: usize) -> Result<Vec<f64>, KltError> {
    if length == 0 || rows.is_empty() || !rows.len().is_multiple_of(length) {
        return Err(KltError::Shape { samples: rows.len(), length });
    }
    if let Some(at) = rows.iter().position(|x| !x.is_finite()) {
        return Err(KltError::NotFinite { row: at / length, entry: at % length });
    }
    let count = (rows.len() / length) as f64;
    let mut mean = sums(rows, length, length, |rows, sum| {
        wide(
            #[inline(always)]
            || {
                for row in rows.chunks_exact(length) {
                    sum.iter_mut().zip(row).for_each(|(s, &x)| *s += f64::from(x));
                }
            },
        );
    });
    for m in &mut mean {
        *m /= count;
    }
    Ok(mean)
}

/// Returns true if a vector is linearly independent of earlier vectors: orthogonalisation must leave more than rounding
/// error.
fn is_independent(squares: Squares) -> bool {
    squares.after.sqrt() > 1e-9 * squares.before.sqrt()
}

/// Returns the covariance matrix of `rows` times each vector, up to a common factor.
fn covariance_times(rows: &[f32], mean: &[f64], vectors: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (n, k) = (mean.len(), vectors.len());
    let mut columns = vec![0.0; n * k];
    for (j, vector) in vectors.iter().enumerate() {
        for (i, &x) in vector.iter().enumerate() {
            columns[i * k + j] = x;
        }
    }
    let product = sums(rows, n, n * k, |rows, sum| {
        let mut along = vec![0.0; k];
        wide(
            #[inline(always)]
            || {
                for row in rows.chunks_exact(n) {
                    along.fill(0.0);
                    for ((&x, m), column) in row.iter().zip(mean).zip(columns.chunks_exact(k)) {
                        let x = f64::from(x) - m;
                        along.iter_mut().zip(column).for_each(|(a, c)| *a += x * c);
                    }
                    for ((&x, m), sum) in row.iter().zip(mean).zip(sum.chunks_exact_mut(k)) {
                        let x = f64::from(x) - m;
                        sum.iter_mut().zip(&along).for_each(|(s, a)| *s += x * a);
                    }
                }
            },
        );
    });
    (0..k).map(|j| (0..n).map(|i| product[i * k + j]).collect()).collect()
}

fn rotate(p: &mut [f64], q: &mut [f64], c: f64, s: f64) {
    for (x, y) in p.iter_mut().zip(q) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns test rows that are linear combinations of three functions plus little noise.
    fn rows(count: usize, n: usize) -> Vec<f32> {
        let mut state = 7_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / 8_388_608.0 - 1.0
        };
        let mut rows = Vec::new();
        for _ in 0..count {
            let (a, b, c) = (noise(), noise(), noise());
            for i in 0..n {
                let t = i as f64 / n as f64;
                rows.push((5.0 + a * t + 0.3 * b * t * t + 0.1 * c * (1.0 - t) * t + 1e-3 * noise()) as f32);
            }
        }
        rows
    }

    #[test]
    fn vectors_are_orthonormal_and_coefficients_uncorrelated() {
        for n in [1, 2, 7, 75] {
            let rows = rows(500, n);
            let klt = Klt::of(&rows, n).unwrap();
            assert_eq!((klt.length(), klt.rank()), (n, n));
            for (i, a) in klt.vectors.iter().enumerate() {
                for (j, b) in klt.vectors.iter().enumerate() {
                    let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                    assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-12);
                }
            }
            assert!(klt.variances.is_sorted_by(|a, b| a >= b));
            let coefficients = klt.forward(&rows);
            for i in 0..n {
                for j in 0..=i {
                    let product: f64 =
                        coefficients.chunks(n).map(|row| f64::from(row[i]) * f64::from(row[j])).sum::<f64>() / 500.0;
                    let expected = if i == j { klt.variances[i] } else { 0.0 };
                    assert!((product - expected).abs() < 1e-6 * klt.variances[0], "{i} {j}: {product} {expected}");
                }
            }
        }
    }

    #[test]
    fn all_vectors_reconstruct_and_few_lose_what_they_say() {
        let rows = rows(300, 33);
        let mut klt = Klt::of(&rows, 33).unwrap();
        let error = |klt: &Klt| -> f64 {
            let back = klt.inverse(&klt.forward(&rows));
            rows.iter().zip(&back).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / 300.0
        };
        assert!(error(&klt) < 1e-10);
        let total: f64 = klt.variances.iter().sum();
        let lost = klt.lost(3) * total;
        assert!(klt.lost(3) < 1e-3 && klt.lost(0) == 1.0);
        klt.truncate(3);
        assert!((error(&klt) - lost).abs() < 1e-3 * lost, "{} {lost}", error(&klt));
    }

    #[test]
    fn largest_entries_are_positive_and_threads_change_no_bit() {
        let rows = rows(5000, 20);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Klt::of(&rows, 20).unwrap())
        };
        let klt = on(1);
        assert_eq!(klt, on(3));
        for vector in &klt.vectors {
            assert!(vector.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap() > 0.0);
        }
    }

    #[test]
    fn leading_vectors_are_those_of_the_whole_basis() {
        for (count, n) in [(500, 75), (5000, 20), (40, 300)] {
            let rows = rows(count, n);
            let whole = Klt::of(&rows, n).unwrap();
            let leading = Klt::leading(&rows, n, 3).unwrap();
            assert_eq!((leading.length(), leading.rank()), (n, 3));
            // The third component hardly exceeds the noise, so its direction is poorly determined.
            for (k, tolerance) in [(0, 1e-6), (1, 1e-6), (2, 0.2)] {
                let product: f64 = whole.vectors[k].iter().zip(&leading.vectors[k]).map(|(a, b)| a * b).sum();
                assert!(k == 2 || product.abs() > 1.0 - tolerance, "{count} {n} {k}: {product}");
                assert!((leading.variances[k] / whole.variances[k] - 1.0).abs() < tolerance);
            }
        }
        let equal = Klt::leading(&[1.0, 2.0, 3.0, 1.0, 2.0, 3.0], 3, 2).unwrap();
        assert_eq!((equal.rank(), equal.variances.as_slice()), (2, [0.0; 2].as_slice()));
    }

    #[test]
    fn equal_rows_have_no_variance() {
        let klt = Klt::of(&[1.0, 2.0, 3.0, 1.0, 2.0, 3.0], 3).unwrap();
        assert_eq!(klt.mean, [1.0, 2.0, 3.0]);
        assert_eq!((klt.variances.as_slice(), klt.lost(0)), ([0.0; 3].as_slice(), 0.0));
        assert_eq!(klt.inverse(&klt.forward(&[4.0, 5.0, 6.0])), [4.0, 5.0, 6.0]);
    }

    #[test]
    fn what_has_no_basis_is_refused() {
        assert_eq!(Klt::of(&[1.0; 5], 3), Err(KltError::Shape { samples: 5, length: 3 }));
        assert_eq!(Klt::of(&[], 3), Err(KltError::Shape { samples: 0, length: 3 }));
        assert_eq!(Klt::of(&[1.0; 4000], 2000), Err(KltError::Length(2000)));
        assert_eq!(Klt::of(&[1.0, 2.0, 3.0, f32::NAN], 2), Err(KltError::NotFinite { row: 1, entry: 1 }));
    }
}
