//! Values at one place: whole spectra, some wavelengths, weighted sums.

use super::error::{Buffer, EvaluateError, QueryError, unfit};
use super::form::Form;
use super::function::Function;
use super::place::{Beyond, Interpolation, Place};
use super::planes::{FEW, Planes};
use super::samples::{Found, known_sum};
use super::smooth::Smooth;
use crate::domain::{Measurement, Tensor, WavelengthGrid};

/// Maximum number of samples of a spectrum that is summed on the stack.
const SPECTRUM: usize = 512;

impl Function {
    /// Writes the whole spectrum at `place` (indices and directions) into `out` (`lambdas()` long), in the
    /// measurement's unit, without a cosine factor. NaN means masked; values are 0 if `wo` is outside the outgoing
    /// domain.
    #[inline]
    pub(super) fn spectrum(&self, place: Place<'_>, how: Interpolation, out: &mut [f32]) -> Result<(), EvaluateError> {
        let geometry = self.geometry();
        Buffer::Spectrum.check(out.len(), geometry.lambdas())?;
        match self.form() {
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
            Form::Samples(samples) if geometry.is_alone() => {
                geometry.cell_of(place)?;
                out.copy_from_slice(samples.all());
            }
            Form::Samples(samples) => match samples.find(geometry, place, how)? {
                Found::Outside => out.fill(0.0),
                Found::Cell(row) => out.copy_from_slice(row),
                Found::Rows(rows) => samples.sum(&rows, out),
            },
        }
        Ok(())
    }

    /// Writes the values at the indices and directions of `place`, at `wavelengths` in nm, into `out`, which has the
    /// same length. Values are linear between the measured wavelengths; `beyond` decides outside their range. A value
    /// is NaN (masked) if one of the two samples between which it lies is. Fails for RGB and monochromatic data.
    #[inline]
    pub(super) fn at_wavelengths(
        &self,
        place: Place<'_>,
        how: Interpolation,
        beyond: Beyond,
        wavelengths: &[f64],
        out: &mut [f32],
    ) -> Result<(), EvaluateError> {
        let geometry = self.geometry();
        let Some(grid) = geometry.grid() else {
            return unfit(QueryError::NoWavelengths { quantity: geometry.quantity() });
        };
        Buffer::Wavelengths.check(out.len(), wavelengths.len())?;
        match self.form() {
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
            Form::Samples(samples) => match samples.find(geometry, place, how)? {
                Found::Outside => between(grid, beyond, wavelengths, out, |_| 0.0),
                Found::Cell(row) => between(grid, beyond, wavelengths, out, |lambda| row[lambda]),
                Found::Rows(rows) => between(grid, beyond, wavelengths, out, |lambda| samples.sample_of(&rows, lambda)),
            },
        }
        Ok(())
    }

