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

use super::compressed::Compressed;
use super::effort::Tally;
use super::error::CompressError;
use super::finish::finish;
use super::noise::estimate;
use super::settings::Settings;
use super::spectral_basis::SpectralBasis;
use super::target::Target;
use super::values::Values;
use crate::domain::{ErrorReport, Measurement, Progress};
use candidate::Candidate;
use class_plane::ClassPlane;
use floored::{Below, Negative};
use schemes::{Scheme, schemes};
use sized::settled;
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
    let with = |below: Below<'_>, negative| {
        compress_with(measurement, settings, bases, (floor, below, negative), (progress, tally))
    };
    let values = Values::of(settings.target, measurement.tensor.samples());
    if floor <= 0.0 || values.is_linear() || gridded::Shape::of(measurement.tensor.axes()).is_none() {
        return with(Below::Clipped, Negative::Bounded);
    }
    floored::best_of(measurement, settings, floor, with)
}

fn compress_with(
    measurement: &Measurement,
    settings: &Settings,
    bases: &[SpectralBasis],
    (floor, below, negative): (f32, Below<'_>, Negative),
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Compressed, CompressError> {
    let samples = measurement.tensor.samples();
    let values = Values::of(settings.target, samples);
    let (classes, coded) = below.classes(measurement, values, floor);
    // The counts do not depend on the decoded samples, so the header has its final size before decoding.
    let counts = ErrorReport::without_errors(samples, f64::from(floor));
    let noise = match settings.target {
        Target::Auto => estimate(measurement, floor).map(|noise| noise.relative),
        _ => None,
    };
    let weighs_negative = negative == Negative::Weighed;
    let (coded, least) = (coded.as_ref(), below.least(floor));
    let plane = ClassPlane { values, classes: &classes, coded, counts, least, weighs_negative, noise };
    let work = |scheme: &Scheme| Candidate::new(measurement, plane, scheme, settings, (floor, tally));
    let schemes = schemes(measurement, plane, bases, settings)?;
    progress.step(0.05)?;
    let (work, steps, ranking) = match schemes.as_slice() {
        [only] => {
            let work = work(only)?;
            let found = find_steps(&work, progress)?;
            let found = if work.has_levels() { settled(&work, found, progress)? } else { found };
            let steps = refined(&work, found, progress)?;
            (work, steps, None)
        }
        several => {
            let (work, steps, ranking) = contest::best_of(&work, several, (settings.target, samples.len()), progress)?;
            (work, steps, Some(ranking))
        }
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
