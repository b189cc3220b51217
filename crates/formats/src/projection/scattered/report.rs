//! Errors of a fit to scattered samples, by region of the outgoing direction.

use serde::Serialize;

/// What is known of a fit to scattered samples.
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
    /// Every tenth sample predicted from the other nine, or as many of them as are compared.
    pub left_out: Regions,
    /// The fit itself at original samples, as many as are compared.
    pub fit: Regions,
    /// The cells' averages, taken as constant over each cell, at all original samples.
    pub constant: Regions,
    /// The share of the withheld samples whose light lies more than a third, and ten times the usual, from the prediction.
    pub outliers: f64,
    /// What quadratics through cells of the outgoing level cannot say, about; `None` where it was not tried.
    pub representation: Option<f64>,
}

/// Relative errors by region of the outgoing direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Regions {
    /// Everywhere.
    pub all: Scores,
    /// At least half as bright as the brightest (99.5 % of samples are darker) under the same incoming direction.
    pub peak: Scores,
    /// The rest.
    pub middle: Scores,
    /// Less bright, more than 70° from the normal.
    pub grazing: Scores,
}

/// Relative errors of positive values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Scores {
    /// Values that were compared.
    pub values: u64,
    /// Mean of |s' − s| / s.
    pub er_l1: f64,
    /// Root mean square of (s' − s) / s.
    pub er_l2: f64,
}
