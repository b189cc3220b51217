//! Bytes by their digest: looked up in the catalog, read from the store, verified.

use super::archive::{Archive, ArchiveError};
use crate::catalog::{Blob, CatalogError};
use crate::store::{Digest, Object, StoreError, StoreExt};
use bytes::Bytes;
use futures::stream::{BoxStream, StreamExt};
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Failure to read stored bytes or to store new ones.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BlobError {
    /// The store (directory or S3 prefix that holds the files) failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The catalog (database) failed.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
    /// The store belongs to another catalog now, so that nothing may be written to it.
    #[error("refused to write to the store: {0}")]
    Foreign(String),
}

impl Archive {
    /// Returns the catalog row about the stored bytes with the given digest, and the number of bytes.
    pub(crate) async fn blob(&self, digest: Digest) -> Result<(Blob, u64), BlobError> {
        let blob = self.catalog.blob(digest).await?.ok_or(StoreError::NotFound(digest))?;
        let bytes = match self.store.size_of(&blob.object, blob.bytes).await {
            Err(error @ StoreError::NotFound(_)) => return Err(self.suspected(&blob, error).await.into()),
            bytes => bytes?,
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
            Ok(bytes) => return Ok(bytes),
            Err(error) if error.damage().is_some() => error,
            Err(error) => return Err(error.into()),
        };
        // The object may have been replaced since it was looked up.
        match self.catalog.blob(digest).await? {
            Some(now) if now.object != blob.object => Ok(self.store.get(&now.object, now.bytes).await?),
            Some(_) => Err(self.suspected(blob, error).await.into()),
            None => Err(StoreError::NotFound(digest).into()),
        }
    }

    /// Streams the bytes of `range` of a stored object of `size` bytes. If the range is the whole object, its digest is
    /// checked on the way.
    pub(crate) fn stream(
        &self,
        blob: Blob,
        range: Range<u64>,
        size: u64,
    ) -> BoxStream<'static, Result<Bytes, StoreError>> {
        let archive = self.clone();
        let pieces = Arc::clone(&self.store).stream(blob.object.clone(), range, size);
        let watched = pieces.then(move |piece| {
            let (archive, blob) = (archive.clone(), blob.clone());
            async move {
                match piece {
                    Err(error) if error.damage().is_some() => Err(archive.suspected(&blob, error).await),
                    piece => piece,
                }
            }
        });
        watched.boxed()
    }

    /// Marks a stored object in the catalog as missing or damaged, so that the next upload of the same bytes replaces
    /// it. Returns the error that revealed the damage.
    async fn suspected(&self, blob: &Blob, error: StoreError) -> StoreError {
        tracing::error!(object = %blob.object, %error, "stored bytes are missing or damaged");
        metrics::counter!("wavelume_damaged_blobs_total").increment(1);
        if let Err(error) = self.mark_damaged(&blob.object).await {
            tracing::error!(object = %blob.object, %error, "the catalog could not mark stored bytes as damaged");
        }
        error
    }

    /// Marks a stored object in the catalog as missing or damaged. Fails if the store does not carry the id of this
    /// catalog: a directory whose disk was unmounted lacks all files.
    pub(super) async fn mark_damaged(&self, object: &Object) -> Result<(), ArchiveError> {
        self.belongs().await?;
        Ok(self.catalog.suspect(object).await?)
    }
}
