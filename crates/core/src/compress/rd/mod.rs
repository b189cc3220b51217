//! The rate–distortion policy: logarithms of magnitudes, one uniform step for all normalised coefficients.
//!
//! A relative error is an absolute error of the logarithm, so one step serves bright and dark samples alike. The sphere basis
//! is orthonormal and the line bases are normalised by the norms of their synthesis functions, so that a step means the same
//! error everywhere. Signs, zeros and masks go into a class plane beside; what has no logarithm is filled smoothly.

pub(crate) mod adaptive;
mod chart;
mod contest;
mod folding;
mod layer;
pub(crate) mod levels;
mod metric;
pub(crate) mod predictive;
mod pyramid;
pub(crate) mod shape;
mod sized;
mod spectrum;
mod streams;
mod symmetry;

use super::decode::apply_classes;
use super::effort::Tally;
use super::exponential::add_corrections;
use super::file::{Parts, classes_chunk, finish};
use super::fill::fill;
use super::header::Header;
use super::light::{self, Light};
use super::refusal;
use super::rows::lanes;
use super::search::{Falling, Until, largest, powers_of_two};
use super::values::{self, Values};
use super::{CompressError, Compressed, Policy, Settings, SpectralBasis, Target, estimate_noise};
use crate::codec::{ChunkKind, Class, Encoder, code_corrections, code_steps};
use crate::domain::{Axis, Cancelled, ErrorReport, Measurement, Progress};
use adaptive::AdaptiveLayer;
use chart::ChartKind;
use layer::{Counted, Fineness, FirstLayer, FixedLayer};
use metric::Trial;
use predictive::{Folded, PredictiveLayer};
use rayon::prelude::*;
use shape::Shape;
use sized::Sizes;
use std::cell::Cell;
use std::sync::Arc;

/// Entries of an index axis that the data's own basis is tried on.
const MOST_INDICES: usize = 64;
/// The symmetries of a hemisphere's mesh.
const ALL_SYMMETRIES: usize = 8;
/// Bisections of the step: 2^(1/64) at the end, 1 % of the step.
const REFINEMENTS: u32 = 6;
/// Steps from here on may quantise everything to 0, where errors stand still and fall again below.
const COARSE: f64 = 1.0;
/// Corrections of a sample at most, in steps: its neighbours are numbers of 32 bits too.
const LARGEST_CORRECTION: f64 = (1 << 30) as f64;
/// How much more than one coefficient's noise a coefficient kept for its size takes over.
const SELECTED: f64 = 3.0;

