//! Reasons why a table of the paper could not be made.

use crate::domain::Cancelled;

/// Reason why a table could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PaperError {
    /// The table number does not exist.
    #[error("table {found}, expected 1 to 7")]
    NoSuchTable {
        /// Requested number.
        found: u8,
    },
    /// The bundled data cannot be read as expected.
    #[error("bundled data: {0}")]
    Data(String),
    /// The caller cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
