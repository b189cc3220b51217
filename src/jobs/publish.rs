//! Bytes written to the store under an announcement until a row of the catalog refers to them, and written again if the
//! announcement expires first.

use super::archive::Archive;
use super::blobs::BlobError;
use crate::catalog::{Claim, Partial};
use crate::store::{Digest, Object, Staged, StoreError};
use std::io;
use std::time::Duration;
use tokio::time::{MissedTickBehavior, interval_at};

/// Time after the announcement of a new object within which a row of the catalog must refer to it; afterwards the
/// object is listed for deletion. Raising it keeps what a killed process has written for longer. A process that paused
/// for longer stores its bytes again.
const INTENT: Duration = Duration::from_hours(1);

/// Interval at which a process extends its announcement that an object is being written. Raising it risks that the
/// announcement expires during the write.
const PROLONG: Duration = Duration::from_mins(10);

/// Number of times that the bytes of an upload or of a job's result are stored before the upload or the job attempt
/// fails. They are stored again if the process paused for longer than [`INTENT`] before it wrote a row that refers to
/// them. Raising it tolerates more such pauses.
const TIMES: u32 = 3;

/// Bytes in the store, with the claim that lets a row of the catalog refer to them. Their staged (temporary) file stays
/// open until a row does.
#[derive(Debug)]
pub(crate) struct Published {
    staged: Staged,
    claim: Claim,
    times: u32,
}

impl Published {
    /// Writes a staged (temporary) file to the store, unless the store already holds its bytes.
    pub(super) async fn new(archive: &Archive, staged: Staged) -> Result<Self, BlobError> {
        let claim = publish(archive, &staged).await?;
        Ok(Self { staged, claim, times: 1 })
    }

    /// BLAKE3 digest of the stored file's content.
    pub(super) fn digest(&self) -> Digest {
        self.staged.digest()
    }

    /// Returns the claim that lets a row of the catalog refer to the stored bytes.
    pub(super) fn claim(&self) -> &Claim {
        &self.claim
    }

    /// Hands newly stored bytes over to the next sweep, which removes them: the catalog has refused the row that would
    /// refer to them.
    pub(super) async fn withdraw(self, archive: &Archive) {
        if let Claim::Written(object, _) = &self.claim
            && let Err(error) = archive.catalog.withdraw(object).await
        {
            tracing::warn!(%object, %error, "refused bytes stay in the store until their announcement expires");
        }
    }

    /// Stores the bytes of the object again, because the catalog refused a row that refers to it: the object may have
    /// been removed.
    pub(super) async fn again(self, archive: &Archive) -> Result<Self, BlobError> {
        let digest = self.digest();
        if self.times >= TIMES {
            let message =
                format!("the bytes {digest} were stored {TIMES} times, and each claim ran out before a row named them");
            return Err(StoreError::Io(io::Error::new(io::ErrorKind::TimedOut, message)).into());
        }
        tracing::warn!(%digest, "the claim on stored bytes ran out before a row named them; they are stored again");
        let (staging, staged) = (archive.staging.clone(), self.staged);
        let staged = tokio::task::spawn_blocking(move || staging.stage_again(&staged)).await;
        let staged = staged.map_err(|error| StoreError::Io(error.into()))??;
        let claim = publish(archive, &staged).await?;
        Ok(Self { staged, claim, times: self.times + 1 })
    }
}

async fn publish(archive: &Archive, staged: &Staged) -> Result<Claim, BlobError> {
    let (digest, bytes) = (staged.digest(), staged.bytes());
    writable(archive).await?;
    if let Some(known) = archive.catalog.blob(digest).await?
        && !known.suspect
        && archive.holds(&known, bytes).await?
    {
        return Ok(Claim::Known(digest));
    }
    let object = Object::fresh(archive.catalog.tenant(), digest);
    archive.catalog.intend(&object, bytes, INTENT).await?;
    write(archive, staged, &object).await?;
    Ok(Claim::Written(object, bytes))
}

/// Writes a staged (temporary) file to the store as a part of an upload, and returns the new object. The upload must
/// count the part within the time of the announcement; otherwise a sweep removes it.
pub(super) async fn publish_part(archive: &Archive, staged: &Staged, upload: &Partial) -> Result<Object, BlobError> {
    writable(archive).await?;
    let object = Object::part(&upload.id, upload.parts, staged.digest());
    archive.catalog.intend_part(&object, staged.bytes(), INTENT).await?;
    write(archive, staged, &object).await?;
    Ok(object)
}

/// Checks that there is space for new bytes, and that the store still belongs to the catalog.
async fn writable(archive: &Archive) -> Result<(), BlobError> {
    archive.has_room().await?;
    Ok(archive.belonged().await?)
}

