//! Write lock of the database: when this process last held it, and whether it is free now.

use super::error::CatalogError;
use super::result_code::{BUSY, primary};
use sqlx::{AnyConnection, Connection, Executor};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Age in seconds up to which the last write of this process proves that the database can be written. Raising it lets
/// the readiness check ([`Catalog::ping`](super::Catalog::ping)) overlook a lock for as long.
const FRESH: Duration = Duration::from_secs(5);

/// Pause between two checks of the database's write lock.
pub(super) const PAUSE: Duration = Duration::from_millis(20);

/// Time of this process's last write to the database, and the database URL with which the write lock is checked.
#[derive(Debug)]
pub(super) struct Readiness {
    pub(super) url: String,
    pub(super) written: Mutex<Option<Instant>>,
    /// True if the last write that ended has failed on the disk.
    is_broken: AtomicBool,
}

impl Readiness {
    pub(super) fn new(url: String) -> Self {
        Self { url, written: Mutex::default(), is_broken: AtomicBool::new(false) }
    }

    /// Records that this process has just obtained the write lock of the database.
    pub(super) fn began(&self) {
        *self.written.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    /// Records that a write of this process has just succeeded.
    pub(super) fn committed(&self) {
        self.is_broken.store(false, Ordering::Relaxed);
        self.began();
    }

    /// Records that a write of this process has just failed, for another reason than the lock of another one.
    pub(super) fn failed(&self) {
        self.is_broken.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_fresh(&self) -> bool {
        let written = *self.written.lock().unwrap_or_else(PoisonError::into_inner);
        !self.is_broken.load(Ordering::Relaxed) && written.is_some_and(|written| written.elapsed() < FRESH)
    }
}

/// Returns true if the write lock of the SQLite database is free at this moment.
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
