//! Result of a compression: the file, its errors, and the search that found it.

use super::below_floor::BelowFloor;
use super::decode::{Decoded, decode};
use super::effort::Effort;
use super::light::LightReport;
use super::noise::Noise;
use super::summary::Summary;
use crate::codec::CodecError;
use crate::domain::Measurement;
use crate::domain::colour::ColourReport;
use serde::{Deserialize, Serialize};

/// Result of a compression: the file, its errors and the search that found it.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// Complete content of the compressed file.
    pub bytes: Vec<u8>,
    /// Samples that the file decodes to; `None` once they are freed or taken, see [`Compressed::take_decoded`].
    pub(crate) decoded: Option<Measurement>,
    /// Summary of the file, with the errors of the decoded bytes in full precision (the header rounds them).
    pub summary: Summary,
    /// Errors of the samples that the floor leaves out of the relative errors.
    pub(crate) below_floor: BelowFloor,
    /// Errors of the directional albedo or flux of the decoded file against the measurement; `None` without directions.
    pub light: Option<LightReport>,
    /// Colour differences between decoded file and measurement; `None` unless the target bounds them.
    pub colour: Option<ColourReport>,
    /// Spectral bases that competed, best first; a single one if the settings named it.
    pub ranking: Vec<Ranked>,
    /// Estimated noise of the measurement; `None` if it cannot be estimated. It does not affect the file.
    pub noise: Option<Noise>,
    /// Work of the search for this file: trials (quantisations that were coded or reconstructed) and samples they
    /// processed.
    pub effort: Effort,
}

impl Compressed {
    /// Takes the decoded samples of the file. If they were freed or taken before, decodes them again, with the same
    /// result.
    pub fn take_decoded(&mut self) -> Result<Decoded, CodecError> {
        match self.decoded.take() {
            Some(measurement) => Ok(Decoded { measurement, summary: self.summary.clone() }),
            None => decode(&self.bytes),
        }
    }

    /// Frees the decoded samples, which need as much memory as the measurement, for example before another file is
    /// made.
    #[must_use]
    pub fn without_samples(self) -> Self {
        Self { decoded: None, ..self }
    }
}

/// Spectral basis that competed for a file, with the size and error it reached.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Ranked {
    /// Name of the spectral basis, for example `klt`.
    pub basis: String,
    /// Size in bytes of the file made with this basis, or of its coefficients alone if only those were compared.
    pub bytes: u64,
    /// Relative RMS error er(L2) of the file made with this basis; `None` if the file was not decoded.
    pub er_l2: Option<f64>,
}
