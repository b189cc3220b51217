//! Spectral basis of the data's own: mean spectrum and principal components, stored with the material.
//!
//! ```text
//! basis chunk   u8 r + 32 · c: number of vectors, 1 … 24, and their coarseness, 0 … 7;
//!               for a grid of angles u8 r, 1 … 64, and u8 c;
//!               r × u8 k, the root mean square (8 + k mod 8) · 2^(⌊k / 8⌋ − 23) of a vector's coefficient;
//!               then the range-coded integers of the mean and of the r vectors, rows of the spectral axis in bior4.4
//! ```
//! The vectors are quantised so that their error in a sample stays well below the step's own, decoded, and made
//! orthonormal again (Gram–Schmidt in f64, in order). Encoder and decoder thus project on identical decoded vectors.

use super::super::rows::coding_order;
use super::super::scales::Scales;
use super::steps::Fineness;
use crate::codec::{CodecError, Decoder, Encoder, Payload, Reader, Rows, Writer, code_coefficients};
use crate::domain::Axis;
use crate::numeric::orthogonal::orthonormalise_decoded;
use crate::numeric::wide;
use crate::transform::{AxisTransform, Klt, KltError, LineBasis, Plan};
use rayon::prelude::*;

/// Largest number of spectral basis vectors in a file without a grid of angles, which states it in one byte together
/// with the precision of the vectors. Spectra of one material need far fewer.
pub(super) const MAX_RANK: usize = 24;
/// Largest number of spectral basis vectors in a file on a grid of angles, which states it in a byte of its own. Noisy
/// spectra of 200 bands need more than 24.
pub(super) const MAX_GRID_RANK: usize = 64;
/// Largest number of samples used in the principal component analysis of spectra. Raising it costs time.
pub(super) const ANALYSED: usize = 1 << 23;
/// Smallest root mean square of a basis vector's coefficients with which the vector is kept, in quantiser steps;
/// smaller ones would quantise to 0.
const WORTH_KEEPING: f64 = 0.35;
/// Usual and largest coarseness of the quantised spectral basis vectors: number of times their quantiser step is
/// doubled.
const USUAL: u8 = 2;
const COARSEST: u8 = 7;
/// Number of spectra projected or reconstructed by one parallel task.
const BLOCK: usize = 256;
/// Number of spectra whose coefficients in the spectral basis are computed side by side within a parallel task.
const LANES: usize = 16;

/// Largest length of a spectrum for which all principal components are computed at once.
const LONG: usize = 256;

/// Computes the first `most` principal components of spectra of `length` samples.
pub(super) fn components(rows: &[f32], length: usize, most: usize) -> Result<Klt, KltError> {
    let mut klt = if length > LONG { Klt::leading(rows, length, most) } else { Klt::of(rows, length) }?;
    klt.truncate(most);
    Ok(klt)
}

/// Spectral basis as decoded: a mean spectrum and orthonormal vectors.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    mean: Vec<f64>,
    vectors: Vec<Vec<f64>>,
}

impl Basis {
    /// Encodes the mean and the first principal components that are worth their bits for `count` spectra, at most
    /// `most`. Returns the decoded basis and its chunk.
    pub(super) fn encode(
        klt: &Klt,
        axes: &[Axis],
        (count, most): (usize, usize),
        fineness: Fineness,
    ) -> (Self, Vec<u8>) {
        let step64 = f64::from(fineness.step);
        let spreads: Vec<f64> = klt.variances.iter().map(|v| v.sqrt()).collect();
        let worth = spreads.iter().take_while(|&&spread| spread > WORTH_KEEPING * step64).count();
        let rank = worth.max(1).saturating_add_signed(isize::from(fineness.more_vectors)).clamp(1, klt.rank());
        let spreads: Vec<u8> = spreads[..rank].iter().map(|&spread| spread_code(spread)).collect();
        let coarse = USUAL.saturating_add_signed(fineness.coarser_vectors).min(COARSEST);
        let steps = steps(fineness.step, count, coarse, &spreads);
        let coder = BasisCoder::new(axes);
        let rows = std::iter::once(&klt.mean).chain(&klt.vectors);
        let mut quantised: Vec<i32> = rows.zip(&steps).flat_map(|(row, &step)| coder.quantise(row, step)).collect();
        let mut w = Writer::default();
        if most > MAX_RANK {
            w.u8(rank as u8);
            w.u8(coarse);
        } else {
            w.u8(rank as u8 | coarse << 5);
        }
        w.raw(&spreads);
        let mut encoder = Encoder::default();
        code_coefficients(&mut encoder, &coder.rows(rank + 1), Payload::Integer, &mut quantised);
        w.raw(&encoder.finish());
        (coder.basis(&quantised, &steps), w.into_bytes())
    }

