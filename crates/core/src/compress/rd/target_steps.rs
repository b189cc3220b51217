//! Steps for a wanted target of any kind, and the search around them for a smaller file.

use super::super::error::CompressError;
use super::super::refusal;
use super::super::search::{Falling, Until};
use super::super::setting_error::SettingError;
use super::super::spectral_basis::SpectralBasis;
use super::super::target::Target;
use super::super::unreachable_error::UnreachableError;
use super::candidate::Candidate;
use super::largest_step::{COARSE, largest_falling, largest_power};
use super::layer::{FirstLayer, chunk_bytes};
use super::metric::Trial;
use super::sized::{finest, sized_steps};
use super::steps::{Fineness, Steps};
use crate::domain::Progress;
use std::ops::RangeInclusive;

/// Selection penalty: noise variance of a coefficient chosen by magnitude, as a multiple of that of one chosen
/// beforehand. Raising it keeps fewer coefficients.
const SELECTED: f64 = 3.0;

/// Largest size in bytes of coded samples on a grid of angles for which all quantiser steps near the one that the
/// search found are tried. Raising it costs time: some 40 trials, half as many for tables above [`FEW_SAMPLES`].
const SMALL_GRID: usize = 1 << 14;

/// Largest number of samples for which additional spectral basis vectors, steps far coarser than those found, and all
/// steps near them are tried. Raising it costs time: about 80 trials of all samples.
const FEW_SAMPLES: usize = 1 << 20;

/// Number of quantiser steps tried on either side of the one that the search for the wanted error found, each 1/72 of a
/// doubling apart.
///
/// They reach 1/8 of a doubling: half-way to the next step of the trials with more basis vectors, which are 1/4 of a
/// doubling apart.
const NEAR: i32 = 9;

/// Coarser quantiser steps tried with each width of the zero bin, in 1/72 of a doubling above the best step so far. The
/// error of a small file may be too large at some steps and within its bound at still coarser ones.
const FAR: RangeInclusive<i32> = NEAR + 6..=4 * NEAR;
/// Multiple of the wanted error at which a series of ever coarser steps ends. It applies to the [`FAR`] ones.
const FAR_OFF: f64 = 1.2;
/// Multiple of the wanted error at which a series of ever coarser steps ends for tables above [`FEW_SAMPLES`]. Their
/// error is nearly monotone in the step, and their trials take long.
const FAR_OFF_OF_MANY: f64 = 1.03;

/// Extra widths of the quantiser's zero bin tried on small grids, in sixteenths of a step.
const DEAD_ZONES: [u8; 4] = [0, 1, 2, 3];

/// Largest number of spectral basis vectors tried beyond those that the quantiser step suggests. Raising it costs
/// trials.
const MORE_VECTORS: i8 = 3;
/// Largest increase of the quantiser step tried together with additional basis vectors, in quarters of a doubling.
const COARSER: i32 = 12;

