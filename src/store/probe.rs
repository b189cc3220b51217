//! Probe of a store: a few objects of its own are written, read, listed and removed again, and nothing else is changed.
//!
//! The probe lies beside the folder of the stored objects, under a name that is made anew each time, so it never meets
//! one of them.

use super::error::StoreError;
use super::interface::Store;
use super::objects::{Objects, Publication};
use super::place::Place;
use super::s3;
use bytes::Bytes;
use futures::{StreamExt, TryStreamExt};
use object_store::local::LocalFileSystem;
use object_store::path::Path;
use object_store::{ObjectStore, ObjectStoreExt, PutPayload};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// Longest time that one step in the test of a store may take. Raising it tolerates slower stores, but delays the
/// report when the store does not answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Size in bytes of the test object that is sent in one request.
const SMALL: usize = 1000;

/// Size in bytes of the first part of the test object that is sent in parts; no server takes a smaller one.
const PART: usize = 5 << 20;

/// Size in bytes of the second and last part of the test object that is sent in parts.
const REST: usize = 1000;

/// Connection to a store, to test that objects can be written, read, listed and removed there.
pub(crate) struct Probe {
    store: Arc<dyn ObjectStore>,
    folder: String,
}

/// Outcome of one step in the test of a store: a description of what was done, or of the fault.
pub(crate) struct Step {
    /// Name of the step in the test of a store, such as `put`.
    pub name: &'static str,
    /// Description of what the step has done with the store, or of its fault.
    pub outcome: Result<String, String>,
}

impl Probe {
    /// Connects to a store to test it; sends no request yet. A store in a directory must exist. Blocks the thread.
    pub(crate) fn open(place: &Place) -> Result<Self, StoreError> {
        let store: Arc<dyn ObjectStore> = match place {
            Place::Directory(root) => {
                Arc::new(LocalFileSystem::new_with_prefix(root)?.with_fsync(true).with_automatic_cleanup(true))
            }
            Place::S3 { bucket, prefix } => s3::client(bucket, prefix, PATIENCE / 2, PATIENCE / 2)?.0,
        };
        Ok(Self { store, folder: format!("wavelume-probe-{}", uuid::Uuid::now_v7().simple()) })
    }

    /// Returns a small named text that the store keeps beside its objects, as [`Store::note`] does.
    pub(crate) async fn note(&self, name: &str) -> Result<Option<String>, String> {
        let objects = Objects::new(Arc::clone(&self.store), Publication::Upload);
        within(async { Ok(objects.note(name).await?) }).await
    }

    /// Tests the store: writes, reads, lists and removes test objects. Leaves out the other steps if the first object
    /// cannot be written.
    pub(crate) async fn run(&self) -> Vec<Step> {
        let mut steps = Vec::new();
        let mut add = |name, outcome: Result<String, String>| {
            steps.push(Step { name, outcome });
        };
        let small = self.path("object");
        let put = self.timed(format!("{SMALL} bytes"), self.put(&small)).await;
        let is_written = put.is_ok();
        add("put", put);
        if is_written {
            add("get", self.timed(format!("{SMALL} bytes"), self.get(&small)).await);
            add("range", self.timed("bytes 100 to 199".to_owned(), self.range(&small)).await);
            add("list", self.timed("1 object".to_owned(), self.listed(SMALL)).await);
            add("multipart", self.timed(format!("{} bytes in 2 parts", PART + REST), self.parts()).await);
        }
        // Also after a failure: the answer may have been lost, and the object is there.
        let removed = self.timed("the test objects were removed".to_owned(), self.remove()).await;
        if is_written {
            let hint = |reason| format!("{reason}; remove the folder {}/ from the store by hand", self.folder);
            add("delete", removed.map_err(hint));
        }
        steps
    }

    fn path(&self, name: &str) -> Path {
        Path::from_iter([self.folder.as_str(), name])
    }

    /// Runs one step of the test within its time limit; returns `shown` with the time that the step took, or its fault.
    async fn timed(&self, shown: String, step: impl Future<Output = Result<(), Failed>>) -> Result<String, String> {
        let start = Instant::now();
        within(step).await?;
        Ok(format!("{shown}, {} ms", start.elapsed().as_millis()))
    }

    async fn put(&self, path: &Path) -> Result<(), Failed> {
        self.store.put(path, PutPayload::from(pattern(SMALL))).await?;
        Ok(())
    }

    async fn get(&self, path: &Path) -> Result<(), Failed> {
        same(&self.store.get(path).await?.bytes().await?, &pattern(SMALL))
    }