/// Compresses with every candidate basis and keeps the best: the smallest file at a wanted error, the least error at a
/// wanted size. `tally` counts the trials.
pub(crate) fn compress(
    measurement: &Measurement,
    settings: &Settings,
    bases: &[SpectralBasis],
    floor: f32,
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Compressed, CompressError> {
    let axes = measurement.tensor.axes();
    let samples = measurement.tensor.samples();
    let values = Values::of(settings.target, samples);
    let (classes, classes_coded) = if values::all_positive(samples) {
        (vec![Class::Positive; samples.len()], None)
    } else {
        let mut classes: Vec<Class> = samples.iter().map(|&s| values.class_of(s, floor)).collect();
        let coded = classes_chunk(axes, &mut classes);
        (classes, coded)
    };
    // The counts do not depend on what is decoded, so that a header has its final size before anything is.
    let counts = ErrorReport::without_errors(samples, f64::from(floor));
    let noise = match settings.target {
        Target::Auto => estimate_noise(measurement, floor).map(|noise| noise.relative),
        _ => None,
    };
    let plane = Plane { values, classes: &classes, coded: classes_coded.as_ref(), counts, noise };
    let work = |scheme: &Scheme| Work::new(measurement, plane, scheme, settings, (floor, tally));
    let schemes = schemes(measurement, plane, bases, settings, floor)?;
    progress.step(0.05)?;
    let (work, steps, ranking) = match schemes.as_slice() {
        [only] => {
            let work = work(only)?;
            let found = work.find_steps(progress)?;
            let found = if work.layer.is_predicted() { work.settled(found, progress)? } else { found };
            let steps = work.refined(found, progress)?;
            (work, steps, None)
        }
        several => {
            let (work, steps, ranking) = contest::best_of(&work, several, (settings.target, samples.len()), progress)?;
            (work, steps, Some(ranking))
        }
    };
    let parts = work.encode(steps);
    // Decoding needs the memory.
    drop(work);
    drop(classes);
    progress.step(0.95)?;
    let compressed = finish(parts, measurement, settings.metadata.as_deref())?;
    let ranking = ranking.unwrap_or(compressed.ranking);
    Ok(Compressed { ranking, ..compressed })
}

/// How the first layer sees a tensor.
#[derive(Clone)]
enum Scheme {
    /// In fixed bases on all axes.
    Fixed(SpectralBasis),
    /// On the data's own spectral basis, in fixed bases on the other axes.
    Adaptive,
    /// The same with triangles predicted, folded by the group of these symmetries, behind a model.
    Predicted(Arc<Folded>, Option<ChartKind>),
}

impl Scheme {
    fn name(&self) -> &'static str {
        match self {
            Self::Fixed(basis) => basis.name(),
            Self::Adaptive => SpectralBasis::Klt.name(),
            Self::Predicted(folded, None) if folded.is_trivial() => "predicted",
            Self::Predicted(_, None) => "predicted, folded",
            Self::Predicted(_, Some(ChartKind::Isotropic)) => "predicted, isotropic model",
            Self::Predicted(_, Some(ChartKind::Anisotropic)) => "predicted, anisotropic model",
            Self::Predicted(_, Some(ChartKind::Zonal)) => "predicted, zonal model",
        }
    }
}

/// What competes: triangles are predicted where the spectral basis is the data's own, or where there is no spectral axis.
fn schemes(
    measurement: &Measurement,
    plane: Plane<'_>,
    bases: &[SpectralBasis],
    settings: &Settings,
    floor: f32,
) -> Result<Vec<Scheme>, CompressError> {
    let axes = measurement.tensor.axes();
    let named = settings.basis != "auto";
    let mut schemes = Vec::new();
    for &basis in bases {
        let own = basis == SpectralBasis::Klt;
        match Shape::of(axes) {
            // Where nothing has a basis to be named, the data's own costs nothing or a few numbers.
            Some(shape) if schemes.is_empty() && (own || !named && short(axes)) => {
                let logs = approximated(measurement, plane, floor);
                let classes = plane.coded.map(|_| plane.classes);
                schemes.extend(
                    predicted(&shape, classes, &logs, settings.target, plane.noise).map_err(CompressError::Setting)?,
                );
            }
            None if own => schemes.push(Scheme::Adaptive),
            _ => {}
        }
        if !own {
            schemes.push(Scheme::Fixed(basis));
        }
    }
    Ok(schemes)
}

/// Whether the last axis is no spectrum, but triangles, colours or some index.
fn short(axes: &[Axis]) -> bool {
    axes.last().is_some_and(|axis| match axis {
        Axis::Triangles(_) | Axis::Rgb => true,
        Axis::Index { count, .. } => *count <= MOST_INDICES,
        Axis::Wavelength(_) | Axis::Elevation(_) => false,
    })
}