/// Finds the quantiser steps that serve the target best: the smallest file at a wanted error, the least error at a
/// wanted size.
pub(super) fn find_steps(candidate: &Candidate<'_>, progress: &dyn Progress) -> Result<Steps, CompressError> {
    match candidate.settings.target {
        Target::ErL2(error) => {
            // A uniform quantiser's error is its step / √12; most coefficients are 0, so the step can be larger.
            let mut falling = Falling::default();
            let measure = |step: f64| {
                let found = candidate.relative_error(Fineness::of(step as f32), progress)?;
                candidate.closest.set(candidate.closest.get().min(found));
                Ok::<f64, CompressError>(found)
            };
            let keeps = |step: f64| {
                let found = measure(step)?;
                Ok(if found <= error || falling.falls(step, found) || step >= COARSE {
                    Ok(found <= error)
                } else {
                    Err(())
                })
            };
            if let Some(step) = largest_falling(4.0 * error, keeps)? {
                return with_more_vectors(candidate, Steps::of(step), error, progress);
            }
            // The search may have started at steps that are already too fine.
            let (basis, finest) = (candidate.layer.basis(), f64::from(finest(candidate).value()));
            let keeps = |step: f64| Ok(measure(step)? <= error);
            if let Some(step) = largest_power((4.0 * error, finest), basis, &candidate.closest, keeps)? {
                return Ok(Steps::of(step));
            }
            let of = (candidate.layer.basis(), false);
            Err(refusal::cannot_follow(("er_l2", error), candidate.closest.get(), of, candidate.limits()))
        }
        Target::ErL1(_) | Target::RelativeRmse(_) | Target::DeltaE(_) => {
            let magnitudes = |step: f32| candidate.magnitudes(Fineness::of(step));
            let classes = candidate.plane.coded.map(|_| candidate.plane.classes);
            let trial = Trial {
                measurement: candidate.measurement,
                classes,
                floor: candidate.floor,
                linear: candidate.plane.values.is_linear(),
                limits: candidate.limits(),
                magnitudes,
            };
            let found = trial.largest_step(
                candidate.settings.target,
                (candidate.layer.basis(), f64::from(finest(candidate).value()), &candidate.closest),
                progress,
            )?;
            Ok(Steps::of(found))
        }
        Target::Step(step) => Ok(Steps::of(step)),
        Target::Auto => find_truth(candidate, progress),
        Target::Ratio(_) | Target::Bytes(_) => sized_steps(candidate, None, Until::Close, progress),
        // |Δ ln s| ≤ ln(1 + error) bounds the relative error from both sides, with a margin for rounding to f32.
        Target::MaxRelativeError(error) => {
            // Means of values of both signs have larger relative errors than the values.
            let error = error / candidate.plane.restated.amplification();
            find_bounded(candidate, 2.0 * libm::log1p(error) * (1.0 - 1e-5) - 4e-7, progress)
        }
        Target::MaxAbsoluteError(error) => {
            // Samples below the floor keep an absolute error within it.
            let floored = candidate.original().iter().any(|&s| s != 0.0 && s.abs() < candidate.floor);
            let error = if floored { error.min(f64::from(candidate.floor)) } else { error };
            let (low, high) = candidate.measurement.tensor.range().unwrap_or_default();
            let largest = f64::from(low.abs().max(high.abs()));
            let rounding = largest * f64::from(f32::EPSILON);
            // An error above twice the largest sample allows nothing more; a step must stay finite.
            let error = error.min(2.0 * largest.max(f64::from(f32::MIN_POSITIVE)));
            find_bounded(candidate, 2.0 * error * (1.0 - 1e-5) - 4.0 * rounding, progress)
        }
        Target::Lossless => Err(SettingError::NotLossless.into()),
    }
}

/// Tries a few more spectral basis vectors than usual for samples on a grid of angles, with coarser quantiser steps,
/// and returns the setting of the smallest file that keeps the wanted error.
///
/// In smooth functions most coefficients are 0. A vector whose coefficients are small compared with the step may
/// therefore be worth its bytes.
fn with_more_vectors(
    candidate: &Candidate<'_>,
    steps: Steps,
    error: f64,
    progress: &dyn Progress,
) -> Result<Steps, CompressError> {
    let first = (chunk_bytes(&candidate.layer.chunks(steps.first)), steps.first);
    let has_basis = candidate.layer.is_gridded() && candidate.layer.basis() == SpectralBasis::Klt;
    if !has_basis || first.0 > SMALL_GRID || candidate.original().len() > FEW_SAMPLES {
        return Ok(steps);
    }
    let mut best = first;
    for more in 1..=MORE_VECTORS {
        let before = best.0;
        for quarter in 0..=COARSER {
            let from = Fineness { more_vectors: more, ..first.1 };
            let fineness = from.at(first.1.step * libm::exp2(f64::from(quarter) / 4.0) as f32);
            let bytes = chunk_bytes(&candidate.layer.chunks(fineness));
            if bytes < best.0 && candidate.relative_error(fineness, progress)? <= error {
                best = (bytes, fineness);
            }
        }
        if best.0 == before {
            break;
        }
    }
    Ok(Steps { first: best.1, ..steps })
}

