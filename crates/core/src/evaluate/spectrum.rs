//! Values at a place: whole spectra, chosen wavelengths, luminance; one at a time or in batches.

use super::lookup::Stencil;
use super::material::Form;
use super::planes::{FEW, Planes};
use super::smooth::{Seen, Smooth};
use super::{Beyond, EvaluateError, Interpolation, Material, Place, unfit};
use crate::domain::{Measurement, Tensor, WavelengthGrid, wide};

/// Samples of a spectrum that are summed together where some are masked.
const BLOCK: usize = 64;

/// The rows of samples that make the value at a place.
struct Rows {
    entry: usize,
    incoming: Stencil,
    outgoing: Stencil,
}

/// What there is at a place where every sample is kept.
#[allow(clippy::large_enum_variant, reason = "it lives on the stack for a moment: a query does not allocate")]
enum Found<'a> {
    /// Outside the outgoing domain.
    Outside,
    Cell(&'a [f32]),
    Rows(Rows),
}

impl Material {
    /// The whole spectrum at `place` into `out` (`lambdas()` long), in the measurement's unit, without a cosine;
    /// NaN = masked, 0 where `wo` is outside the outgoing domain.
    #[inline]
    pub fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        if out.len() != self.lambdas() {
            return unfit(format!("room for {} samples, expected {}", out.len(), self.lambdas()));
        }
        match &self.form {
            Form::Planes { planes, smooth } => {
                self.with_row(
                    planes,
                    smooth,
                    place,
                    how,
                    None,
                    #[inline(always)]
                    |row, presence| planes.expand(row, presence, out),
                )?;
            }
            Form::Samples { samples, .. } if self.cells() == 1 && self.layout().incoming.is_none() => {
                self.cell_of(place)?;
                out.copy_from_slice(samples);
            }
            Form::Samples { samples, .. } => match self.find(samples, place, how)? {
                Found::Outside => out.fill(0.0),
                Found::Cell(row) => out.copy_from_slice(row),
                Found::Rows(rows) => self.sum(&rows, out),
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
        match &self.form {
            Form::Planes { planes, smooth } => self.with_row(
                planes,
                smooth,
                place,
                how,
                None,
                #[inline(always)]
                |row, presence| {
                    if presence > 0.0 {
                        for (lambdas, out) in wavelengths.chunks(FEW).zip(out.chunks_mut(FEW)) {
                            few(planes, (row, presence), (grid, beyond), lambdas, out);
                        }
                    } else {
                        between(grid, beyond, wavelengths, out, |_| presence);
                    }
                },
            )?,
            Form::Samples { samples, .. } => match self.find(samples, place, how)? {
                Found::Outside => between(grid, beyond, wavelengths, out, |_| 0.0),
                Found::Cell(row) => between(grid, beyond, wavelengths, out, |lambda| row[lambda]),
                Found::Rows(rows) => between(grid, beyond, wavelengths, out, |lambda| self.sample_of(&rows, lambda)),
            },
        }
        Ok(())
    }

    /// The inner product of the spectrum at `place` with `weights`, one a sample of a spectrum: its luminance or another
    /// colour coordinate, power in a band, a mean. NaN where a sample with a weight is masked.
    pub fn weighted(&self, place: Place<'_>, how: Interpolation, weights: &[f32]) -> Result<f32, EvaluateError> {
        if weights.len() != self.lambdas() {
            return unfit(format!("{} weights, expected {}: one a sample", weights.len(), self.lambdas()));
        }
        self.weighted_by(place, how, weights, |value| {
            weights.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(lambda, w)| w * value(lambda)).sum()
        })
    }

    /// As [`Material::weighted`]; masked samples are left out and the others weigh more, 0 where all are.
    pub(super) fn weighted_known(
        &self,
        place: Place<'_>,
        how: Interpolation,
        weights: &[f32],
    ) -> Result<f32, EvaluateError> {
        let sum = self.weighted_by(place, how, weights, |value| known_sum(weights, value))?;
        Ok(if sum.is_nan() { 0.0 } else { sum })
    }

    /// The inner product at `place`, by `sum` where every sample is kept; NaN where a cell of planes is masked.
    fn weighted_by(
        &self,
        place: Place<'_>,
        how: Interpolation,
        weights: &[f32],
        sum: impl Fn(&dyn Fn(usize) -> f32) -> f32,
    ) -> Result<f32, EvaluateError> {
        Ok(match &self.form {
            Form::Planes { planes, smooth } => self.with_row(
                planes,
                smooth,
                place,
                how,
                None,
                #[inline(always)]
                |row, presence| planes.weighted(row, presence, weights),
            )?,
            Form::Samples { samples, .. } => match self.find(samples, place, how)? {
                Found::Outside => 0.0,
                Found::Cell(row) => sum(&|lambda| row[lambda]),
                Found::Rows(rows) => sum(&|lambda| self.sample_of(&rows, lambda)),
            },
        })
    }

