//! Reasons why a colour or picture cannot be computed.

use crate::domain::Quantity;
use crate::domain::colour::ColourError;
use crate::evaluate::EvaluateError;

/// Error of a colour or picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PreviewError {
    /// The directions or the index do not fit the material.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The spectra do not allow a colour.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The request does not fit the material.
    #[error(transparent)]
    Question(#[from] QuestionError),
    /// The picture could not be encoded; this is a bug.
    #[error("the picture could not be encoded: {0}")]
    Encode(String),
}

/// Requests for colours or pictures that do not fit the material.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum QuestionError {
    /// An outgoing direction was given without an incoming one.
    #[error("wo was given without wi, but this {quantity} has an incoming axis")]
    LoneWo {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// No index was given, but one entry has to be chosen.
    #[error("no index was given, expected {expected}: one for each index axis")]
    MissingIndex {
        /// Number of index axes.
        expected: usize,
    },
    /// The index is out of range.
    #[error("index {found:?}, expected entries of the index axes of lengths {shape:?}")]
    Index {
        /// The index given.
        found: Vec<usize>,
        /// Lengths of the index axes.
        shape: Vec<usize>,
    },
    /// RGB data were requested under a light other than that of sRGB.
    #[error("these are RGB data, which have no spectrum to see under {illuminant}, expected D65")]
    RgbIlluminant {
        /// Name of the requested light.
        illuminant: String,
    },
    /// The number of entries exceeds the limit of one answer.
    #[error("{found} entries, expected at most {most} colours in one answer: give an index")]
    TooMany {
        /// Number of entries.
        found: usize,
        /// The limit.
        most: usize,
    },
    /// The picture size is out of range.
    #[error("size {found}, expected {low} to {high} pixels")]
    Size {
        /// Requested pixels along a side.
        found: usize,
        /// Smallest allowed number.
        low: usize,
        /// Largest allowed number.
        high: usize,
    },
    /// The material has no incoming directions and cannot be lit.
    #[error("no incoming axis, expected one to light a ball")]
    NoIncoming,
}

/// Returns the error as a refusal of the request.
pub(super) fn unfit<T>(error: QuestionError) -> Result<T, PreviewError> {
    Err(PreviewError::Question(error))
}