/// The predicted schemes worth a trial: the symmetries that hold decide.
fn predicted(
    shape: &Shape,
    classes: Option<&[Class]>,
    values: &[f32],
    target: Target,
    noise: Option<f64>,
) -> Result<Vec<Scheme>, String> {
    let tolerance = match target {
        Target::ErL1(error) | Target::ErL2(error) => error,
        Target::RelativeRmse(error) => error * metric::root_mean_square(values),
        Target::MaxAbsoluteError(error) | Target::MaxRelativeError(error) => 0.5 * error,
        // Where a symmetry holds, entries differ from each other by √2 times their noise, which is what is compared.
        Target::Auto => noise.map_or(0.05, |noise| 1.05 * noise),
        _ => 0.05,
    };
    let found = symmetry::symmetries(shape, values, classes, tolerance);
    let mut schemes = Vec::new();
    let mut groups = vec![found.generators.as_slice()];
    // Well within the error that is allowed, a symmetry is always worth its while.
    if !found.generators.is_empty() && found.deviation > 0.5 * tolerance && target != Target::Auto {
        groups.push(&[]);
    }
    for (i, generators) in groups.into_iter().enumerate() {
        let folded = Arc::new(Folded::new(shape, classes, values, generators)?);
        if i == 0 {
            for kind in ChartKind::ALL.into_iter().filter(|&kind| shape.has_chart(kind)) {
                // What has all symmetries of the mesh is as good as isotropic.
                if kind != ChartKind::Anisotropic || found.order < ALL_SYMMETRIES {
                    schemes.push(Scheme::Predicted(Arc::clone(&folded), Some(kind)));
                }
            }
        }
        schemes.push(Scheme::Predicted(folded, None));
    }
    Ok(schemes)
}

/// The largest step that `keeps` says yes to, from `start`; `None` where none does, or where it says that errors no longer
/// fall with the step.
fn largest_falling(
    start: f64,
    mut keeps: impl FnMut(f64) -> Result<Result<bool, ()>, CompressError>,
) -> Result<Option<f64>, CompressError> {
    let stood = Cell::new(false);
    let found = largest(start, REFINEMENTS, |step| match keeps(step) {
        Ok(Ok(kept)) => Ok(kept),
        Ok(Err(())) => {
            stood.set(true);
            Err(CompressError::Unreachable(String::new()))
        }
        Err(error) => Err(error),
    });
    if stood.get() { Ok(None) } else { found }
}

/// The last attempt before a refusal: the largest of [`powers_of_two`] that `keeps` says yes to. `closest`, which the refusal names,
/// starts anew, so that the error it advises is one that these steps find again. The Karhunen-Loève basis has too few vectors,
/// not too coarse steps: of it only `finest` is tried.
fn largest_power(
    (start, finest): (f64, f64),
    basis: SpectralBasis,
    closest: &Cell<f64>,
    mut keeps: impl FnMut(f64) -> Result<bool, CompressError>,
) -> Result<Option<f64>, CompressError> {
    let start = if basis == SpectralBasis::Klt {
        finest
    } else {
        closest.set(f64::INFINITY);
        start
    };
    for step in powers_of_two(start, finest) {
        if keeps(step)? {
            return Ok(Some(step));
        }
    }
    Ok(None)
}

fn chunk_bytes(chunks: &[(ChunkKind, Vec<u8>)]) -> usize {
    chunks.iter().map(|(_, payload)| payload.len()).sum()
}

/// What is approximated, smooth where there is nothing.
fn approximated(measurement: &Measurement, plane: Plane<'_>, floor: f32) -> Vec<f32> {
    let samples = measurement.tensor.samples();
    let mut values = vec![0.0_f32; samples.len()];
    let block = 1 << 14;
    values.par_chunks_mut(block).zip(samples.par_chunks(block)).zip(plane.classes.par_chunks(block)).for_each(
        |((values, samples), classes)| {
            plane.values.wanted_of_all(samples, classes, floor, values);
        },
    );
    fill(measurement.tensor.axes(), &mut values);
    values
}

/// The quantiser's fineness and the step of the corrections, 0 without.
#[derive(Clone, Copy)]
struct Steps {
    first: Fineness,
    correction: f32,
}

impl Steps {
    /// One layer at `step`.
    fn of(step: f64) -> Self {
        Self { first: Fineness::of(step as f32), correction: 0.0 }
    }
}

/// What is the same in every basis and at every step.
#[derive(Clone, Copy)]
struct Plane<'a> {
    values: Values,
    classes: &'a [Class],
    /// The classes chunk, where there is one.
    coded: Option<&'a (ChunkKind, Vec<u8>)>,
    counts: ErrorReport,
    /// The standard deviation of the relative noise, where it is asked for and can be told.
    noise: Option<f64>,
}

