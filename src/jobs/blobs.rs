//! Bytes by their digest: looked up in the catalog, read from the store, verified.

use super::archive::{Archive, ArchiveError};
use crate::catalog::{Blob, CatalogError};
use crate::store::{Digest, StoreError, StoreExt};
use bytes::Bytes;
use futures::stream::{BoxStream, StreamExt};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::sleep;

/// Seconds between two looks at stored bytes in which a fault was found, before they count as missing or damaged.
/// Raising it takes fewer files for damaged that are being put back, but delays the answer to whoever reads them.
pub(super) const APART: Duration = Duration::from_secs(1);

/// Failure to read stored bytes or to store new ones.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BlobError {
    /// The store (directory or S3 prefix that holds the files) failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The catalog (database) failed.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
    /// The store is away, or belongs to another catalog now: bytes that it lacks may exist, and none may be written.
    #[error("{0}")]
    Away(String),
}

impl From<ArchiveError> for BlobError {
    fn from(error: ArchiveError) -> Self {
        match error {
            ArchiveError::Store(error) => Self::Store(error),
            ArchiveError::Catalog(error) => Self::Catalog(error),
            other => Self::Away(other.to_string()),
        }
    }
}

impl Archive {
    /// Returns the catalog row about the stored bytes with the given digest, and the number of bytes.
    pub(crate) async fn blob(&self, digest: Digest) -> Result<(Blob, u64), BlobError> {
        let blob = self.catalog.blob(digest).await?.ok_or(StoreError::NotFound(digest))?;
        let bytes = match self.store.size_of(&blob.object, blob.bytes).await {
            Err(error) => self.read_again(&blob, error, self.store.size_of(&blob.object, None)).await?,
            Ok(bytes) => bytes,
        };
        Ok((blob, bytes))
    }

    /// Returns a presigned URL of the object store that reads the stored bytes with the given digest for the time
    /// `life`, with these headers of the answer; `None` if the store has no such URLs. Whoever has the URL reads bytes
    /// that nobody has checked against their digest.
    pub(crate) async fn presigned(
        &self,
        digest: Digest,
        life: Duration,
        media_type: &str,
        disposition: &str,
    ) -> Result<Option<String>, BlobError> {
        let (blob, _) = self.blob(digest).await?;
        // The store itself would tell the client that it has no such bytes.
        self.belonged().await?;
        Ok(self.store.presigned(&blob.object, life, media_type, disposition).await?)
    }

    /// Returns all stored bytes with the given digest, after checking them against the digest.
    pub(crate) async fn get(&self, digest: Digest) -> Result<Bytes, BlobError> {
        let blob = self.catalog.blob(digest).await?.ok_or(StoreError::NotFound(digest))?;
        self.read(&blob).await
    }

    /// Returns all bytes of a stored object that was just looked up in the catalog, after checking them against their
    /// digest.
    pub(crate) async fn read(&self, blob: &Blob) -> Result<Bytes, BlobError> {
        let digest = blob.object.digest();
        let error = match self.store.get(&blob.object, blob.bytes).await {
            Ok(bytes) => {
                // Bytes that are back lose their mark.
                if blob.suspect
                    && let Err(error) = self.catalog.checked(&blob.object, bytes.len() as u64).await
                {
                    tracing::warn!(object = %blob.object, %error, "sound bytes keep the mark of damaged ones");
                }
                return Ok(bytes);
            }
            Err(error) => error,
        };
        // The object may have been replaced since it was looked up.
        let now = self.catalog.blob(digest).await?.ok_or(StoreError::NotFound(digest))?;
        let read = || self.store.get(&now.object, now.bytes);
        if now.object == blob.object {
            return self.read_again(&now, error, read()).await;
        }
        match read().await {
            Ok(bytes) => Ok(bytes),
            Err(error) => self.read_again(&now, error, read()).await,
        }
    }

