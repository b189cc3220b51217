//! Places that belong together: the data directory, the catalog's database and the store.

use crate::catalog::Database;
use crate::store::Place;
use std::path::{Path, PathBuf};

/// Places in which a service keeps its data. The data directory holds the database and the stored files, unless other
/// places are given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Site {
    /// Data directory. It always holds temporary files, and also the database and the stored files if no other place is
    /// given.
    pub data: PathBuf,
    /// Place of the catalog's database; `None` means `catalog.sqlite` in the data directory.
    pub database: Option<Database>,
    /// Place of the store, which holds the files; `None` means the data directory.
    pub store: Option<Place>,
    /// Id of the catalog whose store this service takes over; see [`ArchiveError::Belongs`](super::ArchiveError).
    pub adopt: Option<String>,
}

impl Site {
    /// Keeps the database, the stored files and the temporary files in one data directory.
    pub fn new(data: impl Into<PathBuf>) -> Self {
        Self { data: data.into(), database: None, store: None, adopt: None }
    }

    /// Returns the place of the database, given the path `root` of the data directory.
    pub(super) fn database(&self, root: &Path) -> Database {
        self.database.clone().unwrap_or_else(|| Database::File(root.join("catalog.sqlite")))
    }

    /// Returns the place of the store, given the path `root` of the data directory.
    pub(super) fn store(&self, root: &Path) -> Place {
        self.store.clone().unwrap_or_else(|| Place::Directory(root.to_owned()))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::catalog::{Catalog, testing};
    use crate::store::contract;

    /// Returns the places of two new services for tests: one with a single directory, one with PostgreSQL and an S3
    /// bucket.
    pub(crate) async fn sites() -> Vec<(Site, tempfile::TempDir)> {
        let (alone, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let database = testing::server().await;
        Catalog::migrate(&database, false).await.unwrap();
        let shared = Site { database: Some(database), store: Some(contract::bucket()), ..Site::new(scratch.path()) };
        vec![(Site::new(alone.path()), alone), (shared, scratch)]
    }
}