/// Writes an announced object to the store, and extends the announcement meanwhile.
async fn write(archive: &Archive, staged: &Staged, object: &Object) -> Result<(), BlobError> {
    let writing = archive.store.publish(staged, object);
    tokio::pin!(writing);
    let mut ticks = interval_at(tokio::time::Instant::now() + PROLONG, PROLONG);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            written = &mut writing => return Ok(written?),
            // An announcement that has run out is noticed when the row is written.
            _ = ticks.tick() => drop(archive.catalog.prolong(object, INTENT).await?),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::catalog::{Added, Deleted, NewMeasurement, testing};
    use crate::jobs::{Engine, IngestError, Options, Upload, WorkConfig};
    use crate::store::Store;
    use crate::trust::Tenant;
    use bytes::Bytes;
    use futures::future::BoxFuture;
    use futures::stream::{BoxStream, StreamExt};
    use std::ops::Range;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Stores bytes and a measurement that refers to them, as an upload does. Returns the digest of the bytes.
    pub(crate) async fn stored(archive: &Archive, bytes: &[u8]) -> Digest {
        let published = Published::new(archive, archive.staging.stage(bytes).unwrap()).await.unwrap();
        let new = NewMeasurement { id: Digest::of(bytes), content: Digest::of(bytes), ..testing::measurement("bytes") };
        let added = archive.catalog.add_measurement(&new, published.claim()).await.unwrap();
        assert!(matches!(added, Added::Row(..)), "{added:?}");
        new.id
    }

    /// A store for tests. Each of the first `times` objects is removed as soon as it is written, as if its announcement
    /// had expired and another process had removed unused objects.
    #[derive(Debug)]
    pub(crate) struct Late {
        archive: Archive,
        times: Arc<AtomicU32>,
    }

    impl Late {
        /// Opens the service's job engine for a test, on a new data directory. Each of the first `times` files is
        /// removed from its store as soon as it is stored. Also returns the counter of the removals still to come.
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
        fn publish<'a>(&'a self, staged: &'a Staged, object: &'a Object) -> BoxFuture<'a, Result<(), StoreError>> {
            Box::pin(async move {
                self.archive.store.publish(staged, object).await?;
                let late = self.times.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |times| times.checked_sub(1));
                if late.is_ok() {
                    testing::expire_intents(&self.archive.catalog).await;
                    self.archive.catalog.doom_expired(9, Duration::ZERO).await.unwrap();
                    assert_eq!(self.archive.sweep_now().await.unwrap().removed_blobs, 1);
                }
                Ok(())
            })
        }

        fn size<'a>(&'a self, object: &'a Object) -> BoxFuture<'a, Result<Option<u64>, StoreError>> {
            self.archive.store.size(object)
        }

        fn read<'a>(&'a self, object: &'a Object, range: Range<u64>) -> BoxFuture<'a, Result<Bytes, StoreError>> {
            self.archive.store.read(object, range)
        }

        fn list<'a>(&'a self, folder: &'a str) -> BoxStream<'a, Result<(Object, u64), StoreError>> {
            self.archive.store.list(folder)
        }

        fn tenants(&self) -> BoxFuture<'_, Result<Vec<Tenant>, StoreError>> {
            self.archive.store.tenants()
        }

        fn remove<'a>(&'a self, objects: &'a [Object]) -> BoxFuture<'a, Vec<Result<(), StoreError>>> {
            self.archive.store.remove(objects)
        }

        fn note<'a>(&'a self, name: &'a str) -> BoxFuture<'a, Result<Option<String>, StoreError>> {
            self.archive.store.note(name)
        }

        fn set_note<'a>(&'a self, name: &'a str, text: String) -> BoxFuture<'a, Result<(), StoreError>> {
            self.archive.store.set_note(name, text)
        }
    }

    pub(crate) const SPECTRUM: &[u8] = b"wavelength,a\n400,1\n410,2\n420,3\n430,2\n440,1\n";

    pub(crate) fn upload() -> Upload {
        let quantity = Some(crate::domain::Quantity::Spectrum.into());
        let options = Options::from(crate::formats::Interpretation { quantity, ..Default::default() });
        Upload { file_name: None, name: None, options }
    }

    #[tokio::test]
    async fn an_upload_whose_claim_ran_out_is_published_again_before_it_is_accepted() {
        let (engine, _, _data) = Late::engine(2).await;
        let staged = engine.archive.staging.stage(SPECTRUM).unwrap();
        let (row, new) = engine.ingest(staged, upload()).await.unwrap();
        assert!(new);
        assert_eq!(engine.archive.get(row.content).await.unwrap(), SPECTRUM);
        assert_eq!(engine.archive.check().await.unwrap().faults, []);
    }

    #[tokio::test]
    async fn an_upload_that_is_always_late_is_refused_and_named_nowhere() {
        let (engine, _, _data) = Late::engine(99).await;
        let staged = engine.archive.staging.stage(SPECTRUM).unwrap();
        let error = engine.ingest(staged, upload()).await.unwrap_err();
        assert!(matches!(error, IngestError::Store(StoreError::Io(_))), "{error}");
        assert!(error.to_string().contains("stored 3 times"), "{error}");
        assert_eq!(engine.archive.catalog.namer(Digest::of(SPECTRUM)).await.unwrap(), None);
    }

    #[tokio::test]
    async fn bytes_that_are_stored_are_not_written_again_unless_they_are_damaged() {
        let data = tempfile::tempdir().unwrap();
        let archive = Archive::open(data.path()).await.unwrap();
        let digest = stored(&archive, b"the truth").await;
        let publish = async || {
            let staged = archive.staging.stage(b"the truth").unwrap();
            Published::new(&archive, staged).await.unwrap().claim().clone()
        };
        assert_eq!(publish().await, Claim::Known(digest));
        let object = archive.catalog.blob(digest).await.unwrap().unwrap().object;
        let file = data.path().join(object.to_string());
        // Cut short, which an upload sees; changed in place, which a reader sees; missing.
        for damage in [Some("the"), Some("the lie!!"), None] {
            let object = archive.catalog.blob(digest).await.unwrap().unwrap().object;
            let file = data.path().join(object.to_string());
            match damage {
                Some(text) => std::fs::write(&file, text).unwrap(),
                None => std::fs::remove_file(&file).unwrap(),
            }
            assert!(archive.get(digest).await.is_err(), "{damage:?}");
            stored(&archive, b"the truth").await;
            assert!(matches!(publish().await, Claim::Known(_)));
            assert_eq!(archive.get(digest).await.unwrap(), b"the truth".as_slice(), "{damage:?}");
        }
        assert!(!file.exists() || file.metadata().unwrap().len() == 3, "an object is never written again");
        archive.sweep_now().await.unwrap();
        assert_eq!(archive.check().await.unwrap().faults, []);
    }

    /// Stores a small file, adds, reads and deletes a measurement that refers to it, and repeats this 15 times. Test
    /// tasks that run at the same time store files with the same three contents.
    async fn publisher(archive: Archive, number: u64) -> (u64, u64) {
        let (mut named, mut late) = (0, 0);
        for round in 0..15 {
            let content = format!("content {}", (number + round) % 3);
            let staged = archive.staging.stage(content.as_bytes()).unwrap();
            let id = Digest::of(format!("{number} {round}").as_bytes());
            let new = NewMeasurement { id, ..testing::measurement(&content) };
            let mut published = Published::new(&archive, staged).await.unwrap();
            if round % 4 == 1 {
                testing::expire_intents(&archive.catalog).await;
            }
            let row = loop {
                match archive.catalog.add_measurement(&new, published.claim()).await.unwrap() {
                    Added::Row(row, true) => break Some(row),
                    Added::Unpublished => late += 1,
                    other => panic!("{other:?}"),
                }
                match published.again(&archive).await {
                    Ok(again) => published = again,
                    Err(_) => break None,
                }
            };
            let Some(row) = row else { continue };
            named += 1;
            let found = archive.get(row.content).await;
            assert_eq!(found.expect("a row names what a sweep took"), content.as_bytes());
            assert_eq!(archive.catalog.delete_measurement(row.id).await.unwrap(), Deleted::Done);
        }
        (named, late)
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 4)]
    async fn publishers_of_the_same_bytes_and_sweeps_of_two_processes_lose_nothing() {
        for (site, _guard) in crate::jobs::site::tests::sites().await {
            let first = Archive::serve(&site).await.unwrap();
            let archives = [first, Archive::serve(&site).await.unwrap()];
            let done = tokio_util::sync::CancellationToken::new();
            let sweeps = archives.clone().map(|archive| {
                let done = done.clone();
                tokio::spawn(async move {
                    let mut removed = 0;
                    while !done.is_cancelled() {
                        removed += archive.sweep_now().await.unwrap().removed_blobs;
                    }
                    removed
                })
            });
            let publishers =
                (0..4).map(|number| tokio::spawn(publisher(archives[number as usize % 2].clone(), number)));
            let counts = futures::future::try_join_all(publishers).await.unwrap();
            done.cancel();
            let removed = futures::future::try_join_all(sweeps).await.unwrap().iter().sum::<u64>();
            let (named, late) = counts.iter().fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
            testing::expire_intents(&archives[0].catalog).await;
            archives[0].catalog.doom_expired(999, Duration::ZERO).await.unwrap();
            let left = archives[0].sweep_now().await.unwrap();
            let removed = removed + left.removed_blobs;
            assert!(named > 20 && late > 0 && removed > 0, "{named} named, {late} late, {removed} removed");
            let faults = archives[0].check().await.unwrap().faults;
            assert_eq!((left.kept_blobs, left.waiting_blobs, faults), (0, 0, vec![]));
            let mut objects = Vec::new();
            for first in 0..=u8::MAX {
                for folder in Object::folders(archives[0].catalog.tenant(), first) {
                    objects.extend(archives[0].store.list(&folder).collect::<Vec<_>>().await);
                }
            }
            assert!(objects.is_empty(), "{objects:?}");
        }
    }
}