/// Returns the quantiser setting near `steps` with the smallest file that keeps a wanted er(L2).
pub(super) fn refined(
    candidate: &Candidate<'_>,
    steps: Steps,
    progress: &dyn Progress,
) -> Result<Steps, CompressError> {
    let Target::ErL2(error) = candidate.settings.target else { return Ok(steps) };
    if candidate.layer.is_gridded() {
        return refined_grid(candidate, steps, error, progress);
    }
    if matches!(candidate.layer.basis(), SpectralBasis::Line(_)) {
        return Ok(steps);
    }
    let mut best = (chunk_bytes(&candidate.layer.chunks(steps.first)), steps.first);
    // One choice after the other, each from the best so far.
    for (vectors, coarser) in [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)] {
        let from = Fineness {
            more_vectors: best.1.more_vectors + vectors,
            coarser_vectors: best.1.coarser_vectors + coarser,
            ..best.1
        };
        if chunk_bytes(&candidate.layer.chunks(from)) > best.0 + best.0 / 16 {
            continue;
        }
        for quarter in -4..=4_i32 {
            // The error is not monotone in the step, so the whole neighbourhood is tried.
            let factor = libm::exp2(f64::from(quarter) / 24.0) as f32;
            let fineness = from.at(from.step * factor);
            let bytes = chunk_bytes(&candidate.layer.chunks(fineness));
            if bytes < best.0 && candidate.relative_error(fineness, progress)? <= error {
                best = (bytes, fineness);
            }
        }
    }
    Ok(Steps { first: best.1, ..steps })
}

/// Finds the smallest file on a grid of angles that keeps the wanted error, among quantiser steps, numbers of basis
/// vectors and zero-bin widths near `steps`, and at coarser steps. Only small files are refined: their errors are not
/// monotone in the step.
///
/// Errors of large files are monotone and their trials take long, so `steps` is returned for them.
fn refined_grid(
    candidate: &Candidate<'_>,
    steps: Steps,
    error: f64,
    progress: &dyn Progress,
) -> Result<Steps, CompressError> {
    let mut best = (chunk_bytes(&candidate.layer.chunks(steps.first)), steps.first);
    if best.0 > SMALL_GRID {
        return Ok(steps);
    }
    let is_few = candidate.original().len() <= FEW_SAMPLES;
    let (near, coarser_steps) = (-NEAR..=NEAR, 0..=NEAR);
    let far_off = if is_few { FAR_OFF } else { FAR_OFF_OF_MANY };
    let look_around =
        |from: Fineness, (places, stride): (&RangeInclusive<i32>, usize), best: &mut (usize, Fineness)| {
            for place in places.clone().step_by(stride) {
                let fineness = from.at(from.step * libm::exp2(f64::from(place) / 72.0) as f32);
                let bytes = chunk_bytes(&candidate.layer.chunks(fineness));
                if bytes >= best.0 {
                    continue;
                }
                let found = candidate.relative_error(fineness, progress)?;
                if found <= error {
                    *best = (bytes, fineness);
                } else if found > far_off * error && (place > NEAR || !is_few) {
                    break;
                }
            }
            Ok::<(), CompressError>(())
        };
    let has_basis = candidate.layer.basis() == SpectralBasis::Klt;
    let choices: &[(i8, i8)] = if has_basis { &[(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)] } else { &[(0, 0)] };
    for &(vectors, coarser) in choices {
        let from = Fineness {
            more_vectors: best.1.more_vectors + vectors,
            coarser_vectors: best.1.coarser_vectors + coarser,
            ..best.1
        };
        // A finer step rarely makes a file smaller, unless fewer or coarser vectors go with it.
        let is_less = vectors < 0 || coarser > 0;
        look_around(from, (if is_few || is_less { &near } else { &coarser_steps }, 1), &mut best)?;
    }
    loop {
        let from = best.1;
        for dead_zone in DEAD_ZONES {
            if is_few || dead_zone != from.dead_zone {
                look_around(Fineness { dead_zone, ..from }, (&near, 3), &mut best)?;
            }
            if is_few {
                look_around(Fineness { dead_zone, ..from }, (&FAR, 6), &mut best)?;
            }
        }
        if best.1 == from || !is_few {
            break;
        }
        look_around(best.1, (&near, 1), &mut best)?;
    }
    Ok(Steps { first: best.1, ..steps })
}

