//! Smooth model of scattering in coordinates that follow the lobe, fitted to each plane; the pyramid codes its
//! residual.
//!
//! A gloss lobe moves with the incoming direction, but stays fixed in the coordinates of the half vector h
//! (Rusinkiewicz 1998, *A new change of variables for efficient BRDF representation*). The model is linear in products
//! of cubic B-splines:
//! * isotropic: of the angle between h and the normal, of that between wi and h, of wo's polar angle and of the angle
//!   between wi and wo;
//! * anisotropic: of h's two tangential coordinates and of the angle between wi and h;
//! * zonal: of the angle between wi and wo alone, for phase functions.
//!
//! The columns are made orthonormal on the coded rows (Cholesky factor of their Gram matrix, f64, in a fixed order), so
//! that the pyramid's step serves their coefficients too. Only square roots and divisions are used, so the columns are
//! identical on every machine.

mod columns;
mod kind;

pub(crate) use kind::ChartKind;

use super::shape::Shape;
use super::symmetry::Representatives;
use crate::codec::{BitCoder, DetailCoder, Surroundings};
use crate::domain::vector::Vector;
use crate::domain::{Axis, Direction, Domain};
use crate::numeric::cholesky::GramFactor;
use crate::numeric::wide;
use columns::{Columns, Entries, LANES, RUN, add_up};
use rayon::prelude::*;
use std::ops::Range;

/// Largest number of pairs of incoming and outgoing direction, on triangle meshes, over which the basis functions of
/// the scattering model are made orthonormal. Raising it slows encoding and decoding.
const MESH_ROWS: usize = 1 << 12;
/// Largest number of pairs of incoming and outgoing direction, on grids of angles, over which the basis functions of
/// the scattering model are made orthonormal. It is large, because some of these functions are nonzero only at the few
/// pairs around the normal.
pub(crate) const GRID_ROWS: usize = 1 << 16;
/// Largest number of direction pairs to which the scattering model is fitted. Raising it slows encoding.
const FITTED_ROWS: usize = 1 << 16;
/// Rounding offset of the scattering model's coefficients, in quantiser steps: a magnitude rounds up if its fraction is
/// at least 1 − this. Raising it keeps more coefficients.
const ROUNDING: f64 = 0.4;
/// Upper bound on the magnitude of a quantised coefficient of the scattering model, in quantiser steps.
const LARGEST: f64 = (1 << 24) as f64;
/// Largest number of incoming directions for which the scattering model has a constant of its own for each.
const MOST_CONSTANTS: usize = 64;

/// Scattering model, a sum of basis functions, on all pairs of an incoming and an outgoing direction.
pub(crate) struct Chart {
    columns: Columns,
    incoming: Vec<Vector>,
    outgoing: Vec<Vector>,
    factor: GramFactor,
    /// Cholesky factor of the basis functions' Gram matrix on the fitted direction pairs; only in an encoder.
    fitted: Option<GramFactor>,
    /// Marks the pairs of an incoming and an outgoing direction to which the scattering model is fitted; `None` for
    /// all.
    live: Option<Vec<bool>>,
}

/// Values of all pairs of an incoming and an outgoing direction, in rows of all outgoing directions: one for each
/// incoming direction and each channel (wavelength or spectral coefficient).
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    values: &'a [f32],
    /// Numbers of rows from an incoming direction to the next, and from a channel to the next.
    strides: [usize; 2],
}

impl<'a> Rows<'a> {
    /// Values `[incoming, channel, outgoing]`.
    pub(crate) fn by_block(values: &'a [f32], channels: usize) -> Self {
        Self { values, strides: [channels, 1] }
    }

    /// Values `[channel, incoming, outgoing]`.
    pub(crate) fn by_channel(values: &'a [f32], incoming: usize) -> Self {
        Self { values, strides: [1, incoming] }
    }

    /// Row of `outgoing` values of an incoming direction and a channel.
    fn of(&self, incoming: usize, channel: usize, outgoing: usize) -> &'a [f32] {
        &self.values[(incoming * self.strides[0] + channel * self.strides[1]) * outgoing..][..outgoing]
    }
}

