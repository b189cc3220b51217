//! Places that belong together: the data directory, the catalog's database and the store.

use crate::catalog::Database;
use crate::store::Place;
use std::path::{Path, PathBuf};

/// Places of one service. Without a database or a store of its own, the data directory holds them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Site {
    /// Data directory: always for staging files, and for the catalog and the objects where nothing else is named.
    pub data: PathBuf,
    /// Database of the catalog; `None` is `catalog.sqlite` in the data directory.
    pub database: Option<Database>,
    /// Store of the objects; `None` is the data directory.
    pub store: Option<Place>,
    /// Id of the catalog from which the store is to be taken over; see [`ArchiveError::Belongs`](super::ArchiveError).
    pub adopt: Option<String>,
}

impl Site {
    /// Everything in one data directory.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        Self { data: data.into(), database: None, store: None, adopt: None }
    }

    /// Returns the database, for a data directory at `root`.
    pub(super) fn database(&self, root: &Path) -> Database {
        self.database.clone().unwrap_or_else(|| Database::File(root.join("catalog.sqlite")))
    }

    /// Returns the store, for a data directory at `root`.
    pub(super) fn store(&self, root: &Path) -> Place {
        self.store.clone().unwrap_or_else(|| Place::Directory(root.to_owned()))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::catalog::{Catalog, testing};

    /// New sites for tests: all in one directory, and PostgreSQL with an S3 bucket.
    pub(crate) async fn sites() -> Vec<(Site, tempfile::TempDir)> {
        let (alone, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let database = testing::server().await;
        Catalog::migrate(&database, false).await.unwrap();
        let shared = Site { database: Some(database), store: Some(bucket()), ..Site::new(scratch.path()) };
        vec![(Site::new(alone.path()), alone), (shared, scratch)]
    }

    /// A new prefix in the bucket of the tests.
    fn bucket() -> Place {
        let bucket = std::env::var("WAVELUME_TEST_STORE").expect(
            "WAVELUME_TEST_STORE is not set: run the tests as `tests/servers cargo test …`, which starts an S3 server",
        );
        format!("{bucket}/{}", uuid::Uuid::now_v7().simple()).parse().unwrap()
    }
}
