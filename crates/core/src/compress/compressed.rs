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
    /// Summary of the file, with the errors of the decoded bytes in full precision (the header holds them rounded).
    pub summary: Summary,
    /// Comparison of the light (directional albedo, flux) of the decoded bytes with the measurement's; `None` without directions.
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
    /// Name of the basis.
    pub basis: String,
    /// Bytes of the file made with it; where the contest compared coefficients alone, the bytes of those.
    pub bytes: u64,
    /// er(L2) of the file made with it; `None` where that was not decoded.
    pub er_l2: Option<f64>,
}
