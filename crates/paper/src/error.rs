//! Reasons why a table of the paper could not be made.

use crate::domain::Cancelled;

/// Why a table could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PaperError {
    /// No such table.
    #[error("table {found}, expected 1 to 7")]
    NoSuchTable {
        /// The number asked for.
        found: u8,
    },
    /// The bundled data do not read as they should.
    #[error("bundled data: {0}")]
    Data(String),
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
