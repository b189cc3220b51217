//! Errors of the decoded samples at a step, for targets that bound one, and the largest step that keeps the bound.

use super::super::below_floor::BelowFloor;
use super::super::classes::apply_classes;
use super::super::error::CompressError;
use super::super::promise::colours_of;
use super::super::refusal::{self, Limits};
use super::super::search::Falling;
use super::super::setting_error::SettingError;
use super::super::spectral_basis::SpectralBasis;
use super::super::target::{Bound, Target};
use super::largest_step::{COARSE, largest_falling, largest_power};
use crate::codec::Class;
use crate::domain::colour::SpectraColours;
use crate::domain::{Cancelled, ErrorReport, Measurement, Progress, Restated};
use std::borrow::Cow;
use std::cell::Cell;

/// Measure of the error of decoded samples that a search for a quantiser step bounds.
enum Metric {
    /// Error of all samples in one number, for example the mean relative error er(L1), with its upper bound.
    Samples(Bound),
    /// Colours of the measurement's spectra, and the largest colour difference allowed.
    Colours(Box<SpectraColours>, f64),
}

/// Inputs of a search for the largest quantiser step that keeps an error.
pub(super) struct Trial<'a, F> {
    /// Original measurement, against which errors are measured.
    pub(super) measurement: &'a Measurement,
    /// Classes (positive, negative, zero, masked) of the samples; `None` if all are positive.
    pub(super) classes: Option<&'a [Class]>,
    /// Magnitude below which samples do not count in relative errors, in the unit of the samples.
    pub(super) floor: f32,
    /// True if quantiser steps are in the unit of the samples, false if in natural logarithms.
    pub(super) linear: bool,
    /// Reasons why files may follow the samples no closer, and a remedy.
    pub(super) limits: Limits,
    /// Function that computes the decoded magnitudes for a quantiser step.
    pub(super) magnitudes: F,
}

impl<F: Fn(f32) -> Vec<f32>> Trial<'_, F> {
    /// Finds the largest quantiser step that keeps `target`, which must bound an error. If none does, `closest` is the
    /// smallest error found.
    pub(super) fn largest_step(
        &self,
        target: Target,
        (basis, finest, closest): (SpectralBasis, f64, &Cell<f64>),
        progress: &dyn Progress,
    ) -> Result<f64, CompressError> {
        let metric = match (target, target.bound()) {
            (Target::DeltaE(wanted), _) => {
                Metric::Colours(Box::new(colours_of(self.measurement, wanted)?), wanted.at_most)
            }
            (_, Some(bound)) => Metric::Samples(bound),
            (_, None) => return Err(SettingError::Unbounded.into()),
        };
        // Relative errors are those of positive samples. If all are negative, their errors are used instead; otherwise
        // any step would pass.
        let (axes, samples) = (self.measurement.tensor.axes(), self.measurement.tensor.samples());
        let negated = matches!(target, Target::ErL1(_)) && !samples.iter().any(|&s| s > 0.0 && s >= self.floor);
        let original = if negated { Cow::Owned(samples.iter().map(|s| -s).collect()) } else { Cow::Borrowed(samples) };
        let restated = Restated::of(axes, &original, f64::from(self.floor));
        let coarse = if self.linear { f64::INFINITY } else { COARSE };
        // Measures the error at a step, and if it is kept.
        let measure = |step: f64| {
            if progress.is_cancelled() {
                return Err(CompressError::from(Cancelled));
            }
            let mut decoded = (self.magnitudes)(step as f32);
            if let Some(classes) = self.classes {
                apply_classes(classes, &mut decoded);
            }
            if negated {
                for sample in &mut decoded {
                    *sample = -*sample;
                }
            }
            let (found, keeps) = match &metric {
                Metric::Colours(colours, at_most) => {
                    let found = colours.differences(&decoded).largest;
                    (found, found <= *at_most)
                }
                Metric::Samples(bound) => {
                    let errors = ErrorReport::with_means(&restated, &original, &decoded, f64::from(self.floor));
                    ((bound.figure)(&errors), bound.keeps(&errors))
                }
            };
            closest.set(closest.get().min(found));
            let keeps_floor =
                || self.floor <= 0.0 || BelowFloor::measure(&original, &decoded, self.floor).keeps(self.floor);
            Ok((found, keeps && keeps_floor()))
        };
        let falls = matches!(metric, Metric::Samples(_));
        let mut falling = Falling::default();
        let keeps = |step: f64| {
            let (found, keeps) = measure(step)?;
            Ok(if keeps || !falls || falling.falls(step, found) || step >= coarse { Ok(keeps) } else { Err(()) })
        };
        if let Some(step) = largest_falling(self.first_step(target), keeps)? {
            return Ok(step);
        }
        // The search may have started at steps that are already too fine.
        let keeps = |step: f64| Ok(measure(step)?.1);
        if let Some(step) = largest_power((self.first_step(target), finest), basis, closest, keeps)? {
            return Ok(step);
        }
        let wanted = match &metric {
            Metric::Colours(_, at_most) => ("delta_e", *at_most),
            Metric::Samples(bound) => (bound.name, bound.at_most),
        };
        Err(refusal::cannot_follow(wanted, closest.get(), (basis, self.linear), self.limits))
    }

    /// Initial guess of the quantiser step for a wanted error: that of a uniform quantiser, larger because most
    /// coefficients become 0.
    fn first_step(&self, target: Target) -> f64 {
        match target {
            Target::ErL1(error) => 5.0 * error,
            // A step of 1 % changes lightness by about 0.1.
            Target::DeltaE(wanted) => (0.1 * wanted.at_most).min(4.0),
            Target::RelativeRmse(error) if self.linear => {
                4.0 * error * root_mean_square(self.measurement.tensor.samples()).max(f64::from(f32::MIN_POSITIVE))
            }
            Target::RelativeRmse(error) | Target::ErL2(error) => 4.0 * error,
            _ => 0.01,
        }
    }
}

/// Root mean square √(Σ s² / n) of the samples that are not NaN, summed in order.
pub(super) fn root_mean_square(samples: &[f32]) -> f64 {
    let measured = samples.iter().filter(|s| !s.is_nan());
    let (sum, count) = measured.fold((0.0, 0_u64), |(sum, n), &s| (sum + f64::from(s) * f64::from(s), n + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}
