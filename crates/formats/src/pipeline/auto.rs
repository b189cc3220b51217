//! Error bound of the target `auto`: the estimated noise, or the uncertainty stated in the file if that is larger.

use super::uncertainty::relative;
use crate::compress::{self, Policy, Settings, Target};
use crate::domain::{Measurement, named};
use crate::formats::Acquisition;
use serde::{Deserialize, Serialize};

/// Origin of the error bound at which a compression with the target `auto` stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum StoppedAt {
    /// The error bound of the compression is the noise that was estimated from the samples.
    Noise,
    /// The error bound of the compression is the measurement uncertainty stated in the file.
    Uncertainty,
}
named!(StoppedAt, "bound of auto", { Noise = "noise", Uncertainty = "uncertainty" });

/// Error bound chosen by the compression target `auto`, and the numbers behind it. All numbers are relative: 0.01 is 1
/// %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct AutoReport {
    /// Origin of the chosen error bound: the larger of `uncertainty` and `noise`.
    pub stopped_at: StoppedAt,
    /// Root mean square of the relative standard uncertainties in the file, over values larger than their own
    /// uncertainty. `None` if the file states no uncertainty.
    pub uncertainty: Option<f64>,
    /// Estimated relative noise of the samples; `None` if it cannot be estimated.
    pub noise: Option<f64>,
}

impl AutoReport {
    /// Returns the error bound that the target `auto` chooses for `measurement`. `scattered` is the noise of samples at
    /// scattered directions, if known. Returns `None` for other targets, and for policies other than `rd`.
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

    /// Returns the compression target that reaches the chosen error bound.
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