/// A first layer in one basis, ready to be tried at any step.
struct Work<'a> {
    measurement: &'a Measurement,
    settings: &'a Settings,
    plane: Plane<'a>,
    layer: Counted<'a>,
    /// What light is corrected by, and the step of its logarithms.
    light: Option<(Light, f32)>,
    floor: f32,
    /// The error or size nearest to the wanted one, where none is reached.
    closest: Cell<f64>,
    sizes: Sizes,
}

impl<'a> Work<'a> {
    fn new(
        measurement: &'a Measurement,
        plane: Plane<'a>,
        scheme: &Scheme,
        settings: &'a Settings,
        (floor, tally): (f32, &'a Tally),
    ) -> Result<Self, CompressError> {
        let axes = measurement.tensor.axes();
        let logs = || approximated(measurement, plane, floor);
        let coded = plane.coded.map(|_| plane.classes);
        let layer: Box<dyn FirstLayer + 'a> = match scheme {
            Scheme::Adaptive => Box::new(AdaptiveLayer::new(axes, coded, logs()).map_err(CompressError::Setting)?),
            Scheme::Predicted(folded, chart) => {
                let layer = PredictiveLayer::new(Arc::clone(folded), *chart, settings.random_access);
                Box::new(layer.map_err(CompressError::Setting)?)
            }
            Scheme::Fixed(basis) => {
                let layer = FixedLayer::new(axes, coded, *basis, logs());
                Box::new(layer.map_err(|e| CompressError::Setting(e.to_string()))?)
            }
        };
        let layer = Counted::new(layer, tally, measurement.tensor.len());
        let light = settings
            .albedo_error
            .and_then(|bound| Light::of(measurement.quantity, axes).map(|light| (light, light::step_of(bound))));
        let closest = Cell::new(f64::INFINITY);
        Ok(Self { measurement, settings, plane, layer, light, floor, closest, sizes: Sizes::default() })
    }

    fn original(&self) -> &[f32] {
        self.measurement.tensor.samples()
    }

    fn find_steps(&self, progress: &dyn Progress) -> Result<Steps, CompressError> {
        match self.settings.target {
            Target::ErL2(error) => {
                // A uniform quantiser's error is its step / √12; most coefficients are 0, so the step can be larger.
                let mut decoded = vec![0.0; self.original().len()];
                let mut falling = Falling::default();
                let mut measure = |step: f64| {
                    let found = self.relative_error(Fineness::of(step as f32), &mut decoded, progress)?;
                    self.closest.set(self.closest.get().min(found));
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
                    return Ok(Steps::of(step));
                }
                // The search may have begun where steps are too fine already.
                let (basis, finest) = (self.layer.basis(), f64::from(self.finest().value()));
                let keeps = |step: f64| Ok(measure(step)? <= error);
                if let Some(step) = largest_power((4.0 * error, finest), basis, &self.closest, keeps)? {
                    return Ok(Steps::of(step));
                }
                Err(refusal::cannot_follow(("er_l2", error), self.closest.get(), (self.layer.basis(), false)))
            }
            Target::ErL1(_) | Target::RelativeRmse(_) | Target::DeltaE(_) => {
                let magnitudes = |step: f32, decoded: &mut [f32]| {
                    self.magnitudes(Fineness::of(step), decoded);
                };
                let classes = self.plane.coded.map(|_| self.plane.classes);
                let trial = Trial {
                    measurement: self.measurement,
                    classes,
                    floor: self.floor,
                    linear: self.plane.values.is_linear(),
                    magnitudes,
                };
                let found = trial.largest_step(
                    self.settings.target,
                    (self.layer.basis(), f64::from(self.finest().value()), &self.closest),
                    progress,
                )?;
                Ok(Steps::of(found))
            }
            Target::Step(step) => Ok(Steps::of(step)),
            Target::Auto => self.find_truth(progress),
            Target::Ratio(_) | Target::Bytes(_) => self.sized_steps(None, Until::Close, progress),
            // |Δ ln s| ≤ ln(1 + error) bounds the relative error from both sides; a little is left for rounding to f32.
            Target::MaxRelativeError(error) => {
                self.find_bounded(2.0 * libm::log1p(error) * (1.0 - 1e-5) - 4e-7, progress)
            }
            Target::MaxAbsoluteError(error) => {
                // What lies below the floor is kept within it.
                let floored = self.plane.counts.below_floor_samples > 0;
                let error = if floored { error.min(f64::from(self.floor)) } else { error };
                let (low, high) = self.measurement.tensor.range().unwrap_or_default();
                let largest = f64::from(low.abs().max(high.abs()));
                let rounding = largest * f64::from(f32::EPSILON);
                // An error above twice the largest sample allows nothing more; a step must stay a finite number.
                let error = error.min(2.0 * largest.max(f64::from(f32::MIN_POSITIVE)));
                self.find_bounded(2.0 * error * (1.0 - 1e-5) - 4.0 * rounding, progress)
            }
            Target::Lossless => Err(CompressError::Setting("the rd policy is not lossless".to_owned())),
        }
    }

