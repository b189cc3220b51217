//! The rate–distortion policy: logarithms of magnitudes, one uniform step for all normalised coefficients.
//!
//! A relative error is an absolute error of the logarithm, so one step serves bright and dark samples alike. The sphere basis
//! is orthonormal and the line bases are normalised by the norms of their synthesis functions, so that a step means the same
//! error everywhere. Signs, zeros and masks go into a class plane beside; what has no logarithm is filled smoothly.

use super::decode::{add_corrections, exponentiate};
use super::file::{Parts, assemble, classes_chunk, finish, lanes, metadata_with_labels};
use super::fill::fill;
use super::header::Header;
use super::rows::coding_order;
use super::search::largest;
use super::{CompressError, Compressed, Policy, Settings, Target, candidate_bases};
use crate::codec::{ChunkKind, Class, Encoder, Payload, Rows, code_coefficients, code_corrections};
use crate::domain::{Axis, Cancelled, ErrorReport, Measurement, Progress};
use crate::transform::{AxisTransform, LineBasis, Plan, SphereBasis, Weights};
use rayon::prelude::*;

/// Coefficients within half a step and this much more become 0.
const DEAD_ZONE: f32 = 0.12;
/// Other coefficients decode this much closer to 0, where their density is higher.
const RECONSTRUCTION_OFFSET: f32 = 0.03;
/// Quantised magnitudes stay below this.
const LARGEST: f32 = (1 << 30) as f32;
/// Bisections of the step: 2^(1/64) at the end, 1 % of the step.
const REFINEMENTS: u32 = 6;
/// A positive sample below the floor keeps at least this fraction of it, so that its error stays below the floor.
const FLOORED: f64 = 0.7;

/// The norms of synthesis functions, by row and by lane: a coefficient times both is in units of the error it makes.
pub(crate) struct Scales {
    rows: Vec<Scale>,
    lanes: Vec<Scale>,
}

/// A norm and its inverse, so that the inner loops do not divide.
#[derive(Clone, Copy)]
struct Scale {
    norm: f32,
    inverse: f32,
}

impl Scale {
    fn times(self, other: Self) -> Self {
        Self { norm: self.norm * other.norm, inverse: self.inverse * other.inverse }
    }
}

impl Scales {
    pub(crate) fn new(axes: &[Axis], plan: &Plan) -> Self {
        let norms = |axis| plan.norms(axis, Weights::Count);
        let mut rows = vec![1.0_f64];
        for axis in 0..axes.len().saturating_sub(1) {
            let norms = norms(axis);
            rows = rows.iter().flat_map(|row| norms.iter().map(move |norm| row * norm)).collect();
        }
        let lanes = axes.len().checked_sub(1).map_or_else(|| vec![1.0], norms);
        let single =
            |v: Vec<f64>| v.into_iter().map(|norm| Scale { norm: norm as f32, inverse: (1.0 / norm) as f32 }).collect();
        Self { rows: single(rows), lanes: single(lanes) }
    }

    /// Calls `each(coefficient, scale, out)` for every element, rows in parallel.
    fn for_each<A: Sync, B: Send>(&self, from: &[A], to: &mut [B], each: impl Fn(&A, Scale, &mut B) + Sync) {
        let n = self.lanes.len();
        // Blocks of whole rows, large enough to be worth a task.
        let block = (1_usize << 14).div_ceil(n);
        let rows = self.rows.par_chunks(block);
        rows.zip(from.par_chunks(block * n)).zip(to.par_chunks_mut(block * n)).for_each(|((rows, from), to)| {
            for ((row, from), to) in rows.iter().zip(from.chunks_exact(n)).zip(to.chunks_exact_mut(n)) {
                for ((lane, from), to) in self.lanes.iter().zip(from).zip(to) {
                    each(from, row.times(*lane), to);
                }
            }
        });
    }

