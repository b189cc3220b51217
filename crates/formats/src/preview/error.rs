//! Reasons why a colour or picture cannot be computed.

use crate::domain::Quantity;
use crate::domain::colour::ColourError;
use crate::evaluate::EvaluateError;

/// Reasons why a colour or picture of a material cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PreviewError {
    /// The material cannot be evaluated as requested: directions, or the index of an entry (spectrum or specimen), are
    /// missing, too many or out of range.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The material's spectra, with the light and observer given, do not define a colour.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The request for a colour or picture does not fit the material.
    #[error(transparent)]
    Question(#[from] QuestionError),
    /// The picture could not be encoded as PNG; this is a bug.
    #[error("the picture could not be encoded as PNG, a bug: {0}")]
    Encode(String),
}

/// Requests for colours or pictures that do not fit the material.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum QuestionError {
    /// The picture of the material is a ball, which cannot have the requested look.
    #[error(
        "the picture of this material is a ball, made of pixels on dark ground: PNG without a title or light style"
    )]
    Ball,
    /// The request has an outgoing direction but no incoming one.
    #[error("found an outgoing direction (wo) without an incoming one (wi), which this {quantity} needs")]
    LoneWo {
        /// Radiometric quantity of the material.
        quantity: Quantity,
    },
    /// The request lacks the index that selects one entry (spectrum or specimen) of a material with numbered entries.
    #[error(
        "found no index of one entry (spectrum or specimen) of the material, expected one number for each axis of \
         numbered entries, {expected} in all"
    )]
    MissingIndex {
        /// Number of index axes of the material; a request has to name a position on each of them.
        expected: usize,
    },
    /// The requested index is outside the index axes of the material.
    #[error("index {found:?}, expected one number for each index axis of the material, below its length in {shape:?}")]
    Index {
        /// Requested entry of the material, one number for each of its index axes.
        found: Vec<usize>,
        /// Number of entries on each index axis of the material.
        shape: Vec<usize>,
    },
    /// RGB data were requested under a light other than that of sRGB.
    #[error("the material has RGB instead of spectra, so that its colour is known under D65 only, found {illuminant}")]
    RgbIlluminant {
        /// Name of the requested illuminant.
        illuminant: String,
    },
    /// The index axes of the material have more entries, each with a colour of its own, than colours fit in one answer.
    #[error(
        "the index axes of the material have {found} entries, each with a colour, expected at most {most} colours in \
         one answer: give the index of one entry"
    )]
    TooMany {
        /// Number of entries (spectra or specimens) of the material, each with a colour of its own: the product of the
        /// lengths of its axes of numbered entries.
        found: usize,
        /// Upper bound on the number of colours in one answer.
        most: usize,
    },
    /// The requested picture size is out of range.
    #[error("picture size {found}, expected {low} to {high} pixels along a side")]
    Size {
        /// Requested number of pixels along a side of the picture.
        found: usize,
        /// Smallest allowed number of pixels along a side of the picture.
        low: usize,
        /// Largest allowed number of pixels along a side of the picture.
        high: usize,
    },
    /// The material has no incoming directions, so a ball of it cannot be lit.
    #[error("the material has no incoming directions, expected some to light a ball with this surface")]
    NoIncoming,
}

/// Returns the error for a request for a colour or picture that does not fit the material.
pub(super) fn unfit<T>(error: QuestionError) -> Result<T, PreviewError> {
    Err(PreviewError::Question(error))
}
