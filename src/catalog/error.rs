//! Failures of the catalog.

use sqlx::migrate::MigrateError;
use std::path::PathBuf;

/// Failure of the catalog to answer.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// The database failed.
    #[error("database: {0}")]
    Sql(#[from] sqlx::Error),
    /// The schema does not fit this version.
    #[error("database schema: {0}")]
    Migrate(#[from] MigrateError),
    /// The file cannot serve as the catalog.
    #[error("catalog {}: {reason}", file.display())]
    Unusable {
        /// The file.
        file: PathBuf,
        /// The fault, and what to do about it.
        reason: String,
    },
    /// Another program has held the write lock for longer than a writer should.
    #[error("the catalog is locked: another program has been writing to it for a while; end that program")]
    Locked,
    /// A row has content that this version never writes.
    #[error("{table} row {id}: {reason}")]
    Row {
        /// The table.
        table: &'static str,
        /// The row.
        id: String,
        /// Description of the fault.
        reason: String,
    },
}