    fn quantise(&self, step: f32, coefficients: &[f32], quantised: &mut [i32]) {
        let inverse = 1.0 / step;
        self.for_each(coefficients, quantised, |&c, scale, q| *q = quantise(c, scale, inverse));
    }

    /// Coefficients of quantised integers.
    pub(crate) fn dequantise(&self, step: f32, quantised: &[i32], coefficients: &mut [f32]) {
        self.for_each(quantised, coefficients, |&q, scale, c| *c = dequantise(q, scale, step));
    }

    /// What a decoder will have instead of `coefficients`.
    fn requantise(&self, step: f32, coefficients: &[f32], decoded: &mut [f32]) {
        let inverse = 1.0 / step;
        self.for_each(coefficients, decoded, |&c, scale, d| *d = dequantise(quantise(c, scale, inverse), scale, step));
    }

    /// Coefficients whose normalised magnitude reaches `threshold`, 0 for the others.
    pub(crate) fn threshold(&self, threshold: f32, coefficients: &[f32], kept: &mut [f32]) {
        self.for_each(coefficients, kept, |&c, scale, k| *k = if c.abs() * scale.norm >= threshold { c } else { 0.0 });
    }

    /// How many coefficients have a normalised magnitude of at least `threshold` and are not 0.
    pub(crate) fn count_above(&self, threshold: f32, coefficients: &[f32]) -> u64 {
        self.count(coefficients, |c, scale| c != 0.0 && c.abs() * scale.norm >= threshold)
    }

    fn count_kept(&self, step: f32, coefficients: &[f32]) -> u64 {
        let inverse = 1.0 / step;
        self.count(coefficients, |c, scale| quantise(c, scale, inverse) != 0)
    }

    fn count(&self, coefficients: &[f32], counts: impl Fn(f32, Scale) -> bool + Sync) -> u64 {
        let n = self.lanes.len();
        let rows = self.rows.par_iter().zip(coefficients.par_chunks_exact(n));
        rows.map(|(row, c)| c.iter().zip(&self.lanes).filter(|(c, lane)| counts(**c, row.times(**lane))).count() as u64)
            .sum()
    }
}

fn quantise(coefficient: f32, scale: Scale, inverse_step: f32) -> i32 {
    let x = coefficient * scale.norm * inverse_step;
    let magnitude = (x.abs() + (0.5 - DEAD_ZONE)).min(LARGEST) as i32;
    if x < 0.0 { -magnitude } else { magnitude }
}

fn dequantise(quantised: i32, scale: Scale, step: f32) -> f32 {
    let offset = match quantised.signum() {
        0 => return 0.0,
        sign => sign as f32 * RECONSTRUCTION_OFFSET,
    };
    (quantised as f32 - offset) * step * scale.inverse
}

/// Compresses with every candidate basis to the same step and keeps the smallest file.
pub(crate) fn compress(
    measurement: &Measurement,
    settings: &Settings,
    floor: f32,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    let axes = measurement.tensor.axes();
    let mut classes: Vec<Class> = measurement.tensor.samples().iter().map(|&s| class_of(s, floor)).collect();
    let classes_coded = classes_chunk(axes, &mut classes);
    let has_classes = classes_coded.is_some();
    let bases = candidate_bases(axes, settings);
    let work = |basis| Work::new(measurement, &classes, basis, settings, floor, has_classes);
    progress.step(0.05)?;
    let (work, steps) = match bases.as_slice() {
        [only] => {
            let work = work(*only)?;
            let steps = work.find_steps(progress)?;
            (work, steps)
        }
        several => cheapest(&work, several, progress)?,
    };
    let parts = work.encode(steps, classes_coded);
    // Decoding needs the memory.
    drop(work);
    drop(classes);
    progress.step(0.95)?;
    finish(parts, measurement, settings.metadata.as_deref())
}

