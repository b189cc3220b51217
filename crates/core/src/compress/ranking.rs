//! Selects the spectral bases that compete.
//!
//! At a wanted ratio or size every wavelet is ranked. The score is the energy lost by its coefficients, or, for policy
//! conventional, the error with the wanted number of coefficients. Small measurements are ranked on all samples, large
//! ones on a sample of spectra; the best few are then tried on all samples. At a wanted error only the three bases that
//! serve nearly all data compete.

use super::effort::Tally;
use super::error::CompressError;
use super::fill::fill;
use super::metadata_chunk::metadata_chunk;
use super::policy::Policy;
use super::scales::Scales;
use super::setting_error::SettingError;
use super::settings::Settings;
use super::spectral_basis::SpectralBasis;
use super::target::Target;
use super::thresholded;
use super::values::Values;
use crate::domain::{Axis, Measurement, Progress, Silent, Tensor};
use crate::transform::{LineBasis, Plan, SphereBasis, Weights};
use rayon::prelude::*;

/// Largest number of wavelengths for which basis `auto` tries the data's own principal components.
const MOST_FOR_KLT: usize = 4096;
/// Smallest number of spectra for which a basis of the data's own principal components is worth its bytes.
const LEAST_FOR_KLT: usize = 32;
/// Largest number of samples for which every spectral basis is tried on all of them. Raising it costs trials.
const SMALL: usize = 1 << 13;
/// Number of spectral bases that get a full search on all samples of a large measurement: the best in trials on a
/// subset of its spectra. Raising it costs one search each.
const FINALISTS: usize = 4;
/// Number of spectral bases tried on all samples of a small measurement for a wanted file size: one quantisation each,
/// then a full search of the best few. Raising it costs trials; at this value a wanted size takes at most four times as
/// many as a wanted error.
const SMALL_FINALISTS: usize = 11;
const SMALL_FINALISTS_OF_A_RATIO: usize = 42;
/// Number of spectral bases tried on all samples of a small measurement for a wanted ratio of samples to kept
/// coefficients by the policies `generic` and `adaptive`. Each basis takes many trials to find a threshold for each
/// axis.
const SPACES_FINALISTS_OF_A_RATIO: usize = 24;
/// Bytes of a small file besides its coefficients: magic, header and checksums.
const HEADER: usize = 44;
/// Typical number of bytes of an exactly kept coefficient, its position included.
const BYTES_OF_A_FLOAT: f64 = 4.5;

