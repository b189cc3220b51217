//! Reasons why a measurement is not compressed.

use crate::domain::Cancelled;

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
