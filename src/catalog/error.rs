//! Reasons why the catalog did not answer.

use sqlx::migrate::MigrateError;
use std::path::PathBuf;

/// Why the catalog did not answer.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// The database.
    #[error("database: {0}")]
    Sql(#[from] sqlx::Error),
    /// The schema is not this version's.
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
    /// A row holds what this version never writes.
    #[error("{table} row {id}: {reason}")]
    Row {
        /// The table.
        table: &'static str,
        /// The row.
        id: String,
        /// What is wrong with it.
        reason: String,
    },
}
