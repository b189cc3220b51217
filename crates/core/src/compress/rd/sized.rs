//! Steps for a wanted size: the finest one whose file has at most the wanted bytes, or at least the wanted samples per
//! coefficient.

use super::super::error::CompressError;
use super::super::header::UNSCORED_BYTES;
use super::super::metadata::metadata_with_labels;
use super::super::metadata_chunk::metadata_chunk;
use super::super::parts::assemble;
use super::super::refusal;
use super::super::scales::LARGEST;
use super::super::search::{DOUBLING, NEAR, Notch, Until, finest_fitting};
use super::super::target::{LEAST_STEP, Target};
use super::super::unreachable_error::UnreachableError;
use super::candidate::Candidate;
use super::layer::{FirstLayer, chunk_bytes};
use super::levels;
use super::steps::{Fineness, Steps};
use crate::codec::Class;
use crate::domain::{Cancelled, Progress};

/// First quantiser step to try when nothing is known, in natural logarithms.
const USUAL_STEP: f32 = 0.05;
/// Magnitude of the largest sample up to which decoded samples stay finite at any useful quantiser step: half of the
/// float32 exponents lie above it.
const SAFE: f32 = 1e19;
/// Number of doublings of the quantiser step to try if samples decode beyond float32.
const DOUBLINGS: u32 = 24;
/// Upper bound on the number of times that the estimated size of the table of lower-resolution levels is corrected.
/// Each correction decodes all levels once.
const CORRECTIONS: u32 = 4;
/// Approximate bytes of every file besides coefficients, classes and metadata.
const LEAST_HEADER: usize = 36;
/// Fraction of the allowed file size in bytes above which a file counts as full, so that no finer quantiser step is
/// sought.
const FULL: f64 = 0.995;

/// Finds the finest quantiser step whose file has at most the wanted size. The search begins at the step of `start`;
/// depending on `until` it may end at a slightly coarser step, which is enough for comparing coding schemes.
pub(super) fn sized_steps(
    candidate: &Candidate<'_>,
    start: Option<Steps>,
    until: Until,
    progress: &dyn Progress,
) -> Result<Steps, CompressError> {
    let start = Notch::below(start.map_or(USUAL_STEP, |steps| steps.first.step));
    // Counts without trials are met exactly.
    let until = if is_counted(candidate) { Until::Exact } else { until };
    match fitting(candidate, (start, finest(candidate)), until, progress)? {
        Some(at) => finite(candidate, at, progress),
        None => Err(too_large(candidate, progress)?),
    }
}

/// Ratio of the coefficients' size to the space that the wanted size leaves them: 1 if they fill it.
pub(super) fn room(candidate: &Candidate<'_>, steps: Steps, progress: &dyn Progress) -> Result<f64, CompressError> {
    let (size, most) = (size(candidate, Notch::below(steps.first.step), progress)?, most(candidate));
    let own = match candidate.settings.target {
        Target::Bytes(_) => chunk_bytes(&candidate.layer.chunks(steps.first)) as f64,
        _ => size,
    };
    Ok(own.max(1.0) / (most - (size - own)).max(1.0))
}

/// Estimates the exponent p of the law error ∝ b^−p, with b the bytes of the coefficients, from file sizes at two
/// quantiser steps: that of `steps` and one near it.
///
/// It assumes that an error is proportional to its step.
pub(super) fn exponent(candidate: &Candidate<'_>, steps: Steps) -> f64 {
    let known = candidate.sizes.known.borrow();
    let here = Notch::below(steps.first.step);
    let least = known.values().copied().fold(f64::INFINITY, f64::min);
    let Some(&size) = known.get(&here) else { return 1.0 };
    // At least a quarter of a doubling away: adjacent steps have nearly equal sizes.
    let far = known.iter().filter(|(at, _)| at.octaves_from(here).abs() >= 0.25);
    let near = far.min_by(|a, b| a.0.octaves_from(here).abs().total_cmp(&b.0.octaves_from(here).abs()));
    let Some((&at, &there)) = near else { return 1.0 };
    // Headers and classes do not depend on the step.
    let fixed = assembled_without(candidate, steps).min(0.9 * least);
    let fall = libm::log2((size - fixed) / (there - fixed));
    let exponent = at.octaves_from(here) / fall;
    if exponent.is_finite() { exponent.clamp(0.3, 6.0) } else { 1.0 }
}

