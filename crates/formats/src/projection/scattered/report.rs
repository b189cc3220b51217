//! Report on scattered samples: how many there are, their noise, and what was rejected.

use serde::{Deserialize, Serialize};

/// Counts, noise and outliers of scattered samples, independent of the cells made of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ScatterReport {
    /// Samples (directions, or pairs of them).
    pub samples: u64,
    /// Values of them that are missing.
    pub missing: u64,
    /// Values that are negative; they are kept.
    pub negative: u64,
    /// Nearest samples that each value is fitted to.
    pub neighbours: usize,
    /// Root mean square of the relative noise of the samples, from differences between neighbours; `None` where there are too
    /// few samples to tell.
    pub noise: Option<f64>,
    /// Outliers.
    pub rejected: Rejected,
    /// Those of them that lie alone: fewer than three within two sample spacings of each other, whatever the coordinate.
    pub isolated: Rejected,
    /// Values far from their neighbours that are the light of a narrow lobe: samples of several incidences lie together about
    /// the mirror direction, in the slope of the half vector, or about the direction back, and fall off from one peak. They are
    /// not rejected.
    pub lobe: u64,
}

/// Samples that lie so far from their neighbours that they are left out of all errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// The number of values.
    pub values: u64,
    /// Share of all positive values.
    pub samples: f64,
    /// Share of the sum of all positive values.
    pub light: f64,
}
