//! A data directory opened: its blobs and its catalog, swept and checked together.

use super::config::Limits;
use crate::catalog::{Catalog, CatalogError};
use crate::store::{LocalStore, Staging, Store, StoreError, StoreExt};
use futures::TryStreamExt;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// An opened data directory; cheap to clone.
#[derive(Clone, Debug)]
pub struct Archive {
    pub(crate) data: PathBuf,
    pub(crate) store: Arc<dyn Store>,
    pub(crate) staging: Staging,
    pub(crate) catalog: Catalog,
}

/// Failure to open or to maintain a data directory.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The directory cannot be used.
    #[error("data directory {}: {source}", directory.display())]
    Directory {
        /// The directory.
        directory: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The store of blobs failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The catalog failed.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
    /// The pools of threads could not be built.
    #[error("threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Report of a sweep; the answer of `wavelume gc`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SweepReport {
    /// Removed blobs, which nothing named.
    pub removed_blobs: u64,
    /// Bytes of the removed blobs.
    pub removed_bytes: u64,
    /// Removed staging files, which no process was writing.
    pub removed_staging: u64,
    /// Blobs kept, because a row or a pin names them.
    pub kept_blobs: u64,
}

/// Report of a check; the answer of `wavelume fsck`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FsckReport {
    /// Blobs whose digest was computed.
    pub checked_blobs: u64,
    /// Bytes of the checked blobs.
    pub checked_bytes: u64,
    /// Faults found; empty if there are none.
    pub faults: Vec<Fault>,
}

/// One fault.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Fault {
    /// The stored bytes do not match their digest.
    Corrupt {
        /// The digest.
        digest: String,
    },
    /// A row names bytes that are missing.
    Missing {
        /// The digest.
        digest: String,
        /// Row that names it: `measurement b3-…`, `material b3-…` or `job …`.
        named_by: String,
    },
}

/// Time that an idempotency key is kept at least. Raising it lets clients repeat a request for longer.
const KEYS: Duration = Duration::from_hours(24);

impl Archive {
    /// Opens the directory, makes what is missing and brings the catalog's schema up to date.
    pub async fn open(data: &Path) -> Result<Self, ArchiveError> {
        Ok(Self::prepare(data).await?.0)
    }

    /// Brings the schema up to date without starting anything. Returns the number of migrations applied.
    pub async fn migrate(data: &Path) -> Result<usize, ArchiveError> {
        let (archive, applied) = Self::prepare(data).await?;
        archive.catalog.close().await;
        Ok(applied)
    }

    async fn prepare(data: &Path) -> Result<(Self, usize), ArchiveError> {
        let wrong = |source| ArchiveError::Directory { directory: data.to_owned(), source };
        std::fs::create_dir_all(data).map_err(wrong)?;
        // SQLite takes its path as text and the process may change its directory.
        let root = data.canonicalize().map_err(wrong)?;
        let (store, staging) = match LocalStore::new(&root) {
            Ok(opened) => opened,
            Err(StoreError::Io(source)) => return Err(wrong(source)),
            Err(other) => return Err(other.into()),
        };
        let (catalog, applied) = Catalog::migrate(&root.join("catalog.sqlite")).await?;
        Ok((Self { data: root, store: Arc::new(store), staging, catalog }, applied))
    }

    /// Removes blobs that neither a row nor a live pin names, and stale staging files.
    pub async fn sweep(&self) -> Result<SweepReport, ArchiveError> {
        self.sweep_stale(Limits::default().stale, &|| false).await
    }

    /// Sweeps like [`Self::sweep`], but ends early once `stopped` returns true.
    pub(crate) async fn sweep_stale(
        &self,
        stale: Duration,
        stopped: &(dyn Fn() -> bool + Sync),
    ) -> Result<SweepReport, ArchiveError> {
        let staging = self.staging.clone();
        let removed_staging =
            tokio::task::spawn_blocking(move || staging.sweep(stale)).await.map_err(|e| StoreError::Io(e.into()))??;
        // The list of named blobs saves a query for each of them; the others are decided under the write lock.
        let named = self.catalog.named().await?;
        let mut report = SweepReport { removed_staging, ..SweepReport::default() };
        let mut blobs = self.store.list();
        while let Some((digest, bytes)) = blobs.try_next().await? {
            if stopped() {
                return Ok(report);
            }
            if named.contains_key(&digest) {
                report.kept_blobs += 1;
                continue;
            }
            let Some(retired) = self.catalog.unless_named(digest, || self.store.retire(digest)).await? else {
                report.kept_blobs += 1;
                continue;
            };
            // Another sweep may have been faster.
            if let Some(retired) = retired? {
                self.store.discard(retired).await?;
                report.removed_blobs += 1;
                report.removed_bytes += bytes;
            }
        }
        self.catalog.forget_keys(KEYS).await?;
        Ok(report)
    }