/// The basis whose coefficients take the fewest bytes at the step that the first one needs, and its own steps.
fn cheapest<'a>(
    work: &impl Fn(LineBasis) -> Result<Work<'a>, CompressError>,
    bases: &[LineBasis],
    progress: &dyn Progress,
) -> Result<(Work<'a>, Steps), CompressError> {
    let first = work(bases[0])?;
    let steps = first.find_steps(progress)?;
    let mut best = (first.coefficients_chunk(steps.step).1.len(), bases[0]);
    drop(first);
    for (i, &basis) in bases.iter().enumerate().skip(1) {
        progress.step(0.05 + 0.4 * i as f64 / bases.len() as f64)?;
        let bytes = work(basis)?.coefficients_chunk(steps.step).1.len();
        if bytes < best.0 {
            best = (bytes, basis);
        }
    }
    let chosen = work(best.1)?;
    let steps = if best.1 == bases[0] { steps } else { chosen.find_steps(progress)? };
    Ok((chosen, steps))
}

/// The logarithms of magnitudes, smooth where there is none.
fn logarithms(measurement: &Measurement, classes: &[Class], floor: f32) -> Vec<f32> {
    let samples = measurement.tensor.samples();
    let lowest = FLOORED * f64::from(floor);
    let mut logs = vec![0.0_f32; samples.len()];
    let block = 1 << 14;
    logs.par_chunks_mut(block).zip(samples.par_chunks(block)).zip(classes.par_chunks(block)).for_each(
        |((logs, samples), classes)| {
            for ((log, s), class) in logs.iter_mut().zip(samples).zip(classes) {
                *log = match class {
                    Class::Positive | Class::Negative => libm::log(f64::from(s.abs()).max(lowest)) as f32,
                    Class::Zero | Class::Masked => f32::NAN,
                };
            }
        },
    );
    fill(measurement.tensor.axes(), &mut logs);
    logs
}

/// Negative samples within the floor become zeros: their sign is worth no bits, and their error stays below the floor.
fn class_of(sample: f32, floor: f32) -> Class {
    if sample.is_nan() {
        Class::Masked
    } else if sample > 0.0 {
        Class::Positive
    } else if sample == 0.0 || -sample < floor {
        Class::Zero
    } else {
        Class::Negative
    }
}

/// The quantiser's step and that of the corrections, 0 without.
#[derive(Clone, Copy)]
struct Steps {
    step: f32,
    correction: f32,
}

/// Coefficients in one basis, ready to be tried at any step.
struct Work<'a> {
    measurement: &'a Measurement,
    settings: &'a Settings,
    classes: &'a [Class],
    plan: Plan,
    transforms: Vec<AxisTransform>,
    scales: Scales,
    rows: Rows,
    coefficients: Vec<f32>,
    floor: f32,
    has_classes: bool,
}

impl<'a> Work<'a> {
    fn new(
        measurement: &'a Measurement,
        classes: &'a [Class],
        basis: LineBasis,
        settings: &'a Settings,
        floor: f32,
        has_classes: bool,
    ) -> Result<Self, CompressError> {
        let axes = measurement.tensor.axes();
        let transforms: Vec<_> = axes.iter().map(|axis| transform_of(axis, basis)).collect();
        let plan = Plan::new(axes, &transforms).map_err(|e| CompressError::Setting(e.to_string()))?;
        let mut coefficients = logarithms(measurement, classes, floor);
        plan.forward(&mut coefficients);
        let (scales, rows) = (Scales::new(axes, &plan), coding_order(axes, &plan));
        Ok(Self { measurement, settings, classes, plan, transforms, scales, rows, coefficients, floor, has_classes })
    }

    fn original(&self) -> &[f32] {
        self.measurement.tensor.samples()
    }

