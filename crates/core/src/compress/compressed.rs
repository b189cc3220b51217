//! Result of a compression: the file, what it achieves, and how it was found.

use super::effort::Effort;
use super::light::LightReport;
use super::noise::Noise;
use super::summary::Summary;
use crate::domain::colour::ColourReport;
use serde::Serialize;

/// A compressed material.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// The file.
    pub bytes: Vec<u8>,
    /// What was achieved; its errors are those of the decoded bytes, in full precision.
    pub summary: Summary,
    /// How much of the light the decoded bytes keep, where there are triangles.
    pub light: Option<LightReport>,
    /// The colours of the decoded bytes, where they were promised.
    pub colour: Option<ColourReport>,
    /// The bases that competed, best first; one where the basis was named.
    pub ranking: Vec<Ranked>,
    /// The noise of the measurement, where it can be told; it decides nothing.
    pub noise: Option<Noise>,
    /// The trials that the search took.
    pub effort: Effort,
}

/// One basis that competed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranked {
    /// Its name.
    pub basis: String,
    /// The size of its file, or of its coefficients where only those were compared.
    pub bytes: u64,
    /// The error of its file, where it was decoded.
    pub er_l2: Option<f64>,
}
