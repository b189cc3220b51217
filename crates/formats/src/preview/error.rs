//! Reasons why there is no colour or no picture.

use crate::domain::Quantity;
use crate::domain::colour::ColourError;
use crate::evaluate::EvaluateError;

/// Kinds of reasons why there is no colour or no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PreviewError {
    /// The place asked for does not fit the material.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The spectra have no colour.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// The question does not fit the material.
    #[error(transparent)]
    Question(#[from] QuestionError),
    /// The picture could not be written: a bug.
    #[error("the picture could not be encoded: {0}")]
    Encode(String),
}

/// Questions for colours or pictures that do not fit the material.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum QuestionError {
    /// An outgoing direction without the incoming one.
    #[error("wo was given without wi, but this {quantity} has an incoming axis")]
    LoneWo {
        /// Quantity of the material.
        quantity: Quantity,
    },
    /// No index where one entry has to be chosen.
    #[error("no index was given, expected {expected}: one for each index axis")]
    MissingIndex {
        /// Number of index axes.
        expected: usize,
    },
    /// An index of no entry.
    #[error("index {found:?}, expected entries of the index axes of lengths {shape:?}")]
    Index {
        /// The index given.
        found: Vec<usize>,
        /// Lengths of the index axes.
        shape: Vec<usize>,
    },
    /// RGB data under a light other than that of sRGB.
    #[error("these are RGB data, which have no spectrum to see under {illuminant}, expected D65")]
    RgbIlluminant {
        /// Name of the light asked for.
        illuminant: String,
    },
    /// More entries than are answered at once.
    #[error("{found} entries, expected at most {most} colours in one answer: give an index")]
    TooMany {
        /// Number of entries.
        found: usize,
        /// The limit.
        most: usize,
    },
    /// A picture too small or too large.
    #[error("size {found}, expected {low} to {high} pixels")]
    Size {
        /// Pixels of a side.
        found: usize,
        /// The least number.
        low: usize,
        /// The largest number.
        high: usize,
    },
    /// A material without incoming directions, which cannot be lit.
    #[error("no incoming axis, expected one to light a ball")]
    NoIncoming,
}

/// Refuses a question.
pub(super) fn unfit<T>(error: QuestionError) -> Result<T, PreviewError> {
    Err(PreviewError::Question(error))
}
