//! Reasons why a material is not exported.

use crate::evaluate::EvaluateError;
use crate::formats::{FormatError, FormatErrorKind};
use crate::preview::PreviewError;

/// Why there is no file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// The format does not hold what the material is.
    #[error("{0}")]
    Unfit(String),
    /// An option is out of its range, or one that the format does not know, or one is missing.
    #[error("{0}")]
    Setting(String),
    /// The file would be larger than is allowed.
    #[error("{0}")]
    OverLimit(String),
    /// The material has values that the format cannot hold.
    #[error("{0}")]
    Values(String),
    /// The material did not answer.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The material has no colours.
    #[error(transparent)]
    Colour(#[from] PreviewError),
}

impl From<FormatError> for ExportError {
    fn from(error: FormatError) -> Self {
        match error.kind {
            FormatErrorKind::OverLimit => Self::OverLimit(error.to_string()),
            _ => Self::Values(error.to_string()),
        }
    }
}

/// Refuses an option, with this message.
pub(super) fn setting<T>(message: impl Into<String>) -> Result<T, ExportError> {
    Err(ExportError::Setting(message.into()))
}