    fn find_steps(&self, progress: &dyn Progress) -> Result<Steps, CompressError> {
        let plain = |step: Option<f64>, unreachable: &str| match step {
            Some(step) => Ok(Steps { step: step as f32, correction: 0.0 }),
            None => Err(CompressError::Unreachable(unreachable.to_owned())),
        };
        match self.settings.target {
            Target::ErL2(error) => {
                // A uniform quantiser's error is its step / √12; most coefficients are 0, so the step can be larger.
                let mut decoded = vec![0.0; self.coefficients.len()];
                let keeps = |step: f64| self.relative_error(step as f32, &mut decoded, progress).map(|e| e <= error);
                let step = largest(4.0 * error, REFINEMENTS, keeps)?;
                plain(step, "er_l2 is below what float32 logarithms hold: ask for a larger error or lossless")
            }
            Target::Ratio(ratio) => {
                let most = self.coefficients.len() as f64 / ratio;
                smallest_step(progress, |step| self.scales.count_kept(step, &self.coefficients) as f64 <= most)
            }
            Target::Bytes(bytes) => {
                let fits = |step| self.file_size(step) as u64 <= bytes;
                smallest_step(progress, fits).map_err(|error| match error {
                    CompressError::Unreachable(_) => CompressError::Unreachable(format!(
                        "bytes {bytes}: the smallest file of this material has {} bytes{}",
                        self.file_size(f32::MAX),
                        if self.settings.metadata.is_some() { ", its metadata included" } else { "" }
                    )),
                    other => other,
                })
            }
            Target::MaxRelativeError(error) => self.find_bounded(error, progress),
            Target::Lossless => Err(CompressError::Setting("the rd policy is not lossless".to_owned())),
        }
    }

    /// er(L2) of what a decoder has at `step`; negative samples are held to the same error as positive ones.
    fn relative_error(&self, step: f32, decoded: &mut [f32], progress: &dyn Progress) -> Result<f64, CompressError> {
        if progress.is_cancelled() {
            return Err(Cancelled.into());
        }
        self.scales.requantise(step, &self.coefficients, decoded);
        self.plan.inverse(decoded);
        exponentiate(decoded);
        if !self.has_classes {
            return Ok(ErrorReport::measure(self.original(), decoded, f64::from(self.floor)).er_l2);
        }
        Ok(magnitude_error(self.original(), decoded, self.classes, self.floor))
    }

    /// The first layer's step for which both layers together are smallest.
    fn find_bounded(&self, error: f64, progress: &dyn Progress) -> Result<Steps, CompressError> {
        // |Δ ln s| ≤ ln(1 + error) bounds the relative error from both sides; a little is left for rounding to f32.
        let correction = (2.0 * libm::log1p(error) * (1.0 - 1e-5) - 4e-7) as f32;
        if correction <= 0.0 {
            let text = "max_relative_error is below what float32 logarithms hold: ask for a larger error or lossless";
            return Err(CompressError::Unreachable(text.to_owned()));
        }
        let factors = [0.5_f32, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0];
        let mut best: Option<(usize, Steps)> = None;
        for (i, factor) in factors.into_iter().enumerate() {
            let steps = Steps { step: correction * factor, correction };
            let bytes = self.coefficients_chunk(steps.step).1.len() + self.corrections_chunk(steps).1.len();
            if best.is_none_or(|(least, _)| bytes < least) {
                best = Some((bytes, steps));
            }
            progress.step(0.45 + 0.5 * i as f64 / factors.len() as f64)?;
        }
        best.map(|(_, steps)| steps).ok_or_else(|| CompressError::Unreachable("no step to try".to_owned()))
    }

    fn file_size(&self, step: f32) -> usize {
        let mut chunks = vec![self.coefficients_chunk(step)];
        let mut classes = self.classes.to_vec();
        chunks.extend(classes_chunk(self.measurement.tensor.axes(), &mut classes));
        let header = self.header(Steps { step, correction: 0.0 });
        let metadata = metadata_with_labels(self.measurement.tensor.axes(), self.settings.metadata.as_deref());
        assemble(&Parts { header, chunks }, metadata.as_deref()).len()
    }

