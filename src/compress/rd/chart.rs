//! A smooth model of scattering in coordinates that follow the lobe, fitted to each plane: the pyramid codes what it misses.
//!
//! A gloss lobe moves with the incoming direction, but in the coordinates of the half vector h it stays (Rusinkiewicz 1998,
//! *A new change of variables for efficient BRDF representation*). The model is linear in products of cubic B-splines:
//! * isotropic: of the angle between h and the normal, of that between wi and h, of wo's and of that between wi and wo;
//! * anisotropic: of h's two tangential coordinates and of the angle between wi and h;
//! * zonal: of the angle between wi and wo alone, for phase functions.
//!
//! The columns are made orthonormal on the coded rows (Cholesky's factor of their Gram matrix, f64, in order), so that the
//! pyramid's step serves their coefficients too. Square roots and divisions only: the same columns on any machine.

use super::shape::Shape;
use super::symmetry::Representatives;
use crate::codec::{BitCoder, DetailCoder, Surroundings};
use crate::domain::vector::{Vector, add, dot, unit};
use crate::domain::{Axis, Direction, Domain};
use rayon::prelude::*;
use std::ops::Range;

/// Which coordinates a model has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum ChartKind {
    /// Half-vector coordinates of an isotropic surface.
    Isotropic = 1,
    /// Half-vector coordinates with the tangent frame.
    Anisotropic = 2,
    /// The angle of scattering.
    Zonal = 3,
}

impl ChartKind {
    pub(crate) const ALL: [Self; 3] = [Self::Isotropic, Self::Anisotropic, Self::Zonal];

    pub(crate) fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == code)
    }
}

/// Cubic splines that are not zero at a place.
const RUN: usize = 4;
/// Runs of columns of a row that are not zero, at most.
const MOST_RUNS: usize = 16;
/// Rows on which the columns are made orthonormal: few, because a decoder does it, too.
const GRAM_ROWS: usize = 1 << 12;
/// Rows to which the model is fitted.
const FITTED_ROWS: usize = 1 << 16;
/// A column with less than this part of its square left by those before it is left out.
const INDEPENDENT: f64 = 1e-4;
/// Coefficients round down from here.
const ROUNDING: f64 = 0.4;
/// Quantised coefficients stay below this.
const LARGEST: f64 = (1 << 24) as f64;
/// Blocks that have a constant of their own.
const MOST_CONSTANTS: usize = 64;

/// A model on the rows of a shape.
pub(crate) struct Chart {
    kind: ChartKind,
    constants: usize,
    incoming: Vec<Vector>,
    outgoing: Vec<Vector>,
    columns: usize,
    factor: Factor,
    /// Of the rows the model is fitted to; an encoder's.
    fitted: Option<Factor>,
}

/// Cholesky's factor of the Gram matrix of columns: row-major lower triangle, with rows of zeros for columns left out.
struct Factor {
    n: usize,
    lower: Vec<f64>,
}

impl Factor {
    /// Of a Gram matrix; columns that depend on those before them are left out, and those that `keep` does not want.
    fn new(n: usize, gram: &[f64], keep: impl Fn(usize) -> bool) -> Self {
        let (mut lower, mut columns) = (vec![0.0; n * n], vec![0.0; n * n]);
        let mut sums = vec![0.0; n];
        for i in (0..n).filter(|&i| keep(i)) {
            let row = &mut lower[i * n..][..n];
            // Σ_k L_ik · L_jk of all j at once, in the order of k.
            sums.fill(0.0);
            for k in 0..i {
                let column = &columns[k * n..][..i];
                if columns[k * n + k] > 0.0 {
                    let own = (gram[i * n + k] - sums[k]) / columns[k * n + k];
                    row[k] = own;
                    if own != 0.0 {
                        sums[k + 1..i].iter_mut().zip(&column[k + 1..]).for_each(|(sum, other)| *sum += own * other);
                    }
                }
            }
            let own = gram[i * n + i];
            let left = own - row[..i].iter().map(|a| a * a).sum::<f64>();
            if left > INDEPENDENT * own {
                row[i] = left.sqrt();
                (0..=i).for_each(|k| columns[k * n + i] = row[k]);
            } else {
                row.fill(0.0);
            }
        }
        Self { n, lower }
    }

