//! Readiness of the catalog: the file checked before it is opened, and a probe that never waits for a writer.

use super::{Catalog, CatalogError, PRAGMAS};
use sqlx::{AnyConnection, Connection, Executor};
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::time::{sleep, timeout};

/// Age in seconds up to which the last write of this process proves that the catalog can be written. Raising it lets
/// [`Catalog::ping`] overlook a lock for as long.
const FRESH: Duration = Duration::from_secs(5);

/// Seconds that [`Catalog::ping`] gives the database to answer a read, and the write lock to be free once. Raising it
/// delays the answer *not ready*.
const PATIENCE: Duration = Duration::from_secs(1);

/// Pause between two looks at the write lock.
const PAUSE: Duration = Duration::from_millis(20);

/// Time of the last write, and how to connect for a look at the lock.
#[derive(Debug)]
pub(super) struct Readiness {
    url: String,
    written: Mutex<Option<Instant>>,
}

impl Readiness {
    pub(super) fn new(url: String) -> Self {
        Self { url, written: Mutex::default() }
    }

    /// Notes that this process has just got the write lock.
    pub(super) fn wrote(&self) {
        *self.written.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    fn is_fresh(&self) -> bool {
        let written = *self.written.lock().unwrap_or_else(PoisonError::into_inner);
        written.is_some_and(|written| written.elapsed() < FRESH)
    }
}

impl Catalog {
    /// Checks within about two seconds that the database answers and can be written.
    ///
    /// Never waits for a writer and delays none: a write of this process within the last 5 s is proof enough. Without
    /// one, a connection of its own asks for the write lock without waiting and gives it back at once.
    pub async fn ping(&self) -> Result<(), CatalogError> {
        let read = sqlx::query("SELECT 1 FROM pins LIMIT 1").fetch_optional(&self.pool);
        timeout(PATIENCE, read).await.map_err(|_| CatalogError::Locked)??;
        let looking = async {
            while !self.readiness.is_fresh() {
                if is_free(&self.readiness.url).await? {
                    self.readiness.wrote();
                } else {
                    sleep(PAUSE).await;
                }
            }
            Ok(())
        };
        timeout(PATIENCE, looking).await.unwrap_or(Err(CatalogError::Locked))
    }
}

/// Whether the write lock can be had at this moment.
async fn is_free(url: &str) -> Result<bool, CatalogError> {
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

/// Opens and reads the file without a pool, whose retries would hide the fault for 30 s. The fault, with what to do about
/// it, is the error.
pub(super) async fn check(file: &Path, url: &str) -> Result<(), CatalogError> {
    let start = Instant::now();
    // Another process that starts now may hold the lock for a moment, where SQLite does not wait.
    while let Err(error) = look(url).await {
        if primary(&error) != Some(BUSY) || is_hopeless(&error, start) {
            return Err(unusable(file, error));
        }
        sleep(PAUSE).await;
    }
    Ok(())
}

async fn look(url: &str) -> Result<(), sqlx::Error> {
    let mut connection = AnyConnection::connect(url).await?;
    for pragma in PRAGMAS {
        connection.execute(pragma).await?;
    }
    connection.execute("SELECT COUNT(*) FROM sqlite_master").await?;
    connection.close().await
}

const BUSY: u32 = 5;
const READ_ONLY: u32 = 8;
const CORRUPT: u32 = 11;
const CANNOT_OPEN: u32 = 14;
const NOT_A_DATABASE: u32 = 26;

/// SQLite's primary result code: the low byte of the extended one.
fn primary(error: &sqlx::Error) -> Option<u32> {
    let code = error.as_database_error()?.code()?;
    code.parse::<u32>().ok().map(|code| code & 0xff)
}

/// Seconds of waiting for the lock after which a start gives up.
const START: Duration = Duration::from_secs(10);

/// Whether another try cannot help: the file is at fault, or its lock has not been free since `start`.
pub(super) fn is_hopeless(error: &sqlx::Error, start: Instant) -> bool {
    match primary(error) {
        Some(BUSY) => start.elapsed() >= START,
        Some(READ_ONLY | CORRUPT | CANNOT_OPEN | NOT_A_DATABASE) => true,
        _ => false,
    }
}

/// The error of a file that cannot serve, with what to do about it.
pub(super) fn unusable(file: &Path, error: sqlx::Error) -> CatalogError {
    let advice = match primary(&error) {
        Some(NOT_A_DATABASE) => {
            "found other bytes, expected a SQLite database; restore it from a backup, or move it away to begin empty"
        }
        Some(CORRUPT) => "the database is damaged; restore it from a backup",
        Some(BUSY) => "another program has locked the database; end that program and start again",
        Some(CANNOT_OPEN) => {
            "the file cannot be opened; check that it is a file and that this user may read and write it"
        }
        Some(READ_ONLY) => "the file or its directory is read-only; let this user write both",
        _ => return error.into(),
    };
    CatalogError::Unusable { file: file.to_owned(), reason: format!("{advice} ({error})") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;

    #[tokio::test]
    async fn a_file_that_is_no_database_is_named_with_what_to_do() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("catalog.sqlite");
        std::fs::write(&file, "notes of last week\n".repeat(300)).unwrap();
        let error = Catalog::open(&file).await.unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, CatalogError::Unusable { .. }), "{text}");
        assert!(text.contains("catalog.sqlite") && text.contains("restore it from a backup"), "{text}");
        let inside = file.join("below a file");
        let text = Catalog::open(&inside).await.unwrap_err().to_string();
        assert!(text.contains("below a file") && text.contains("cannot be opened"), "{text}");
    }

    #[tokio::test]
    async fn a_ping_does_not_wait_for_a_writer_of_this_process() {
        let (catalog, _directory) = testing::catalog().await;
        let write = catalog.write().await.unwrap();
        catalog.ping().await.unwrap();
        drop(write);
        catalog.ping().await.unwrap();
    }

    #[tokio::test]
    async fn a_catalog_that_another_program_has_locked_is_not_ready() {
        let (catalog, directory) = testing::catalog().await;
        let url = super::super::url(&directory.path().join("catalog.sqlite")).unwrap();
        let mut other = AnyConnection::connect(&url).await.unwrap();
        other.execute("BEGIN IMMEDIATE").await.unwrap();
        // As after a while without writes.
        *catalog.readiness.written.lock().unwrap() = None;
        assert!(matches!(catalog.ping().await, Err(CatalogError::Locked)));
        other.execute("ROLLBACK").await.unwrap();
        catalog.ping().await.unwrap();
        assert!(catalog.readiness.is_fresh(), "the lock was seen free");
    }
}