    async fn range(&self, path: &Path) -> Result<(), Failed> {
        same(&self.store.get_range(path, 100..200).await?, &pattern(SMALL)[100..200])
    }

    /// Checks that the store lists exactly one object, of `size` bytes, in the folder of the test objects.
    async fn listed(&self, size: usize) -> Result<(), Failed> {
        let folder = Path::from(self.folder.as_str());
        let found: Vec<_> = self.store.list(Some(&folder)).map_ok(|meta| meta.size).try_collect().await?;
        if found == [size as u64] {
            return Ok(());
        }
        Err(Failed(format!("the store lists test objects of {found:?} bytes, expected one of {size} bytes")))
    }

    async fn parts(&self) -> Result<(), Failed> {
        let (path, whole) = (self.path("parts"), pattern(PART + REST));
        let mut upload = self.store.put_multipart(&path).await?;
        let sent = async {
            upload.put_part(PutPayload::from(whole.slice(..PART))).await?;
            upload.put_part(PutPayload::from(whole.slice(PART..))).await?;
            upload.complete().await
        };
        if let Err(error) = sent.await {
            let _ = upload.abort().await;
            return Err(error.into());
        }
        let across = PART - 50..PART + 50;
        same(&self.store.get_range(&path, across.start as u64..across.end as u64).await?, &whole[across])?;
        match self.store.head(&path).await?.size {
            size if size == whole.len() as u64 => Ok(()),
            size => Err(Failed(format!("the object has {size} bytes, expected {}", whole.len()))),
        }
    }

    async fn remove(&self) -> Result<(), Failed> {
        let paths = ["object", "parts"].map(|name| Ok(self.path(name)));
        let removed: Vec<_> = self.store.delete_stream(futures::stream::iter(paths).boxed()).collect().await;
        for removed in removed {
            match removed {
                Err(object_store::Error::NotFound { .. }) | Ok(_) => {}
                Err(error) => return Err(error.into()),
            }
        }
        match self.store.head(&self.path("object")).await {
            Err(object_store::Error::NotFound { .. }) => Ok(()),
            Err(error) => Err(error.into()),
            Ok(_) => Err(Failed("the store still has the test object after its removal".to_owned())),
        }
    }
}

/// Description of the fault of one step in the test of a store.
struct Failed(String);

impl From<object_store::Error> for Failed {
    fn from(error: object_store::Error) -> Self {
        Self(error.to_string())
    }
}

impl From<StoreError> for Failed {
    fn from(error: StoreError) -> Self {
        Self(error.to_string())
    }
}

async fn within<T>(step: impl Future<Output = Result<T, Failed>>) -> Result<T, String> {
    match timeout(PATIENCE, step).await {
        Ok(done) => done.map_err(|Failed(reason)| reason),
        Err(_) => Err(format!("no answer within {} s", PATIENCE.as_secs())),
    }
}

fn same(found: &[u8], expected: &[u8]) -> Result<(), Failed> {
    if found == expected {
        return Ok(());
    }
    Err(Failed(format!("read {} bytes that differ from the {} bytes that were written", found.len(), expected.len())))
}

/// Returns test bytes that vary from place to place, so that a read from a wrong position is recognised.
fn pattern(size: usize) -> Bytes {
    (0..size as u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::object::FOLDER;
    use crate::store::{Object, contract};

    #[tokio::test]
    async fn a_probe_leaves_nothing_behind() {
        let root = tempfile::tempdir().unwrap();
        for place in [Place::Directory(root.path().to_owned()), contract::bucket()] {
            let probe = Probe::open(&place).unwrap();
            assert_eq!(probe.note("wavelume-instance").await.unwrap(), None);
            let steps = probe.run().await;
            let names: Vec<_> = steps.iter().map(|step| step.name).collect();
            assert_eq!(names, ["put", "get", "range", "list", "multipart", "delete"]);
            for step in &steps {
                assert!(step.outcome.is_ok(), "{place} {}: {:?}", step.name, step.outcome);
            }
            assert_eq!(probe.store.list(None).count().await, 0);
            assert!(!probe.folder.starts_with(FOLDER) && probe.path("object").to_string().parse::<Object>().is_err());
        }
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 0);
        assert!(root.path().is_dir());
    }

    #[tokio::test]
    async fn a_place_that_is_missing_is_told_and_not_created() {
        let root = tempfile::tempdir().unwrap();
        let missing = root.path().join("none");
        assert!(Probe::open(&Place::Directory(missing.clone())).is_err());
        assert!(!missing.exists());
    }
}