    fn keeps(&self, column: usize) -> bool {
        self.lower[column * self.n + column] > 0.0
    }

    /// L⁻¹ x, in place.
    fn solve(&self, x: &mut [f64]) {
        for i in 0..self.n {
            let row = &self.lower[i * self.n..][..self.n];
            let product: f64 = row[..i].iter().zip(&*x).map(|(l, x)| l * x).sum();
            x[i] = if row[i] > 0.0 { (x[i] - product) / row[i] } else { 0.0 };
        }
    }

    /// L⁻ᵀ x, in place.
    fn solve_transposed(&self, x: &mut [f64]) {
        for i in (0..self.n).rev() {
            let row = &self.lower[i * self.n..][..self.n];
            x[i] = if row[i] > 0.0 { x[i] / row[i] } else { 0.0 };
            let own = x[i];
            x.iter_mut().zip(&row[..i]).for_each(|(x, l)| *x -= l * own);
        }
    }

    /// Lᵀ x, in place.
    fn multiply_transposed(&self, x: &mut [f64]) {
        for j in 0..self.n {
            x[j] = (j..self.n).map(|i| self.lower[i * self.n + j] * x[i]).sum();
        }
    }
}

/// One row's columns that are not zero, in ascending order: a constant, then runs of four columns.
struct Entries {
    /// The column of a constant 1.
    constant: Option<usize>,
    length: usize,
    runs: [(usize, [f64; RUN]); MOST_RUNS],
}

impl Entries {
    fn new() -> Self {
        Self { constant: None, length: 0, runs: [(0, [0.0; RUN]); MOST_RUNS] }
    }

    fn clear(&mut self) {
        self.constant = None;
        self.length = 0;
    }

    fn push(&mut self, column: usize, values: [f64; RUN]) {
        if let Some(run) = self.runs.get_mut(self.length) {
            *run = (column, values);
            self.length += 1;
        }
    }

    fn runs(&self) -> &[(usize, [f64; RUN])] {
        &self.runs[..self.length]
    }

    /// Adds the splines of `x` in 0 … 1 from column `first`; returns the next free column.
    fn splines(&mut self, first: usize, count: usize, x: f64) -> usize {
        let (at, values) = spline(count, x);
        self.push(first + at, values);
        first + count
    }

    /// Adds products of splines of `x` and of `y`.
    fn products(&mut self, first: usize, (nx, x): (usize, f64), (ny, y): (usize, f64)) -> usize {
        let ((ax, vx), (ay, vy)) = (spline(nx, x), spline(ny, y));
        for (i, a) in vx.into_iter().enumerate() {
            self.push(first + (ax + i) * ny + ay, vy.map(|b| a * b));
        }
        first + nx * ny
    }

    /// Adds value · value to the lower triangle of a matrix of rows of `n`.
    fn add_products(&self, n: usize, matrix: &mut [f64]) {
        if let Some(constant) = self.constant {
            matrix[constant * n + constant] += 1.0;
        }
        for (number, &(row, a)) in self.runs().iter().enumerate() {
            for (i, a) in a.into_iter().enumerate() {
                let row = &mut matrix[(row + i) * n..][..n];
                if let Some(constant) = self.constant {
                    row[constant] += a;
                }
                // Above the diagonal of the last run is what nobody reads.
                for &(column, b) in &self.runs[..=number] {
                    row[column..column + RUN].iter_mut().zip(b).for_each(|(sum, b)| *sum += a * b);
                }
            }
        }
    }

    /// Adds value · `x` to every column's sum.
    fn add(&self, x: f64, sums: &mut [f64]) {
        if let Some(constant) = self.constant {
            sums[constant] += x;
        }
        for &(column, values) in self.runs() {
            sums[column..column + RUN].iter_mut().zip(values).for_each(|(sum, value)| *sum += value * x);
        }
    }

