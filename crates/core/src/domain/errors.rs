//! Errors between two tensors: the measures of the paper (\[CPB06\] section 5), and absolute errors of the samples
//! those exclude.

use super::axis::Axis;
use super::restated::{MeanErrors, Restated};
use super::totals::Totals;
use crate::numeric::wide;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Relative error that a compression promises if the user states none: 0.01 is 1 %. It is also the error assumed for
/// data that promise none. Raising it makes smaller files and brings fewer warnings.
pub const DEFAULT_ERROR: f64 = 0.01;

/// Errors of decoded samples `s'` against the original samples `s`, computed in f64 from f32 samples.
///
/// Relative errors are defined for scored samples: those with `s > 0` (and `s ≥ floor`, if a floor was declared).
/// `er_l1 = mean |s'−s|/s` and `er_l2 = √ mean ((s'−s)/s)²`, unweighted over samples. Other samples are counted, and
/// their absolute error is reported. If a file states several values for one direction, its relative errors are those
/// of the values or of their means, whichever are larger.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ErrorReport {
    /// Number of samples, including masked ones.
    pub samples: u64,
    /// Mean relative error over the scored samples (positive and not below the floor that the user may declare); 0 if
    /// there are none.
    pub er_l1: f64,
    /// Root mean square of the relative error over the scored samples (positive and not below the floor that the user
    /// may declare).
    pub er_l2: f64,
    /// Largest relative error of a scored sample (positive and not below the floor that the user may declare).
    pub max_relative_error: f64,
    /// Relative root mean square error `√(Σ(s'−s)² / Σs²)` of decoded samples s' against the original s, over all
    /// unmasked samples.
    pub relative_rmse: f64,
    /// Largest absolute error |s'−s| of decoded samples s' against the original s, over all unmasked samples.
    pub max_absolute_error: f64,
    /// Number of samples that enter the relative errors: positive and not below the floor that the user may declare.
    pub scored_samples: u64,
    /// Number of original samples that are exactly 0.
    pub zero_samples: u64,
    /// Number of original samples below 0.
    pub negative_samples: u64,
    /// Number of original samples that are positive but left out of the relative errors, because they are below the
    /// floor that the user declared for samples.
    pub below_floor_samples: u64,
    /// Number of samples that are masked in the original data.
    pub masked_samples: u64,
    /// Largest absolute error |s'−s| over the unmasked samples that have no relative error: `s ≤ 0`, or below the floor
    /// that the user may declare.
    pub max_absolute_error_unscored: f64,
    /// Number of samples masked in either the original or the decoded data but not in both; other values than 0
    /// indicate a defect.
    pub mask_mismatches: u64,
}

/// Sums of errors over one block of samples. Blocks are added in order, so that the result does not depend on the
/// number of threads.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    totals: Totals,
    report: ErrorReport,
}

const BLOCK: usize = 1 << 16;

impl ErrorReport {
    /// Measures the errors of the samples `decoded` against `original`; masked samples are NaN in both. Original
    /// samples below `floor`, in the unit of a sample, do not count in relative errors.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn measure(original: &[f32], decoded: &[f32], floor: f64) -> Self {
        let mut accumulator = ErrorAccumulator::default();
        accumulator.add(original, decoded, floor);
        accumulator.finish()
    }

    /// Measures the errors of samples on `axes` as [`ErrorReport::measure`] does, and those of the values that
    /// evaluation returns: where several values are stated for one direction, their mean. Each figure is the larger one
    /// of the two.
    ///
    /// A mean is compared with the mean of the original values, and counts as often as its direction is stated. It has
    /// no relative error if it is not above 0, below the floor, or if values of both signs cancel to less than half
    /// their mean magnitude.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn at_directions(axes: &[Axis], original: &[f32], decoded: &[f32], floor: f64) -> Self {
        Self::with_means(&Restated::of(axes, original, floor), original, decoded, floor)
    }

    /// Measures the errors of samples and of the means of those that are stated for one direction, see
    /// [`ErrorReport::at_directions`].
    pub(crate) fn with_means(restated: &Restated, original: &[f32], decoded: &[f32], floor: f64) -> Self {
        let mut accumulator = ErrorAccumulator::default();
        accumulator.add(original, decoded, floor);
        accumulator.finish_with(restated.errors(original, |at| decoded[at]))
    }

    /// Returns the error report of data that are identical to `original`: all errors are 0.
    pub(crate) fn without_errors(original: &[f32], floor: f64) -> Self {
        let mut total = Sums::default();
        let blocks: Vec<ErrorReport> = original.par_chunks(BLOCK).map(|samples| counts(samples, floor)).collect();
        for report in blocks {
            total.add(&Sums { report, ..Sums::default() });
        }
        total.report
    }
}

