//! Ways to code what lies below a floor, the smallest sample whose relative error counts; the best file is kept.

use super::super::classes::classes_chunk;
use super::super::compressed::Compressed;
use super::super::decode::open;
use super::super::error::CompressError;
use super::super::settings::Settings;
use super::super::target::Target;
use super::super::values::{self, Values};
use super::gridded::{Spent, outlined};
use crate::codec::{ChunkKind, Class};
use crate::domain::{Measurement, Restated};

/// Fraction of the floor to which smaller positive samples are raised before coding if all of them are coded, so that
/// their absolute error stays below the floor.
const CLIPPED: f64 = 0.7;

/// Way to code positive samples below the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Below<'a> {
    /// Coded like larger ones, the smallest of them raised to a fixed fraction of the floor.
    Clipped,
    /// Coded as 0.
    Zero,
    /// Coded as if they were as large as the floor where they are marked, and as 0 elsewhere.
    Outlined(&'a [bool]),
}

impl Below<'_> {
    /// Returns the class of every sample (positive, negative, zero or masked), and the chunk that states the classes;
    /// no chunk if all are positive. Samples of `restated`, whose mean has a relative error, are coded even if they are
    /// below the floor.
    pub(super) fn classes(
        self,
        measurement: &Measurement,
        values: Values,
        floor: f32,
        restated: &Restated,
    ) -> (Vec<Class>, Option<(ChunkKind, Vec<u8>)>) {
        let samples = measurement.tensor.samples();
        if values::all_positive(samples) && self == Self::Clipped {
            return (vec![Class::Positive; samples.len()], None);
        }
        let is_zero = |(at, sample): (usize, f32)| {
            sample > 0.0
                && sample < floor
                && match self {
                    Self::Clipped => false,
                    Self::Zero => true,
                    Self::Outlined(marks) => !marks[at],
                }
        };
        let class_of = |(at, &sample): (usize, &f32)| {
            if is_zero((at, sample)) { Class::Zero } else { values.class_of(sample, floor) }
        };
        let mut classes: Vec<Class> = samples.iter().enumerate().map(class_of).collect();
        for at in restated.samples() {
            classes[at] = values.class_of(samples[at], 0.0);
        }
        let chunk = classes_chunk(measurement.tensor.axes(), &mut classes);
        (classes, chunk)
    }

    /// Magnitude to which smaller ones are raised before they are coded.
    pub(super) fn least(self, floor: f32) -> f64 {
        let share = if let Self::Outlined(_) = self { 1.0 } else { CLIPPED };
        share * f64::from(floor)
    }
}

/// Way to code negative samples whose magnitude is at least the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Negative {
    /// Coding in which a negative sample on a grid of angles takes the magnitude predicted from its neighbours, at most
    /// the largest magnitude of a negative sample. Its error may exceed the floor.
    Bounded,
    /// Coding in which negative samples on a grid of angles are approximated as exactly as positive ones.
    Weighed,
}

/// Largest er(L2) at which coding samples below the floor as if they were as large as the floor is tried. With larger
/// errors too many of them would decode to more than their own value and the floor together.
const MOST_ERROR: f64 = 0.1;

