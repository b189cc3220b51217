//! Candidate: a first layer in one scheme, evaluated at any step: its errors, its chunks and the parts of its file.

use super::super::classes::{apply_classes, sample_of};
use super::super::effort::Tally;
use super::super::error::CompressError;
use super::super::exponential::add_corrections;
use super::super::header::Header;
use super::super::light::{self, Correcting, Light};
use super::super::parts::Parts;
use super::super::policy::Policy;
use super::super::refusal::Limits;
use super::super::rows::lanes;
use super::super::search::Notch;
use super::super::setting_error::SettingError;
use super::super::settings::{AUTO_BASIS, Settings};
use super::super::spectral_basis::SpectralBasis;
use super::adaptive::AdaptiveLayer;
use super::class_plane::{ClassPlane, approximated};
use super::gridded::{Form, GridLayer};
use super::layer::{Counted, FirstLayer, FixedLayer};
use super::predictive::PredictiveLayer;
use super::schemes::Scheme;
use super::spectrum::{MAX_GRID_RANK, MAX_RANK};
use super::steps::{Fineness, Steps};
use crate::codec::{ChunkKind, Class, Encoder, code_corrections, code_steps};
use crate::domain::{Cancelled, ErrorReport, MeanErrors, Measurement, Progress, Totals};
use rayon::prelude::*;
use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest relative error that can be asked for. A larger one is returned for a file that is not to be accepted.
const BROKEN: f64 = 10.0;

/// Upper bound on the correction of a sample, in correction steps; it keeps the integers within 32 bits.
const LARGEST_CORRECTION: f64 = (1 << 30) as f64;

/// Cache of the file sizes that a search has found for one coding scheme.
#[derive(Default)]
pub(super) struct Sizes {
    /// File size found for each quantiser step tried: number of nonzero coefficients if the target is a ratio,
    /// otherwise bytes without the table of coarser resolution levels.
    pub(super) known: RefCell<BTreeMap<Notch, f64>>,
    /// Bytes of the table of coarser resolution levels in a file; an estimate until a file has been assembled.
    pub(super) index: Cell<Option<f64>>,
}

/// Measurement prepared for coding in one scheme, ready to be tried at any quantiser step.
pub(super) struct Candidate<'a> {
    pub(super) measurement: &'a Measurement,
    pub(super) settings: &'a Settings,
    pub(super) plane: ClassPlane<'a>,
    pub(super) layer: Counted<'a>,
    /// Integration weights for light corrections (of albedo or flux of each block and wavelength), and the step of
    /// these corrections. `None` if no error of light is bounded.
    light: Option<(Light, f32)>,
    pub(super) floor: f32,
    /// Smallest error or size found, reported if no trial reaches the wanted one.
    pub(super) closest: Cell<f64>,
    pub(super) sizes: Sizes,
}

impl<'a> Candidate<'a> {
    pub(super) fn new(
        measurement: &'a Measurement,
        plane: ClassPlane<'a>,
        scheme: &Scheme,
        settings: &'a Settings,
        (floor, tally): (f32, &'a Tally),
    ) -> Result<Self, CompressError> {
        let axes = measurement.tensor.axes();
        let logs = move || approximated(measurement, plane);
        let coded = plane.coded.map(|_| plane.classes);
        let layer: Box<dyn FirstLayer + 'a> = match scheme {
            Scheme::Adaptive => Box::new(AdaptiveLayer::new(axes, coded, logs())?),
            Scheme::Predicted(folded, chart) => {
                let layer = PredictiveLayer::new(Arc::clone(folded), *chart, settings.random_access);
                Box::new(layer?)
            }
            Scheme::Gridded { shape, klt, learns, model, divisor, step } => {
                let form = Form {
                    klt: *klt,
                    weighs_negative: plane.weighs_negative,
                    learns: *learns,
                    model: *model,
                    divisor: *divisor,
                    is_linear: plane.values.is_linear(),
                    random: settings.random_access,
                    step: *step,
                };
                Box::new(GridLayer::new(axes, shape.clone(), coded, logs, form)?)
            }
            Scheme::Fixed(basis) => {
                let layer = FixedLayer::new(axes, coded, *basis, logs());
                Box::new(layer.map_err(SettingError::from)?)
            }
        };
        let layer = Counted::new(layer, tally, measurement.tensor.len());
        let signed = layer.negative_bound().is_some();
        let light = settings.albedo_error.and_then(|bound| {
            Light::of(measurement.quantity, axes).map(|light| (light, light::step_of(bound, signed)))
        });
        let closest = Cell::new(f64::INFINITY);
        Ok(Self { measurement, settings, plane, layer, light, floor, closest, sizes: Sizes::default() })
    }