    /// Adds Σ value · coefficient, in the order of the columns, to a sum of each vector; coefficients by column and vector.
    fn add_up(&self, coefficients: &[f64], sums: &mut [f64]) {
        let vectors = sums.len();
        let mut add = |column: usize, value: f64| {
            let coefficients = &coefficients[column * vectors..][..vectors];
            sums.iter_mut().zip(coefficients).for_each(|(sum, c)| *sum += value * c);
        };
        if let Some(constant) = self.constant {
            add(constant, 1.0);
        }
        for &(column, values) in self.runs() {
            values.into_iter().enumerate().for_each(|(i, value)| add(column + i, value));
        }
    }
}

/// The first of the four cubic B-splines that are not 0 at `x`, and their values; `count` ≥ 4 splines on even knots whose
/// ends are repeated (de Boor 1978, chapter X).
fn spline(count: usize, x: f64) -> (usize, [f64; 4]) {
    let spans = count - 3;
    let scaled = x.clamp(0.0, 1.0) * spans as f64;
    let span = (scaled as usize).min(spans - 1);
    // Knots relative to the span; repeated at both ends.
    let knot = |k: isize| (span as isize + k).clamp(0, spans as isize) as f64;
    let mut values = [1.0, 0.0, 0.0, 0.0];
    for degree in 1..=3_isize {
        let mut saved = 0.0;
        for r in 0..degree {
            let (right, left) = (knot(r + 1), knot(r + 1 - degree));
            let share = values[r as usize] / (right - left);
            values[r as usize] = saved + (right - scaled) * share;
            saved = (scaled - left) * share;
        }
        values[degree as usize] = saved;
    }
    (span, values)
}