    /// The best of the choices around `steps` that keep a wanted er(L2).
    fn refined(&self, steps: Steps, progress: &dyn Progress) -> Result<Steps, CompressError> {
        let Target::ErL2(error) = self.settings.target else { return Ok(steps) };
        if matches!(self.layer.basis(), SpectralBasis::Line(_)) {
            return Ok(steps);
        }
        let mut decoded = vec![0.0; self.original().len()];
        let mut best = (chunk_bytes(&self.layer.chunks(steps.first)), steps.first);
        // One choice after the other, each from the best so far.
        for (vectors, coarser) in [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)] {
            let from = Fineness {
                more_vectors: best.1.more_vectors + vectors,
                coarser_vectors: best.1.coarser_vectors + coarser,
                ..best.1
            };
            if chunk_bytes(&self.layer.chunks(from)) > best.0 + best.0 / 16 {
                continue;
            }
            for quarter in -4..=4_i32 {
                // The error is not monotone in the step: all of its neighbourhood is tried.
                let factor = libm::exp2(f64::from(quarter) / 24.0) as f32;
                let fineness = from.at(from.step * factor);
                let bytes = chunk_bytes(&self.layer.chunks(fineness));
                if bytes < best.0 && self.relative_error(fineness, &mut decoded, progress)? <= error {
                    best = (bytes, fineness);
                }
            }
        }
        Ok(Steps { first: best.1, ..steps })
    }

    /// What a decoder has before its corrections at `fineness`.
    fn approximate(&self, fineness: Fineness, values: &mut [f32]) {
        self.layer.approximate(fineness, values);
        if let Some((light, step)) = &self.light {
            let steps = self.light_steps(light, *step, values);
            light.add(*step, &steps, values);
        }
    }

    /// The same as magnitudes of samples.
    fn magnitudes(&self, fineness: Fineness, values: &mut [f32]) {
        if self.light.is_none() {
            return self.layer.magnitudes(fineness, self.plane.values, values);
        }
        self.approximate(fineness, values);
        self.plane.values.finish(values);
    }

    /// The corrections of the light of `values`.
    fn light_steps(&self, light: &Light, step: f32, values: &[f32]) -> Vec<i32> {
        let mut samples = values.to_vec();
        self.plane.values.finish(&mut samples);
        if self.plane.coded.is_some() {
            apply_classes(self.plane.classes, &mut samples);
        }
        light.steps(self.settings.albedo_error.unwrap_or(1.0), step, self.original(), &samples)
    }

    /// The chunk of the light's corrections.
    fn light_chunk(&self, fineness: Fineness) -> Option<(ChunkKind, Vec<u8>)> {
        let (light, step) = self.light.as_ref()?;
        let mut values = vec![0.0; self.original().len()];
        self.layer.approximate(fineness, &mut values);
        let mut steps = self.light_steps(light, *step, &values);
        let mut encoder = Encoder::default();
        code_steps(&mut encoder, light.inner(), &mut steps);
        Some((ChunkKind::Light, encoder.finish()))
    }

    /// er(L2) of what a decoder has at `fineness`.
    fn relative_error(
        &self,
        fineness: Fineness,
        decoded: &mut [f32],
        progress: &dyn Progress,
    ) -> Result<f64, CompressError> {
        if progress.is_cancelled() {
            return Err(Cancelled.into());
        }
        self.magnitudes(fineness, decoded);
        if self.plane.coded.is_none() {
            return Ok(ErrorReport::measure(self.original(), decoded, f64::from(self.floor)).er_l2);
        }
        Ok(magnitude_error(self.original(), decoded, self.plane.classes, self.floor))
    }

    /// The step for which the file is nearest to the truth behind the noise, as far as the noise lets one tell.
    fn find_truth(&self, progress: &dyn Progress) -> Result<Steps, CompressError> {
        let mut decoded = vec![0.0; self.original().len()];
        let mut best: Option<(f64, Steps)> = None;
        for quarter in -12..=20_i32 {
            let steps = Steps::of(self.noise()? * libm::exp2(f64::from(quarter) / 4.0));
            let risk = self.risk(steps, &mut decoded, progress)?;
            if best.is_none_or(|(least, _)| risk < least) {
                best = Some((risk, steps));
            }
        }
        best.map(|(_, steps)| steps).ok_or_else(|| CompressError::Unreachable(refusal::NOTHING_TO_TRY.to_owned()))
    }

    /// An estimate of the mean square distance from the truth, but for a constant: that from the measurement, and what
    /// each coefficient takes over from its noise (Mallows 1973, *Some comments on Cp*). Coefficients that are kept because
    /// they are large take over more than those named beforehand.
    fn risk(&self, steps: Steps, decoded: &mut [f32], progress: &dyn Progress) -> Result<f64, CompressError> {
        let error = self.relative_error(steps.first, decoded, progress)?;
        let noise = self.noise()?;
        let share = self.layer.kept(steps.first) as f64 / self.original().len() as f64;
        Ok(error * error + SELECTED * 2.0 * noise * noise * share)
    }

    /// The noise of the measurement.
    fn noise(&self) -> Result<f64, CompressError> {
        self.plane.noise.ok_or_else(|| CompressError::Setting(refusal::NO_NOISE.to_owned()))
    }

    /// The first layer's step for which both layers together are smallest.
    fn find_bounded(&self, correction: f64, progress: &dyn Progress) -> Result<Steps, CompressError> {
        // The largest step tried is a few times as large, and is a finite number too.
        let mut correction = correction.min(f64::from(f32::MAX) / 8.0) as f32;
        if self.measurement.tensor.range().is_none_or(|range| range == (0.0, 0.0)) {
            // Zeros and masked samples come back as they are.
            correction = correction.max(f32::MIN_POSITIVE);
        }
        if correction < f32::MIN_POSITIVE {
            return Err(refusal::below_rounding(self.settings.target, self.measurement));
        }
        let factors = [0.5_f32, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0];
        let mut best: Option<(usize, Steps)> = None;
        for (i, factor) in factors.into_iter().enumerate() {
            let steps = Steps { first: Fineness::of(correction * factor), correction };
            // A coarse first layer may leave float32, where no correction helps.
            let Some((_, corrections)) = self.corrections_chunk(steps) else { continue };
            let bytes = chunk_bytes(&self.layer.chunks(steps.first)) + corrections.len();
            if best.is_none_or(|(least, _)| bytes < least) {
                best = Some((bytes, steps));
            }
            progress.step(0.45 + 0.5 * i as f64 / factors.len() as f64)?;
        }
        best.map(|(_, steps)| steps).ok_or_else(|| CompressError::Unreachable(refusal::OVERFLOWS.to_owned()))
    }

    /// The corrections of the first layer; `None` where that is not finite.
    fn corrections_chunk(&self, steps: Steps) -> Option<(ChunkKind, Vec<u8>)> {
        let mut logs = vec![0.0; self.original().len()];
        self.layer.approximate(steps.first, &mut logs);
        if !logs.iter().all(|log| log.is_finite()) {
            return None;
        }
        let (values, floor) = (self.plane.values, self.floor);
        let mut corrections: Vec<i32> = self
            .original()
            .par_iter()
            .zip(&logs)
            .zip(self.plane.classes)
            .map(|((&s, &value), &class)| {
                let wanted = values.wanted(s, class, floor);
                if wanted.is_nan() {
                    return 0;
                }
                let k = libm::round((wanted - f64::from(value)) / f64::from(steps.correction));
                // The decoder adds in f32: make sure that the nearest step is still the nearest there.
                nearest_in_f32(value, k.clamp(-LARGEST_CORRECTION, LARGEST_CORRECTION) as i32, steps.correction, wanted)
            })
            .collect();
        let mut encoder = Encoder::default();
        code_corrections(&mut encoder, lanes(self.measurement.tensor.axes()), &mut corrections);
        Some((ChunkKind::Corrections, encoder.finish()))
    }

    fn header(&self, steps: Steps) -> Header {
        let measurement = self.measurement;
        Header {
            quantity: measurement.quantity,
            unit: measurement.unit,
            sampling: measurement.sampling,
            axes: measurement.tensor.axes().to_vec(),
            policy: Policy::Rd,
            transforms: self.layer.transforms().to_vec(),
            klt: self.layer.basis() == SpectralBasis::Klt,
            predicted: self.layer.is_predicted(),
            // Known when the file is put together.
            pyramid_length: 0,
            linear: self.plane.values.is_linear(),
            step: steps.first.step,
            light_step: self.light.as_ref().map_or(0.0, |(_, step)| *step),
            correction_step: steps.correction,
            has_classes: self.plane.coded.is_some(),
            floor: self.floor,
            kept: self.layer.kept(steps.first),
            errors: self.plane.counts,
        }
    }

    fn encode(&self, steps: Steps) -> Parts {
        let corrections = if steps.correction == 0.0 { None } else { self.corrections_chunk(steps) };
        let classes = self.plane.coded.cloned();
        let chunks = classes
            .into_iter()
            .chain(self.layer.chunks(steps.first))
            .chain(self.light_chunk(steps.first))
            .chain(corrections)
            .collect();
        Parts { header: self.header(steps), chunks }
    }
}