/// Bytes of a whole file less those of its coefficients.
fn assembled_without(candidate: &Candidate<'_>, steps: Steps) -> f64 {
    let known = candidate.sizes.known.borrow().get(&Notch::below(steps.first.step)).copied().unwrap_or_default();
    known - chunk_bytes(&candidate.layer.chunks(steps.first)) as f64
}

/// Finds the finest quantiser step with which the complete file, its index of coarser resolution levels included, has
/// at most the wanted size. The search begins at `steps`.
pub(super) fn settled(
    candidate: &Candidate<'_>,
    steps: Steps,
    progress: &dyn Progress,
) -> Result<Steps, CompressError> {
    if !matches!(candidate.settings.target, Target::Ratio(_) | Target::Bytes(_)) || is_counted(candidate) {
        return Ok(steps);
    }
    let most = most(candidate);
    let mut at = Notch::below(steps.first.step);
    if !(candidate.has_levels() && matches!(candidate.settings.target, Target::Bytes(_))) {
        // Compared steps may be slightly coarser than necessary.
        let finest = finest(candidate).max(at.moved(-NEAR));
        return match fitting(candidate, (at, finest), Until::Close, progress)? {
            Some(at) => finite(candidate, at, progress),
            None => Ok(steps),
        };
    }
    let mut best: Option<Notch> = None;
    for _ in 0..CORRECTIONS {
        let whole = file_size(candidate, at);
        candidate.sizes.index.set(Some(whole - (size(candidate, at, progress)? - index(candidate))));
        if whole <= most {
            best = Some(best.map_or(at, |best| best.min(at)));
            if whole >= FULL * most {
                break;
            }
        }
        match fitting(candidate, (at, finest(candidate)), Until::Close, progress)? {
            Some(next) if next != at => at = next,
            Some(_) => break,
            None => return Err(too_large(candidate, progress)?),
        }
    }
    // The index itself depends on the step slightly.
    while best.is_none() && at < Notch::COARSEST {
        at = at.moved(DOUBLING / 16.0);
        if progress.is_cancelled() {
            return Err(Cancelled.into());
        }
        best = (file_size(candidate, at) <= most).then_some(at);
    }
    match best {
        Some(at) => Ok(Steps::of(f64::from(at.value()))),
        None => Err(too_large(candidate, progress)?),
    }
}

/// Finest useful quantiser step. Below it float32 logarithms resolve no more, or the largest coefficients exceed the
/// integers; a file with more bytes would be worse.
pub(super) fn finest(candidate: &Candidate<'_>) -> Notch {
    let samples = candidate.original();
    let live = samples.iter().filter(|s| **s != 0.0 && !s.is_nan());
    let (low, high) = live.fold((f32::MAX, 0.0_f32), |(low, high), s| (low.min(s.abs()), high.max(s.abs())));
    let logarithm = |size: f32| libm::log(f64::from(size.max(f32::MIN_POSITIVE))).abs();
    let (largest, least) = if candidate.plane.values.is_linear() {
        (f64::from(high), LEAST_STEP * f64::from(high))
    } else {
        (logarithm(low).max(logarithm(high)).max(1.0), LEAST_STEP)
    };
    // Bound on a coefficient: the norm of a tensor of equal values, with a margin because the basis is not exactly
    // orthonormal.
    let coefficient = largest * (samples.len() as f64).sqrt();
    Notch::below((coefficient / f64::from(LARGEST / 4.0)).max(least) as f32)
}

/// Returns true if the target is a ratio of samples to kept coefficients, and the coefficients can be counted without
/// coding them.
pub(super) fn is_counted(candidate: &Candidate<'_>) -> bool {
    matches!(candidate.settings.target, Target::Ratio(_)) && candidate.layer.counts_alone()
}

/// Finds the finest quantiser step whose file fits the wanted size. The search leaves out the constant part of sizes:
/// the rest is nearly a power of the step.
fn fitting(
    candidate: &Candidate<'_>,
    from: (Notch, Notch),
    until: Until,
    progress: &dyn Progress,
) -> Result<Option<Notch>, CompressError> {
    let most = most(candidate);
    let fixed = if matches!(candidate.settings.target, Target::Bytes(_)) {
        let metadata = candidate
            .settings
            .metadata
            .as_deref()
            .map_or(0, |text| metadata_chunk(candidate.measurement.tensor.axes(), text).1.len());
        let classes = candidate.plane.coded.map_or(0, |(_, chunk)| chunk.len());
        ((LEAST_HEADER + metadata + classes) as f64).min(most - 1.0)
    } else {
        0.0
    };
    finest_fitting(from, (most - fixed, until), |at| Ok((size(candidate, at, progress)? - fixed).max(0.0)))
}

