//! Failures of the catalog.

use sqlx::migrate::MigrateError;
use std::path::PathBuf;

/// Failure of the catalog to answer.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// The database failed.
    #[error("database: {0}")]
    Sql(#[from] sqlx::Error),
    /// A migration of the schema failed, or an applied one differs from this program's.
    #[error("database schema: {0}")]
    Migrate(#[from] MigrateError),
    /// The database has a schema that this program cannot work with.
    #[error("database schema: {0}")]
    Schema(String),
    /// The database server does not answer, or refuses the user.
    #[error("database {place}: {reason}; check its address, and that it runs and lets this user in")]
    Unreachable {
        /// URL of the database, without its password.
        place: String,
        /// Error of the connection.
        reason: String,
    },
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
        /// Name of the table.
        table: &'static str,
        /// Id of the row.
        id: String,
        /// Description of the fault.
        reason: String,
    },
}

/// Returns true if a statement failed because the row that it refers to is missing, or because another row refers to
/// the row that it deletes.
pub(super) fn breaks_reference(error: &sqlx::Error) -> bool {
    error.as_database_error().is_some_and(sqlx::error::DatabaseError::is_foreign_key_violation)
}
