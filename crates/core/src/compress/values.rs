//! What the rate–distortion policy approximates of a sample: the logarithm of its magnitude, or the sample itself.
//!
//! A relative error is an absolute error of the logarithm; an absolute error is one of the sample, whatever its sign.

use super::exponential::exponentiate;
use super::logarithm::logarithms;
use super::target::Target;
use crate::codec::Class;
use crate::numeric::wide;
use rayon::prelude::*;

/// A positive sample below the floor keeps at least this fraction of it, so that its error stays below the floor.
const FLOORED: f64 = 0.7;

/// Whether every sample is above 0, hence none masked.
pub(crate) fn all_positive(samples: &[f32]) -> bool {
    let block = |samples: &[f32]| {
        wide(
            #[inline(always)]
            || samples.iter().map(|&s| u32::from(s > 0.0)).sum::<u32>() as usize == samples.len(),
        )
    };
    samples.par_chunks(1 << 14).all(block)
}

/// What is approximated of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Values {
    /// The natural logarithm of its magnitude; its class says the sign.
    Logarithms,
    /// The sample, negative ones too if `signed`; otherwise nothing decodes below 0.
    Samples {
        /// Whether the measurement has negative samples.
        signed: bool,
    },
}

impl Values {
    /// What serves `target` best.
    pub(crate) fn of(target: Target, samples: &[f32]) -> Self {
        match target {
            Target::MaxAbsoluteError(_) | Target::RelativeRmse(_) => {
                Self::Samples { signed: samples.iter().any(|&s| s < 0.0) }
            }
            _ => Self::Logarithms,
        }
    }

    /// Whether samples are approximated as they are.
    pub(crate) fn is_linear(self) -> bool {
        matches!(self, Self::Samples { .. })
    }

    /// The class of a sample. Negative samples within the floor become zeros where only magnitudes are approximated: their
    /// sign is worth no bits, and their error stays below the floor.
    pub(crate) fn class_of(self, sample: f32, floor: f32) -> Class {
        if sample.is_nan() {
            Class::Masked
        } else if sample > 0.0 {
            Class::Positive
        } else if sample == 0.0 {
            Class::Zero
        } else if self.is_linear() {
            // It carries its own sign.
            Class::Positive
        } else if -sample < floor {
            Class::Zero
        } else {
            Class::Negative
        }
    }

    /// What is approximated of a sample; NaN where nothing is.
    pub(crate) fn wanted(self, sample: f32, class: Class, floor: f32) -> f64 {
        match (class, self) {
            (Class::Zero | Class::Masked, _) => f64::NAN,
            (_, Self::Samples { .. }) => f64::from(sample),
            (_, Self::Logarithms) => libm::log(f64::from(sample.abs()).max(FLOORED * f64::from(floor))),
        }
    }

    /// The same of many samples.
    pub(crate) fn wanted_of_all(self, samples: &[f32], classes: &[Class], floor: f32, wanted: &mut [f32]) {
        const BLOCK: usize = 256;
        if self.is_linear() {
            for ((wanted, &s), &class) in wanted.iter_mut().zip(samples).zip(classes) {
                *wanted = self.wanted(s, class, floor) as f32;
            }
            return;
        }
        let least = FLOORED * f64::from(floor);
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

    /// From what was approximated to samples, but for what the classes say.
    pub(crate) fn finish(self, values: &mut [f32]) {
        match self {
            Self::Logarithms => exponentiate(values),
            Self::Samples { signed: true } => {}
            Self::Samples { signed: false } => values.par_chunks_mut(1 << 14).for_each(|values| {
                for value in values {
                    // NaN stays, and is refused later.
                    if *value < 0.0 {
                        *value = 0.0;
                    }
                }
            }),
        }
    }
}
