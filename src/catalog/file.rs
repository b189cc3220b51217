//! File of the catalog: its URL, a check before it is opened for good, and advice on its faults.

use super::dialect::SWITCH;
use super::error::CatalogError;
use super::lock::PAUSE;
use super::result_code::{BUSY, CANNOT_OPEN, CORRUPT, FULL, NOT_A_DATABASE, READ_ONLY, is_full, primary};
use crate::store::give;
use sqlx::any::install_default_drivers;
use sqlx::{AnyConnection, Connection, Executor};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tokio::time::sleep;

/// Returns the path of the write-ahead log of the SQLite file `file`.
pub(super) fn log_of(file: &Path) -> PathBuf {
    beside(file, "-wal")
}

/// Returns the path of the index of that log, which processes share.
pub(super) fn index_of(file: &Path) -> PathBuf {
    beside(file, "-shm")
}

fn beside(file: &Path, suffix: &str) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// Returns the SQLite URL of `file`, with the path percent-encoded. A missing file is an error when it is opened.
pub(super) fn url(file: &Path) -> Result<String, CatalogError> {
    encoded(file).map(|path| format!("sqlite:{path}?mode=rw"))
}

/// Returns the SQLite URL for reading `file` alone, with the path percent-encoded.
pub(super) fn url_to_read(file: &Path) -> Result<String, CatalogError> {
    encoded(file).map(|path| format!("sqlite:{path}?mode=ro"))
}

/// Makes an empty SQLite file if it is missing, and lets readers not wait for the writer. Made by root in the directory
/// of another user, it belongs to that user, and so do the files that SQLite makes beside it.
pub(super) async fn make(file: &Path) -> Result<(), CatalogError> {
    let made = match File::create_new(file) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(()),
        made => made.and_then(|made| give(&made, directory_of(file))),
    };
    made.map_err(|error| CatalogError::Unusable {
        file: file.to_owned(),
        reason: format!("the file cannot be opened; let this user write to its directory ({error})"),
    })?;
    check(file, &url(file)?, &SWITCH).await
}

/// Returns the directory of a SQLite file, in which SQLite makes further files.
pub(super) fn directory_of(file: &Path) -> &Path {
    file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn encoded(file: &Path) -> Result<String, CatalogError> {
    let path = file
        .to_str()
        .ok_or_else(|| CatalogError::Sql(sqlx::Error::Configuration("the path of the catalog is not UTF-8".into())))?;
    let encoded = path
        .bytes()
        .map(|b| match b {
            b'/' | b'.' | b'-' | b'_' => char::from(b).to_string(),
            b if b.is_ascii_alphanumeric() => char::from(b).to_string(),
            b => format!("%{b:02X}"),
        })
        .collect();
    Ok(encoded)
}

/// Opens and reads the SQLite file without a connection pool, whose retries would hide a fault for 30 s. The error
/// names the fault and what to do about it.
/// `statements` set up the connection.
pub(super) async fn check(file: &Path, url: &str, statements: &'static [&'static str]) -> Result<(), CatalogError> {
    let start = Instant::now();
    // Another process that starts now may hold the lock briefly, and SQLite does not wait for it here.
    while let Err(error) = look(url, statements).await {
        if primary(&error) != Some(BUSY) || is_hopeless(&error, start) {
            return Err(unusable(file, error));
        }
        sleep(PAUSE).await;
    }
    Ok(())
}

/// Reads a SQLite file once, on a connection that `statements` set up.
pub(super) async fn look(url: &str, statements: &'static [&'static str]) -> Result<(), sqlx::Error> {
    install_default_drivers();
    let mut connection = AnyConnection::connect(url).await?;
    for statement in statements {
        connection.execute(*statement).await?;
    }
    connection.execute("SELECT COUNT(*) FROM sqlite_master").await?;
    connection.close().await
}

/// Seconds that a starting program waits for the write lock of the SQLite file before it gives up. Raising it tolerates
/// longer writers.
const START: Duration = Duration::from_secs(10);

/// Returns true if it is useless to open the SQLite file again: the file is at fault, or other programs have kept it
/// locked for too long since `start`.
pub(super) fn is_hopeless(error: &sqlx::Error, start: Instant) -> bool {
    match primary(error) {
        Some(BUSY) => start.elapsed() >= START,
        Some(READ_ONLY | CORRUPT | FULL | CANNOT_OPEN | NOT_A_DATABASE) => true,
        _ => is_full(error),
    }
}

/// Builds the error for a file that cannot be used as the catalog's database, with advice on what to do.
pub(super) fn unusable(file: &Path, error: sqlx::Error) -> CatalogError {
    let advice = match primary(&error) {
        _ if is_full(&error) => {
            "its disk is full; remove other files from the disk or make it larger, then start again and run `wavelume gc`"
        }
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
    use crate::catalog::{Catalog, CatalogError, Database};

    #[tokio::test]
    async fn a_file_that_is_no_database_is_named_with_what_to_do() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("catalog.sqlite");
        std::fs::write(&file, "notes of last week\n".repeat(300)).unwrap();
        let error = Catalog::migrate(&Database::File(file.clone()), false).await.unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, CatalogError::Unusable { .. }), "{text}");
        assert!(text.contains("catalog.sqlite") && text.contains("restore it from a backup"), "{text}");
        let inside = file.join("below a file");
        let text = Catalog::migrate(&Database::File(inside), false).await.unwrap_err().to_string();
        assert!(text.contains("below a file") && text.contains("cannot be opened"), "{text}");
    }
}
