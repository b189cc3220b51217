//! Report on scattered samples: counts, noise, and rejected values.

use crate::domain::LobeCentre;
use serde::{Deserialize, Serialize};

/// Counts, noise and outliers of scattered samples, independent of the cells made of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ScatterReport {
    /// Number of samples (directions, or pairs of them).
    pub samples: u64,
    /// Number of missing values.
    pub missing: u64,
    /// Number of negative values; they are kept.
    pub negative: u64,
    /// Number of nearest samples that each value is fitted to.
    pub neighbours: usize,
    /// Root mean square of the relative noise of the samples, from differences between neighbours; `None` if there are
    /// too few samples.
    pub noise: Option<f64>,
    /// Outliers.
    pub rejected: Rejected,
    /// Isolated outliers: fewer than three within two sample spacings of each other, in every coordinate system.
    pub isolated: Rejected,
    /// Number of values that differ strongly from their neighbours but belong to a narrow lobe. Samples of several
    /// incidences lie close together about the mirror direction, in the slope of the half vector, or about the
    /// direction back to the source. They fall off from one peak and are not rejected.
    pub lobe: u64,
    /// Rejected values that suggest a lobe which the scan does not resolve; `None` if there are none. Samples of
    /// several incidences (of one if there is no other) are outliers and the nearest ones to the mirror direction or to
    /// that back to the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unresolved: Option<UnresolvedLobe>,
}

/// Outliers: samples that differ so much from their neighbours that they are left out of all errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Rejected {
    /// Number of values.
    pub values: u64,
    /// Fraction of all positive values, by number.
    pub samples: f64,
    /// Fraction of the sum of all positive values.
    pub light: f64,
}

/// Outliers about one likely centre: perhaps samples of a lobe that the scan does not resolve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct UnresolvedLobe {
    /// Centre of the lobe; in transmission the direction straight through stands for the mirror direction.
    pub centre: LobeCentre,
    /// Number of rejected values about the centre.
    pub values: u64,
}