impl Chart {
    /// The model of `kind` on the representatives of `shape`; `None` where it makes no sense.
    pub(crate) fn new(kind: ChartKind, shape: &Shape, representatives: &Representatives) -> Option<Self> {
        let incoming = incoming(shape, kind)?;
        let incoming = (0..representatives.len()).map(|k| incoming.get(representatives.block(k)).copied());
        let incoming = incoming.collect::<Option<Vec<_>>>()?;
        let mesh = shape.mesh();
        let outgoing: Vec<Vector> = (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect();
        let constants = if kind == ChartKind::Zonal || incoming.len() > MOST_CONSTANTS { 0 } else { incoming.len() };
        let mut chart = Self {
            kind,
            constants,
            incoming,
            outgoing,
            columns: 0,
            factor: Factor { n: 0, lower: Vec::new() },
            fitted: None,
        };
        let mut entries = Entries::new();
        chart.columns = chart.row(0, 0, &mut entries);
        chart.factor = Factor::new(chart.columns, &chart.gram(GRAM_ROWS), |_| true);
        Some(chart)
    }

    /// Ready to be fitted.
    pub(crate) fn prepared(mut self) -> Self {
        self.fitted = Some(Factor::new(self.columns, &self.gram(FITTED_ROWS), |column| self.factor.keeps(column)));
        self
    }

    pub(crate) fn kind(&self) -> ChartKind {
        self.kind
    }

    fn rows(&self) -> usize {
        self.incoming.len() * self.outgoing.len()
    }

    /// Fills in the columns of a row; returns how many columns there are.
    fn row(&self, block: usize, leaf: usize, entries: &mut Entries) -> usize {
        entries.clear();
        let wi = self.incoming[block];
        let mut wo = self.outgoing[leaf];
        let angle = ((1.0 - dot(wi, wo)).max(0.0) / 2.0).sqrt();
        if self.kind == ChartKind::Zonal {
            return entries.splines(0, 32, angle);
        }
        // Transmission is seen in the mirror.
        wo[2] = wo[2].abs();
        let wi = [wi[0], wi[1], wi[2].abs()];
        let h = unit(add(wi, wo));
        // Sines of half angles over that of 45°.
        let to_normal = (1.0 - h[2]).max(0.0).sqrt();
        let difference = (1.0 - dot(wi, h)).max(0.0).sqrt();
        let height = wo[2].sqrt();
        let mut next = self.constants;
        entries.constant = (block < self.constants).then_some(block);
        if self.kind == ChartKind::Isotropic {
            let peak = to_normal.sqrt();
            next = entries.splines(next, 14, peak);
            next = entries.splines(next, 6, difference);
            next = entries.splines(next, 7, height);
            next = entries.splines(next, 7, angle);
            next = entries.products(next, (10, peak), (5, difference));
            return entries.products(next, (4, height), (5, difference));
        }
        next = entries.splines(next, 7, height);
        next = entries.splines(next, 7, angle);
        next = entries.splines(next, 6, difference);
        // The plane of h, in which splines are denser near the normal; then the same times the centred difference angle and
        // its square.
        let across = |x: f64| 0.5 + 0.5 * x * 1.06 / (x * x + 0.1236).sqrt();
        let first = entries.length;
        let planar = entries.products(next, (10, across(h[0])), (10, across(h[1])));
        let columns = planar - next;
        let centred = difference - 0.5;
        for at in first..entries.length {
            let (column, values) = entries.runs[at];
            entries.push(column + columns, values.map(|value| value * centred));
        }
        for at in first..first + RUN {
            let (column, values) = entries.runs[at];
            entries.push(column + 2 * columns, values.map(|value| value * centred * centred));
        }
        planar + 2 * columns
    }

    /// Every how many rows are looked at, so that there are at most `most`.
    fn stride(&self, most: usize) -> usize {
        // Odd, so that all places among siblings have their turn.
        if self.rows() <= most { 1 } else { self.rows().div_ceil(most) | 1 }
    }

    /// The Gram matrix of all columns (its lower triangle) on `most` rows, as if on all.
    fn gram(&self, most: usize) -> Vec<f64> {
        let n = self.columns;
        let stride = self.stride(most);
        let mut gram = vec![0.0; n * n];
        let mut entries = Entries::new();
        for at in (0..self.rows()).step_by(stride) {
            self.row(at / self.outgoing.len(), at % self.outgoing.len(), &mut entries);
            entries.add_products(n, &mut gram);
        }
        for entry in &mut gram {
            *entry *= stride as f64;
        }
        gram
    }

    /// The best coefficients of planes `[blocks, vectors, leaves]` on the orthonormal columns, by vector.
    fn fit(&self, fitted: &Factor, planes: &[f32], vectors: usize) -> Vec<f64> {
        let (n, leaves) = (self.columns, self.outgoing.len());
        let stride = self.stride(FITTED_ROWS);
        let parts: Vec<Vec<f64>> = planes
            .par_chunks(vectors * leaves)
            .enumerate()
            .map(|(block, planes)| {
                let mut sums = vec![0.0; vectors * n];
                let mut entries = Entries::new();
                for leaf in (0..leaves).filter(|leaf| (block * leaves + leaf).is_multiple_of(stride)) {
                    self.row(block, leaf, &mut entries);
                    for (plane, sums) in planes.chunks_exact(leaves).zip(sums.chunks_exact_mut(n)) {
                        let x = f64::from(plane[leaf]) * stride as f64;
                        entries.add(x, sums);
                    }
                }
                sums
            })
            .collect();
        let mut sums = vec![0.0; vectors * n];
        for part in parts {
            sums.iter_mut().zip(part).for_each(|(sum, x)| *sum += x);
        }
        for y in sums.chunks_exact_mut(n) {
            fitted.solve(y);
            fitted.solve_transposed(y);
            self.factor.multiply_transposed(y);
        }
        sums
    }

    /// All representatives.
    pub(crate) fn all(&self) -> Range<usize> {
        0..self.incoming.len()
    }

    /// The model's planes `[representatives, vectors, leaves]` of coefficients on the orthonormal columns.
    pub(crate) fn evaluate(
        &self,
        mut coefficients: Vec<f64>,
        vectors: usize,
        representatives: Range<usize>,
    ) -> Vec<f32> {
        let (n, leaves) = (self.columns, self.outgoing.len());
        coefficients.chunks_exact_mut(n).for_each(|c| self.factor.solve_transposed(c));
        let by_column: Vec<f64> =
            (0..n).flat_map(|column| coefficients.iter().skip(column).step_by(n).copied()).collect();
        let mut planes = vec![0.0; representatives.len() * leaves * vectors];
        planes.par_chunks_mut(vectors * leaves).enumerate().for_each(|(block, planes)| {
            let mut entries = Entries::new();
            let mut sums = vec![0.0; vectors];
            for leaf in 0..leaves {
                self.row(representatives.start + block, leaf, &mut entries);
                sums.fill(0.0);
                entries.add_up(&by_column, &mut sums);
                for (plane, &sum) in planes.chunks_exact_mut(leaves).zip(&sums) {
                    plane[leaf] = sum as f32;
                }
            }
        });
        planes
    }

    /// Codes the model of planes at `step`: an encoder is given them; both return the model's coefficients.
    pub(crate) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        step: f32,
        vectors: usize,
        planes: Option<&[f32]>,
        kept: &mut u64,
    ) -> Vec<f64> {
        let step = f64::from(step);
        let wanted = planes.zip(self.fitted.as_ref()).map(|(planes, fitted)| self.fit(fitted, planes, vectors));
        let n = self.columns;
        let mut details = DetailCoder::default();
        let mut decoded = vec![0.0; vectors * n];
        let mut before = vec![0_u32; n];
        for vector in 0..vectors {
            let mut last = [64_u32; 3];
            for column in 0..n {
                if !self.factor.keeps(column) {
                    continue;
                }
                let wanted = wanted.as_ref().map_or(0, |wanted| {
                    let x = wanted[vector * n + column] / step;
                    let magnitude = (x.abs() + ROUNDING).min(LARGEST) as i32;
                    if x < 0.0 { -magnitude } else { magnitude }
                });
                let around = Surroundings {
                    level: 0,
                    neighbours: Some(16 * (2 * last[0] + last[1] + last[2]) / 4),
                    before: (vector > 0).then(|| 16 * before[column]),
                    ..Surroundings::default()
                };
                let q = details.code(coder, &around, wanted);
                *kept += u64::from(q != 0);
                let magnitude = q.unsigned_abs().min(1 << 16);
                last = [magnitude, last[0], last[1]];
                before[column] = magnitude;
                decoded[vector * n + column] = f64::from(q) * step;
            }
        }
        decoded
    }
}

