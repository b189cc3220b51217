//! Measurements → compressed materials to a promised error, measured on the decoded bytes.

use crate::domain::{Axis, Cancelled, ErrorReport, Measurement, Progress, Quantity, Sampling, Unit};
use serde::{Deserialize, Serialize};

/// What the user is promised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Target {
    /// er(L2) at most this (0.01 = 1 %).
    ErL2(f64),
    /// The relative error of every sample > 0 at most this.
    MaxRelativeError(f64),
    /// At least this many samples per kept coefficient.
    Ratio(f64),
    /// At most this many bytes, metadata included.
    Bytes(u64),
    /// Every bit.
    Lossless,
}

/// How coefficients are chosen and coded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Policy {
    /// Rate–distortion: log domain, one uniform step.
    #[default]
    Rd,
    /// The paper's: one threshold on normalised coefficients, kept ones exact.
    Conventional,
}
crate::domain::named!(Policy, "policy", { Rd = "rd", Conventional = "conventional" });

/// Everything that decides the bytes, beside the measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The promise.
    pub target: Target,
    /// The policy.
    pub policy: Policy,
    /// Name of the spectral basis, or `auto`.
    pub basis: String,
    /// Samples below `floor ×` the maximum leave the relative errors and are kept within that absolutely.
    pub floor: Option<f64>,
    /// Text for the optional metadata chunk: a JSON object.
    pub metadata: Option<String>,
}

/// A compressed material.
#[derive(Clone, Debug)]
pub struct Compressed {
    /// The file.
    pub bytes: Vec<u8>,
    /// What was achieved.
    pub summary: Summary,
}

/// What is known of a material from its header.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// The quantity.
    pub quantity: Quantity,
    /// The unit of a sample.
    pub unit: Unit,
    /// What a sample on a triangle axis stands for.
    pub sampling: Sampling,
    /// The axes.
    pub axes: Vec<Axis>,
    /// The policy.
    pub policy: Policy,
    /// The spectral basis.
    pub basis: String,
    /// Coefficients that are not zero; `None` for lossless.
    pub kept_coefficients: Option<u64>,
    /// Absolute floor, 0 if none was declared.
    pub floor: f64,
    /// The errors of the decoded file against its input tensor.
    pub errors: ErrorReport,
    /// The metadata chunk's text, if there is one.
    pub metadata: Option<String>,
}

/// A decoded material.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// The samples.
    pub measurement: Measurement,
    /// The header.
    pub summary: Summary,
}

/// Why a measurement was not compressed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompressError {
    /// A setting out of its range, or an unknown basis.
    #[error("{0}")]
    Setting(String),
    /// No file meets the target.
    #[error("{0}")]
    Unreachable(String),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Why bytes are no material.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("not a material: {0}")]
pub struct DecodeError(pub String);

/// Compresses `measurement` to the promise of `settings`.
pub fn compress(
    measurement: &Measurement,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Compressed, CompressError> {
    let _ = (measurement, settings, progress);
    unimplemented!()
}

/// Reads the header of a material without decoding its samples; checks every chunk's checksum.
pub fn inspect(bytes: &[u8]) -> Result<Summary, DecodeError> {
    let _ = bytes;
    unimplemented!()
}

/// Decodes a material.
pub fn decode(bytes: &[u8]) -> Result<Decoded, DecodeError> {
    let _ = bytes;
    unimplemented!()
}

/// The digest of the file without its metadata chunk.
pub fn payload_digest(bytes: &[u8]) -> Result<blake3::Hash, DecodeError> {
    let _ = bytes;
    unimplemented!()
}