    /// The piecewise constant samples `[outgoing, lambda]` of entry `slice` (row-major) of the axes before the outgoing one;
    /// of a table without directions, of one spectrum. NaN = masked.
    ///
    /// # Panics
    /// If there is no such entry.
    pub fn slice(&self, slice: usize) -> Vec<f32> {
        let length = self.shape[1] * self.lambdas();
        match &self.form {
            Form::Samples { samples, .. } => samples[slice * length..][..length].to_vec(),
            Form::Planes { planes, .. } => {
                let mut out = vec![0.0; length];
                for (cell, out) in (slice * self.shape[1]..).zip(out.chunks_exact_mut(self.lambdas())) {
                    planes.expand(planes.row(cell), planes.presence(cell), out);
                }
                out
            }
        }
    }

    /// The samples as they are opened: those decoded, but for the deviation that [`Material::report`] states.
    pub fn measurement(&self) -> Result<Measurement, EvaluateError> {
        let samples = (0..self.entries() * self.shape[0]).flat_map(|slice| self.slice(slice)).collect();
        let tensor = Tensor::new(self.axes().to_vec(), samples);
        let tensor = tensor.map_err(|error| EvaluateError::Unfit(error.to_string()))?;
        Ok(Measurement { quantity: self.quantity(), unit: self.unit(), sampling: self.sampling, tensor })
    }

    /// How many cells there are: entries of all axes but the last.
    pub(super) fn cells(&self) -> usize {
        let [n_in, n_out, _] = self.shape;
        self.entries() * n_in * n_out
    }

    /// The inner product of a cell's spectrum with weights; masked samples are left out and the others weigh more; NaN where
    /// a cell of planes is masked.
    pub(super) fn cell_value(&self, cell: usize, weights: &[f32]) -> f32 {
        match &self.form {
            Form::Planes { planes, .. } => wide(
                #[inline(always)]
                || planes.weighted(planes.row(cell), planes.presence(cell), weights),
            ),
            Form::Samples { samples, .. } => {
                let row = &samples[cell * self.lambdas()..];
                known_sum(weights, &|lambda| row[lambda])
            }
        }
    }

    /// Whether anything is known and not 0 in a cell.
    pub(super) fn is_lit_cell(&self, cell: usize) -> bool {
        match &self.form {
            Form::Planes { planes, .. } => planes.presence(cell) > 0.0,
            Form::Samples { samples, .. } => {
                let row = &samples[cell * self.lambdas()..][..self.lambdas()];
                row.iter().any(|&sample| !sample.is_nan() && sample != 0.0)
            }
        }
    }

    /// Whether some cells are masked.
    pub(super) fn has_masked(&self) -> bool {
        match &self.form {
            Form::Planes { planes, .. } => (0..self.cells()).any(|cell| planes.presence(cell).is_nan()),
            Form::Samples { has_masked, .. } => *has_masked,
        }
    }

    /// Whether anything is known at a place.
    pub(super) fn is_known(&self, place: Place<'_>, how: Interpolation) -> Result<bool, EvaluateError> {
        match &self.form {
            Form::Planes { planes, smooth } => {
                self.with_row(planes, smooth, place, how, None, |_, presence| !presence.is_nan())
            }
            Form::Samples { samples, .. } => Ok(match self.find(samples, place, how)? {
                Found::Outside => true,
                Found::Cell(row) => row.iter().any(|sample| !sample.is_nan()),
                Found::Rows(rows) => (0..self.lambdas()).any(|lambda| !self.sample_of(&rows, lambda).is_nan()),
            }),
        }
    }

    /// The same of the smooth function at a vertex, in the table of `cell` of the axes before the outgoing one.
    pub(super) fn vertex_value(&self, cell: usize, vertex: u32, d: [f64; 3], weights: &[f32]) -> f32 {
        let [n_in, n_out, _] = self.shape;
        let (entry, incoming) = (cell / n_in, cell % n_in);
        match (&self.form, &self.outgoing) {
            (Form::Planes { planes, smooth }, _) => {
                let mixed = smooth.own(entry, incoming, self.incoming_directions[incoming], d);
                wide(
                    #[inline(always)]
                    || planes.weighted(&mixed.row, mixed.presence, weights),
                )
            }
            (Form::Samples { .. }, Some(lookup)) => {
                lookup.ring(vertex).map(|(leaf, share)| share * self.cell_value(cell * n_out + leaf, weights)).sum()
            }
            _ => 0.0,
        }
    }

