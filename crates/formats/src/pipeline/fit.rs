//! Errors of a material at scattered samples, and what of them it adds to the noise of these.

use crate::compress::Target;
use crate::domain::{ErrorAccumulator, ErrorReport};
use crate::evaluate::{Directions, Interpolation, Material, Pairs, Place};
use crate::formats::Acquisition;
use crate::projection::{Projected, Rejected, ScatteredSamples, scattered_samples};
use serde::{Deserialize, Serialize};

/// Values that are compared at a time.
const PIECE: usize = 1 << 20;
/// Promised relative error of targets that name none.
const PROMISED: f64 = 0.01;

/// Errors of a material at scattered samples; all numbers are relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Root mean square of the noise of the samples, from differences between neighbours, whatever the cells; `None` where
    /// there are too few samples to tell.
    pub noise: Option<f64>,
    /// er(L2) of the evaluated material at all samples that were not rejected.
    pub fit: f64,
    /// Error that the material adds to the noise: the root of fit² − noise², 0 where that is negative.
    pub added: f64,
    /// Upper bound on `added`: twice the promised error, or half of the noise if that is more.
    pub allowed: f64,
    /// Samples left out as outliers.
    pub rejected: Rejected,
}

impl FitReport {
    /// The report on a material with these errors at the samples; `promised` is its relative error against the cells.
    pub(super) fn new(noise: Option<f64>, rejected: Rejected, errors: &ErrorReport, promised: f64) -> Self {
        let (fit, sigma) = (errors.er_l2, noise.unwrap_or(0.0));
        let added = (fit * fit - sigma * sigma).max(0.0).sqrt();
        Self { noise, fit, added, allowed: (2.0 * promised).max(0.5 * sigma), rejected }
    }

    /// Returns true where the material adds no more than it may.
    pub fn is_kept(&self) -> bool {
        self.added <= self.allowed
    }

    /// The numbers as a file states them, with four digits.
    pub(super) fn stated(&self) -> Self {
        let rounded = |value: f64| format!("{value:.3e}").parse().unwrap_or(value);
        let Rejected { values, samples, light } = self.rejected;
        Self {
            noise: self.noise.map(rounded),
            fit: rounded(self.fit),
            added: rounded(self.added),
            allowed: rounded(self.allowed),
            rejected: Rejected { values, samples: rounded(samples), light: rounded(light) },
        }
    }
}

/// The relative error that `target` promises, at least `reached` where it names none.
pub(super) fn promised(target: Target, reached: f64) -> f64 {
    match target {
        Target::ErL1(error) | Target::ErL2(error) | Target::MaxRelativeError(error) => error,
        _ => reached.max(PROMISED),
    }
}

/// The noise and the outliers of scattered samples.
pub(super) fn noise_of(projected: &Projected) -> (Option<f64>, Rejected) {
    projected.coverage.scatter.as_ref().map_or_else(Default::default, |found| (found.noise, found.rejected))
}

/// Errors of `material`, evaluated as it is by default, at the scattered samples of `acquisition` that were not rejected.
pub(super) fn errors(acquisition: &Acquisition, samples: &ScatteredSamples, material: &Material) -> ErrorReport {
    let Some(scattered) = scattered_samples(acquisition) else { return ErrorReport::default() };
    let width = samples.width();
    if material.lambdas() != width {
        return ErrorReport::default();
    }
    let rows = (PIECE / width.max(1)).clamp(1, samples.len().max(1));
    let (mut original, mut found) = (vec![0.0_f32; rows * width], vec![0.0_f32; rows * width]);
    let mut errors = ErrorAccumulator::default();
    for from in (0..samples.len()).step_by(rows) {
        let to = (from + rows).min(samples.len());
        let (original, found) = (&mut original[..(to - from) * width], &mut found[..(to - from) * width]);
        samples.write(&scattered, from, to, original);
        let (wi, wo) = (samples.incoming(from, to), samples.outgoing(from, to));
        let pairs = Pairs { index: &[], wi: wi.as_deref().map(Directions::of), wo: wo.as_deref().map(Directions::of) };
        if material.par_spectra(pairs, Interpolation::Smooth, found).is_err() {
            // Some direction has no answer: the others have.
            for (i, found) in found.chunks_exact_mut(width).enumerate() {
                let at = |directions: &Option<Vec<_>>| directions.as_ref().map(|directions| directions[i]);
                let place = Place { index: &[], wi: at(&wi), wo: at(&wo) };
                if material.evaluate(place, Interpolation::Smooth, found).is_err() {
                    found.fill(f32::NAN);
                }
            }
        }
        // What is not compared is no mismatch.
        found
            .iter_mut()
            .zip(&*original)
            .filter(|(_, original)| original.is_nan())
            .for_each(|(found, _)| *found = f32::NAN);
        errors.add(original, found, 0.0);
    }
    let mut errors = errors.finish();
    errors.samples -= samples.rejected_values();
    errors.masked_samples -= samples.rejected_values();
    errors
}