/// Largest size that the target allows, in bytes or coefficients.
fn most(candidate: &Candidate<'_>) -> f64 {
    match candidate.settings.target {
        Target::Ratio(ratio) => candidate.original().len() as f64 / ratio,
        Target::Bytes(bytes) => bytes as f64,
        _ => f64::INFINITY,
    }
}

/// Size of the file at a quantiser step, in bytes or, for a ratio, in coefficients.
fn size(candidate: &Candidate<'_>, at: Notch, progress: &dyn Progress) -> Result<f64, CompressError> {
    if progress.is_cancelled() {
        return Err(Cancelled.into());
    }
    let known = candidate.sizes.known.borrow().get(&at).copied();
    let size = known.unwrap_or_else(|| {
        let fineness = Fineness::of(at.value());
        let size = match candidate.settings.target {
            Target::Ratio(_) => candidate.layer.kept(fineness) as f64,
            _ => assembled(candidate, fineness, false),
        };
        candidate.sizes.known.borrow_mut().insert(at, size);
        size
    });
    Ok(if matches!(candidate.settings.target, Target::Ratio(_)) { size } else { size + index(candidate) })
}

/// Bytes of the table of lower-resolution levels in the file: an estimate until a complete file has been built.
fn index(candidate: &Candidate<'_>) -> f64 {
    let usual = if candidate.has_levels() { levels::usual_bytes(candidate.measurement) as f64 } else { 0.0 };
    candidate.sizes.index.get().unwrap_or(usual)
}

/// Bytes of the whole file at a quantiser step, the table of lower-resolution levels included.
fn file_size(candidate: &Candidate<'_>, at: Notch) -> f64 {
    assembled(candidate, Fineness::of(at.value()), true)
}

fn assembled(candidate: &Candidate<'_>, fineness: Fineness, with_levels: bool) -> f64 {
    let metadata = metadata_with_labels(candidate.measurement.tensor.axes(), candidate.settings.metadata.as_deref());
    let mut parts = candidate.encode(Steps { first: fineness, correction: 0.0 });
    if with_levels && levels::insert(&mut parts, candidate.measurement).is_err() {
        return f64::INFINITY;
    }
    let counts = &candidate.plane.counts;
    // The decoded file will state an error for unscored samples, which is not known yet.
    let stated = if counts.negative_samples + counts.below_floor_samples > 0 { UNSCORED_BYTES } else { 0 };
    (assemble(&parts, metadata.as_deref()).len() + stated) as f64
}

/// Returns the quantiser step `at`, doubled as often as is needed for all samples to decode within the range of
/// float32.
fn finite(candidate: &Candidate<'_>, at: Notch, progress: &dyn Progress) -> Result<Steps, CompressError> {
    let (low, high) = candidate.measurement.tensor.range().unwrap_or_default();
    if low.abs().max(high.abs()) <= SAFE {
        return Ok(Steps::of(f64::from(at.value())));
    }
    for doublings in 0..DOUBLINGS {
        let at = at.moved(f64::from(doublings) * DOUBLING);
        if size(candidate, at, progress)? > most(candidate) {
            continue;
        }
        let decoded = candidate.magnitudes(Fineness::of(at.value()));
        let live = |class: &Class| matches!(class, Class::Positive | Class::Negative);
        let mut pairs = decoded.iter().zip(candidate.plane.classes);
        if pairs.all(|(sample, class)| sample.is_finite() || !live(class)) {
            return Ok(Steps::of(f64::from(at.value())));
        }
    }
    Err(UnreachableError::Overflow.into())
}

/// Builds the error for a wanted size that no quantiser step reaches.
fn too_large(candidate: &Candidate<'_>, progress: &dyn Progress) -> Result<CompressError, CompressError> {
    let least = match candidate.settings.target {
        Target::Ratio(_) => size(candidate, Notch::COARSEST, progress)?,
        _ => file_size(candidate, Notch::COARSEST),
    };
    candidate.closest.set(least);
    let has_metadata = candidate.settings.metadata.is_some();
    Ok(refusal::too_large(
        candidate.settings.target,
        least,
        (candidate.original().len(), candidate.layer.basis()),
        has_metadata,
    ))
}
