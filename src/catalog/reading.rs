//! A SQLite catalog that this user may read and not write: read where it is, or from a copy.

use super::dialect::PRAGMAS;
use super::error::CatalogError;
use super::file::{directory_of, index_of, log_of, look, url, url_to_read};
use rustix::fs::{Access, access};
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

/// State of a catalog that is opened for reading alone; it keeps the copy of the file, if one is read instead.
#[derive(Debug)]
pub(super) struct Reading {
    _copy: Option<TempDir>,
}

/// Number of times that a file is copied before the program gives up because it is written to. Raising it lets the
/// command wait longer until nobody writes.
const TRIES: u32 = 50;

/// Pause before a file is copied again, and age of a change that the time of a file shows for certain. Raising it makes
/// commands slower, and lets them wait longer until nobody writes.
const PAUSE: Duration = Duration::from_millis(100);

/// Returns true if this user may write a SQLite file, and make files beside it, as SQLite does.
pub(super) fn may_write(file: &Path) -> bool {
    let beside = Access::WRITE_OK | Access::EXEC_OK;
    access(file, Access::WRITE_OK).is_ok() && access(directory_of(file), beside).is_ok()
}

/// Returns the URL at which a SQLite file can be read without making or changing a file beside it. Where another
/// process has the database open, or has left its log and its index of the log behind, SQLite reads all three as they
/// are. Otherwise it would make them, and a copy is read instead.
pub(super) async fn readable(file: &Path) -> Result<(String, Reading), CatalogError> {
    let unusable = |reason: String| CatalogError::Unusable { file: file.to_owned(), reason };
    access(file, Access::READ_OK).map_err(|error| unusable(format!("this user may not read it ({error})")))?;
    if log_of(file).exists() && index_of(file).exists() {
        let url = url_to_read(file)?;
        if look(&url, &PRAGMAS).await.is_ok() {
            return Ok((url, Reading { _copy: None }));
        }
    }
    let from = file.to_owned();
    let copied = tokio::task::spawn_blocking(move || copied(&from)).await.map_err(io::Error::other).flatten();
    let copy = copied.map_err(|error| {
        let to = std::env::temp_dir();
        unusable(format!("this user may not write it, and its copy in {} cannot be read: {error}", to.display()))
    })?;
    Ok((url(&copy.path().join(NAME))?, Reading { _copy: Some(copy) }))
}

/// Name of the copy in its directory.
const NAME: &str = "catalog.sqlite";

/// Copies a SQLite file and its log to a new temporary directory, at a moment at which nobody writes them. Blocks the
/// thread.
fn copied(file: &Path) -> io::Result<TempDir> {
    let copy = tempfile::Builder::new().prefix("wavelume-").tempdir()?;
    let to = copy.path().join(NAME);
    let to_log = log_of(&to);
    for _ in 0..TRIES {
        let before = states(file);
        copy_bytes(file, &to)?;
        match copy_bytes(&log_of(file), &to_log) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => drop(fs::remove_file(&to_log)),
            copied => copied?,
        }
        if before.is_some() && states(file) == before {
            return Ok(copy);
        }
        sleep(PAUSE);
    }
    Err(io::Error::other("another program is writing to it"))
}

/// Copies the content of a file, and not its permissions: the copy must be writable.
fn copy_bytes(from: &Path, to: &Path) -> io::Result<()> {
    let mut from = File::open(from)?;
    io::copy(&mut from, &mut File::create(to)?).map(drop)
}

/// Returns what tells two states of a SQLite file and its log apart: their numbers, sizes and times. `None` if one was
/// changed so recently that its time may not tell.
fn states(file: &Path) -> Option<Vec<(u64, u64, i64, i64)>> {
    let mut states = Vec::new();
    for path in [file.to_owned(), log_of(file)] {
        let Ok(found) = fs::metadata(path) else { continue };
        let age = SystemTime::now().duration_since(found.modified().ok()?).ok()?;
        if age < PAUSE {
            return None;
        }
        states.push((found.ino(), found.len(), found.mtime(), found.mtime_nsec()));
    }
    Some(states)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Catalog, Database, testing};

    #[tokio::test]
    async fn a_catalog_is_read_with_its_log_without_a_file_made_beside_it() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("catalog.sqlite");
        let (catalog, _) = Catalog::migrate(&Database::File(file.clone()), false).await.unwrap();
        testing::add(&catalog, &testing::measurement("lamp")).await;
        let read = async |file: &Path| {
            let (url, _reading) = readable(file).await.unwrap();
            let is_copy = !url.ends_with("mode=ro");
            let read = Catalog::pooled(&Database::File(file.to_owned()), url, 2, &PRAGMAS).await.unwrap();
            let found = testing::count(&read, "measurements").await;
            read.close().await;
            (found, is_copy)
        };
        assert_eq!(read(&file).await, (1, false), "while it is open elsewhere");
        // As a killed process leaves it, without the index of the log.
        let killed = tempfile::tempdir().unwrap();
        for name in ["catalog.sqlite", "catalog.sqlite-wal"] {
            fs::copy(directory.path().join(name), killed.path().join(name)).unwrap();
        }
        assert_eq!(read(&killed.path().join("catalog.sqlite")).await, (1, true));
        assert_eq!(fs::read_dir(killed.path()).unwrap().count(), 2);
        catalog.close().await;
        assert_eq!(read(&file).await, (1, true));
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
