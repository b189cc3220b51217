//! Spectra if every sample is kept: those of a cell, or means of the cells around a place.

use super::error::EvaluateError;
use super::geometry::Geometry;
use super::lookup::Stencil;
use super::place::{Interpolation, Place};

/// Number of consecutive wavelengths for which weighted samples are summed in one pass if some samples are masked.
/// Raising it takes more scratch memory.
const BLOCK: usize = 64;

/// All samples of a material, `[combination of indices, incoming, outgoing, wavelength]`.
#[derive(Debug)]
pub(super) struct Samples {
    values: Vec<f32>,
    has_masked: bool,
    shape: [usize; 3],
}

/// Spectra whose weighted mean is the value for a pair of directions: all combinations of some incoming and some
/// outgoing samples.
pub(super) struct Rows {
    entry: usize,
    incoming: Stencil,
    outgoing: Stencil,
}

/// Samples that determine the value for a pair of directions.
#[allow(clippy::large_enum_variant, reason = "it lives on the stack for a moment: a query does not allocate")]
pub(super) enum Found<'a> {
    /// No samples: the pair of directions lies outside the outgoing domain.
    Outside,
    Cell(&'a [f32]),
    Rows(Rows),
}

impl Samples {
    /// Stores samples; `shape` holds the numbers of incoming directions, of outgoing directions and of samples in a
    /// spectrum.
    pub(super) fn new(values: Vec<f32>, shape: [usize; 3]) -> Self {
        let has_masked = values.iter().any(|s| s.is_nan());
        Self { values, has_masked, shape }
    }

    pub(super) fn all(&self) -> &[f32] {
        &self.values
    }

    /// Returns true if some samples of the material are masked (without a value).
    pub(super) fn has_masked(&self) -> bool {
        self.has_masked
    }

    /// Spectrum of the pair of sampled directions numbered `cell`.
    #[inline]
    pub(super) fn cell(&self, cell: usize) -> &[f32] {
        &self.values[cell * self.shape[2]..][..self.shape[2]]
    }

    /// Finds the stored spectra whose weighted mean is the value of the material's function for a pair of directions.
    pub(super) fn find(
        &self,
        geometry: &Geometry,
        place: Place<'_>,
        how: Interpolation,
    ) -> Result<Found<'_>, EvaluateError> {
        match how {
            Interpolation::Constant => {
                let cell = geometry.cell_of(place)?;
                Ok(cell.map_or(Found::Outside, |cell| Found::Cell(self.cell(cell))))
            }
            Interpolation::Smooth => {
                let entry = geometry.entry_of(place)?;
                let incoming = geometry.incoming_stencil(place.wi)?;
                let outgoing = match geometry.outgoing(place.wi, place.wo)? {
                    None => Some(Stencil::one(0)),
                    Some((lookup, wo)) => lookup.stencil(wo),
                };
                Ok(outgoing.map_or(Found::Outside, |outgoing| Found::Rows(Rows { entry, incoming, outgoing })))
            }
        }
    }

    /// Weighted mean of spectra at one wavelength; NaN if all are masked there.
    pub(super) fn sample_of(&self, rows: &Rows, lambda: usize) -> f32 {
        let (mut sum, mut total) = (0.0, 0.0);
        for (i, a) in rows.incoming.entries() {
            for (o, b) in rows.outgoing.entries() {
                let sample = self.row(rows.entry, i, o)[lambda];
                if !sample.is_nan() {
                    sum += a * b * sample;
                    total += a * b;
                }
            }
        }
        match self.has_masked {
            true if total > 0.0 => sum / total,
            true => f32::NAN,
            false => sum,
        }
    }

    /// Spectrum of one pair of sampled directions, for one combination of indices (positions on the axes before the
    /// directions).
    fn row(&self, entry: usize, incoming: usize, outgoing: usize) -> &[f32] {
        let [n_in, n_out, lambdas] = self.shape;
        &self.values[((entry * n_in + incoming) * n_out + outgoing) * lambdas..][..lambdas]
    }

    /// Writes the weighted mean of spectra into `out`; NaN at wavelengths where all are masked.
    pub(super) fn sum(&self, rows: &Rows, out: &mut [f32]) {
        if self.has_masked {
            self.sum_with_masks(rows, out);
            return;
        }
        out.fill(0.0);
        for (i, a) in rows.incoming.entries() {
            for (o, b) in rows.outgoing.entries() {
                let weight = a * b;
                for (sum, sample) in out.iter_mut().zip(self.row(rows.entry, i, o)) {
                    *sum += weight * sample;
                }
            }
        }
    }

    fn sum_with_masks(&self, rows: &Rows, out: &mut [f32]) {
        for (block, out) in out.chunks_mut(BLOCK).enumerate() {
            let mut totals = [0.0_f32; BLOCK];
            out.fill(0.0);
            for (i, a) in rows.incoming.entries() {
                for (o, b) in rows.outgoing.entries() {
                    let weight = a * b;
                    let row = &self.row(rows.entry, i, o)[block * BLOCK..];
                    for ((sum, total), &sample) in out.iter_mut().zip(&mut totals).zip(row) {
                        if !sample.is_nan() {
                            *sum += weight * sample;
                            *total += weight;
                        }
                    }
                }
            }
            for (sum, total) in out.iter_mut().zip(totals) {
                *sum = if total > 0.0 { *sum / total } else { f32::NAN };
            }
        }
    }
}

/// Inner product of `weights` and the unmasked samples, rescaled to the sum of all weights; 0 if all are masked.
pub(super) fn known_sum(weights: &[f32], value: &dyn Fn(usize) -> f32) -> f32 {
    let (mut sum, mut weight, mut all) = (0.0, 0.0, 0.0);
    for (lambda, w) in weights.iter().enumerate() {
        let value = value(lambda);
        all += w;
        if !value.is_nan() {
            sum += w * value;
            weight += w;
        }
    }
    if weight > 0.0 { sum * all / weight } else { 0.0 }
}

/// Mean of the values that are not masked (NaN); NaN if all are masked.
pub(super) fn known_mean(values: impl Iterator<Item = f32>) -> f32 {
    let known = values.filter(|value| !value.is_nan());
    let (sum, count) = known.fold((0.0_f64, 0_u32), |(sum, count), value| (sum + f64::from(value), count + 1));
    (sum / f64::from(count)) as f32
}
