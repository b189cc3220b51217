//! Errors of a material at scattered samples, and what of them it adds to the noise of these.

use super::sample_light::{IncidenceLight, LightSums, SampleLight};
use super::uncertainty::Within;
use crate::compress::Target;
use crate::domain::{ErrorAccumulator, ErrorReport};
use crate::evaluate::{Directions, Interpolation, Material, Pairs, Place};
use crate::formats::Acquisition;
use crate::projection::{Projected, Rejected, ScatterReport, ScatteredSamples, scattered_samples};
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
    /// er(L2) at all samples, rejected ones too; `None` in files of earlier versions.
    #[serde(default)]
    pub fit_all: Option<f64>,
    /// Error that the material adds to the noise: the root of fit² − noise², 0 where that is negative.
    pub added: f64,
    /// Upper bound on `added`: twice the promised error, or half of the noise if that is more.
    pub allowed: f64,
    /// Samples left out as outliers.
    pub rejected: Rejected,
    /// Those of them that lie alone; `None` in files of earlier versions.
    #[serde(default)]
    pub isolated: Option<Rejected>,
    /// Values far from their neighbours that are the light of a narrow lobe, and were not rejected.
    #[serde(default)]
    pub lobe: u64,
    /// The largest differences of the light of the material from that of the samples, over incidences and groups of bands;
    /// `None` in files of earlier versions.
    #[serde(default)]
    pub light: Option<SampleLight>,
    /// Share of all values with a stated standard uncertainty u, rejected ones too, from which the evaluated material
    /// is at most 2u away, 0 to 1; `None` where the file states none, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_2u: Option<f64>,
}

/// Errors of a material at scattered samples, and its light against theirs.
#[derive(Clone, Debug, Default)]
pub(super) struct AtSamples {
    /// Errors at the samples that were not rejected.
    pub(super) errors: ErrorReport,
    /// er(L2) at all samples.
    pub(super) all: f64,
    /// Empty where it was not asked for.
    pub(super) light: Vec<IncidenceLight>,
    /// Values within twice their stated uncertainty.
    pub(super) within: Within,
}

impl FitReport {
    /// The report on a material with these errors at the samples; `promised` is its relative error against the cells.
    pub(super) fn new(scatter: &ScatterReport, found: &AtSamples, promised: f64) -> Self {
        let ScatterReport { noise, rejected, isolated, lobe, .. } = *scatter;
        let (fit, sigma) = (found.errors.er_l2, noise.unwrap_or(0.0));
        let added = (fit * fit - sigma * sigma).max(0.0).sqrt();
        let allowed = (2.0 * promised).max(0.5 * sigma);
        let light = (!found.light.is_empty()).then(|| SampleLight::of(&found.light));
        Self {
            noise,
            fit,
            fit_all: Some(found.all),
            added,
            allowed,
            rejected,
            isolated: Some(isolated),
            lobe,
            light,
            within_2u: found.within.share(),
        }
    }

    /// Returns true where the material adds no more than it may.
    pub fn is_kept(&self) -> bool {
        self.added <= self.allowed
    }

    /// The numbers as a file states them, with four digits.
    pub(super) fn stated(&self) -> Self {
        let rounded = |value: f64| format!("{value:.3e}").parse().unwrap_or(value);
        let shares = |Rejected { values, samples, light }: Rejected| {
            let (samples, light) = (rounded(samples), rounded(light));
            Rejected { values, samples, light }
        };
        let light = |SampleLight { kept, together, all }: SampleLight| {
            let (kept, together, all) = (kept.map(rounded), together.map(rounded), all.map(rounded));
            SampleLight { kept, together, all }
        };
        Self {
            noise: self.noise.map(rounded),
            fit: rounded(self.fit),
            fit_all: self.fit_all.map(rounded),
            added: rounded(self.added),
            allowed: rounded(self.allowed),
            rejected: shares(self.rejected),
            isolated: self.isolated.map(shares),
            lobe: self.lobe,
            light: self.light.map(light),
            within_2u: self.within_2u.map(rounded),
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
pub(super) fn scatter_of(projected: &Projected) -> ScatterReport {
    projected.coverage.scatter.as_deref().cloned().unwrap_or_default()
}

/// Errors of `material`, evaluated as it is by default, at the scattered samples of `acquisition`, and its light there where
/// `light` has sums for it.
pub(super) fn at_samples(
    acquisition: &Acquisition,
    samples: &ScatteredSamples,
    material: &Material,
    mut light: Option<(&mut LightSums, Option<f64>)>,
) -> AtSamples {
    let Some(scattered) = scattered_samples(acquisition) else { return AtSamples::default() };
    let width = samples.width();
    if material.lambdas() != width {
        return AtSamples::default();
    }
    let rows = (PIECE / width.max(1)).clamp(1, samples.len().max(1));
    let (mut original, mut found) = (vec![0.0_f32; rows * width], vec![0.0_f32; rows * width]);
    let (mut errors, mut all) = (ErrorAccumulator::default(), ErrorAccumulator::default());
    let (mut sigma, mut within) = (Vec::new(), Within::default());
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
        all.add(original, found, 0.0);
        sigma.resize(original.len(), 0.0);
        if samples.write_sigma(&scattered, from, to, &mut sigma) {
            within.add(original, found, &sigma);
        }
        if let Some((sums, _)) = &mut light {
            sums.add(from, (&*original, &*found), samples.rejected(from, to));
        }
        for (place, _) in samples.rejected(from, to) {
            (original[place], found[place]) = (f32::NAN, f32::NAN);
        }
        errors.add(original, found, 0.0);
    }
    let mut errors = errors.finish();
    errors.samples -= samples.rejected_values();
    errors.masked_samples -= samples.rejected_values();
    let spectral = material.axes().last();
    let light = light.map_or_else(Vec::new, |(sums, noise)| sums.finish(noise, spectral));
    AtSamples { errors, all: all.finish().er_l2, light, within }
}
