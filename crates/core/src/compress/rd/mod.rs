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

use super::classes::classes_chunk;
use super::compressed::Compressed;
use super::effort::Tally;
use super::error::CompressError;
use super::finish::finish;
use super::noise::estimate;
use super::settings::Settings;
use super::spectral_basis::SpectralBasis;
use super::target::Target;
use super::values::{self, Values};
use crate::codec::Class;
use crate::domain::{ErrorReport, Measurement, Progress};
use candidate::Candidate;
use class_plane::ClassPlane;
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
    let with =
        |below, negative| compress_with(measurement, settings, bases, (floor, below, negative), (progress, tally));
    let samples = measurement.tensor.samples();
    let values = Values::of(settings.target, samples);
    if floor <= 0.0 || values.is_linear() || gridded::Shape::of(measurement.tensor.axes()).is_none() {
        return with(Below::Clipped, Negative::Bounded);
    }
    let has_negative = samples.iter().any(|&s| values.class_of(s, floor) == Class::Negative);
    let attempt = |below| match with(below, Negative::Bounded) {
        Ok(file) if file.summary.errors.max_absolute_error_unscored <= f64::from(floor) => Ok(file),
        Err(CompressError::Cancelled(cancelled)) => Err(CompressError::Cancelled(cancelled)),
        _ if has_negative => with(below, Negative::Weighed),
        failed => failed,
    };
    let clipped = attempt(Below::Clipped).map(Compressed::without_samples);
    let dark = attempt(Below::Zero);
    let (Ok(first), Ok(second)) = (&clipped, &dark) else { return clipped.or(dark) };
    let by_size = matches!(settings.target, Target::Bytes(_) | Target::Ratio(_) | Target::Auto);
    let is_better = if by_size {
        second.summary.errors.er_l2 < first.summary.errors.er_l2
    } else {
        second.bytes.len() < first.bytes.len()
    };
    if is_better { dark } else { clipped }
}

/// Way to code positive samples below the floor, the smallest sample whose relative error counts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Below {
    /// Positive samples below the floor (smallest sample whose relative error counts) are coded like others, the
    /// smallest of them raised to a fixed fraction of the floor.
    Clipped,
    /// Positive samples below the floor (smallest sample whose relative error counts) are coded as 0.
    Zero,
}

/// Way to code negative samples whose magnitude is at least the floor, the smallest sample whose relative error counts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Negative {
    /// Coding in which a negative sample on a grid of angles takes the magnitude predicted from its neighbours, at most
    /// the largest magnitude of a negative sample. Its error may exceed the floor (smallest sample whose relative error
    /// counts).
    Bounded,
    /// Coding in which negative samples on a grid of angles are approximated as exactly as positive ones.
    Weighed,
}

fn compress_with(
    measurement: &Measurement,
    settings: &Settings,
    bases: &[SpectralBasis],
    (floor, below, negative): (f32, Below, Negative),
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Compressed, CompressError> {
    let axes = measurement.tensor.axes();
    let samples = measurement.tensor.samples();
    let values = Values::of(settings.target, samples);
    let is_dark = |s: f32| below == Below::Zero && s > 0.0 && s < floor;
    let class_of = |&s: &f32| if is_dark(s) { Class::Zero } else { values.class_of(s, floor) };
    let (classes, classes_coded) = if values::all_positive(samples) && below == Below::Clipped {
        (vec![Class::Positive; samples.len()], None)
    } else {
        let mut classes: Vec<Class> = samples.iter().map(class_of).collect();
        let coded = classes_chunk(axes, &mut classes);
        (classes, coded)
    };
    // The counts do not depend on the decoded samples, so the header has its final size before decoding.
    let counts = ErrorReport::without_errors(samples, f64::from(floor));
    let noise = match settings.target {
        Target::Auto => estimate(measurement, floor).map(|noise| noise.relative),
        _ => None,
    };
    let coded = classes_coded.as_ref();
    let weighs_negative = negative == Negative::Weighed;
    let plane = ClassPlane { values, classes: &classes, coded, counts, weighs_negative, noise };
    let work = |scheme: &Scheme| Candidate::new(measurement, plane, scheme, settings, (floor, tally));
    let schemes = schemes(measurement, plane, bases, settings, floor)?;
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