    /// What `work` makes of the row of planes at a place and of its presence: 0 if `wo` is outside the outgoing domain, NaN
    /// where it is masked. The smooth form need not look for the entry of the incoming axis where it is known.
    #[inline(always)]
    pub(super) fn with_row<R>(
        &self,
        planes: &Planes,
        smooth: &Smooth,
        place: Place<'_>,
        how: Interpolation,
        incoming: Option<usize>,
        work: impl FnOnce(&[f32], f32) -> R,
    ) -> Result<R, EvaluateError> {
        let entry = self.entry_of(place)?;
        wide(
            #[inline(always)]
            || {
                Ok(match how {
                    Interpolation::Constant => match self.cell_at(entry, place)? {
                        Some(cell) => work(planes.row(cell), planes.presence(cell)),
                        None => work(&[], 0.0),
                    },
                    Interpolation::Smooth => match self.seen(smooth, incoming, place)? {
                        Some(seen) => {
                            let mixed = smooth.at(entry, &seen);
                            work(&mixed.row, mixed.presence)
                        }
                        None => work(&[], 0.0),
                    },
                })
            },
        )
    }

    #[inline]
    fn entry_of(&self, place: Place<'_>) -> Result<usize, EvaluateError> {
        if place.index.is_empty() && self.has_no_index() { Ok(0) } else { self.entry(place.index) }
    }

    /// The cell of a place; `None` if `wo` is outside the outgoing domain.
    #[inline]
    fn cell_of(&self, place: Place<'_>) -> Result<Option<usize>, EvaluateError> {
        let entry = self.entry_of(place)?;
        self.cell_at(entry, place)
    }

    /// The samples at a place.
    fn find<'a>(&self, samples: &'a [f32], place: Place<'_>, how: Interpolation) -> Result<Found<'a>, EvaluateError> {
        match how {
            Interpolation::Constant => {
                let lambdas = self.lambdas();
                let cell = self.cell_of(place)?;
                Ok(cell.map_or(Found::Outside, |cell| Found::Cell(&samples[cell * lambdas..][..lambdas])))
            }
            Interpolation::Smooth => {
                let entry = self.entry_of(place)?;
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
    #[inline(always)]
    pub(super) fn cell_at(&self, entry: usize, place: Place<'_>) -> Result<Option<usize>, EvaluateError> {
        let incoming = self.incoming_entry(place.wi)?;
        let outgoing = match self.outgoing(place.wi, place.wo)? {
            None => Some(0),
            Some((lookup, wo)) => lookup.locate(wo),
        };
        let [n_in, n_out, _] = self.shape;
        Ok(outgoing.map(|outgoing| (entry * n_in + incoming) * n_out + outgoing))
    }

    /// A place as the smooth form sees it, where the entry of the incoming axis may be known; `None` outside the outgoing
    /// domain.
    #[inline(always)]
    pub(super) fn seen(
        &self,
        smooth: &Smooth,
        incoming: Option<usize>,
        place: Place<'_>,
    ) -> Result<Option<Seen>, EvaluateError> {
        let (around, wi) = self.around(smooth, incoming, place.wi)?;
        let Some((lookup, wo)) = self.outgoing(place.wi, place.wo)? else { return Ok(None) };
        let wo = wo.xyz();
        Ok(if lookup.holds(wo) { Some(Seen { around, wi, wo }) } else { None })
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

/// The inner product without masked samples, as if the others stood for them; 0 where all are masked.
fn known_sum(weights: &[f32], value: &dyn Fn(usize) -> f32) -> f32 {
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

/// Up to [`FEW`] wavelengths of a row of planes.
#[inline]
fn few(
    planes: &Planes,
    (row, presence): (&[f32], f32),
    (grid, beyond): (&WavelengthGrid, Beyond),
    wavelengths: &[f64],
    out: &mut [f32],
) {
    let (first, last) = grid.range();
    let mut positions = [0.0; FEW];
    let mut within = true;
    for (position, &lambda) in positions.iter_mut().zip(wavelengths) {
        *position = grid.position(lambda);
        within &= lambda >= first && lambda <= last;
    }
    let samples = planes.few(row, presence, &positions[..wavelengths.len().min(FEW)]);
    for (value, sample) in out.iter_mut().zip(samples) {
        *value = sample;
    }
    if !within {
        for (value, &lambda) in out.iter_mut().zip(wavelengths).filter(|(_, l)| !(**l >= first && **l <= last)) {
            *value = match beyond {
                Beyond::Nearest if !lambda.is_nan() => *value,
                Beyond::Zero => 0.0,
                _ => f32::NAN,
            };
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
