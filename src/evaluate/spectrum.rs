//! Spectra at a place: sums of contiguous rows of the tensor.

use super::lookup::Stencil;
use super::{EvaluateError, Interpolation, Material, Place, unfit};
use crate::domain::WavelengthGrid;

/// Samples of a spectrum that are summed together where some are masked.
const BLOCK: usize = 64;

/// The rows of the tensor that make the value at a place.
struct Rows {
    entry: usize,
    incoming: Stencil,
    outgoing: Stencil,
}

impl Material {
    /// The whole spectrum at `place` into `out` (`lambdas()` long), in the measurement's unit, without a cosine;
    /// NaN = masked, 0 where `wo` is outside the outgoing domain.
    pub fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        if out.len() != self.lambdas() {
            return unfit(format!("room for {} samples, expected {}", out.len(), self.lambdas()));
        }
        match how {
            Interpolation::Constant => match self.constant_row(place)? {
                Some(row) => out.copy_from_slice(row),
                None => out.fill(0.0),
            },
            Interpolation::Smooth => match self.smooth_rows(place)? {
                Some(rows) if self.has_masked => self.sum_with_masks(&rows, out),
                Some(rows) => self.sum(&rows, out),
                None => out.fill(0.0),
            },
        }
        Ok(())
    }

    /// Values at `wavelengths` in nm into `out` (as long), linear between the samples of the spectrum at `place`.
    /// NaN = masked: outside the measured range, or where a sample needed is masked. RGB and monochromatic data are
    /// refused: they have no wavelengths.
    pub fn at_wavelengths(
        &self,
        place: Place<'_>,
        how: Interpolation,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let Some(grid) = self.grid() else {
            return unfit(format!("wavelengths were asked for, but this {} has none", self.measurement.quantity));
        };
        if out.len() != wavelengths.len() {
            return unfit(format!("room for {} samples, expected {}: one a wavelength", out.len(), wavelengths.len()));
        }
        match how {
            Interpolation::Constant => {
                let row = self.constant_row(place)?;
                between(grid, wavelengths, out, |lambda| row.map_or(0.0, |row| row[lambda]));
            }
            Interpolation::Smooth => {
                let rows = self.smooth_rows(place)?;
                between(grid, wavelengths, out, |lambda| {
                    rows.as_ref().map_or(0.0, |rows| self.sample_of(rows, lambda))
                });
            }
        }
        Ok(())
    }

    /// The spectrum of the cell that holds a place; `None` if `wo` is outside the outgoing domain.
    fn constant_row(&self, place: Place<'_>) -> Result<Option<&[f32]>, EvaluateError> {
        let entry = self.entry(place.index)?;
        let incoming = self.incoming_entry(place.wi)?;
        let outgoing = match self.outgoing(place.wi, place.wo)? {
            None => Some(0),
            Some((lookup, wo)) => lookup.locate(wo),
        };
        Ok(outgoing.map(|outgoing| self.row(entry, incoming, outgoing)))
    }

    /// The cells around a place; `None` if `wo` is outside the outgoing domain.
    fn smooth_rows(&self, place: Place<'_>) -> Result<Option<Rows>, EvaluateError> {
        let entry = self.entry(place.index)?;
        let incoming = self.incoming_stencil(place.wi)?;
        let outgoing = match self.outgoing(place.wi, place.wo)? {
            None => Some(Stencil::one(0)),
            Some((lookup, wo)) => lookup.stencil(wo),
        };
        Ok(outgoing.map(|outgoing| Rows { entry, incoming, outgoing }))
    }

    /// The spectrum of one cell.
    fn row(&self, entry: usize, incoming: usize, outgoing: usize) -> &[f32] {
        let [n_in, n_out, lambdas] = self.shape;
        let row = (entry * n_in + incoming) * n_out + outgoing;
        &self.measurement.tensor.samples()[row * lambdas..][..lambdas]
    }

    /// One sample of the interpolated spectrum; NaN if all its cells are masked.
    fn sample_of(&self, rows: &Rows, lambda: usize) -> f32 {
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
        if !self.has_masked {
            sum
        } else if total > 0.0 {
            sum / total
        } else {
            f32::NAN
        }
    }

    fn sum(&self, rows: &Rows, out: &mut [f32]) {
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

/// Linear between the samples of a spectrum; NaN outside the grid or beside a NaN that is needed.
fn between(grid: &WavelengthGrid, wavelengths: &[f64], out: &mut [f32], sample: impl Fn(usize) -> f32) {
    for (value, &lambda) in out.iter_mut().zip(wavelengths) {
        *value = match grid.locate(lambda) {
            None => f32::NAN,
            Some((below, 0.0)) => sample(below),
            Some((below, t)) => (1.0 - t as f32) * sample(below) + t as f32 * sample(below + 1),
        };
    }
}