/// er(L2) over positive samples at or above the floor, over negative ones where there are no others; blocks are added in
/// order. Both have the same step, hence nearly the same relative error; only the positive ones are promised one.
fn magnitude_error(original: &[f32], magnitudes: &[f32], classes: &[Class], floor: f32) -> f64 {
    let block = 1 << 16;
    let sums: Vec<[(f64, u64); 2]> = original
        .par_chunks(block)
        .zip(magnitudes.par_chunks(block))
        .zip(classes.par_chunks(block))
        .map(|((original, magnitudes), classes)| {
            let mut sums = [(0.0, 0); 2];
            for ((&s, &m), &class) in original.iter().zip(magnitudes).zip(classes) {
                let size = f64::from(s.abs());
                if matches!(class, Class::Positive | Class::Negative) && s.abs() >= floor {
                    let relative = (f64::from(m) - size) / size;
                    let sum = &mut sums[usize::from(class == Class::Negative)];
                    *sum = (sum.0 + relative * relative, sum.1 + 1);
                }
            }
            sums
        })
        .collect();
    let mean = |k: usize| {
        let (sum, n) = sums.iter().fold((0.0, 0), |total, block| (total.0 + block[k].0, total.1 + block[k].1));
        (n > 0).then(|| (sum / n as f64).sqrt())
    };
    mean(0).or(mean(1)).unwrap_or(0.0)
}

/// Of `k` and its neighbours, the correction after which the decoder's f32 sum is nearest to `wanted`.
fn nearest_in_f32(log: f32, k: i32, step: f32, wanted: f64) -> i32 {
    let distance = |k: i32| {
        let mut sum = [log];
        add_corrections(step, &[k], &mut sum);
        (f64::from(sum[0]) - wanted).abs()
    };
    [k - 1, k, k + 1].into_iter().min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(k)
}