    /// Decodes a spectral basis of at most `most` vectors from its chunk. `axes` are those of the tensor, whose spectra
    /// lie along the last axis. `count` is the number of spectra, and `step` the quantiser step of the coefficients
    /// that represent a spectrum in the basis.
    pub(super) fn decode(
        chunk: &[u8],
        axes: &[Axis],
        (count, most): (usize, usize),
        step: f32,
    ) -> Result<Self, CodecError> {
        let length = axes.last().map_or(1, Axis::len);
        let mut r = Reader::new(chunk, 0);
        let first = r.u8("number of basis vectors")?;
        let (rank, coarse) = if most > MAX_RANK {
            let coarse = r.u8("coarseness of basis vectors")?;
            if coarse > COARSEST {
                return Err(
                    r.malformed(format!("the coarseness of the spectral basis is {coarse}, expected 0 to {COARSEST}"))
                );
            }
            (usize::from(first), coarse)
        } else {
            (usize::from(first & 31), first >> 5)
        };
        let most = most.min(length);
        if rank == 0 || rank > most {
            return Err(r.malformed(format!("the spectral basis has {rank} vectors, expected 1 to {most}")));
        }
        let steps = steps(step, count, coarse, r.take(rank, "spreads of basis vectors")?);
        let rest = r.take(r.remaining(), "basis")?;
        let coder = BasisCoder::new(axes);
        let mut quantised = vec![0; (rank + 1) * length];
        code_coefficients(&mut Decoder::new(rest), &coder.rows(rank + 1), Payload::Integer, &mut quantised);
        Ok(coder.basis(&quantised, &steps))
    }

    /// Number of vectors in the spectral basis, the mean not included.
    pub(super) fn rank(&self) -> usize {
        self.vectors.len()
    }

    /// Number of samples in the mean and all vectors of the spectral basis together.
    pub(super) fn entries(&self) -> usize {
        self.mean.len() * (self.vectors.len() + 1)
    }

    /// Returns the coefficients of every spectrum in the spectral basis: its projections, less the mean spectrum, on
    /// the basis vectors, ⟨spectrum − mean, vector⟩.
    pub(super) fn analyse(&self, logs: &[f32]) -> Vec<f32> {
        let (n, r) = (self.mean.len(), self.vectors.len());
        let mut planes = vec![0.0; logs.len() / n * r];
        planes.par_chunks_mut(BLOCK * r).zip(logs.par_chunks(BLOCK * n)).for_each(|(planes, logs)| {
            // Rows are processed side by side; each row's sum is in the order of its samples.
            let mut centred = vec![[0.0; LANES]; n];
            for (planes, logs) in planes.chunks_mut(LANES * r).zip(logs.chunks(LANES * n)) {
                for (lane, row) in logs.chunks_exact(n).enumerate() {
                    for ((centred, &x), m) in centred.iter_mut().zip(row).zip(&self.mean) {
                        centred[lane] = f64::from(x) - m;
                    }
                }
                for (k, vector) in self.vectors.iter().enumerate() {
                    let sums = wide(
                        #[inline(always)]
                        || products(&centred, vector),
                    );
                    planes.chunks_exact_mut(r).zip(sums).for_each(|(plane, sum)| plane[k] = sum as f32);
                }
            }
        });
        planes
    }

    /// Reconstructs every spectrum from its coefficients: mean + Σ coefficient · vector, in f64 and in the order of the
    /// vectors.
    pub(super) fn synthesise(&self, planes: &[f32], logs: &mut [f32]) {
        let (n, r) = (self.mean.len(), self.vectors.len());
        logs.par_chunks_mut(BLOCK * n).zip(planes.par_chunks(BLOCK * r)).for_each(|(logs, planes)| {
            let mut sums = vec![0.0; n];
            wide(
                #[inline(always)]
                || {
                    for (row, plane) in logs.chunks_exact_mut(n).zip(planes.chunks_exact(r)) {
                        sums.copy_from_slice(&self.mean);
                        for (&coefficient, vector) in plane.iter().zip(&self.vectors) {
                            let c = f64::from(coefficient);
                            sums.iter_mut().zip(vector).for_each(|(sum, v)| *sum += c * v);
                        }
                        row.iter_mut().zip(&sums).for_each(|(x, &sum)| *x = sum as f32);
                    }
                },
            );
        });
    }
}