    fn coefficients_chunk(&self, step: f32) -> (ChunkKind, Vec<u8>) {
        let mut quantised = vec![0; self.coefficients.len()];
        self.scales.quantise(step, &self.coefficients, &mut quantised);
        let mut encoder = Encoder::default();
        code_coefficients(&mut encoder, &self.rows, Payload::Integer, &mut quantised);
        (ChunkKind::Coefficients, encoder.finish())
    }

    fn corrections_chunk(&self, steps: Steps) -> (ChunkKind, Vec<u8>) {
        let mut logs = vec![0.0; self.coefficients.len()];
        self.scales.requantise(steps.step, &self.coefficients, &mut logs);
        self.plan.inverse(&mut logs);
        let lowest = FLOORED * f64::from(self.floor);
        let mut corrections: Vec<i32> = self
            .original()
            .par_iter()
            .zip(&logs)
            .zip(self.classes)
            .map(|((&s, &log), class)| match class {
                Class::Positive | Class::Negative => {
                    let wanted = libm::log(f64::from(s.abs()).max(lowest));
                    let k = libm::round((wanted - f64::from(log)) / f64::from(steps.correction));
                    // The decoder adds in f32: make sure that the nearest step is still the nearest there.
                    nearest_in_f32(log, k as i32, steps.correction, wanted)
                }
                Class::Zero | Class::Masked => 0,
            })
            .collect();
        let mut encoder = Encoder::default();
        code_corrections(&mut encoder, lanes(self.measurement.tensor.axes()), &mut corrections);
        (ChunkKind::Corrections, encoder.finish())
    }

    fn header(&self, steps: Steps) -> Header {
        let measurement = self.measurement;
        Header {
            quantity: measurement.quantity,
            unit: measurement.unit,
            sampling: measurement.sampling,
            axes: measurement.tensor.axes().to_vec(),
            policy: Policy::Rd,
            transforms: self.transforms.clone(),
            step: steps.step,
            correction_step: steps.correction,
            has_classes: self.has_classes,
            floor: self.floor,
            kept: self.scales.count_kept(steps.step, &self.coefficients),
            // The counts do not depend on what is decoded, so that the header has its final size.
            errors: ErrorReport::measure(self.original(), self.original(), f64::from(self.floor)),
        }
    }

    fn encode(&self, steps: Steps, classes: Option<(ChunkKind, Vec<u8>)>) -> Parts {
        let corrections = (steps.correction != 0.0).then(|| self.corrections_chunk(steps));
        let chunks = classes.into_iter().chain([self.coefficients_chunk(steps.step)]).chain(corrections).collect();
        Parts { header: self.header(steps), chunks }
    }
}

/// The smallest step, hence the smallest error, for which `fits` answers yes.
fn smallest_step(progress: &dyn Progress, fits: impl Fn(f32) -> bool) -> Result<Steps, CompressError> {
    // In terms of 1/step, the largest.
    let keeps = |inverse: f64| {
        if progress.is_cancelled() {
            return Err(CompressError::from(Cancelled));
        }
        Ok(fits((1.0 / inverse) as f32))
    };
    match largest(20.0, REFINEMENTS + 4, keeps)? {
        Some(inverse) => Ok(Steps { step: (1.0 / inverse) as f32, correction: 0.0 }),
        None => Err(CompressError::Unreachable("no file is that small".to_owned())),
    }
}

fn transform_of(axis: &Axis, basis: LineBasis) -> AxisTransform {
    match axis {
        Axis::Triangles(_) => AxisTransform::Sphere(SphereBasis::Orthonormal(Weights::Count)),
        Axis::Elevation(_) => AxisTransform::line(LineBasis::BIOR44),
        Axis::Wavelength(_) => AxisTransform::line(basis),
        Axis::Rgb => AxisTransform::line(LineBasis::HAAR),
        Axis::Index { .. } => AxisTransform::Identity,
    }
}

/// The larger of er(L2) over positive and over negative samples at or above the floor; blocks are added in order.
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
        if n == 0 { 0.0 } else { (sum / n as f64).sqrt() }
    };
    mean(0).max(mean(1))
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
