//! Facts about the database that `wavelume doctor` judges, or the reason why they could not be read.

use crate::catalog::{Catalog, CatalogError, Database, Examined};
use std::time::Duration;
use tokio::time::timeout;

/// Longest time that `wavelume doctor` waits for all facts about a database or a file system. Raising it tolerates
/// slower ones, but delays the report when there is no answer.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);

/// Outcome of examining the database for `wavelume doctor`.
pub(super) enum Asked {
    /// The SQLite file of the database does not exist yet.
    Missing,
    /// The database did not answer all questions within [`PATIENCE`].
    Silent,
    /// The database cannot be used.
    Failed(CatalogError),
    /// The database was examined, with these results.
    Answered(Box<Examined>),
}

impl Asked {
    /// Connects to the database at `place` and reads what `wavelume doctor` judges: its version, settings, clock and
    /// schema. `is_missing` states that `place` is a SQLite file that does not exist; the file is not created.
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
