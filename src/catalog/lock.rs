//! Write lock of the database: when this process last held it, and whether it is free now.

use super::error::CatalogError;
use super::result_code::{BUSY, primary};
use sqlx::{AnyConnection, Connection, Executor};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Age in seconds up to which the last write of this process proves that the catalog can be written. Raising it lets
/// [`Catalog::ping`](super::Catalog::ping) overlook a lock for as long.
const FRESH: Duration = Duration::from_secs(5);

/// Pause between two checks of the write lock.
pub(super) const PAUSE: Duration = Duration::from_millis(20);

/// Time of the last write, and the URL for a check of the lock.
#[derive(Debug)]
pub(super) struct Readiness {
    pub(super) url: String,
    pub(super) written: Mutex<Option<Instant>>,
}

impl Readiness {
    pub(super) fn new(url: String) -> Self {
        Self { url, written: Mutex::default() }
    }

    /// Notes that this process has just got the write lock.
    pub(super) fn wrote(&self) {
        *self.written.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    pub(super) fn is_fresh(&self) -> bool {
        let written = *self.written.lock().unwrap_or_else(PoisonError::into_inner);
        written.is_some_and(|written| written.elapsed() < FRESH)
    }
}

/// Returns true if the write lock is free at this moment.
pub(super) async fn is_free(url: &str) -> Result<bool, CatalogError> {
    let mut connection = AnyConnection::connect(url).await?;
    connection.execute("PRAGMA busy_timeout = 0").await?;
    let begun = connection.execute("BEGIN IMMEDIATE").await;
    let free = match begun {
        Ok(_) => {
            connection.execute("ROLLBACK").await?;
            true
        }
        Err(error) if primary(&error) == Some(BUSY) => false,
        Err(error) => return Err(error.into()),
    };
    connection.close().await?;
    Ok(free)
}