impl Chart {
    /// Builds the scattering model of `kind` on the coded (representative) blocks of a tensor of triangles; `None` if
    /// the tensor lacks the directions.
    pub(crate) fn of_triangles(kind: ChartKind, shape: &Shape, representatives: &Representatives) -> Option<Self> {
        let incoming = incoming(shape, kind)?;
        let incoming = (0..representatives.len()).map(|k| incoming.get(representatives.block(k)).copied());
        let incoming = incoming.collect::<Option<Vec<_>>>()?;
        let mesh = shape.mesh();
        let outgoing = (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect();
        Some(Self::new(kind, incoming, outgoing, MESH_ROWS))
    }

    /// Builds the scattering model of `kind` on every pair of an incoming and an outgoing direction. Its basis
    /// functions are orthonormal on at most `most` of these pairs.
    pub(crate) fn new(kind: ChartKind, incoming: Vec<Vector>, outgoing: Vec<Vector>, most: usize) -> Self {
        let constants = if kind == ChartKind::Zonal || incoming.len() > MOST_CONSTANTS { 0 } else { incoming.len() };
        let columns = Columns { kind, constants };
        let mut chart = Self { columns, incoming, outgoing, factor: GramFactor::default(), fitted: None, live: None };
        chart.factor = GramFactor::new(chart.columns.count(), &chart.gram(most), |_| true);
        chart
    }

    /// Prepares the scattering model for fitting to the direction pairs that `live` marks, or to all.
    pub(crate) fn prepared(mut self, live: Option<Vec<bool>>) -> Self {
        self.live = live;
        let gram = self.gram(FITTED_ROWS);
        self.fitted = Some(GramFactor::new(self.columns.count(), &gram, |column| self.factor.keeps(column)));
        self
    }

    pub(crate) fn kind(&self) -> ChartKind {
        self.columns.kind
    }

    fn rows(&self) -> usize {
        self.incoming.len() * self.outgoing.len()
    }

    /// Evaluates the basis functions of the scattering model at the next pairs of incoming and outgoing direction, one
    /// for each element of `entries`. If pairs run out, the remaining elements repeat the first one.
    fn fill(&self, rows: impl Iterator<Item = usize>, entries: &mut [Entries; LANES]) {
        let mut rows = rows.take(LANES);
        let first = rows.next().unwrap_or(0);
        let mut places = [first; LANES];
        places[1..].iter_mut().zip(rows).for_each(|(place, row)| *place = row);
        let leaves = self.outgoing.len();
        let row = |at: usize| (at / leaves, self.incoming[at / leaves], self.outgoing[at % leaves]);
        self.columns.fill(&places.map(row), entries);
    }

    /// Returns the step from one visited direction pair to the next with which at most `most` of all pairs are visited.
    fn stride(&self, most: usize) -> usize {
        // Odd, so that every position among siblings occurs.
        if self.rows() <= most { 1 } else { self.rows().div_ceil(most) | 1 }
    }

    /// Returns true if the model is fitted to direction pair number `row`.
    fn is_live(&self, row: usize) -> bool {
        self.live.as_ref().is_none_or(|live| live[row])
    }

    /// Gram matrix (lower triangle) of the scattering model's basis functions: sums of their products over at most
    /// `most` of the direction pairs to which the model is fitted, scaled up to all of them.
    fn gram(&self, most: usize) -> Vec<f64> {
        let n = self.columns.count();
        let stride = self.stride(most);
        let mut gram = vec![0.0; n * n];
        let mut entries = [Entries::new(); LANES];
        for at in (0..self.rows()).step_by(stride * LANES) {
            let rows = (at..self.rows()).step_by(stride).take(LANES);
            self.fill(rows.clone(), &mut entries);
            wide(
                #[inline(always)]
                || {
                    for (_, entries) in rows.clone().zip(&entries).filter(|(row, _)| self.is_live(*row)) {
                        entries.add_products(n, &mut gram);
                    }
                },
            );
        }
        for entry in &mut gram {
            *entry *= stride as f64;
        }
        gram
    }

    /// Fits the coefficients of the orthonormal basis functions to the values of each channel.
    fn fit(&self, fitted: &GramFactor, values: Rows<'_>, vectors: usize) -> Vec<f64> {
        let (n, leaves) = (self.columns.count(), self.outgoing.len());
        let stride = self.stride(FITTED_ROWS);
        let parts: Vec<Vec<f64>> = (0..self.incoming.len())
            .into_par_iter()
            .map(|block| {
                let mut sums = vec![0.0; vectors * n];
                let mut entries = [Entries::new(); LANES];
                let (first, end) = ((block * leaves).next_multiple_of(stride), (block + 1) * leaves);
                for at in (first..end).step_by(stride * LANES) {
                    let rows = (at..end).step_by(stride).take(LANES);
                    self.fill(rows.clone(), &mut entries);
                    for (row, entries) in rows.zip(&entries).filter(|(row, _)| self.is_live(*row)) {
                        for (vector, sums) in sums.chunks_exact_mut(n).enumerate() {
                            let x = values.of(block, vector, leaves)[row - block * leaves];
                            let x = f64::from(x) * stride as f64;
                            entries.add(x, sums);
                        }
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

    /// Range of the indices of all incoming directions of the scattering model.
    pub(crate) fn all(&self) -> Range<usize> {
        0..self.incoming.len()
    }

    /// Evaluates the scattering model, a sum of orthonormal functions of incoming and outgoing direction, with the
    /// given coefficients. Returns values `[incoming, channel, outgoing]`, a channel being a wavelength or a spectral
    /// coefficient.
    pub(crate) fn evaluate(
        &self,
        mut coefficients: Vec<f64>,
        vectors: usize,
        representatives: Range<usize>,
    ) -> Vec<f32> {
        let (n, leaves) = (self.columns.count(), self.outgoing.len());
        coefficients.chunks_exact_mut(n).for_each(|c| self.factor.solve_transposed(c));
        // Several vectors together, by column.
        let groups: Vec<Vec<[f64; RUN]>> = coefficients
            .chunks(n * RUN)
            .map(|vectors| (0..n).map(|column| std::array::from_fn(|k| *vectors.get(k * n + column).unwrap_or(&0.0))))
            .map(Iterator::collect)
            .collect();
        let mut planes = vec![0.0; representatives.len() * leaves * vectors];
        planes.par_chunks_mut(vectors * leaves).enumerate().for_each(|(block, planes)| {
            let mut entries = [Entries::new(); LANES];
            let start = (representatives.start + block) * leaves;
            for leaf in (0..leaves).step_by(LANES) {
                self.fill(start + leaf..start + leaves, &mut entries);
                for (planes, coefficients) in planes.chunks_mut(RUN * leaves).zip(&groups) {
                    let sums = wide(
                        #[inline(always)]
                        || add_up(&entries, coefficients),
                    );
                    for (k, plane) in planes.chunks_exact_mut(leaves).enumerate() {
                        plane[leaf..].iter_mut().zip(&sums).for_each(|(value, sums)| *value = sums[k] as f32);
                    }
                }
            }
        });
        planes
    }

    /// Encodes or decodes the scattering model's coefficients, quantised with `step`, and returns them. Only an encoder
    /// passes `values`, to which it fits the model.
    pub(crate) fn code<C: BitCoder>(
        &self,
        coder: &mut C,
        step: f32,
        vectors: usize,
        values: Option<Rows<'_>>,
        kept: &mut u64,
    ) -> Vec<f64> {
        let step = f64::from(step);
        let wanted = values.zip(self.fitted.as_ref()).map(|(values, fitted)| self.fit(fitted, values, vectors));
        let n = self.columns.count();
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

/// Returns true if a tensor has the incoming and outgoing directions that a scattering model of `kind` needs.
pub(super) fn has_chart(shape: &Shape, kind: ChartKind) -> bool {
    incoming(shape, kind).is_some()
}

/// Directions of the entries of an axis; `None` if the entries are not directions.
fn directions(axis: &Axis) -> Option<Vec<Vector>> {
    (0..axis.len()).map(|entry| axis.direction(entry).map(Direction::xyz)).collect()
}

/// Lists the incoming directions of a tensor. `None` if its incoming or outgoing directions do not suit a scattering
/// model of `kind`.
fn incoming(shape: &Shape, kind: ChartKind) -> Option<Vec<Vector>> {
    let zonal = kind == ChartKind::Zonal;
    if zonal != (shape.mesh().domain() == Domain::Sphere) {
        return None;
    }
    match shape.block_axes() {
        [Axis::Triangles(mesh)] if zonal != (mesh.domain() == Domain::Sphere) => None,
        [axis @ Axis::Triangles(_)] => directions(axis),
        [axis @ Axis::Elevation(_)] if !zonal => directions(axis),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::Encoder;

    #[test]
    fn a_smooth_lobe_on_a_grid_is_followed() {
        let direction = |theta: f64, phi: f64| Direction::from_degrees(theta, phi).xyz();
        let incoming: Vec<Vector> = (0..9).map(|i| direction(10.0 * f64::from(i), 0.0)).collect();
        let outgoing: Vec<Vector> =
            (0..18 * 37).map(|i| direction(5.0 * f64::from(i / 37), 5.0 * f64::from(i % 37))).collect();
        let lobe = |wi: &Vector, wo: &Vector| {
            let h = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
            let cosine = h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt();
            (5.0 * cosine.powi(8)) as f32
        };
        let planes: Vec<f32> = incoming.iter().flat_map(|wi| outgoing.iter().map(move |wo| lobe(wi, wo))).collect();
        for live in [None, Some(vec![true; planes.len()])] {
            let chart = Chart::new(ChartKind::Isotropic, incoming.clone(), outgoing.clone(), GRID_ROWS).prepared(live);
            let coefficients = chart.code(&mut Encoder::default(), 0.01, 1, Some(Rows::by_block(&planes, 1)), &mut 0);
            let model = chart.evaluate(coefficients, 1, chart.all());
            let worst = planes.iter().zip(&model).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 0.05, "{worst}");
        }
    }
}
