//! Value that the rate–distortion policy approximates for each sample: the logarithm of its magnitude, or the sample
//! itself.
//!
//! A relative error of a sample is an absolute error of its logarithm. Absolute errors need the sample itself, whatever
//! its sign.

use super::exponential::exponentiate;
use super::logarithm::logarithms;
use super::target::Target;
use crate::codec::Class;
use crate::numeric::wide;
use rayon::prelude::*;

/// Returns true if every sample is above 0, so that none is masked.
pub(crate) fn all_positive(samples: &[f32]) -> bool {
    let block = |samples: &[f32]| {
        wide(
            #[inline(always)]
            || samples.iter().map(|&s| u32::from(s > 0.0)).sum::<u32>() as usize == samples.len(),
        )
    };
    samples.par_chunks(1 << 14).all(block)
}

/// Value that the file approximates for each sample: the logarithm of its magnitude, or the sample itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Values {
    /// Natural logarithm of the sample's magnitude; the sample's class carries the sign.
    Logarithms,
    /// Sample itself, not its logarithm. Decoded values below 0 become 0 unless the measurement has negative samples
    /// (`signed`).
    Samples {
        /// True if the measurement has negative samples, so that decoded values may be negative.
        signed: bool,
    },
}

impl Values {
    /// Returns the kind of value, logarithms or samples, that serves `target` best.
    pub(crate) fn of(target: Target, samples: &[f32]) -> Self {
        match target {
            Target::MaxAbsoluteError(_) | Target::RelativeRmse(_) => {
                Self::Samples { signed: samples.iter().any(|&s| s < 0.0) }
            }
            _ => Self::Logarithms,
        }
    }

    /// Returns true if the file approximates the samples themselves rather than their logarithms.
    pub(crate) fn is_linear(self) -> bool {
        matches!(self, Self::Samples { .. })
    }

    /// Returns the class (positive, negative, zero or masked) of a sample. If logarithms are coded, a negative sample
    /// of magnitude below the floor (smallest sample whose relative error counts) becomes a zero.
    ///
    /// Coding its sign would cost more than it is worth, and its error stays below the floor.
    pub(crate) fn class_of(self, sample: f32, floor: f32) -> Class {
        if sample.is_nan() {
            Class::Masked
        } else if sample > 0.0 {
            Class::Positive
        } else if sample == 0.0 {
            Class::Zero
        } else if self.is_linear() {
            // The coded value carries its own sign.
            Class::Positive
        } else if -sample < floor {
            Class::Zero
        } else {
            Class::Negative
        }
    }

    /// Returns the value (logarithm or sample) that a file should approximate for a sample; NaN for zero and masked
    /// ones. A magnitude below `least` is raised to it before its logarithm is taken.
    pub(crate) fn wanted(self, sample: f32, class: Class, least: f64) -> f64 {
        match (class, self) {
            (Class::Zero | Class::Masked, _) => f64::NAN,
            (_, Self::Samples { .. }) => f64::from(sample),
            (_, Self::Logarithms) => libm::log(f64::from(sample.abs()).max(least)),
        }
    }

    /// Computes for many samples the values (logarithms or samples) that a file should approximate, as
    /// [`Values::wanted`] does for one.
    pub(crate) fn wanted_of_all(self, samples: &[f32], classes: &[Class], least: f64, wanted: &mut [f32]) {
        const BLOCK: usize = 256;
        if self.is_linear() {
            for ((wanted, &s), &class) in wanted.iter_mut().zip(samples).zip(classes) {
                *wanted = self.wanted(s, class, least) as f32;
            }
            return;
        }
        let mut magnitudes = [0.0; BLOCK];
        let blocks = samples.chunks(BLOCK).zip(classes.chunks(BLOCK));
        for (wanted, (samples, classes)) in wanted.chunks_mut(BLOCK).zip(blocks) {
            let magnitudes = &mut magnitudes[..wanted.len()];
            for ((magnitude, &s), &class) in magnitudes.iter_mut().zip(samples).zip(classes) {
                let live = matches!(class, Class::Positive | Class::Negative);
                *magnitude = if live { f64::from(s.abs()).max(least) } else { f64::NAN };
            }
            logarithms(magnitudes);
            wanted.iter_mut().zip(&*magnitudes).for_each(|(wanted, &log)| *wanted = log as f32);
        }
    }

    /// Converts decoded values (logarithms or samples) to magnitudes or samples, before classes restore signs, zeros
    /// and masks.
    pub(crate) fn finish(self, values: &mut [f32]) {
        match self {
            Self::Logarithms => exponentiate(values),
            Self::Samples { signed: true } => {}
            Self::Samples { signed: false } => values.par_chunks_mut(1 << 14).for_each(|values| {
                for value in values {
                    // NaN passes; it is rejected later.
                    if *value < 0.0 {
                        *value = 0.0;
                    }
                }
            }),
        }
    }
}
