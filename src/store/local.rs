//! Blobs in a local directory: `blobs/ab/b3-ab…`, published by a rename that is on stable storage when it returns.

use super::digest::Digest;
use super::error::StoreError;
use super::interface::Store;
use super::staging::{Retired, Staged, Staging};
use bytes::Bytes;
use futures::future::BoxFuture;
use futures::stream::{BoxStream, StreamExt};
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt};
use std::ops::Range;
use std::path::{Path, PathBuf};

const PREFIX: &str = "blobs";

/// Staging directory, on the same file system so that publishing is a rename.
const STAGING: &str = "staging";

/// Blobs in a local directory.
#[derive(Clone, Debug)]
pub(crate) struct LocalStore {
    objects: LocalFileSystem,
    root: PathBuf,
    staging: Staging,
}

impl LocalStore {
    /// Opens the store inside `root`, which must exist, and the staging directory beside it. Blocking.
    pub(crate) fn new(root: &Path) -> Result<(Self, Staging), StoreError> {
        std::fs::create_dir_all(root.join(PREFIX))?;
        std::fs::create_dir_all(root.join(STAGING))?;
        let objects = LocalFileSystem::new_with_prefix(root)?.with_fsync(true);
        let staging = Staging::new(root.join(STAGING));
        Ok((Self { objects, root: root.to_owned(), staging: staging.clone() }, staging))
    }

    fn absent(digest: Digest, error: object_store::Error) -> StoreError {
        match error {
            object_store::Error::NotFound { .. } => StoreError::NotFound(digest),
            other => other.into(),
        }
    }
}

/// Returns the key of a blob; 256 directories keep each of them small.
fn key(digest: Digest) -> Key {
    let name = digest.to_string();
    Key::from(format!("{PREFIX}/{}/{name}", &name[3..5]))
}

impl Store for LocalStore {
    fn publish<'a>(&'a self, staged: &'a Staged) -> BoxFuture<'a, Result<(), StoreError>> {
        Box::pin(async move {
            staged.sync().await?;
            let from = Key::from_iter([STAGING, staged.name()]);
            Ok(self.objects.rename(&from, &key(staged.digest())).await?)
        })
    }

    fn size(&self, digest: Digest) -> BoxFuture<'_, Result<Option<u64>, StoreError>> {
        Box::pin(async move {
            match self.objects.head(&key(digest)).await {
                Ok(meta) => Ok(Some(meta.size)),
                Err(object_store::Error::NotFound { .. }) => Ok(None),
                Err(error) => Err(error.into()),
            }
        })
    }

    fn read(&self, digest: Digest, range: Range<u64>) -> BoxFuture<'_, Result<Bytes, StoreError>> {
        Box::pin(async move {
            let size = self.size(digest).await?.ok_or(StoreError::NotFound(digest))?;
            if range.start > range.end || range.end > size {
                return Err(StoreError::Range { range, size });
            }
            if range.is_empty() {
                return Ok(Bytes::new());
            }
            let wanted = range.end - range.start;
            let bytes =
                self.objects.get_range(&key(digest), range.clone()).await.map_err(|e| Self::absent(digest, e))?;
            if bytes.len() as u64 == wanted { Ok(bytes) } else { Err(StoreError::Range { range, size }) }
        })
    }

    fn list(&self) -> BoxStream<'_, Result<(Digest, u64), StoreError>> {
        self.objects
            .list(Some(&Key::from(PREFIX)))
            .filter_map(|found| async move {
                match found {
                    // A file that is not named like a blob is skipped.
                    Ok(meta) => meta.location.filename()?.parse().ok().map(|digest| Ok((digest, meta.size))),
                    Err(error) => Some(Err(error.into())),
                }
            })
            .boxed()
    }

    fn retire(&self, digest: Digest) -> Result<Option<Retired>, StoreError> {
        self.staging.take_in(&self.root.join(key(digest).as_ref()))
    }

    fn discard(&self, retired: Retired) -> BoxFuture<'_, Result<(), StoreError>> {
        Box::pin(async move {
            let freed = tokio::task::spawn_blocking(move || retired.discard()).await;
            Ok(freed.map_err(std::io::Error::other)??)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{StoreExt, contract};
    use std::sync::Arc;

    #[tokio::test]
    async fn a_local_directory_holds_the_contract() {
        let root = tempfile::tempdir().unwrap();
        let (store, staging) = LocalStore::new(root.path()).unwrap();
        contract::holds(Arc::new(store), &staging).await;
        assert_eq!(std::fs::read_dir(root.path().join(STAGING)).unwrap().count(), 0);
    }

    #[tokio::test]
    async fn other_bytes_under_a_digest_are_corrupt_until_published_again() {
        let root = tempfile::tempdir().unwrap();
        let (store, staging) = LocalStore::new(root.path()).unwrap();
        let store = Arc::new(store);
        let staged = staging.stage(b"the truth").unwrap();
        let digest = staged.digest();
        store.publish(&staged).await.unwrap();
        std::fs::write(root.path().join(key(digest).as_ref()), b"a lie   ").unwrap();
        assert!(matches!(store.get(digest).await, Err(StoreError::Corrupt { .. })));
        assert!(matches!(Arc::clone(&store).verify(digest).await, Err(StoreError::Corrupt { .. })));
        store.publish(&staging.stage(b"the truth").unwrap()).await.unwrap();
        assert_eq!(store.get(digest).await.unwrap(), b"the truth".as_slice());
    }

    #[tokio::test]
    async fn files_that_are_no_blobs_are_not_listed() {
        let root = tempfile::tempdir().unwrap();
        let (store, _) = LocalStore::new(root.path()).unwrap();
        std::fs::write(root.path().join(PREFIX).join("notes.txt"), b"?").unwrap();
        assert_eq!(store.list().count().await, 0);
    }
}