    /// Recomputes every digest, and checks that every blob named by a row exists.
    pub async fn check(&self) -> Result<FsckReport, ArchiveError> {
        let mut report = FsckReport::default();
        let mut blobs = self.store.list();
        while let Some((digest, _)) = blobs.try_next().await? {
            match Arc::clone(&self.store).verify(digest).await {
                Ok(bytes) => {
                    report.checked_blobs += 1;
                    report.checked_bytes += bytes;
                }
                Err(StoreError::Corrupt { .. } | StoreError::Range { .. }) => {
                    report.checked_blobs += 1;
                    report.faults.push(Fault::Corrupt { digest: digest.to_string() });
                }
                // Swept meanwhile.
                Err(StoreError::NotFound(_)) => {}
                Err(other) => return Err(other.into()),
            }
        }
        for (digest, named_by) in self.catalog.named().await? {
            if self.store.size(digest).await?.is_none() {
                report.faults.push(Fault::Missing { digest: digest.to_string(), named_by });
            }
        }
        Ok(report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{Digest, Retired, Staged};
    use bytes::Bytes;
    use futures::future::BoxFuture;
    use futures::stream::BoxStream;
    use std::ops::Range;
    use tokio::sync::Semaphore;

    async fn publish(archive: &Archive, bytes: &[u8]) -> Digest {
        let staged = archive.staging.stage(bytes).unwrap();
        archive.store.publish(&staged).await.unwrap();
        staged.digest()
    }

    #[tokio::test]
    async fn a_sweep_removes_what_nothing_names() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        let (lost, pinned) = (publish(&archive, b"lost").await, publish(&archive, b"pinned").await);
        archive.catalog.pin(pinned, "upload", Duration::from_mins(1)).await.unwrap();
        let report = archive.sweep().await.unwrap();
        assert_eq!((report.removed_blobs, report.removed_bytes, report.kept_blobs), (1, 4, 1));
        assert_eq!(archive.store.size(lost).await.unwrap(), None);
        assert_eq!(archive.store.size(pinned).await.unwrap(), Some(6));
    }

    /// A store that holds a removal back until the test permits it.
    #[derive(Debug)]
    struct Slow {
        store: Arc<dyn Store>,
        begun: Semaphore,
        may_end: Semaphore,
    }

    impl Store for Slow {
        fn publish<'a>(&'a self, staged: &'a Staged) -> BoxFuture<'a, Result<(), StoreError>> {
            self.store.publish(staged)
        }

        fn size(&self, digest: Digest) -> BoxFuture<'_, Result<Option<u64>, StoreError>> {
            self.store.size(digest)
        }

        fn read(&self, digest: Digest, range: Range<u64>) -> BoxFuture<'_, Result<Bytes, StoreError>> {
            self.store.read(digest, range)
        }

        fn list(&self) -> BoxStream<'_, Result<(Digest, u64), StoreError>> {
            self.store.list()
        }

        fn retire(&self, digest: Digest) -> Result<Option<Retired>, StoreError> {
            self.store.retire(digest)
        }

        fn discard(&self, retired: Retired) -> BoxFuture<'_, Result<(), StoreError>> {
            Box::pin(async move {
                self.begun.add_permits(1);
                self.may_end.acquire().await.unwrap().forget();
                self.store.discard(retired).await
            })
        }
    }

    #[tokio::test]
    async fn writers_and_publishers_go_on_while_a_removal_takes_long() {
        let data = tempfile::tempdir().unwrap();
        let plain = Archive::open(data.path()).await.unwrap();
        let digest = publish(&plain, b"deleted").await;
        let (begun, may_end) = (Semaphore::new(0), Semaphore::new(0));
        let slow = Arc::new(Slow { store: Arc::clone(&plain.store), begun, may_end });
        let archive = Archive { store: Arc::clone(&slow) as Arc<dyn Store>, ..plain.clone() };
        let sweep = tokio::spawn(async move { archive.sweep().await.unwrap() });
        slow.begun.acquire().await.unwrap().forget();

        // While the bytes are being removed they are uploaded again, through this process and another one.
        let another = Archive::open(data.path()).await.unwrap();
        for (archive, holder) in [(&plain, "a"), (&another, "b")] {
            let pin = archive.catalog.pin(digest, holder, Duration::from_mins(1));
            tokio::time::timeout(Duration::from_secs(10), pin).await.expect("a writer waits for a removal").unwrap();
            archive.catalog.ping().await.unwrap();
        }
        assert_eq!(plain.store.size(digest).await.unwrap(), None);
        publish(&plain, b"deleted").await;
        slow.may_end.add_permits(1);
        assert_eq!(sweep.await.unwrap().removed_blobs, 1);
        assert_eq!(plain.store.get(digest).await.unwrap(), b"deleted".as_slice(), "a late removal hits nothing new");
    }

    #[tokio::test]
    async fn what_a_sweep_was_killed_over_goes_with_the_next() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        let digest = publish(&archive, b"deleted").await;
        drop(archive.store.retire(digest).unwrap().unwrap());
        let swept = archive.sweep_stale(Duration::ZERO, &|| false).await.unwrap();
        assert_eq!((swept.removed_staging, swept.removed_blobs), (1, 0));
        assert_eq!(std::fs::read_dir(data.path().join("staging")).unwrap().count(), 0);
    }

    #[tokio::test]
    async fn a_check_finds_corrupt_bytes() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        let digest = publish(&archive, b"the truth").await.to_string();
        std::fs::write(data.path().join("blobs").join(&digest[3..5]).join(&digest), b"a lie").unwrap();
        let report = archive.check().await.unwrap();
        assert_eq!((report.checked_blobs, report.faults), (1, vec![Fault::Corrupt { digest }]));
    }

    #[tokio::test]
    async fn a_directory_that_is_a_file_is_refused_by_name() {
        let data = tempfile::NamedTempFile::new().unwrap();
        let error = Archive::open(data.path()).await.unwrap_err();
        assert!(matches!(error, ArchiveError::Directory { .. }));
        assert!(error.to_string().contains(data.path().to_str().unwrap()));
    }
}
