//! Result of a compression: the file, its errors, and the search that found it.

use super::effort::Effort;
use super::light::LightReport;
use super::noise::Noise;
use super::summary::Summary;
use crate::domain::Measurement;
use crate::domain::colour::ColourReport;
use serde::{Deserialize, Serialize};

/// A compressed material.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// Bytes of the file.
    pub bytes: Vec<u8>,
    /// Samples that the bytes decode to, on the axes of the measurement; [`decode`](super::decode) returns the same.
    /// `None` once they are taken.
    pub decoded: Option<Measurement>,
    /// Summary of the file, with the errors of the decoded bytes in full precision (the header rounds them).
    pub summary: Summary,
    /// Comparison of the light (directional albedo, flux) of the decoded bytes with the measurement's; `None` without
    /// directions.
    pub light: Option<LightReport>,
    /// Colour differences of the decoded bytes; `None` unless the target bounds them.
    pub colour: Option<ColourReport>,
    /// Competing spectral bases, best first; a single one if the basis was named.
    pub ranking: Vec<Ranked>,
    /// Noise of the measurement, if it can be estimated; informative only.
    pub noise: Option<Noise>,
    /// Number of trials that the search took.
    pub effort: Effort,
}

/// Spectral basis that competed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Ranked {
    /// Name of the basis.
    pub basis: String,
    /// Bytes of the file made with the basis, or of its coefficients if only those were compared.
    pub bytes: u64,
    /// er(L2) of the file made with the basis; `None` if the file was not decoded.
    pub er_l2: Option<f64>,
}
