//! Bytes published and pinned until a row names them, and published again if the pin expires first.

use super::archive::Archive;
use crate::catalog::CatalogError;
use crate::store::{Digest, Staged, StoreError};
use std::io;
use std::time::Duration;

/// Minutes between publishing a blob and naming it after which a sweep may remove it. Raising it keeps what a killed
/// process published for longer; a process that stood still for longer publishes again.
const PIN: Duration = Duration::from_mins(10);

/// Times that the same bytes are published before their upload or attempt fails. Raising it only helps a process that
/// keeps standing still for longer than [`PIN`] each time.
const TIMES: u32 = 3;

/// Bytes in the store, pinned under `holder`. Their staged file stays open until a row names them.
#[derive(Debug)]
pub(crate) struct Published {
    staged: Staged,
    holder: String,
    times: u32,
}

/// Failure to publish.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PublishError {
    /// The store of blobs failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The pin could not be written.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
}

impl Published {
    /// Pins and publishes staged bytes.
    pub(super) async fn new(archive: &Archive, staged: Staged) -> Result<Self, PublishError> {
        let holder = uuid::Uuid::now_v7().simple().to_string();
        Self { staged, holder, times: 0 }.publish(archive).await
    }

    /// Digest of the bytes.
    pub(super) fn digest(&self) -> Digest {
        self.staged.digest()
    }

    /// Holder of the pin; the same after [`Self::again`].
    pub(super) fn holder(&self) -> &str {
        &self.holder
    }

    /// Publishes the bytes again: the catalog refused to name them because their pin had run out, and a sweep may have
    /// removed them.
    pub(super) async fn again(self, archive: &Archive) -> Result<Self, PublishError> {
        let digest = self.digest();
        if self.times >= TIMES {
            let message = format!("{digest} was published {TIMES} times and its pin ran out before it was named");
            return Err(StoreError::Io(io::Error::new(io::ErrorKind::TimedOut, message)).into());
        }
        tracing::warn!(%digest, "the pin ran out before the bytes were named; they are published again");
        let (staging, staged) = (archive.staging.clone(), self.staged);
        let staged = tokio::task::spawn_blocking(move || staging.stage_again(&staged)).await;
        let staged = staged.map_err(|error| StoreError::Io(error.into()))??;
        Self { staged, ..self }.publish(archive).await
    }

    async fn publish(mut self, archive: &Archive) -> Result<Self, PublishError> {
        self.times += 1;
        archive.catalog.pin(self.staged.digest(), &self.holder, PIN).await?;
        archive.store.publish(&self.staged).await?;
        Ok(self)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::catalog::{Added, Deleted, NewMeasurement, testing};
    use crate::jobs::{Engine, IngestError, Options, Upload, WorkConfig};
    use crate::store::{Retired, Store, StoreExt};
    use bytes::Bytes;
    use futures::future::BoxFuture;
    use futures::stream::BoxStream;
    use std::ops::Range;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A store whose first `times` publications outlast their pin, while another process sweeps.
    #[derive(Debug)]
    pub(crate) struct Late {
        archive: Archive,
        times: Arc<AtomicU32>,
    }

    impl Late {
        /// Builds an engine over a new directory with such a store. Also returns the number of delays that are still to
        /// come.
        pub(crate) async fn engine(times: u32) -> (Arc<Engine>, Arc<AtomicU32>, tempfile::TempDir) {
            let data = tempfile::tempdir().unwrap();
            let mut engine = Engine::open(&WorkConfig::new(data.path())).await.unwrap();
            let (archive, times) = (engine.archive.clone(), Arc::new(AtomicU32::new(times)));
            let late = Self { archive, times: Arc::clone(&times) };
            Arc::get_mut(&mut engine).unwrap().archive.store = Arc::new(late);
            (engine, times, data)
        }
    }

    impl Store for Late {
        fn publish<'a>(&'a self, staged: &'a Staged) -> BoxFuture<'a, Result<(), StoreError>> {
            Box::pin(async move {
                self.archive.store.publish(staged).await?;
                let late = self.times.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |times| times.checked_sub(1));
                if late.is_ok() {
                    testing::expire_pins(&self.archive.catalog).await;
                    let swept = self.archive.sweep().await.unwrap();
                    assert_eq!(swept.removed_blobs, 1);
                }
                Ok(())
            })
        }

        fn size(&self, digest: Digest) -> BoxFuture<'_, Result<Option<u64>, StoreError>> {
            self.archive.store.size(digest)
        }