    /// Inner product of the spectrum at the indices and directions of `place` with `weights`, one for each sample: for
    /// example a luminance, the power in a band, or a mean. NaN if a sample with a nonzero weight is masked.
    pub(super) fn weighted(&self, place: Place<'_>, how: Interpolation, weights: &[f32]) -> Result<f32, EvaluateError> {
        let geometry = self.geometry();
        Buffer::Weights.check(weights.len(), geometry.lambdas())?;
        self.weighted_by(place, how, weights, |value| {
            weights.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(lambda, w)| w * value(lambda)).sum()
        })
    }

    /// Inner product of the spectrum at the indices and directions of `place` with `weights`, one for each sample.
    /// Masked samples are skipped and the remaining weights renormalised; 0 if all are masked.
    pub(super) fn weighted_known(
        &self,
        place: Place<'_>,
        how: Interpolation,
        weights: &[f32],
    ) -> Result<f32, EvaluateError> {
        let sum = self.weighted_by(place, how, weights, |value| known_sum(weights, value))?;
        Ok(if sum.is_nan() { 0.0 } else { sum })
    }

    /// Inner product with `weights` of the sum of two spectra: the material's at the indices and directions of `place`,
    /// and one whose sample number n is `beside(n)`. Samples masked in the first are skipped in both and the remaining
    /// weights renormalised; 0 if all are masked.
    pub(super) fn weighted_known_beside(
        &self,
        place: Place<'_>,
        how: Interpolation,
        weights: &[f32],
        beside: impl Fn(usize) -> f32,
    ) -> Result<f32, EvaluateError> {
        let sum = self
            .weighted_by(place, how, weights, |value| known_sum(weights, &|lambda| value(lambda) + beside(lambda)))?;
        let more = match self.form() {
            Form::Planes { .. } => weights.iter().enumerate().map(|(lambda, w)| w * beside(lambda)).sum(),
            Form::Samples(_) => 0.0,
        };
        Ok(if sum.is_nan() { 0.0 } else { sum + more })
    }

    /// Inner product with `weights` of the spectrum at the indices and directions of `place`. If all samples are
    /// stored, `sum` computes it from a function of the sample's number. From spectral coefficients it is NaN where the
    /// spectrum is masked.
    fn weighted_by(
        &self,
        place: Place<'_>,
        how: Interpolation,
        weights: &[f32],
        sum: impl Fn(&dyn Fn(usize) -> f32) -> f32,
    ) -> Result<f32, EvaluateError> {
        let geometry = self.geometry();
        Ok(match self.form() {
            Form::Planes { planes, smooth } => self.weighted_planes(planes, smooth, place, how, weights)?,
            Form::Samples(samples) => match samples.find(geometry, place, how)? {
                Found::Outside => 0.0,
                Found::Cell(row) => sum(&|lambda| row[lambda]),
                Found::Rows(rows) => {
                    // Sums row by row if the spectrum fits here: reading one sample of each row in turn jumps through
                    // memory.
                    let mut spectrum = [0.0; SPECTRUM];
                    match spectrum.get_mut(..geometry.lambdas()) {
                        Some(spectrum) => {
                            samples.sum(&rows, spectrum);
                            sum(&|lambda| spectrum[lambda])
                        }
                        None => sum(&|lambda| samples.sample_of(&rows, lambda)),
                    }
                }
            },
        })
    }

    /// Inner product with `weights` of the spectrum at the indices and directions of `place`, from spectral
    /// coefficients. NaN where the spectrum is masked, even if there are no weights.
    fn weighted_planes(
        &self,
        planes: &Planes,
        smooth: &Smooth,
        place: Place<'_>,
        how: Interpolation,
        weights: &[f32],
    ) -> Result<f32, EvaluateError> {
        self.with_row(
            planes,
            smooth,
            place,
            how,
            None,
            #[inline(always)]
            |row, presence| planes.weighted(row, presence, weights),
        )
    }

    /// Samples `[outgoing, wavelength]` for one combination of the axes before the outgoing one, whose row-major
    /// position is `slice`. Data without directions give one spectrum. NaN means masked.
    ///
    /// # Panics
    /// If there is no such entry.
    pub(super) fn slice(&self, slice: usize) -> Vec<f32> {
        let geometry = self.geometry();
        let [_, n_out, lambdas] = geometry.shape();
        let length = n_out * lambdas;
        match self.form() {
            Form::Samples(samples) => samples.all()[slice * length..][..length].to_vec(),
            Form::Planes { planes, .. } => {
                let mut out = vec![0.0; length];
                for (cell, out) in (slice * n_out..).zip(out.chunks_exact_mut(lambdas)) {
                    planes.expand(planes.row(cell), planes.presence(cell), out);
                }
                out
            }
        }
    }

    /// Samples of the opened material: the decoded ones, up to the deviation that its report gives.
    pub(super) fn measurement(&self) -> Result<Measurement, EvaluateError> {
        let geometry = self.geometry();
        let [n_in, ..] = geometry.shape();
        let samples = (0..geometry.entries() * n_in).flat_map(|slice| self.slice(slice)).collect();
        let tensor = Tensor::new(geometry.axes().to_vec(), samples)?;
        Ok(Measurement { quantity: geometry.quantity(), unit: geometry.unit(), sampling: geometry.sampling(), tensor })
    }

    /// Returns true if the function is unmasked at one wavelength or more for a pair of directions.
    pub(super) fn is_known(&self, place: Place<'_>, how: Interpolation) -> Result<bool, EvaluateError> {
        let geometry = self.geometry();
        match self.form() {
            // A sum over no wavelengths is NaN if and only if the spectrum is masked.
            Form::Planes { planes, smooth } => Ok(!self.weighted_planes(planes, smooth, place, how, &[])?.is_nan()),
            Form::Samples(samples) => Ok(match samples.find(geometry, place, how)? {
                Found::Outside => true,
                Found::Cell(row) => row.iter().any(|sample| !sample.is_nan()),
                Found::Rows(rows) => (0..geometry.lambdas()).any(|lambda| !samples.sample_of(&rows, lambda).is_nan()),
            }),
        }
    }
}

/// Writes the values that spectral coefficients have at up to [`FEW`] wavelengths in nm.
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

/// Interpolates linearly between the samples of a spectrum, at wavelengths in nm.
#[inline]
pub(super) fn between(
    grid: &WavelengthGrid,
    beyond: Beyond,
    wavelengths: &[f64],
    out: &mut [f32],
    sample: impl Fn(usize) -> f32,
) {
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
