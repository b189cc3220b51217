//! Reasons why a table of the paper could not be made.

use crate::domain::Cancelled;

/// Reason why a table of the paper by Claustres et al. (2006) could not be reproduced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PaperError {
    /// The paper by Claustres et al. (2006) has no reproducible table with the requested number.
    #[error("found table number {found} of the paper by Claustres et al. (2006), expected 1 to 7")]
    NoSuchTable {
        /// Number of the table of the paper by Claustres et al. (2006) that the caller asked for.
        found: u8,
    },
    /// The bundled measurement data cannot be read as expected.
    #[error("the bundled measurement data cannot be read: {0}")]
    Data(String),
    /// The caller cancelled the reproduction of a table of the paper by Claustres et al. (2006).
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