/// The incoming direction of every block.
pub(super) fn incoming(shape: &Shape, kind: ChartKind) -> Option<Vec<Vector>> {
    let zonal = kind == ChartKind::Zonal;
    if zonal != (shape.mesh().domain() == Domain::Sphere) {
        return None;
    }
    match shape.block_axes() {
        [Axis::Triangles(mesh)] if zonal == (mesh.domain() == Domain::Sphere) => {
            Some((0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect())
        }
        [Axis::Elevation(degrees)] if !zonal => {
            Some(degrees.iter().map(|&theta| Direction::from_degrees(theta, 0.0).xyz()).collect())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_add_up_to_one_and_are_not_negative() {
        for count in [4, 5, 7, 14, 32] {
            for k in 0..=200 {
                let (first, values) = spline(count, f64::from(k) / 200.0);
                assert!(first + 4 <= count);
                assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                assert!(values.iter().all(|&v| v >= -1e-15));
            }
        }
    }

    #[test]
    fn splines_are_continuous() {
        for count in [4, 7, 14] {
            for k in 1..count - 3 {
                let x = k as f64 / (count - 3) as f64;
                let value = |x: f64, column: usize| {
                    let (first, values) = spline(count, x);
                    column.checked_sub(first).and_then(|k| values.get(k)).copied().unwrap_or(0.0)
                };
                for column in 0..count {
                    assert!((value(x - 1e-9, column) - value(x + 1e-9, column)).abs() < 1e-7);
                }
            }
        }
    }
}