    /// Returns true if the store holds an object of the size of bytes that were uploaded again. If it is missing or cut
    /// short, marks it, so that the upload replaces it.
    pub(super) async fn holds(&self, blob: &Blob, bytes: u64) -> Result<bool, BlobError> {
        let look = || async {
            match self.store.size(&blob.object).await? {
                Some(size) if size == bytes => Ok(()),
                Some(size) => Err(StoreError::Range { range: 0..bytes, size }),
                None => Err(StoreError::NotFound(blob.object.digest())),
            }
        };
        let Err(error) = look().await else { return Ok(true) };
        match self.read_again(blob, error, look()).await {
            Ok(()) => Ok(true),
            Err(BlobError::Store(error)) if error.damage().is_some() => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Streams the bytes of `range` of a stored object of `size` bytes. If the range is the whole object, its digest is
    /// checked on the way.
    pub(crate) fn stream(
        &self,
        blob: Blob,
        range: Range<u64>,
        size: u64,
    ) -> BoxStream<'static, Result<Bytes, BlobError>> {
        let archive = self.clone();
        let pieces = Arc::clone(&self.store).stream(blob.object.clone(), range, size);
        let watched = pieces.then(move |piece| {
            let (archive, blob) = (archive.clone(), blob.clone());
            async move {
                match piece {
                    Err(error) => {
                        let again = Arc::clone(&archive.store).verify(&blob.object);
                        // The pieces before were sent: the answer ends here, whatever the second look finds.
                        let back = || BlobError::Away("the stored bytes could not be read for a moment".to_owned());
                        Err(archive.read_again(&blob, error, again).await.err().unwrap_or_else(back))
                    }
                    piece => Ok(piece?),
                }
            }
        });
        watched.boxed()
    }

    /// Looks a second time, after [`APART`], at a stored object of which a client or a job has found the fault `first`;
    /// see [`Self::confirm`].
    async fn read_again<T>(
        &self,
        blob: &Blob,
        first: StoreError,
        again: impl Future<Output = Result<T, StoreError>>,
    ) -> Result<T, BlobError> {
        if first.damage().is_none() {
            return Err(first.into());
        }
        // While the store is away, the answer comes at once.
        self.belongs().await?;
        if !blob.suspect {
            sleep(APART).await;
        }
        let found = self.confirm(blob, again).await;
        if let Err(ArchiveError::Store(error)) = &found
            && error.damage().is_some()
        {
            tracing::error!(object = %blob.object, %error, "stored bytes are missing or damaged");
            metrics::counter!("wavelume_damaged_blobs_total").increment(1);
        }
        Ok(found?)
    }

    /// Takes a second look, `again`, at a stored object in which a first one has found a fault before, and returns what
    /// it finds. Marks the object as missing or damaged if it finds a fault while the store carries the id of this
    /// catalog, so that the next upload of the same bytes replaces it: an unmounted directory lacks all files.
    pub(super) async fn confirm<T>(
        &self,
        blob: &Blob,
        again: impl Future<Output = Result<T, StoreError>>,
    ) -> Result<T, ArchiveError> {
        self.belongs().await?;
        let fault = match again.await {
            Ok(found) => return Ok(found),
            Err(fault) => fault,
        };
        if fault.damage().is_some() {
            self.belongs().await?;
            if !self.catalog.is_read_only() {
                self.catalog.suspect(std::slice::from_ref(&blob.object)).await?;
            }
        }
        Err(fault.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::archive::INSTANCE;
    use crate::jobs::publish::Published;
    use crate::jobs::publish::tests::stored;
    use crate::jobs::site::tests::sites;

    /// Takes the store away: it lacks the id of the catalog, as an unmounted directory does.
    async fn take_away(archive: &Archive) {
        archive.store.set_note(INSTANCE, String::new()).await.unwrap();
    }

    async fn bring_back(archive: &Archive) {
        archive.store.set_note(INSTANCE, archive.catalog.instance().await.unwrap()).await.unwrap();
    }

    #[tokio::test]
    async fn a_store_that_is_away_is_not_damaged_and_takes_no_bytes() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let digest = stored(&archive, b"bytes").await;
            let blob = async || archive.catalog.blob(digest).await.unwrap().unwrap();
            let before = blob().await;
            archive.store.remove(std::slice::from_ref(&before.object)).await;
            take_away(&archive).await;
            assert!(matches!(archive.get(digest).await, Err(BlobError::Away(_))));
            let piece = archive.stream(before.clone(), 0..5, 5).next().await.unwrap();
            assert!(matches!(piece, Err(BlobError::Away(_))));
            for bytes in [b"bytes".as_slice(), b"others"] {
                let staged = archive.staging.stage(bytes).unwrap();
                let refused = Published::new(&archive, staged).await.map(drop);
                assert!(matches!(refused, Err(BlobError::Away(_))), "{refused:?}");
            }
            assert_eq!(blob().await, before, "nothing is marked");

            bring_back(&archive).await;
            archive.store.publish(&archive.staging.stage(b"bytes").unwrap(), &before.object).await.unwrap();
            assert_eq!(archive.get(digest).await.unwrap(), b"bytes".as_slice());
        }
    }

    #[tokio::test]
    async fn bytes_are_marked_after_two_looks_and_lose_the_mark_when_they_are_back() {
        for (site, _guard) in sites().await {
            let archive = Archive::serve(&site).await.unwrap();
            let digest = stored(&archive, b"bytes").await;
            let blob = async || archive.catalog.blob(digest).await.unwrap().unwrap();
            let object = blob().await.object;
            let absent = || StoreError::NotFound(digest);

            let back = archive.read_again(&blob().await, absent(), async { Ok(5) }).await.unwrap();
            assert_eq!((back, blob().await.suspect), (5, false), "the second look decides");
            // The store goes away during the second look.
            let gone = async {
                take_away(&archive).await;
                Err::<(), _>(absent())
            };
            assert!(matches!(archive.read_again(&blob().await, absent(), gone).await, Err(BlobError::Away(_))));
            assert!(!blob().await.suspect);
            bring_back(&archive).await;

            for short in [Some(b"byt".as_slice()), None] {
                match short {
                    Some(bytes) => {
                        archive.store.publish(&archive.staging.stage(bytes).unwrap(), &object).await.unwrap();
                    }
                    None => drop(archive.store.remove(std::slice::from_ref(&object)).await),
                }
                assert!(matches!(archive.get(digest).await, Err(BlobError::Store(error)) if error.damage().is_some()));
                assert!(blob().await.suspect, "{short:?}");
                archive.store.publish(&archive.staging.stage(b"bytes").unwrap(), &object).await.unwrap();
                assert_eq!(archive.get(digest).await.unwrap(), b"bytes".as_slice());
                assert!(!blob().await.suspect, "{short:?}");
            }
        }
    }
}
