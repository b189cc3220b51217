//! The paper's policies: linear domain, bio-Haar on triangles, thresholds on L2-normalised coefficients, kept
//! coefficients exact.
//!
//! See \[CPB06\] section 4.2. *Conventional* has one threshold, *generic* one threshold for each space, *adaptive*
//! ε√d inside a function of range d. Coefficients are ranked by |c|·‖synthesis function‖ in the counting measure of
//! er(L2). Kept coefficients are stored exactly (float32), so the only error is that of the dropped ones.

use super::classes::classes_chunk;
use super::compressed::{Compressed, Ranked};
use super::effort::Tally;
use super::error::CompressError;
use super::fill::fill;
use super::finish::finish;
use super::header::UNSCORED_BYTES;
use super::kept_coefficients::parts_of;
use super::metadata::metadata_with_labels;
use super::parts::{Parts, assemble};
use super::policy::Policy;
use super::refusal;
use super::rows::{clear_uncoded, coding_order};
use super::scales::Scales;
use super::search::{Notch, Until, finest_fitting, largest};
use super::selection::{GenericTransform, Rule, Search};
use super::setting_error::{RdOption, SettingError};
use super::settings::Settings;
use super::spectral_basis::SpectralBasis;
use super::target::{Bound, Target};
use super::unreachable_error::UnreachableError;
use crate::codec::{ChunkKind, Class, Rows};
use crate::domain::{Cancelled, ErrorReport, Measurement, Progress, Restated};
use crate::transform::{AxisTransform, Plan, SphereBasis};

/// Number of bisections of the coefficient threshold; each halves the remaining interval.
const REFINEMENTS: u32 = 12;
/// Fraction of the allowed bytes at which the search for the number of kept coefficients stops.
const ENOUGH: f64 = 0.99;

/// Compresses by a threshold in every candidate basis and keeps the best file: the smallest, or the one of least error
/// at a given size.
pub(crate) fn compress(
    measurement: &Measurement,
    settings: &Settings,
    bases: &[SpectralBasis],
    floor: f32,
    (progress, tally): (&dyn Progress, &Tally),
) -> Result<Compressed, CompressError> {
    let rule = match settings.policy {
        Policy::Generic => Rule::Generic,
        Policy::Adaptive => Rule::Adaptive,
        _ => Rule::Conventional,
    };
    let axes = measurement.tensor.axes();
    let mut samples = measurement.tensor.samples().to_vec();
    let mut classes: Vec<Class> =
        samples.iter().map(|s| if s.is_nan() { Class::Masked } else { Class::Positive }).collect();
    let classes_coded = classes_chunk(axes, &mut classes);
    fill(axes, &mut samples);
    let mut found: Vec<Compressed> = Vec::new();
    let mut refused = Vec::new();
    for (i, &basis) in bases.iter().enumerate() {
        progress.step(0.05 + 0.9 * i as f64 / bases.len() as f64)?;
        let file = || {
            let work =
                Work::new(measurement, &samples, basis, settings, (floor, tally), (&classes, classes_coded.clone()))?;
            let parts = match rule {
                Rule::Conventional => work.parts(work.find_threshold(progress)?),
                _ => work.find_generic(&samples, rule, progress)?,
            };
            drop(work);
            tally.add(samples.len());
            finish(parts, measurement, settings.metadata.as_deref())
        };
        match file() {
            Ok(file) => found.push(file.without_samples()),
            // Another basis may reach the target.
            Err(CompressError::Unreachable(error)) => refused.push((0.0, error)),
            Err(other) => return Err(other),
        }
    }
    if found.is_empty() {
        return Err(refusal::nothing_reaches(refused));
    }
    best(found, settings.target)
}

/// Returns the best of several files made to one target: the smallest, or that of least error er(L2) if the target is a
/// size or a ratio. Of equally good files it returns the first. A ranking of all is included.
fn best(mut found: Vec<Compressed>, target: Target) -> Result<Compressed, CompressError> {
    let by_error = matches!(target, Target::Ratio(_) | Target::Bytes(_));
    found.sort_by(|a, b| {
        if by_error {
            a.summary.errors.er_l2.total_cmp(&b.summary.errors.er_l2)
        } else {
            a.bytes.len().cmp(&b.bytes.len())
        }
    });
    let ranking = found
        .iter()
        .map(|c| Ranked {
            basis: c.summary.basis.clone(),
            bytes: c.bytes.len() as u64,
            er_l2: Some(c.summary.errors.er_l2),
        })
        .collect();
    let best = found.into_iter().next().ok_or(SettingError::NoBasis)?;
    Ok(Compressed { ranking, ..best })
}