/// Returns the spectral bases to try for a measurement.
pub(crate) fn candidates(
    measurement: &Measurement,
    settings: &Settings,
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Vec<SpectralBasis>, CompressError> {
    if let Some(basis) = SpectralBasis::named(&settings.basis) {
        return Ok(vec![basis]);
    }
    let axes = measurement.tensor.axes();
    let wavelengths = axes.last().filter(|axis| matches!(axis, Axis::Wavelength(_))).map_or(1, Axis::len);
    if wavelengths < 2 {
        return Ok(vec![SpectralBasis::Line(LineBasis::BIOR44)]);
    }
    let spectra = measurement.tensor.len() / wavelengths;
    let own = settings.policy == Policy::Rd && wavelengths <= MOST_FOR_KLT && spectra >= LEAST_FOR_KLT;
    let wavelets = match settings.target {
        // Bases that seldom win are not tried.
        Target::Step(_) if own => Vec::new(),
        Target::Step(_) => vec![LineBasis::BIOR44],
        // Exactly kept coefficients are counted without a search, so every basis is tried.
        Target::Ratio(_) if settings.policy == Policy::Conventional && measurement.tensor.len() <= SMALL => {
            LineBasis::distinct().collect()
        }
        Target::Ratio(ratio) => finalists(measurement, settings, wavelengths, ratio, (progress, tally))?,
        Target::Bytes(bytes) => {
            let bytes_each = if settings.policy == Policy::Rd { 1.0 } else { BYTES_OF_A_FLOAT };
            let metadata = settings.metadata.as_deref().map_or(0, |text| metadata_chunk(axes, text).1.len());
            let coefficients = bytes.saturating_sub((HEADER + metadata) as u64).max(8);
            let ratio = measurement.tensor.len() as f64 * bytes_each / coefficients as f64;
            finalists(measurement, settings, wavelengths, ratio, (progress, tally))?
        }
        _ => vec![LineBasis::BIOR44, LineBasis::BIOR22, LineBasis::HAAR],
    };
    let wavelets = wavelets.into_iter().map(SpectralBasis::Line);
    Ok(own.then_some(SpectralBasis::Klt).into_iter().chain(wavelets).collect())
}

/// Returns the spectral bases of least error, ranked on all samples or on a subset of the spectra.
fn finalists(
    measurement: &Measurement,
    settings: &Settings,
    wavelengths: usize,
    ratio: f64,
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Vec<LineBasis>, CompressError> {
    let small = measurement.tensor.len() <= SMALL;
    let sample = if small { measurement.clone() } else { sample_of(measurement, wavelengths)? };
    // A sample of spectra has less redundancy than the whole tensor, so the ratio is limited.
    let ratio = if small { ratio.max(1.0) } else { ratio.clamp(2.0, (wavelengths as f64 / 4.0).max(2.0)) };
    let bases = LineBasis::distinct().collect::<Vec<_>>();
    // With a single threshold, one trial of each basis is cheaper than a search for an error; thresholds of each space
    // cost more.
    let mut tried: Vec<(f64, LineBasis)> = if settings.policy == Policy::Conventional {
        let settings = Settings { target: Target::Ratio(ratio), ..settings.clone() };
        let error = |basis: LineBasis| {
            let bases = [SpectralBasis::Line(basis)];
            let file = thresholded::compress(&sample, &settings, &bases, 0.0, (&Silent, tally)).ok()?;
            Some((file.summary.errors.er_l2, basis))
        };
        bases.into_par_iter().filter_map(error).collect()
    } else {
        let logs = logarithms(&sample);
        let lost = |basis: LineBasis| Some((lost_logarithms(&sample, &logs, basis, ratio)?, basis));
        bases.into_par_iter().filter_map(lost).collect()
    };
    progress.step(0.2)?;
    tried.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.code().cmp(&b.1.code())));
    let count = match settings.target {
        Target::Ratio(_) if small && matches!(settings.policy, Policy::Generic | Policy::Adaptive) => {
            SPACES_FINALISTS_OF_A_RATIO
        }
        _ if !small || settings.policy != Policy::Rd => FINALISTS,
        Target::Ratio(_) => SMALL_FINALISTS_OF_A_RATIO,
        _ => SMALL_FINALISTS,
    };
    let mut best: Vec<LineBasis> = tried.into_iter().take(count).map(|(_, basis)| basis).collect();
    if !best.contains(&LineBasis::BIOR44) {
        best.push(LineBasis::BIOR44);
    }
    Ok(best)
}

/// Draws evenly spaced spectra from a large measurement, about [`SMALL`] samples in all, for ranking bases.
fn sample_of(measurement: &Measurement, wavelengths: usize) -> Result<Measurement, CompressError> {
    let spectra: Vec<&[f32]> = measurement.tensor.samples().chunks_exact(wavelengths).collect();
    let stride = spectra.len().div_ceil((SMALL / wavelengths).max(1));
    let sample: Vec<f32> = spectra.iter().step_by(stride).flat_map(|spectrum| spectrum.iter().copied()).collect();
    let spectral = measurement.tensor.axes().last().cloned();
    let axes = [Axis::Index { count: sample.len() / wavelengths, labels: Vec::new() }];
    let tensor = Tensor::new(axes.into_iter().chain(spectral).collect(), sample).map_err(SettingError::Sample)?;
    Ok(Measurement { tensor, ..measurement.clone() })
}

/// Logarithms of the samples' magnitudes, filled smoothly at zero and masked samples.
fn logarithms(measurement: &Measurement) -> Vec<f32> {
    let values = Values::Logarithms;
    let of = |&s: &f32| values.wanted(s, values.class_of(s, 0.0), 0.0) as f32;
    let mut logs: Vec<f32> = measurement.tensor.samples().iter().map(of).collect();
    fill(measurement.tensor.axes(), &mut logs);
    logs
}

/// Squared error of the logarithms of samples if only the largest 1/`ratio` of the coefficients of their transform are
/// kept, with `basis` along wavelengths. It is computed without coding or reconstruction.
fn lost_logarithms(measurement: &Measurement, logs: &[f32], basis: LineBasis, ratio: f64) -> Option<f64> {
    let axes = measurement.tensor.axes();
    let sphere = SphereBasis::Orthonormal(Weights::Count);
    let transforms: Vec<_> = axes.iter().map(|axis| SpectralBasis::Line(basis).transform_of(axis, sphere)).collect();
    let plan = Plan::new(axes, &transforms).ok()?;
    let mut coefficients = logs.to_vec();
    plan.forward(&mut coefficients);
    Some(Scales::new(axes, &plan).lost((logs.len() as f64 / ratio) as usize, &coefficients))
}
