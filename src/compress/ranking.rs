//! Which bases compete along wavelength.
//!
//! At a wanted ratio or size every basis competes: all of them on small measurements; on large ones all on a sample of
//! spectra, and the best few on the whole. At a wanted error the three that serve nearly all data compete.

use super::{CompressError, Policy, Settings, SpectralBasis, Target, thresholded};
use crate::domain::{Axis, Measurement, Progress, Silent, Tensor};
use crate::transform::LineBasis;
use rayon::prelude::*;

/// Wavelengths up to which the data's own basis is tried without being asked for.
const MOST_FOR_KLT: usize = 4096;
/// Spectra from which a basis of their own is worth its bytes.
const LEAST_FOR_KLT: usize = 32;
/// Samples up to which every basis is tried on the whole.
const SMALL: usize = 1 << 13;
/// How many of the sample's best are tried on the whole.
const FINALISTS: usize = 3;

/// The bases to try along wavelength.
pub(crate) fn candidates(
    measurement: &Measurement,
    settings: &Settings,
    progress: &dyn Progress,
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
        // Nothing is tried that seldom wins.
        Target::Step(_) if own => Vec::new(),
        Target::Step(_) => vec![LineBasis::BIOR44],
        Target::Ratio(_) | Target::Bytes(_) if measurement.tensor.len() <= SMALL => LineBasis::distinct().collect(),
        Target::Ratio(ratio) => finalists(measurement, wavelengths, ratio, progress)?,
        Target::Bytes(bytes) => {
            finalists(measurement, wavelengths, measurement.tensor.len() as f64 / bytes.max(1) as f64, progress)?
        }
        _ => vec![LineBasis::BIOR44, LineBasis::BIOR22, LineBasis::HAAR],
    };
    let wavelets = wavelets.into_iter().map(SpectralBasis::Line);
    Ok(own.then_some(SpectralBasis::Klt).into_iter().chain(wavelets).collect())
}

/// The bases of least error on a sample of spectra.
fn finalists(
    measurement: &Measurement,
    wavelengths: usize,
    ratio: f64,
    progress: &dyn Progress,
) -> Result<Vec<LineBasis>, CompressError> {
    let spectra: Vec<&[f32]> = measurement.tensor.samples().chunks_exact(wavelengths).collect();
    let stride = spectra.len().div_ceil((SMALL / wavelengths).max(1));
    let sample: Vec<f32> = spectra.iter().step_by(stride).flat_map(|spectrum| spectrum.iter().copied()).collect();
    let spectral = measurement.tensor.axes().last().cloned();
    let axes = [Axis::Index { count: sample.len() / wavelengths, labels: Vec::new() }];
    let unfit = |e: String| CompressError::Setting(format!("a sample of spectra: {e}"));
    let tensor = Tensor::new(axes.into_iter().chain(spectral).collect(), sample).map_err(|e| unfit(e.to_string()))?;
    let sample = Measurement { tensor, ..measurement.clone() };
    // Along wavelength alone there is less to gain than along all axes together.
    let target = Target::Ratio(ratio.clamp(2.0, (wavelengths as f64 / 4.0).max(2.0)));
    let tried: Vec<(f64, LineBasis)> = LineBasis::distinct()
        .collect::<Vec<_>>()
        .into_par_iter()
        .filter_map(|basis| {
            let settings = Settings {
                target,
                policy: Policy::Conventional,
                basis: basis.name().to_owned(),
                floor: None,
                albedo_error: None,
                metadata: None,
                random_access: false,
            };
            let compressed =
                thresholded::compress(&sample, &settings, &[SpectralBasis::Line(basis)], 0.0, &Silent).ok()?;
            Some((compressed.summary.errors.er_l2, basis))
        })
        .collect();
    progress.step(0.2)?;
    let mut tried = tried;
    tried.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.code().cmp(&b.1.code())));
    let mut best: Vec<LineBasis> = tried.into_iter().take(FINALISTS).map(|(_, basis)| basis).collect();
    if !best.contains(&LineBasis::BIOR44) {
        best.push(LineBasis::BIOR44);
    }
    Ok(best)
}
