//! Error bound of the target `auto`: the estimated noise, or the uncertainty stated in the file if that is larger.

use super::uncertainty::relative;
use crate::compress::{self, Policy, Settings, Target};
use crate::domain::{Measurement, named};
use crate::formats::Acquisition;
use serde::{Deserialize, Serialize};

/// Error bound that the target `auto` chose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum StoppedAt {
    /// Noise estimated from the samples.
    Noise,
    /// Uncertainty stated in the file.
    Uncertainty,
}
named!(StoppedAt, "bound of auto", { Noise = "noise", Uncertainty = "uncertainty" });

/// Outcome of the target `auto`. All numbers are relative: 0.01 is 1 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AutoReport {
    /// The bound chosen: the larger of `uncertainty` and `noise`.
    pub stopped_at: StoppedAt,
    /// Root mean square of the stated relative standard uncertainties, over values larger than their own uncertainty.
    /// `None` if the file states none.
    pub uncertainty: Option<f64>,
    /// Estimated noise of the samples; `None` if it cannot be estimated.
    pub noise: Option<f64>,
}

impl AutoReport {
    /// Returns the outcome for the projected `measurement`. `scattered` is the noise of samples at scattered
    /// directions, if known. `floor` is a fraction of the largest sample. Returns `None` unless the target is `auto`
    /// and the policy `rd`.
    pub(super) fn of(
        settings: &Settings,
        acquisition: &Acquisition,
        measurement: &Measurement,
        scattered: Option<f64>,
    ) -> Option<Self> {
        if settings.target != Target::Auto || settings.policy != Policy::Rd {
            return None;
        }
        let floor = compress::absolute_floor(measurement, settings.floor);
        let noise = scattered.or_else(|| Some(compress::estimate_noise(measurement, floor)?.relative));
        Some(Self::larger(relative(acquisition), noise.filter(|noise| *noise > 0.0)))
    }

    fn larger(uncertainty: Option<f64>, noise: Option<f64>) -> Self {
        let is_above = uncertainty.is_some_and(|uncertainty| noise.is_none_or(|noise| uncertainty > noise));
        let stopped_at = if is_above { StoppedAt::Uncertainty } else { StoppedAt::Noise };
        Self { stopped_at, uncertainty, noise }
    }

    /// Returns the compression target that stops at the chosen bound.
    pub(super) fn target(&self) -> Target {
        match (self.stopped_at, self.uncertainty) {
            (StoppedAt::Uncertainty, Some(uncertainty)) => Target::ErL2(uncertainty),
            _ => Target::Auto,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_stops_at_the_larger_bound() {
        for (uncertainty, noise, target) in [
            (Some(0.03), Some(0.01), Target::ErL2(0.03)),
            (Some(0.03), None, Target::ErL2(0.03)),
            (Some(0.01), Some(0.03), Target::Auto),
            (Some(0.01), Some(0.01), Target::Auto),
            (None, Some(0.01), Target::Auto),
            (None, None, Target::Auto),
        ] {
            assert_eq!(AutoReport::larger(uncertainty, noise).target(), target, "{uncertainty:?} {noise:?}");
        }
    }
}
