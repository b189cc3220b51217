//! Values at a place: whole spectra, chosen wavelengths, luminance; one at a time or in batches.

use super::lookup::Stencil;
use super::material::Form;
use super::planes::{Cell, MOST_PLANES, Planes};
use super::smooth::{Mixed, Smooth};
use super::{Beyond, EvaluateError, Interpolation, Material, Place, unfit};
use crate::domain::WavelengthGrid;

/// Samples of a spectrum that are summed together where some are masked.
const BLOCK: usize = 64;

/// The rows of samples that make the value at a place.
struct Rows {
    entry: usize,
    incoming: Stencil,
    outgoing: Stencil,
}

/// What there is at a place, before it becomes a spectrum.
enum Found<'a> {
    /// Outside the outgoing domain.
    Outside,
    Cell(&'a [f32]),
    Rows(Rows),
    Planes(&'a Planes, Mixed),
}

impl Material {
    /// The whole spectrum at `place` into `out` (`lambdas()` long), in the measurement's unit, without a cosine;
    /// NaN = masked, 0 where `wo` is outside the outgoing domain.
    #[inline]
    pub fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        if out.len() != self.lambdas() {
            return unfit(format!("room for {} samples, expected {}", out.len(), self.lambdas()));
        }
        match self.find(place, how)? {
            Found::Outside => out.fill(0.0),
            Found::Cell(row) => out.copy_from_slice(row),
            Found::Rows(rows) => self.sum(&rows, out),
            Found::Planes(planes, mixed) => match mixed.presence {
                presence if presence.is_nan() => out.fill(f32::NAN),
                presence if presence <= 0.0 => out.fill(0.0),
                presence => planes.spectrum(&mixed.row, presence, out),
            },
        }
        Ok(())
    }

    /// Values at `wavelengths` in nm into `out` (as long), linear between the samples of the spectrum at `place`, outside
    /// the measured range as `beyond` says. NaN = masked, also where one of the two samples is. RGB and monochromatic data
    /// are refused: they have no wavelengths.
    #[inline]
    pub fn at_wavelengths(
        &self,
        place: Place<'_>,
        how: Interpolation,
        beyond: Beyond,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let Some(grid) = self.grid() else {
            return unfit(format!("wavelengths were asked for, but this {} has none", self.quantity()));
        };
        if out.len() != wavelengths.len() {
            return unfit(format!("room for {} samples, expected {}: one a wavelength", out.len(), wavelengths.len()));
        }
        match self.find(place, how)? {
            Found::Outside => between(grid, beyond, wavelengths, out, |_| 0.0),
            Found::Cell(row) => between(grid, beyond, wavelengths, out, |lambda| row[lambda]),
            Found::Rows(rows) => between(grid, beyond, wavelengths, out, |lambda| self.sample_of(&rows, lambda)),
            Found::Planes(planes, mixed) => {
                let presence = mixed.presence;
                if presence > 0.0 {
                    between(grid, beyond, wavelengths, out, |lambda| presence * planes.sample(&mixed.row, lambda));
                } else {
                    between(grid, beyond, wavelengths, out, |_| presence);
                }
            }
        }
        Ok(())
    }

    /// The inner product of the spectrum at `place` with `weights`, one a sample of a spectrum: its luminance or another
    /// colour coordinate, power in a band, a mean. NaN where a sample with a weight is masked.
    pub fn weighted(&self, place: Place<'_>, how: Interpolation, weights: &[f32]) -> Result<f32, EvaluateError> {
        if weights.len() != self.lambdas() {
            return unfit(format!("{} weights, expected {}: one a sample", weights.len(), self.lambdas()));
        }
        let sum = |value: &dyn Fn(usize) -> f32| {
            weights.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(lambda, w)| w * value(lambda)).sum()
        };
        Ok(match self.find(place, how)? {
            Found::Outside => 0.0,
            Found::Cell(row) => sum(&|lambda| row[lambda]),
            Found::Rows(rows) => sum(&|lambda| self.sample_of(&rows, lambda)),
            Found::Planes(planes, mixed) if mixed.presence > 0.0 => {
                planes.weighted(&mixed.row, weights) * mixed.presence
            }
            Found::Planes(_, mixed) => mixed.presence,
        })
    }

    #[inline]
    fn find(&self, place: Place<'_>, how: Interpolation) -> Result<Found<'_>, EvaluateError> {
        let entry = if place.index.is_empty() && self.has_no_index() { 0 } else { self.entry(place.index)? };
        match (&self.form, how) {
            (Form::Planes { planes, .. }, Interpolation::Constant) => {
                let Some(cell) = self.cell_at(entry, place)? else { return Ok(Found::Outside) };
                let mut row = [0.0; MOST_PLANES];
                let coefficients = planes.row(cell);
                row[..coefficients.len()].copy_from_slice(coefficients);
                let presence = match planes.cell(cell) {
                    Cell::Live => 1.0,
                    Cell::Zero => 0.0,
                    Cell::Masked => f32::NAN,
                };
                Ok(Found::Planes(planes, Mixed { row, presence }))
            }
            (Form::Planes { planes, smooth }, Interpolation::Smooth) => {
                Ok(self.mixed(smooth, entry, place)?.map_or(Found::Outside, |mixed| Found::Planes(planes, mixed)))
            }
            (Form::Samples { samples, .. }, Interpolation::Constant) => {
                let lambdas = self.lambdas();
                let cell = self.cell_at(entry, place)?;
                Ok(cell.map_or(Found::Outside, |cell| Found::Cell(&samples[cell * lambdas..][..lambdas])))
            }
            (Form::Samples { .. }, Interpolation::Smooth) => {
                let incoming = self.incoming_stencil(place.wi)?;
                let outgoing = match self.outgoing(place.wi, place.wo)? {
                    None => Some(Stencil::one(0)),
                    Some((lookup, wo)) => lookup.stencil(wo),
                };
                Ok(outgoing.map_or(Found::Outside, |outgoing| Found::Rows(Rows { entry, incoming, outgoing })))
            }
        }
    }

    /// The cell that holds a place; `None` if `wo` is outside the outgoing domain.
    #[inline]
    fn cell_at(&self, entry: usize, place: Place<'_>) -> Result<Option<usize>, EvaluateError> {
        let incoming = self.incoming_entry(place.wi)?;
        let outgoing = match self.outgoing(place.wi, place.wo)? {
            None => Some(0),
            Some((lookup, wo)) => lookup.locate(wo),
        };
        let [n_in, n_out, _] = self.shape;
        Ok(outgoing.map(|outgoing| (entry * n_in + incoming) * n_out + outgoing))
    }

    /// The smooth row at a place; `None` if `wo` is outside the outgoing domain.
    #[inline]
    fn mixed(&self, smooth: &Smooth, entry: usize, place: Place<'_>) -> Result<Option<Mixed>, EvaluateError> {
        if place.wi.is_some() != self.has_incoming() {
            return self.refuse_incoming(place.wi);
        }
        let wi = self.wi_in_plane(place.wi);
        let Some(around) = smooth.around(wi) else { return self.refuse_incoming(place.wi) };
        if self.is_isotropic() && wi[2] < 0.0 {
            return self.refuse_incoming(place.wi);
        }
        let Some((lookup, wo)) = self.outgoing(place.wi, place.wo)? else { return Ok(None) };
        let wo = wo.xyz();
        Ok(lookup.holds(wo).then(|| smooth.at(entry, &around, wi, wo)))
    }

    /// One sample of the sum of rows; NaN if all its cells are masked.
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
        match &self.form {
            Form::Samples { has_masked: true, .. } if total > 0.0 => sum / total,
            Form::Samples { has_masked: true, .. } => f32::NAN,
            _ => sum,
        }
    }

    /// The samples of one cell.
    fn row(&self, entry: usize, incoming: usize, outgoing: usize) -> &[f32] {
        let Form::Samples { samples, .. } = &self.form else { return &[] };
        let [n_in, n_out, lambdas] = self.shape;
        &samples[((entry * n_in + incoming) * n_out + outgoing) * lambdas..][..lambdas]
    }

    fn sum(&self, rows: &Rows, out: &mut [f32]) {
        if matches!(self.form, Form::Samples { has_masked: true, .. }) {
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

/// Linear between the samples of a spectrum.
#[inline]
fn between(grid: &WavelengthGrid, beyond: Beyond, wavelengths: &[f64], out: &mut [f32], sample: impl Fn(usize) -> f32) {
    for (value, &lambda) in out.iter_mut().zip(wavelengths) {
        *value = match (grid.locate(lambda), beyond) {
            (Some((below, 0.0)), _) => sample(below),
            (Some((below, t)), _) => (1.0 - t as f32) * sample(below) + t as f32 * sample(below + 1),
            (None, Beyond::Masked) => f32::NAN,
            (None, Beyond::Zero) => 0.0,
            (None, Beyond::Nearest) if lambda.is_nan() => f32::NAN,
            (None, Beyond::Nearest) => sample(if lambda < grid.at(0) { 0 } else { grid.len() - 1 }),
        };
    }
}