/// Scalar products of a basis vector with several spectra side by side, summed as `Iterator::sum` does: starting at −0,
/// in order.
#[inline(always)]
#[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
fn products(rows: &[[f64; LANES]], vector: &[f64]) -> [f64; LANES] {
    let mut sums = [-0.0; LANES];
    for (row, v) in rows.iter().zip(vector) {
        sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * v);
    }
    sums
}

/// Quantiser steps of the mean spectrum and of each basis vector. The errors that they cause in a sample are at most
/// 1.5 · 2^`coarse` / √`rows` times those caused by `step`, the step of the spectra's coefficients.
///
/// `rows` is the number of spectra. Each increment of `coarse` doubles the steps, up to a limit.
fn steps(step: f32, rows: usize, coarse: u8, spreads: &[u8]) -> Vec<f32> {
    let part = (1.5 * f64::from(1_u32 << coarse) / (rows as f64).sqrt()).min(1.0);
    let own = f64::from(step) * part;
    std::iter::once(own as f32).chain(spreads.iter().map(|&code| (own / spread_of(code)) as f32)).collect()
}

/// Decodes an 8-bit code to the root mean square of the spectra's coefficients on one basis vector.
fn spread_of(code: u8) -> f64 {
    let exponent = code / 8;
    f64::from(8 + code % 8) * f64::from(1_u32 << exponent) / f64::from(1_u32 << 23)
}

/// 8-bit code of the root mean square of the spectra's coefficients on a basis vector, rounded down to a value that has
/// a code. Values below the smallest of these get code 0.
fn spread_code(spread: f64) -> u8 {
    (0..=u8::MAX).rev().find(|&code| spread_of(code) <= spread).unwrap_or(0)
}

/// Coder of the mean and vectors of a spectral basis as quantised wavelet coefficients.
struct BasisCoder {
    plan: Option<Plan>,
    order: Rows,
    scales: Scales,
    length: usize,
}

impl BasisCoder {
    fn new(axes: &[Axis]) -> Self {
        let axis: Vec<Axis> = axes.last().cloned().into_iter().collect();
        let length = axes.last().map_or(1, Axis::len);
        let plan = Plan::new(&axis, &[AxisTransform::line(LineBasis::BIOR44)]).ok();
        let order = plan.as_ref().map_or_else(|| Rows::natural(1, length), |plan| coding_order(&axis, plan, None));
        let scales = plan.as_ref().map_or_else(|| Scales::uniform(length), |plan| Scales::new(&axis, plan));
        Self { plan, order, scales, length }
    }

    /// Coding order of the wavelet coefficients of `count` spectra, one spectrum after another.
    fn rows(&self, count: usize) -> Rows {
        let natural = Rows::natural(count, self.length);
        Rows { order: natural.order, level: natural.level, neighbours: natural.neighbours, ..self.order.clone() }
    }

    fn quantise(&self, row: &[f64], step: f32) -> Vec<i32> {
        let mut row: Vec<f32> = row.iter().map(|&x| x as f32).collect();
        if let Some(plan) = &self.plan {
            plan.forward(&mut row);
        }
        let mut quantised = vec![0; row.len()];
        self.scales.quantise(step, &row, &mut quantised);
        quantised
    }

    /// Decodes the mean and the orthonormalised vectors of a spectral basis from quantised wavelet coefficients.
    fn basis(&self, quantised: &[i32], steps: &[f32]) -> Basis {
        let mut rows = quantised.chunks_exact(self.length).zip(steps).map(|(quantised, &step)| {
            let mut row = vec![0.0; self.length];
            self.scales.dequantise(step, quantised, &mut row);
            if let Some(plan) = &self.plan {
                plan.inverse(&mut row);
            }
            row.into_iter().map(f64::from).collect::<Vec<f64>>()
        });
        let mean = rows.next().unwrap_or_default();
        let mut vectors: Vec<Vec<f64>> = rows.collect();
        orthonormalise_decoded(&mut vectors);
        Basis { mean, vectors }
    }
}
