//! Errors of a material at scattered samples, and the part of them that exceeds the noise of the samples.

use super::sample_light::{IncidenceLight, LightSums, SampleLight};
use super::uncertainty::Within;
use crate::compress::Target;
use crate::domain::{DEFAULT_ERROR, ErrorAccumulator, ErrorReport};
use crate::evaluate::{Directions, Interpolation, Material, Pairs, Place};
use crate::formats::{Acquisition, with_digits};
use crate::projection::{Projected, Rejected, ScatterReport, ScatteredSamples, scattered_samples};
use serde::{Deserialize, Serialize};

/// Number of values of the samples and of the material that are compared at a time. Raising it uses more memory: two
/// arrays of float32.
const PIECE: usize = 1 << 20;

/// Errors of a compressed material at samples of scattered directions. All numbers are relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FitReport {
    /// Relative root mean square noise of the samples, estimated from differences between neighbouring samples. It does
    /// not depend on the resolution of the material. `None` if there are too few samples.
    pub noise: Option<f64>,
    /// Root mean square relative error, er(L2), of the evaluated material at all samples that were not rejected as
    /// outliers.
    pub fit: f64,
    /// Root mean square relative error, er(L2), of the evaluated material at all samples, rejected outliers included;
    /// `None` in files of earlier versions.
    #[serde(default)]
    pub fit_all: Option<f64>,
    /// Error that the material adds to the noise of the samples: √(e² − noise²), where e is its root mean square
    /// relative error at the samples; 0 if e is below the noise.
    pub added: f64,
    /// Upper bound on the error that the material may add to the noise of the samples: twice the promised error or half
    /// the noise, whichever is larger.
    pub allowed: f64,
    /// Number and share of the sample values that were left out of the fit as outliers.
    pub rejected: Rejected,
    /// Number and share of the sample values rejected as outliers that have no other outlier near them; `None` in files
    /// of earlier versions.
    #[serde(default)]
    pub isolated: Option<Rejected>,
    /// Number of sample values that differ strongly from their neighbours but belong to a narrow lobe. They are not
    /// rejected as outliers.
    #[serde(default)]
    pub lobe: u64,
    /// Largest differences between the directional albedo or flux of the material and that of the samples, over
    /// incident directions and wavelength bands. `None` in files of earlier versions.
    #[serde(default)]
    pub light: Option<SampleLight>,
    /// Fraction (0 to 1) of the values with a standard uncertainty u in the file from which the evaluated material
    /// differs by at most 2u. The total includes values rejected as outliers. `None` if the file states no uncertainty,
    /// and in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_2u: Option<f64>,
}

/// Errors of a material at samples of scattered directions, and its light compared with that of the samples.
#[derive(Clone, Debug, Default)]
pub(super) struct AtSamples {
    /// Errors of the material at the samples that were not rejected as outliers.
    pub(super) errors: ErrorReport,
    /// Root mean square relative error, er(L2), at all samples, rejected outliers included.
    pub(super) all: f64,
    /// Comparison of the material's values with the sample values, each summed over outgoing directions, for each
    /// incident direction and group of wavelength bands; empty if not requested.
    pub(super) light: Vec<IncidenceLight>,
    /// Number of sample values that the material matches within twice their uncertainty.
    pub(super) within: Within,
}

impl FitReport {
    /// Creates the report on a material at scattered samples, from the errors `found` there. `promised` is the relative
    /// error that the compression of the averages over triangles promises.
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

    /// Returns true if the error that a material adds to the noise of its samples is within its bound.
    pub fn is_kept(&self) -> bool {
        self.added <= self.allowed
    }

    /// Returns the report with numbers rounded to four significant digits, as they are stored in files.
    pub(super) fn stated(&self) -> Self {
        let rounded = |value: f64| with_digits(value, 4);
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

/// Returns the relative error that a compression `target` promises. For targets without a relative error, it is the
/// `reached` error, but at least 1 %.
pub(super) fn promised(target: Target, reached: f64) -> f64 {
    match target {
        Target::ErL1(error) | Target::ErL2(error) | Target::MaxRelativeError(error) => error,
        _ => reached.max(DEFAULT_ERROR),
    }
}

/// Returns the report on noise and outliers of scattered samples; an empty report for other samples.
pub(super) fn scatter_of(projected: &Projected) -> ScatterReport {
    projected.coverage.scatter.as_deref().cloned().unwrap_or_default()
}

/// Compares `material`, evaluated with its default interpolation, with the scattered samples of `acquisition`.
///
/// `light`, if given, has the sums over directions to which the values of both are added, and the relative noise of the
/// samples.
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
            // Some direction cannot be evaluated: evaluate one by one and mark the failures.
            for (i, found) in found.chunks_exact_mut(width).enumerate() {
                let at = |directions: &Option<Vec<_>>| directions.as_ref().map(|directions| directions[i]);
                let place = Place { index: &[], wi: at(&wi), wo: at(&wo) };
                if material.evaluate(place, Interpolation::Smooth, found).is_err() {
                    found.fill(f32::NAN);
                }
            }
        }
        // Missing samples are not compared, so the evaluated value must not count as a mismatch.
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
