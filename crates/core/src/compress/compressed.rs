//! Result of a compression: the file, its errors, and the search that found it.

use super::decode::{Decoded, decode};
use super::effort::Effort;
use super::light::LightReport;
use super::noise::Noise;
use super::summary::Summary;
use crate::codec::CodecError;
use crate::domain::Measurement;
use crate::domain::colour::ColourReport;
use serde::{Deserialize, Serialize};

/// A compressed material.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// Bytes of the file.
    pub bytes: Vec<u8>,
    /// Samples that the bytes decode to, as long as they are at hand: see [`Compressed::take_decoded`].
    pub(crate) decoded: Option<Measurement>,
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

impl Compressed {
    /// Takes the samples that the bytes decode to. They are those that the errors were measured on, or are decoded
    /// again if they were freed or taken before; both are the same.
    pub fn take_decoded(&mut self) -> Result<Decoded, CodecError> {
        match self.decoded.take() {
            Some(measurement) => Ok(Decoded { measurement, summary: self.summary.clone() }),
            None => decode(&self.bytes),
        }
    }

    /// Frees the decoded samples, which take as much memory as the measurement, before another file is made.
    #[must_use]
    pub fn without_samples(self) -> Self {
        Self { decoded: None, ..self }
    }
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
