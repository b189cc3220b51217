//! Reasons why there is no colour or no picture.

use crate::domain::colour::ColourError;
use crate::evaluate::EvaluateError;

/// Why there is no colour or no picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PreviewError {
    /// The place asked for does not fit the material.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The spectra have no colour.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// What was asked for does not fit the material.
    #[error("{0}")]
    Unfit(String),
    /// The picture could not be written: a bug.
    #[error("the picture could not be encoded: {0}")]
    Encode(String),
}

/// Refuses what was asked for, with this message.
pub(super) fn unfit<T>(message: impl Into<String>) -> Result<T, PreviewError> {
    Err(PreviewError::Unfit(message.into()))
}