/// Accumulator of an [`ErrorReport`] for samples that arrive in several pieces.
///
/// Sums are added in the order of the pieces, so equal pieces give identical bits on any number of threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorAccumulator(Sums);

impl ErrorAccumulator {
    /// Adds the errors of `decoded` against `original`. Samples below `floor`, as in [`ErrorReport::measure`], have no
    /// relative error.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn add(&mut self, original: &[f32], decoded: &[f32], floor: f64) {
        assert_eq!(original.len(), decoded.len(), "tensors to compare have the same length");
        let blocks: Vec<Sums> =
            original.par_chunks(BLOCK).zip(decoded.par_chunks(BLOCK)).map(|(s, d)| sums(s, d, floor)).collect();
        for block in &blocks {
            self.0.add(block);
        }
    }

    /// Returns the report on the errors of all decoded samples passed to [`ErrorAccumulator::add`].
    pub fn finish(self) -> ErrorReport {
        self.finish_with(MeanErrors::default())
    }

    /// Returns the report on the errors of all decoded samples, and of the means of those stated for one direction:
    /// each measure of error is the larger one of the two.
    fn finish_with(self, means: MeanErrors) -> ErrorReport {
        let Self(Sums { totals, mut report }) = self;
        let samples = Totals { scored: report.scored_samples as f64, ..totals };
        let larger = |figure: fn(&Totals) -> f64| means.larger(&samples, figure);
        report.er_l1 = larger(Totals::er_l1);
        report.er_l2 = larger(Totals::er_l2);
        report.relative_rmse = larger(Totals::relative_rmse);
        report.max_relative_error = report.max_relative_error.max(means.largest);
        report
    }
}

impl Sums {
    fn add(&mut self, block: &Self) {
        self.totals = self.totals + block.totals;
        let (a, b) = (&mut self.report, &block.report);
        a.samples += b.samples;
        a.scored_samples += b.scored_samples;
        a.zero_samples += b.zero_samples;
        a.negative_samples += b.negative_samples;
        a.below_floor_samples += b.below_floor_samples;
        a.masked_samples += b.masked_samples;
        a.mask_mismatches += b.mask_mismatches;
        a.max_relative_error = a.max_relative_error.max(b.max_relative_error);
        a.max_absolute_error = a.max_absolute_error.max(b.max_absolute_error);
        a.max_absolute_error_unscored = a.max_absolute_error_unscored.max(b.max_absolute_error_unscored);
    }
}

/// Counts the samples by kind: masked, zero, negative, positive below `floor`, and positive from `floor` upward. Only
/// those of the last kind have a relative error.
fn counts(samples: &[f32], floor: f64) -> ErrorReport {
    let all = samples.len() as u64;
    let positive = wide(
        #[inline(always)]
        || samples.iter().map(|&s| u32::from(s > 0.0)).sum::<u32>(),
    );
    if floor <= 0.0 && u64::from(positive) == all {
        return ErrorReport { samples: all, scored_samples: all, ..ErrorReport::default() };
    }
    let (mut masked, mut scored, mut positive, mut zero) = (0_u32, 0_u32, 0_u32, 0_u32);
    wide(
        #[inline(always)]
        || {
            for &s in samples {
                masked += u32::from(s.is_nan());
                positive += u32::from(s > 0.0);
                scored += u32::from((s > 0.0) & (f64::from(s) >= floor));
                zero += u32::from(s == 0.0);
            }
        },
    );
    let [masked, scored, positive, zero] = [masked, scored, positive, zero].map(u64::from);
    ErrorReport {
        samples: all,
        scored_samples: scored,
        zero_samples: zero,
        negative_samples: all - masked - positive - zero,
        below_floor_samples: positive - scored,
        masked_samples: masked,
        ..ErrorReport::default()
    }
}

