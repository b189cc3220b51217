//! Why a material cannot answer.

use crate::compress::DecodeError;

/// Why a material cannot answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluateError {
    /// The bytes are no material.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The query does not fit the material: a direction or index too few or too many, outside the domain.
    #[error("{0}")]
    Unfit(String),
}

/// A query that does not fit.
pub(super) fn unfit<T>(message: impl Into<String>) -> Result<T, EvaluateError> {
    Err(EvaluateError::Unfit(message.into()))
}