/// Finds the quantiser step whose decoded samples are nearest to the noise-free truth, as far as the noise permits an
/// estimate.
fn find_truth(candidate: &Candidate<'_>, progress: &dyn Progress) -> Result<Steps, CompressError> {
    let mut best: Option<(f64, Steps)> = None;
    for quarter in -12..=20_i32 {
        let steps = Steps::of(noise(candidate)? * libm::exp2(f64::from(quarter) / 4.0));
        let risk = risk(candidate, steps, progress)?;
        if best.is_none_or(|(least, _)| risk < least) {
            best = Some((risk, steps));
        }
    }
    best.map(|(_, steps)| steps).ok_or(UnreachableError::NoBasis.into())
}

/// Estimates the mean square distance of a file from the noise-free truth, up to a constant: the distance from the
/// measurement, plus the noise that each coefficient carries (Mallows 1973, *Some comments on Cp*). Coefficients kept
/// because they are large carry more noise than those chosen beforehand.
pub(super) fn risk(candidate: &Candidate<'_>, steps: Steps, progress: &dyn Progress) -> Result<f64, CompressError> {
    let error = candidate.relative_error(steps.first, progress)?;
    let noise = noise(candidate)?;
    let share = candidate.layer.kept(steps.first) as f64 / candidate.original().len() as f64;
    Ok(error * error + SELECTED * 2.0 * noise * noise * share)
}

/// Relative noise of the measurement; an error if it cannot be estimated.
fn noise(candidate: &Candidate<'_>) -> Result<f64, CompressError> {
    candidate.plane.noise.ok_or(SettingError::NoNoise.into())
}

/// Finds the quantiser step of the coefficients for which they and the corrections of single samples take the fewest
/// bytes together.
fn find_bounded(candidate: &Candidate<'_>, correction: f64, progress: &dyn Progress) -> Result<Steps, CompressError> {
    // The largest step tried is a few times larger, and must be finite too.
    let mut correction = correction.min(f64::from(f32::MAX) / 8.0) as f32;
    if candidate.measurement.tensor.range().is_none_or(|range| range == (0.0, 0.0)) {
        // Zeros and masked samples are reproduced by their classes.
        correction = correction.max(f32::MIN_POSITIVE);
    }
    if correction < f32::MIN_POSITIVE {
        return Err(refusal::below_rounding(candidate.settings.target, candidate.measurement));
    }
    let factors = [0.5_f32, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0];
    let mut best: Option<(usize, Steps)> = None;
    for (i, factor) in factors.into_iter().enumerate() {
        let steps = Steps { first: Fineness::of(correction * factor), correction };
        // A coarse first layer may exceed float32, where no correction helps.
        let Some((_, corrections)) = candidate.corrections_chunk(steps) else { continue };
        let bytes = chunk_bytes(&candidate.layer.chunks(steps.first)) + corrections.len();
        if best.is_none_or(|(least, _)| bytes < least) {
            best = Some((bytes, steps));
        }
        progress.step(0.45 + 0.5 * i as f64 / factors.len() as f64)?;
    }
    best.map(|(_, steps)| steps).ok_or(UnreachableError::Overflow.into())
}