struct Work<'a> {
    measurement: &'a Measurement,
    settings: &'a Settings,
    plan: Plan,
    transforms: Vec<AxisTransform>,
    scales: Scales,
    rows: Rows,
    coefficients: Vec<f32>,
    classes: Option<(ChunkKind, Vec<u8>)>,
    basis: SpectralBasis,
    floor: f32,
    tally: &'a Tally,
}

impl<'a> Work<'a> {
    fn new(
        measurement: &'a Measurement,
        samples: &[f32],
        basis: SpectralBasis,
        settings: &'a Settings,
        (floor, tally): (f32, &'a Tally),
        (classes, classes_coded): (&[Class], Option<(ChunkKind, Vec<u8>)>),
    ) -> Result<Self, CompressError> {
        let axes = measurement.tensor.axes();
        let transforms: Vec<_> = axes.iter().map(|axis| basis.transform_of(axis, SphereBasis::BioHaar)).collect();
        let plan = Plan::new(axes, &transforms).map_err(SettingError::from)?;
        let mut coefficients = samples.to_vec();
        plan.forward(&mut coefficients);
        let scales = Scales::new(axes, &plan);
        let rows = coding_order(axes, &plan, classes_coded.is_some().then_some(classes));
        clear_uncoded(&rows, &mut coefficients);
        let classes = classes_coded;
        if coefficients.iter().any(|c| !c.is_finite()) {
            return Err(refusal::transform_overflows(settings.policy, basis, measurement));
        }
        Ok(Self { measurement, settings, plan, transforms, scales, rows, coefficients, classes, basis, floor, tally })
    }

    /// Error figure that the compression target bounds, with its upper bound. `None` for a target without such a
    /// figure, and for lossless, which no threshold on coefficients reaches.
    fn bound(&self) -> Option<Bound> {
        self.settings.target.bound().filter(|_| self.settings.target != Target::Lossless)
    }

    /// Directions for which the measurement states several values.
    fn restated(&self) -> Restated {
        let tensor = &self.measurement.tensor;
        Restated::of(tensor.axes(), tensor.samples(), f64::from(self.floor))
    }

    fn find_threshold(&self, progress: &dyn Progress) -> Result<f32, CompressError> {
        let n = self.coefficients.len() as f64;
        match (self.settings.target, self.bound()) {
            (Target::Ratio(ratio), _) => self.least_threshold(progress, |t| self.kept(t) as f64 <= n / ratio),
            (Target::Bytes(bytes), _) => self.threshold_of_size(progress, bytes),
            (_, Some(bound)) => self.largest_threshold(progress, |errors| bound.keeps(errors)),
            (_, None) => Err(SettingError::NeedsRd { option: RdOption::Target, policy: self.settings.policy }.into()),
        }
    }

    /// Finds the largest threshold on coefficients whose decoded errors are accepted; 0 if only keeping all of them is.
    fn largest_threshold(
        &self,
        progress: &dyn Progress,
        accepts: impl Fn(&ErrorReport) -> bool,
    ) -> Result<f32, CompressError> {
        let samples = self.measurement.tensor.samples();
        let (restated, floor) = (self.restated(), f64::from(self.floor));
        let mut decoded = vec![0.0; self.coefficients.len()];
        let keeps = |threshold: f64| {
            if progress.is_cancelled() {
                return Err(CompressError::from(Cancelled));
            }
            self.tally.add(decoded.len());
            self.scales.threshold(threshold as f32, &self.coefficients, &mut decoded);
            self.plan.inverse(&mut decoded);
            for (value, &s) in decoded.iter_mut().zip(samples) {
                if s.is_nan() {
                    *value = f32::NAN;
                }
            }
            Ok(accepts(&ErrorReport::with_means(&restated, samples, &decoded, floor)))
        };
        Ok(largest(self.scale(), REFINEMENTS, keeps)?.map_or(0.0, |threshold| threshold as f32))
    }

    /// Finds the smallest threshold on coefficients, hence the least error, that `fits` accepts.
    fn least_threshold(&self, progress: &dyn Progress, fits: impl Fn(f32) -> bool) -> Result<f32, CompressError> {
        // Bisects the bit patterns of positive floats, which are in the order of the floats.
        let (mut low, mut high) = (0_u32, f32::MAX.to_bits());
        if !fits(f32::MAX) {
            let kept = self.kept(f32::MAX) as f64;
            let of = (self.coefficients.len(), self.basis);
            return Err(refusal::too_large(self.settings.target, kept, of, false));
        }
        while low < high {
            if progress.is_cancelled() {
                return Err(Cancelled.into());
            }
            let middle = low + (high - low) / 2;
            if fits(f32::from_bits(middle)) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        Ok(f32::from_bits(low))
    }

    /// Finds the smallest threshold, among f32 numbers of 8 significant bits, whose file has at most `bytes` bytes.
    fn threshold_of_size(&self, progress: &dyn Progress, bytes: u64) -> Result<f32, CompressError> {
        let size = |at: Notch| {
            if progress.is_cancelled() {
                return Err(CompressError::from(Cancelled));
            }
            Ok(self.file_size(at.value()) as f64)
        };
        // A kept coefficient takes about four bytes.
        let start = self.scales.threshold_of_count((bytes / 4) as usize, &self.coefficients);
        match finest_fitting((Notch::below(start), Notch::FINEST), (bytes as f64, Until::Close), size)? {
            Some(at) => Ok(at.value()),
            None => Err(self.too_large()),
        }
    }

    /// Builds the error for a wanted size below that of the smallest file.
    fn too_large(&self) -> CompressError {
        let smallest = self.size_of(&self.parts_of(vec![0.0; self.coefficients.len()])) as f64;
        let of = (self.coefficients.len(), self.basis);
        refusal::too_large(self.settings.target, smallest, of, self.settings.metadata.is_some())
    }

    /// Threshold on coefficients with which the search for the best one starts: 1 % of the mean magnitude of a sample.
    fn scale(&self) -> f64 {
        let samples = self.measurement.tensor.samples();
        let sum: f64 = samples.iter().filter(|s| !s.is_nan()).map(|s| f64::from(s.abs())).sum();
        (0.01 * sum / samples.len() as f64).max(1e-30)
    }

    fn kept(&self, threshold: f32) -> u64 {
        self.scales.count_above(threshold, &self.coefficients)
    }

    fn file_size(&self, threshold: f32) -> usize {
        self.size_of(&self.parts(threshold))
    }

    fn size_of(&self, parts: &Parts) -> usize {
        self.tally.add(self.coefficients.len());
        let metadata = metadata_with_labels(self.measurement.tensor.axes(), self.settings.metadata.as_deref());
        let errors = &parts.header.errors;
        let unscored = errors.zero_samples + errors.negative_samples + errors.below_floor_samples > 0;
        // The decoded file will state an error for unscored samples, which is not known yet.
        assemble(parts, metadata.as_deref()).len() + if unscored { UNSCORED_BYTES } else { 0 }
    }

    /// Finds one threshold for each axis so that the file meets the target, for the policies `generic` and `adaptive`.
    /// Returns the content of a file with the coefficients kept.
    ///
    /// These policies transform the samples along one axis after another, and drop coefficients after each.
    fn find_generic(&self, samples: &[f32], rule: Rule, progress: &dyn Progress) -> Result<Parts, CompressError> {
        let axes = self.measurement.tensor.axes();
        let transform = GenericTransform::new(axes, &self.transforms, samples, true).map_err(SettingError::from)?;
        let original = self.measurement.tensor.samples();
        let restated = self.restated();
        let errors = |decoded: &[f32]| {
            self.tally.add(decoded.len());
            let masked: Vec<f32> =
                original.iter().zip(decoded).map(|(s, &d)| if s.is_nan() { f32::NAN } else { d }).collect();
            ErrorReport::with_means(&restated, original, &masked, f64::from(self.floor))
        };
        let er_l2 = |decoded: &[f32]| if progress.is_cancelled() { f64::INFINITY } else { errors(decoded).er_l2 };
        // Margin for the coefficients below dead nodes, which are not coded.
        let slack = 1.0 - 1e-6;
        let count = samples.len();
        let search = match self.settings.target {
            Target::Ratio(ratio) => Some(transform.search_count((count as f64 / ratio) as usize, rule, &er_l2)),
            Target::Bytes(bytes) => {
                let search = |count| transform.search_count(count, rule, &er_l2);
                self.largest_count(bytes, count, search, progress)
            }
            _ => self.bound().and_then(|bound| {
                let figure = |decoded: &[f32]| {
                    if progress.is_cancelled() { f64::INFINITY } else { (bound.figure)(&errors(decoded)) }
                };
                transform.search_error(bound.at_most * slack, rule, &figure)
            }),
        };
        if progress.is_cancelled() {
            return Err(Cancelled.into());
        }
        let search = search.ok_or_else(|| match self.bound() {
            Some(bound) => {
                let closest = (bound.figure)(&errors(&all(&transform)));
                refusal::cannot_follow(
                    (bound.name, bound.at_most),
                    closest,
                    (self.basis, true),
                    refusal::Limits::default(),
                )
            }
            None => self.too_large(),
        })?;
        if let Target::Ratio(ratio) = self.settings.target
            && search.kept as f64 > count as f64 / ratio
        {
            // √d is 0 for a constant function: no threshold drops anything there.
            return Err(UnreachableError::ConstantFunctions { ratio, kept: search.kept, count }.into());
        }
        let mut kept = search.coefficients;
        clear_uncoded(&self.rows, &mut kept);
        Ok(self.parts_of(kept))
    }

    /// Finds the selection with the most coefficients whose file has at most `bytes` bytes; `None` if no file is that
    /// small.
    fn largest_count(
        &self,
        bytes: u64,
        count: usize,
        search: impl Fn(usize) -> Search,
        progress: &dyn Progress,
    ) -> Option<Search> {
        let size = |found: &Search| self.size_of(&self.parts_of(found.coefficients.clone())) as u64;
        let none = self.size_of(&self.parts_of(vec![0.0; count])) as u64;
        if none > bytes {
            return None;
        }
        // Size is nearly linear in the count: the next trial is where the line meets the wanted bytes.
        let (mut low, mut high) = ((0, none), None::<(usize, u64)>);
        let mut best = None;
        let mut middle = ((bytes - none) / 4) as usize;
        while !progress.is_cancelled() {
            let most = high.map_or(count, |(at, _)| at - 1);
            if low.0 >= most && best.is_some() {
                break;
            }
            middle = middle.clamp((low.0 + 1).min(most), most);
            let found = search(middle);
            let found_size = size(&found);
            if found_size <= bytes {
                low = (middle, found_size);
                best = Some(found);
                if found_size as f64 >= ENOUGH * bytes as f64 {
                    break;
                }
            } else {
                high = Some((middle, found_size));
            }
            if high.is_some_and(|(at, _)| at - low.0 <= count / 256) || most == 0 || high.is_some_and(|(at, _)| at <= 1)
            {
                break;
            }
            middle = match high {
                Some((at, there)) => {
                    let part = (bytes - low.1) as f64 / (there - low.1) as f64;
                    // Stays away from both ends, where a trial narrows the interval too little.
                    low.0 + ((at - low.0) as f64 * part.clamp(0.1, 0.9)) as usize
                }
                None => (1.05 * low.0 as f64 * (bytes - none) as f64 / (low.1 - none).max(1) as f64) as usize,
            };
        }
        best.or_else(|| (!progress.is_cancelled()).then(|| search(0)))
    }

    fn parts(&self, threshold: f32) -> Parts {
        let mut kept = vec![0.0_f32; self.coefficients.len()];
        self.scales.threshold(threshold, &self.coefficients, &mut kept);
        self.parts_of(kept)
    }

    fn parts_of(&self, kept: Vec<f32>) -> Parts {
        let plan = (self.settings.policy, self.transforms.as_slice());
        let mut parts = parts_of(self.measurement, plan, self.floor, self.classes.clone(), &self.rows, kept);
        parts.header = parts.header.stating(self.settings);
        parts
    }
}

/// Reconstructs the samples from all coefficients of the transform, so that only its rounding changes them.
fn all(transform: &GenericTransform) -> Vec<f32> {
    let mut decoded = transform.coefficients().to_vec();
    transform.plan().inverse(&mut decoded);
    decoded
}