/// Compresses a measurement on a grid of angles by `with` in each way that may suit what lies below the floor, and
/// returns the best file: the smallest at a wanted error, the one of least error at a wanted size.
pub(super) fn best_of(
    measurement: &Measurement,
    settings: &Settings,
    (floor, restated): (f32, &Restated),
    with: impl Fn(Below<'_>, Negative) -> Result<Compressed, CompressError>,
) -> Result<Compressed, CompressError> {
    let (axes, samples) = (measurement.tensor.axes(), measurement.tensor.samples());
    let values = Values::of(settings.target, samples);
    let is_mixed = restated.amplification() > 1.0;
    let has_negative = is_mixed || samples.iter().any(|&s| values.class_of(s, floor) == Class::Negative);
    let breach = |file: &Compressed| file.below_floor.breach(floor);
    let keeps = |file: &Compressed| breach(file) == 0;
    let attempt = |below| match with(below, Negative::Bounded) {
        Ok(file) if keeps(&file) => Ok((file, Negative::Bounded)),
        Err(CompressError::Cancelled(cancelled)) => Err(CompressError::Cancelled(cancelled)),
        bounded if has_negative => {
            let bounded = bounded.map(Compressed::without_samples);
            match (bounded, with(below, Negative::Weighed)) {
                (Ok(bounded), Ok(weighed)) if breach(&bounded) < breach(&weighed) => Ok((bounded, Negative::Bounded)),
                (_, weighed) => weighed.map(|file| (file, Negative::Weighed)),
            }
        }
        failed => failed.map(|file| (file, Negative::Bounded)),
    };
    let by_size = matches!(settings.target, Target::Bytes(_) | Target::Ratio(_) | Target::Auto);
    let better = |first: Result<Compressed, CompressError>, second: Result<Compressed, CompressError>| {
        let is_better = match (&first, &second) {
            (Ok(first), Ok(second)) if breach(first) != breach(second) => breach(second) < breach(first),
            (Ok(first), Ok(second)) if by_size => second.summary.errors.er_l2 < first.summary.errors.er_l2,
            (Ok(first), Ok(second)) => second.bytes.len() < first.bytes.len(),
            (Err(_), Ok(_)) => true,
            _ => false,
        };
        if is_better { second } else { first }
    };
    let dark = attempt(Below::Zero);
    if let Err(CompressError::Cancelled(cancelled)) = dark {
        return Err(CompressError::Cancelled(cancelled));
    }
    let spent = dark.as_ref().ok().filter(|(file, _)| keeps(file)).and_then(|(file, _)| spent(file));
    let is_plain = settings.albedo_error.is_none() && !matches!(settings.target, Target::DeltaE(_));
    // Each coded sample takes bytes, too, so a longer map of more of them seldom makes a smaller file.
    let is_longer = |spent: Spent| {
        let map = Below::Clipped.classes(measurement, values, floor, restated).1;
        is_plain && map.is_some_and(|(_, map)| map.len() >= spent.classes)
    };
    let outline = dark.as_ref().ok().zip(spent).and_then(|((file, negative), spent)| {
        let is_near = file.summary.errors.er_l2 <= MOST_ERROR;
        let marks = is_near.then(|| outlined(axes, samples, floor, spent)).flatten();
        marks.map(|marks| (marks, *negative))
    });
    let mut best = dark.map(|(file, _)| file);
    let has_some_below = samples.iter().any(|&s| s > 0.0 && s < floor);
    if has_some_below && !spent.is_some_and(is_longer) {
        best = better(best.map(Compressed::without_samples), attempt(Below::Clipped).map(|(file, _)| file));
    }
    if let Some((marks, negative)) = outline {
        best = better(best.map(Compressed::without_samples), with(Below::Outlined(&marks), negative));
    }
    best
}

/// Returns the smaller one of two files, the first one if both have the same size. A cancelled search has no file.
pub(super) fn smaller(
    first: Result<Compressed, CompressError>,
    second: Result<Compressed, CompressError>,
) -> Result<Compressed, CompressError> {
    match (first, second) {
        (_, Err(CompressError::Cancelled(cancelled))) => Err(CompressError::Cancelled(cancelled)),
        (Ok(first), Ok(second)) => Ok(if second.bytes.len() < first.bytes.len() { second } else { first }),
        (Err(_), second) => second,
        (first, Err(_)) => first,
    }
}

/// Returns the bytes that a file spends on the map of classes (positive, negative, zero, masked) and on the values of
/// all other samples. `None` for a file without such a map, or one that codes a transform of its samples.
fn spent(file: &Compressed) -> Option<Spent> {
    let container = open(&file.bytes).ok()?.1;
    let bytes = |kind| container.get(kind).map(|chunk| chunk.payload.len());
    let classes = bytes(ChunkKind::WideClasses).or_else(|| bytes(ChunkKind::Classes))?;
    Some(Spent { classes, values: bytes(ChunkKind::Grid)? + bytes(ChunkKind::Basis).unwrap_or(0) })
}
