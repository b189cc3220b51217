//! Answer of the database to all questions, or the reason why there is none.

use crate::catalog::{Catalog, CatalogError, Database, Examined};
use std::time::Duration;
use tokio::time::timeout;

/// Longest time for which the database, or a file system, may take to answer all questions about it. Raising it
/// tolerates slower ones, but delays the report when there is no answer.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);

/// Answer of the database to all questions.
pub(super) enum Asked {
    /// There is no SQLite file yet.
    Missing,
    /// The database did not answer in time.
    Silent,
    /// The database cannot be used.
    Failed(CatalogError),
    /// The database has answered.
    Answered(Box<Examined>),
}

impl Asked {
    /// Asks the database at `place` all questions. A SQLite file that is missing is not created.
    pub(super) async fn of(place: &Database, is_missing: bool) -> Self {
        if is_missing {
            return Self::Missing;
        }
        match timeout(PATIENCE, Catalog::examine(place)).await {
            Err(_) => Self::Silent,
            Ok(Err(error)) => Self::Failed(error),
            Ok(Ok(examined)) => Self::Answered(Box::new(examined)),
        }
    }
}