        fn read(&self, digest: Digest, range: Range<u64>) -> BoxFuture<'_, Result<Bytes, StoreError>> {
            self.archive.store.read(digest, range)
        }

        fn list(&self) -> BoxStream<'_, Result<(Digest, u64), StoreError>> {
            self.archive.store.list()
        }

        fn retire(&self, digest: Digest) -> Result<Option<Retired>, StoreError> {
            self.archive.store.retire(digest)
        }

        fn discard(&self, retired: Retired) -> BoxFuture<'_, Result<(), StoreError>> {
            self.archive.store.discard(retired)
        }
    }

    pub(crate) const SPECTRUM: &[u8] = b"wavelength,a\n400,1\n410,2\n420,3\n430,2\n440,1\n";

    pub(crate) fn upload() -> Upload {
        let options = Options { quantity: Some(crate::domain::Quantity::Spectrum.into()), ..Options::default() };
        Upload { file_name: None, name: None, options }
    }

    #[tokio::test]
    async fn an_upload_whose_pin_ran_out_is_published_again_before_it_is_accepted() {
        let (engine, _, _data) = Late::engine(2).await;
        let staged = engine.archive.staging.stage(SPECTRUM).unwrap();
        let (row, new) = engine.ingest(staged, upload()).await.unwrap();
        assert!(new);
        assert_eq!(engine.archive.store.get(row.content).await.unwrap(), SPECTRUM);
        assert_eq!(engine.archive.check().await.unwrap().faults, []);
    }

    #[tokio::test]
    async fn an_upload_that_is_always_late_is_refused_and_named_nowhere() {
        let (engine, _, _data) = Late::engine(99).await;
        let staged = engine.archive.staging.stage(SPECTRUM).unwrap();
        let error = engine.ingest(staged, upload()).await.unwrap_err();
        assert!(matches!(error, IngestError::Store(StoreError::Io(_))), "{error}");
        assert!(error.to_string().contains("published 3 times"), "{error}");
        assert!(engine.archive.catalog.named().await.unwrap().is_empty());
    }

    /// Publishes, names, reads and deletes one of three contents that others use too, over and over.
    async fn publisher(archive: Archive, number: u64) -> (u64, u64) {
        let (mut named, mut late) = (0, 0);
        for round in 0..15 {
            let content = format!("content {}", (number + round) % 3);
            let staged = archive.staging.stage(content.as_bytes()).unwrap();
            let id = Digest::of(format!("{number} {round}").as_bytes());
            let new = NewMeasurement { id, ..testing::measurement(&content) };
            let mut published = Published::new(&archive, staged).await.unwrap();
            if round % 4 == 1 {
                testing::expire_pins(&archive.catalog).await;
            }
            let row = loop {
                match archive.catalog.add_measurement(&new, published.holder()).await.unwrap() {
                    Added::Row(row, true) => break Some(row),
                    Added::Unpinned => late += 1,
                    other => panic!("{other:?}"),
                }
                match published.again(&archive).await {
                    Ok(again) => published = again,
                    Err(_) => break None,
                }
            };
            let Some(row) = row else { continue };
            named += 1;
            let found = archive.store.get(row.content).await;
            assert_eq!(found.expect("a row names what a sweep took"), content.as_bytes());
            assert_eq!(archive.catalog.delete_measurement(row.id).await.unwrap(), Deleted::Done);
        }
        (named, late)
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 4)]
    async fn publishers_of_the_same_bytes_and_sweeps_of_two_processes_lose_nothing() {
        let data = tempfile::tempdir().unwrap();
        let archives = [Archive::open(data.path()).await.unwrap(), Archive::open(data.path()).await.unwrap()];
        let done = tokio_util::sync::CancellationToken::new();
        let sweeps = archives.clone().map(|archive| {
            let done = done.clone();
            tokio::spawn(async move {
                let mut removed = 0;
                while !done.is_cancelled() {
                    removed += archive.sweep().await.unwrap().removed_blobs;
                }
                removed
            })
        });
        let publishers = (0..4).map(|number| tokio::spawn(publisher(archives[number as usize % 2].clone(), number)));
        let counts = futures::future::try_join_all(publishers).await.unwrap();
        done.cancel();
        let removed = futures::future::try_join_all(sweeps).await.unwrap().iter().sum::<u64>();
        let (named, late) = counts.iter().fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
        let left = archives[0].sweep().await.unwrap();
        let removed = removed + left.removed_blobs;
        assert!(named > 20 && late > 0 && removed > 0, "{named} named, {late} late, {removed} removed");
        assert_eq!((left.kept_blobs, archives[0].check().await.unwrap().faults), (0, vec![]));
        assert_eq!(std::fs::read_dir(data.path().join("staging")).unwrap().count(), 0);
    }
}
