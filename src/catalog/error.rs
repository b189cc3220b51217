//! Failures of the catalog.

use super::result_code::is_full;
use crate::store::{Digest, NotADigest};
use crate::trust::{NotATenant, Tenant};
use sqlx::migrate::MigrateError;
use std::path::PathBuf;

/// Failure of the catalog (the database of measurements, materials, jobs and stored files).
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// The catalog's database returned an error.
    #[error("the database of the catalog failed: {0}")]
    Sql(#[from] sqlx::Error),
    /// A schema migration failed, or a migration applied earlier differs from the one in this program.
    #[error("a migration of the database schema failed: {0}")]
    Migrate(#[from] MigrateError),
    /// The database has a schema that this program cannot work with.
    #[error("the schema of the database does not suit this program: {0}")]
    Schema(String),
    /// The database server does not answer, or refuses the user.
    #[error(
        "cannot connect to the database {place}: {reason}; check its address, that it runs, and that it lets this user in"
    )]
    Unreachable {
        /// URL of the database that cannot be reached, without its password.
        place: String,
        /// Error reported when connecting to the database.
        reason: String,
    },
    /// The SQLite file cannot be used as the catalog (the database of the service).
    #[error("the file {} cannot be used as the catalog: {reason}", file.display())]
    Unusable {
        /// Path of the SQLite file that cannot be used.
        file: PathBuf,
        /// Fault of the SQLite file, and advice on what to do about it.
        reason: String,
    },
    /// The disk of the catalog is full, or has no more space than is kept for deletions.
    #[error(
        "the disk of the catalog is full: remove other files from it, or make it larger; `wavelume gc --now` removes what \
         nothing refers to"
    )]
    NoSpace,
    /// Another program has held the write lock of the SQLite database for longer than a write should take.
    #[error("the database of the catalog is locked: another program has long been writing to it; end that program")]
    Locked,
    /// A row of the catalog has content that this version of the program never writes.
    #[error("the row {id} of the catalog's table {table} is invalid: {reason}")]
    Row {
        /// Name of the table that holds the invalid row.
        table: &'static str,
        /// Id of the row in the catalog whose content this version of the program never writes.
        id: String,
        /// Description of what is wrong with the content of the invalid row in the catalog's table.
        reason: String,
    },
}

impl CatalogError {
    /// Returns true if the disk of the catalog is full.
    pub(crate) fn is_full(&self) -> bool {
        match self {
            Self::NoSpace => true,
            Self::Sql(error) => is_full(error),
            _ => false,
        }
    }
}

/// Returns true if a statement violated a foreign key: a row that it refers to is missing, or another row refers to the
/// row that it deletes.
pub(super) fn breaks_reference(error: &sqlx::Error) -> bool {
    error.as_database_error().is_some_and(sqlx::error::DatabaseError::is_foreign_key_violation)
}

/// Parses the text of a digest in row `id` of a table of the catalog. The error names the table and the row.
pub(super) fn digest(table: &'static str, id: &str, text: &str) -> Result<Digest, CatalogError> {
    text.parse().map_err(|error: NotADigest| CatalogError::Row { table, id: id.to_owned(), reason: error.to_string() })
}

/// Parses the text of a tenant's id in row `id` of a table of the catalog. The error names the table and the row.
pub(super) fn tenant(table: &'static str, id: &str, text: &str) -> Result<Tenant, CatalogError> {
    text.parse().map_err(|error: NotATenant| CatalogError::Row { table, id: id.to_owned(), reason: error.to_string() })
}
