//! Rate–distortion policy: logarithms of magnitudes, one uniform step for all normalised coefficients.
//!
//! A relative error is an absolute error of the logarithm, so one step serves bright and dark samples alike. The sphere
//! basis is orthonormal, and line bases are normalised by the norms of their synthesis functions, so that a step means
//! the same error everywhere. Signs, zeros and masks go into a separate class plane; samples without a logarithm are
//! filled smoothly.

pub(super) mod adaptive;
mod candidate;
mod chart;
mod class_plane;
mod coded;
mod contest;
mod floored;
mod folding;
pub(super) mod gridded;
mod largest_step;
mod layer;
pub(super) mod levels;
mod lines;
mod metric;
pub(super) mod predictive;
mod pyramid;
mod schemes;
pub(super) mod shape;
mod sized;
mod spectrum;
mod steps;
mod streams;
mod symmetry;
mod symmetry_search;
mod target_steps;

use super::compressed::{Compressed, Ranked};
use super::effort::Tally;
use super::error::CompressError;
use super::finish::finish;
use super::noise::estimate;
use super::settings::Settings;
use super::spectral_basis::SpectralBasis;
use super::target::Target;
use super::values::Values;
use crate::domain::{ErrorReport, Measurement, Progress, Restated};
use candidate::Candidate;
use class_plane::ClassPlane;
use floored::{Below, Negative};
use schemes::{Scheme, fallbacks, schemes};
use sized::settled;
use steps::Steps;
use target_steps::{find_steps, refined};

/// Compresses with every candidate coding scheme and keeps the best file: the smallest at a wanted error, the one of
/// least error at a wanted size. `tally` counts the trials.
pub(crate) fn compress(
    measurement: &Measurement,
    settings: &Settings,
    bases: &[SpectralBasis],
    floor: f32,
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Compressed, CompressError> {
    let (axes, samples) = (measurement.tensor.axes(), measurement.tensor.samples());
    let restated = Restated::of(axes, samples, f64::from(floor));
    let with = |below: Below<'_>, negative| {
        compress_with(measurement, settings, bases, (floor, below, negative), &restated, (progress, tally))
    };
    let values = Values::of(settings.target, samples);
    let is_floored = floor > 0.0 && !values.is_linear() && gridded::Shape::of(axes).is_some();
    // Negative samples enter a mean whose error is promised.
    let is_mixed = restated.amplification() > 1.0;
    let is_negative = measurement.tensor.range().is_some_and(|(low, high)| low < 0.0 && high <= 0.0);
    match settings.target {
        Target::MaxRelativeError(_) if is_mixed => with(Below::Clipped, Negative::Weighed),
        _ if is_floored => floored::best_of(measurement, settings, (floor, &restated), with),
        Target::ErL1(_) | Target::ErL2(_) if is_mixed => {
            let bounded = with(Below::Clipped, Negative::Bounded).map(Compressed::without_samples);
            floored::smaller(bounded, with(Below::Clipped, Negative::Weighed))
        }
        // Without positive samples, errors are those of negative ones.
        _ if is_negative && !values.is_linear() => with(Below::Clipped, Negative::Weighed),
        _ => with(Below::Clipped, Negative::Bounded),
    }
}

fn compress_with(
    measurement: &Measurement,
    settings: &Settings,
    bases: &[SpectralBasis],
    (floor, below, negative): (f32, Below<'_>, Negative),
    restated: &Restated,
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Compressed, CompressError> {
    let samples = measurement.tensor.samples();
    let values = Values::of(settings.target, samples);
    let (classes, coded) = below.classes(measurement, values, floor, restated);
    // The counts do not depend on the decoded samples, so the header has its final size before decoding.
    let counts = ErrorReport::without_errors(samples, f64::from(floor));
    let noise = match settings.target {
        Target::Auto => estimate(measurement, floor).map(|noise| noise.relative),
        _ => None,
    };
    let weighs_negative = negative == Negative::Weighed;
    let (coded, least) = (coded.as_ref(), below.least(floor));
    let mut small: Vec<usize> = restated.samples().filter(|&at| f64::from(samples[at].abs()) < least).collect();
    small.sort_unstable();
    let plane =
        ClassPlane { values, classes: &classes, coded, counts, least, restated, small: &small, weighs_negative, noise };
    let work = |scheme: &Scheme| Candidate::new(measurement, plane, scheme, settings, (floor, tally));
    let schemes = schemes(measurement, plane, bases, settings)?;
    progress.step(0.05)?;
    let of = (settings.target, samples.len());
    let (work, steps, ranking) = match best_of(&work, &schemes, of, progress) {
        Err(CompressError::Unreachable(error)) => match fallbacks(measurement, noise, bases, settings) {
            none if none.is_empty() => return Err(error.into()),
            others => {
                let refused = vec![(error.closest(), error)];
                let (work, steps, ranking) = contest::best_of(&work, (&others, refused), of, progress)?;
                (work, steps, Some(ranking))
            }
        },
        found => found?,
    };
    let parts = work.encode(steps);
    // Frees memory for decoding.
    drop(work);
    drop(classes);
    progress.step(0.95)?;
    let compressed = finish(parts, measurement, settings.metadata.as_deref())?;
    let ranking = ranking.unwrap_or(compressed.ranking);
    Ok(Compressed { ranking, ..compressed })
}

/// Returns the best of the coding schemes for a target with its quantiser steps, and a ranking if several compete.
fn best_of<'a>(
    work: &impl Fn(&Scheme) -> Result<Candidate<'a>, CompressError>,
    schemes: &[Scheme],
    of: (Target, usize),
    progress: &dyn Progress,
) -> Result<(Candidate<'a>, Steps, Option<Vec<Ranked>>), CompressError> {
    let [only] = schemes else {
        let (work, steps, ranking) = contest::best_of(work, (schemes, Vec::new()), of, progress)?;
        return Ok((work, steps, Some(ranking)));
    };
    let work = work(only)?;
    let found = find_steps(&work, progress)?;
    let found = if work.has_levels() { settled(&work, found, progress)? } else { found };
    let steps = refined(&work, found, progress)?;
    Ok((work, steps, None))
}