/// Number of samples whose errors are computed in parallel (SIMD) before they are added in order.
const TOGETHER: usize = 64;

fn sums(original: &[f32], decoded: &[f32], floor: f64) -> Sums {
    let mut sums = Sums::default();
    let mut whole = original.chunks_exact(TOGETHER);
    let mut wholes = decoded.chunks_exact(TOGETHER);
    wide(
        #[inline(always)]
        || {
            for (original, decoded) in (&mut whole).zip(&mut wholes) {
                let scores = |s: f32, d: f32| [s > 0.0, f64::from(s) >= floor, !d.is_nan()].map(u32::from);
                let scored: u32 =
                    original.iter().zip(decoded).map(|(&s, &d)| scores(s, d).iter().product::<u32>()).sum();
                if scored as usize == TOGETHER {
                    sums.add_scored(original, decoded);
                } else {
                    sums.add_any(original, decoded, floor);
                }
            }
        },
    );
    sums.add_any(whole.remainder(), wholes.remainder(), floor);
    sums
}

impl Sums {
    /// Adds the errors of a block of decoded samples to the running sums, if every original sample is large enough for
    /// a relative error.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    fn add_scored(&mut self, original: &[f32], decoded: &[f32]) {
        let (mut absolutes, mut relatives, mut signals) = ([0.0; TOGETHER], [0.0; TOGETHER], [0.0; TOGETHER]);
        let larger = |most: f64, error: f64| if error > most { error } else { most };
        let (mut absolute, mut relative) = ([0.0; 8], [0.0; 8]);
        for (k, (&s, &d)) in original.iter().zip(decoded).enumerate() {
            let (s, d) = (f64::from(s), f64::from(d));
            absolutes[k] = (d - s).abs();
            relatives[k] = absolutes[k] / s;
            signals[k] = s;
        }
        for (absolutes, relatives) in absolutes.chunks_exact(8).zip(relatives.chunks_exact(8)) {
            for k in 0..8 {
                absolute[k] = larger(absolute[k], absolutes[k]);
                relative[k] = larger(relative[k], relatives[k]);
            }
        }
        for ((a, r), s) in absolutes.into_iter().zip(relatives).zip(signals) {
            self.totals.squared += a * a;
            self.totals.signal += s * s;
            self.totals.relative += r;
            self.totals.relative_squared += r * r;
        }
        let report = &mut self.report;
        report.samples += original.len() as u64;
        report.scored_samples += original.len() as u64;
        report.max_absolute_error = absolute.into_iter().fold(report.max_absolute_error, larger);
        report.max_relative_error = relative.into_iter().fold(report.max_relative_error, larger);
    }

    /// Adds the errors of a block of decoded samples to the running sums. The original samples may be masked, zero,
    /// negative or positive.
    fn add_any(&mut self, original: &[f32], decoded: &[f32], floor: f64) {
        let sums = self;
        let r = &mut sums.report;
        for (&s, &d) in original.iter().zip(decoded) {
            r.samples += 1;
            if s.is_nan() || d.is_nan() {
                r.masked_samples += u64::from(s.is_nan());
                r.mask_mismatches += u64::from(s.is_nan() != d.is_nan());
                continue;
            }
            let (s, d) = (f64::from(s), f64::from(d));
            let absolute = (d - s).abs();
            sums.totals.squared += absolute * absolute;
            sums.totals.signal += s * s;
            r.max_absolute_error = r.max_absolute_error.max(absolute);
            if s > 0.0 && s >= floor {
                let relative = absolute / s;
                r.scored_samples += 1;
                sums.totals.relative += relative;
                sums.totals.relative_squared += relative * relative;
                r.max_relative_error = r.max_relative_error.max(relative);
            } else {
                r.zero_samples += u64::from(s == 0.0);
                r.negative_samples += u64::from(s < 0.0);
                r.below_floor_samples += u64::from(s > 0.0);
                r.max_absolute_error_unscored = r.max_absolute_error_unscored.max(absolute);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_positive_samples_above_the_floor_are_scored() {
        let original = [1.0, 2.0, 0.0, -0.5, f32::NAN, 0.001];
        let decoded = [1.1, 1.8, 0.01, -0.25, f32::NAN, 0.5];
        let r = ErrorReport::measure(&original, &decoded, 0.01);
        assert_eq!((r.samples, r.scored_samples, r.zero_samples, r.negative_samples), (6, 2, 1, 1));
        assert_eq!((r.below_floor_samples, r.masked_samples, r.mask_mismatches), (1, 1, 0));
        assert!((r.er_l1 - 0.1).abs() < 1e-7 && (r.er_l2 - 0.1).abs() < 1e-7);
        assert!((r.max_absolute_error_unscored - 0.499).abs() < 1e-6);
    }

    #[test]
    fn blocks_add_up_to_the_whole() {
        let original: Vec<f32> = (0..3 * BLOCK + 17).map(|i| 1.0 + (i % 13) as f32).collect();
        let decoded: Vec<f32> = original.iter().enumerate().map(|(i, s)| s * (1.0 + 0.01 * (i % 3) as f32)).collect();
        let r = ErrorReport::measure(&original, &decoded, 0.0);
        assert!((r.er_l1 - 0.01).abs() < 1e-5, "{}", r.er_l1);
        assert_eq!(r.scored_samples, original.len() as u64);
    }

    #[test]
    fn pieces_add_up_to_the_whole() {
        let original: Vec<f32> = (0..2 * BLOCK).map(|i| (i % 7) as f32 - 1.0).collect();
        let decoded: Vec<f32> = original.iter().map(|s| s * 1.01 + 0.001).collect();
        let mut pieces = ErrorAccumulator::default();
        pieces.add(&original[..BLOCK], &decoded[..BLOCK], 0.5);
        pieces.add(&original[BLOCK..], &decoded[BLOCK..], 0.5);
        assert_eq!(pieces.finish(), ErrorReport::measure(&original, &decoded, 0.5));
        assert_eq!(ErrorAccumulator::default().finish(), ErrorReport::default());
    }

    #[test]
    fn samples_have_no_errors_against_themselves() {
        let samples: Vec<f32> =
            (0..BLOCK + 777).map(|i| if i % 11 == 0 { f32::NAN } else { (i % 7) as f32 - 2.0 }).collect();
        for floor in [0.0, 1.5] {
            assert_eq!(ErrorReport::without_errors(&samples, floor), ErrorReport::measure(&samples, &samples, floor));
        }
    }

    #[test]
    fn samples_together_are_samples_one_by_one() {
        let original: Vec<f32> = (0..5 * TOGETHER).map(|i| 0.3 + (i % 17) as f32).collect();
        let decoded: Vec<f32> = original.iter().enumerate().map(|(i, s)| s + ((i % 5) as f32 - 2.0) * 0.01).collect();
        let mut one_by_one = Sums::default();
        one_by_one.add_any(&original, &decoded, 0.0);
        let together = sums(&original, &decoded, 0.0);
        assert_eq!(together.report, one_by_one.report);
        assert_eq!(together.totals, one_by_one.totals);
    }

    #[test]
    fn nothing_scored_is_no_error() {
        let r = ErrorReport::measure(&[0.0, f32::NAN], &[0.0, 1.0], 0.0);
        assert_eq!((r.er_l2, r.relative_rmse, r.mask_mismatches), (0.0, 0.0, 1));
    }
}
