//! Report on scattered samples: counts, noise, and rejected values.

use crate::domain::LobeCentre;
use serde::{Deserialize, Serialize};

/// Counts, noise and outliers of scattered samples, independent of the triangles onto which they are projected.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ScatterReport {
    /// Number of samples of the file: directions, or pairs of incoming and outgoing directions.
    pub samples: u64,
    /// Number of missing values of the samples.
    pub missing: u64,
    /// Number of negative values of the samples; these values are kept.
    pub negative: u64,
    /// Number of nearest samples to which each value of the tensor is fitted.
    pub neighbours: usize,
    /// Root mean square of the relative noise of the samples, from differences between neighbours; `None` if there are
    /// too few samples.
    pub noise: Option<f64>,
    /// Outliers: samples that differ so much from their neighbours that they are left out of all errors.
    pub rejected: Rejected,
    /// Isolated outliers: those that do not belong to a group of three or more within two sample spacings. Groups are
    /// sought in three coordinate systems: about the mirror direction, in half-vector slopes, and about the direction
    /// back to the source.
    pub isolated: Rejected,
    /// Number of values that differ strongly from their neighbours but belong to a narrow lobe. Samples of several
    /// incoming directions lie close together about the mirror direction, in the slope of the half vector, or about the
    /// direction back to the source. They decrease from one peak and are not rejected.
    pub lobe: u64,
    /// Outliers that suggest a lobe too narrow for the sample spacing; `None` if there are none. They are the samples
    /// nearest to the mirror direction or to the direction back to the source, under two or more incoming directions
    /// (under one if the file has no other).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unresolved: Option<UnresolvedLobe>,
}

/// Number of outliers among the samples, and how much they contribute. Outliers differ so much from their neighbours
/// that they are left out of all errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Rejected {
    /// Number of measured values that were rejected as outliers.
    pub values: u64,
    /// Number of values rejected as outliers, divided by the number of positive values.
    pub samples: f64,
    /// Sum of the outliers divided by the sum of all positive values.
    pub light: f64,
}

/// Outliers about one likely lobe centre: perhaps samples of a lobe that the scan does not resolve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct UnresolvedLobe {
    /// Direction about which the outliers suggest a lobe: the mirror direction (in transmission, the direction straight
    /// through) or the direction back to the source.
    pub centre: LobeCentre,
    /// Number of values that are outliers within about one sample spacing of the direction about which they suggest a
    /// lobe.
    pub values: u64,
}