    /// Returns true if the file may contain coarser resolution levels: its samples are predicted from coarse to fine,
    /// and incoming directions are not coded independently.
    pub(super) fn has_levels(&self) -> bool {
        (self.layer.is_predicted() || self.layer.is_gridded()) && !self.settings.random_access
    }

    pub(super) fn original(&self) -> &[f32] {
        self.measurement.tensor.samples()
    }

    /// Returns what `decode` writes for all samples. The coding comes first, so that its memory is free by then.
    fn decoded(&self, fineness: Fineness, decode: impl FnOnce(&mut [f32])) -> Vec<f32> {
        self.layer.prepare(fineness);
        let mut decoded = vec![0.0; self.original().len()];
        decode(&mut decoded);
        decoded
    }

    /// Computes the values that a decoder gets with this quantiser setting, before corrections of light and of single
    /// samples.
    fn uncorrected(&self, fineness: Fineness) -> Vec<f32> {
        self.decoded(fineness, |values| self.layer.approximate(fineness, values))
    }

    /// Computes the magnitudes of the samples that a decoder gets with this quantiser setting, before corrections of
    /// single samples.
    pub(super) fn magnitudes(&self, fineness: Fineness) -> Vec<f32> {
        let Some((light, step)) = &self.light else {
            return self.decoded(fineness, |values| self.layer.magnitudes(fineness, self.plane.values, values));
        };
        let mut values = self.uncorrected(fineness);
        let steps = self.light_steps(light, *step, &values);
        let how = Correcting::new(*step, Some(self.plane.classes), self.layer.negative_bound());
        light.add(how, &steps, &mut values);
        self.plane.values.finish(&mut values);
        values
    }

    /// Computes the numbers of correction steps to add to the decoded logarithms of each incoming direction and
    /// wavelength, to keep the bound on the error of albedo or flux. `step` is the size of a step.
    fn light_steps(&self, light: &Light, step: f32, values: &[f32]) -> Vec<i32> {
        let mut samples = values.to_vec();
        self.plane.values.finish(&mut samples);
        if self.plane.coded.is_some() {
            apply_classes(self.plane.classes, &mut samples);
        }
        let mut largest = [self.layer.negative_bound().unwrap_or(0.0)];
        self.plane.values.finish(&mut largest);
        light.steps(self.settings.albedo_error.unwrap_or(1.0), (step, largest[0]), (self.original(), &samples))
    }

    /// Encodes the corrections of albedo or flux; `None` if no error of light is bounded.
    fn light_chunk(&self, fineness: Fineness) -> Option<(ChunkKind, Vec<u8>)> {
        let (light, step) = self.light.as_ref()?;
        let mut steps = self.light_steps(light, *step, &self.uncorrected(fineness));
        let mut encoder = Encoder::default();
        code_steps(&mut encoder, light.inner(), &mut steps);
        Some((ChunkKind::Light, encoder.finish()))
    }

    /// Returns the relative RMS error er(L2) of the samples decoded with this quantiser setting, or of the means of
    /// those stated for one direction if it is larger. If a negative sample breaks its bound, the result exceeds every
    /// error that can be asked for.
    pub(super) fn relative_error(&self, fineness: Fineness, progress: &dyn Progress) -> Result<f64, CompressError> {
        if progress.is_cancelled() {
            return Err(Cancelled.into());
        }
        let decoded = self.magnitudes(fineness);
        let ClassPlane { classes, coded, restated, .. } = self.plane;
        let floor = f64::from(self.floor);
        if coded.is_none() {
            return Ok(ErrorReport::with_means(restated, self.original(), &decoded, floor).er_l2);
        }
        let means = restated.errors(self.original(), |at| sample_of(classes[at], decoded[at]));
        let error = magnitude_error(self.original(), &decoded, classes, self.floor, &means);
        Ok(if self.plane.weighs_negative { error.max(BROKEN * self.excess(&decoded)) } else { error })
    }

    /// Returns the reasons why files of this scheme may follow the measurement no closer, and a remedy.
    pub(super) fn limits(&self) -> Limits {
        let Settings { basis, random_access, albedo_error, .. } = self.settings;
        // Larger samples make up for the light that negative ones, or those below the floor, have lost.
        let corrects_light = albedo_error.is_some() && (self.floor > 0.0 || self.plane.counts.negative_samples > 0);
        if self.layer.basis() != SpectralBasis::Klt {
            return Limits { corrects_light, ..Limits::default() };
        }
        let another = match (basis == AUTO_BASIS, *random_access) {
            (true, true) => Some("a file without random access"),
            (true, false) => None,
            (false, true) => Some("basis auto without random access"),
            (false, false) => Some("basis auto"),
        };
        let vectors = Some(if self.layer.is_gridded() { MAX_GRID_RANK } else { MAX_RANK });
        Limits { corrects_light, vectors, another }
    }

