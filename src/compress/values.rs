//! What the rate–distortion policy approximates of a sample: the logarithm of its magnitude, or the sample itself.
//!
//! A relative error is an absolute error of the logarithm; an absolute error is one of the sample, whatever its sign.

use super::Target;
use super::exponential::exponentiate;
use crate::codec::Class;
use rayon::prelude::*;

/// A positive sample below the floor keeps at least this fraction of it, so that its error stays below the floor.
const FLOORED: f64 = 0.7;

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