    /// Largest error of a negative sample that is approximated, as a multiple of the largest magnitude of a negative
    /// sample, which bounds it. 0 if the bound is kept.
    fn excess(&self, decoded: &[f32]) -> f64 {
        let (lowest, _) = self.measurement.tensor.range().unwrap_or_default();
        let negative = self.original().iter().zip(decoded).zip(self.plane.classes);
        let off = negative.filter(|(_, class)| **class == Class::Negative).map(|((s, d), _)| (d + s).abs());
        let excess = f64::from(off.fold(0.0, f32::max)) / f64::from(-lowest);
        if excess > 1.0 { excess } else { 0.0 }
    }

    /// Encodes for every sample the multiple of the correction step that takes the value decoded from coefficients
    /// nearest to the original. `None` if a value decoded from coefficients is not finite.
    pub(super) fn corrections_chunk(&self, steps: Steps) -> Option<(ChunkKind, Vec<u8>)> {
        let logs = self.uncorrected(steps.first);
        if !logs.iter().all(|log| log.is_finite()) {
            return None;
        }
        let plane = self.plane;
        let is_bounded = self.layer.negative_bound().is_some();
        let mut corrections: Vec<i32> = self
            .original()
            .par_iter()
            .zip(&logs)
            .zip(self.plane.classes)
            .enumerate()
            .map(|(at, ((&s, &value), &class))| {
                let wanted = plane.values.wanted(s, class, plane.least_of(at));
                // On grids, negative samples may be bounded instead of approximated.
                if wanted.is_nan() || is_bounded && class == Class::Negative {
                    return 0;
                }
                let k = libm::round((wanted - f64::from(value)) / f64::from(steps.correction));
                // The decoder adds in f32, where a neighbouring step may be nearer.
                nearest_in_f32(value, k.clamp(-LARGEST_CORRECTION, LARGEST_CORRECTION) as i32, steps.correction, wanted)
            })
            .collect();
        let mut encoder = Encoder::default();
        code_corrections(&mut encoder, lanes(self.measurement.tensor.axes()), &mut corrections);
        Some((ChunkKind::Corrections, encoder.finish()))
    }

    fn header(&self, steps: Steps) -> Header {
        Header {
            transforms: self.layer.transforms().to_vec(),
            klt: self.layer.basis() == SpectralBasis::Klt,
            predicted: self.layer.is_predicted(),
            gridded: self.layer.is_gridded(),
            linear: self.plane.values.is_linear(),
            step: steps.first.step,
            light_step: self.light.as_ref().map_or(0.0, |(_, step)| *step),
            correction_step: steps.correction,
            classes: self.plane.coded.map(|(kind, _)| *kind),
            floor: self.floor,
            kept: self.layer.kept(steps.first),
            errors: self.plane.counts,
            // The length of the pyramid is known when the file is assembled.
            ..Header::of(self.measurement, Policy::Rd).stating(self.settings)
        }
    }

    pub(super) fn encode(&self, steps: Steps) -> Parts {
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

/// Computes the relative RMS error er(L2) of decoded magnitudes over the positive samples, or over the negative ones if
/// there are no positive ones. Samples with a magnitude below `floor` do not count. `means` are the errors of the means
/// of positive samples that are stated for one direction; with them the error may be larger.
///
/// Positive and negative samples share one quantiser step and therefore have nearly the same relative error, but an
/// error is promised for positive samples only. Partial sums are added in a fixed order.
fn magnitude_error(original: &[f32], magnitudes: &[f32], classes: &[Class], floor: f32, means: &MeanErrors) -> f64 {
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
    let totals = |k: usize| {
        let (sum, n) = sums.iter().fold((0.0, 0), |total, block| (total.0 + block[k].0, total.1 + block[k].1));
        (n > 0).then(|| Totals { relative_squared: sum, scored: n as f64, ..Totals::default() })
    };
    match (totals(0), totals(1)) {
        (Some(positive), _) => means.larger(&positive, Totals::er_l2),
        (None, Some(negative)) => negative.er_l2(),
        (None, None) => 0.0,
    }
}

/// Returns the integer among k − 1, k and k + 1 whose product with `step`, added to the decoded logarithm `log` in f32,
/// comes nearest to the original logarithm `wanted`. `k` is nearest but for f32 rounding in the decoder's sum.
fn nearest_in_f32(log: f32, k: i32, step: f32, wanted: f64) -> i32 {
    let distance = |k: i32| {
        let mut sum = [log];
        add_corrections(step, &[k], &mut sum);
        (f64::from(sum[0]) - wanted).abs()
    };
    [k - 1, k, k + 1].into_iter().min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(k)
}
