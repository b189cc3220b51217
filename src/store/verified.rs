//! Verified reading of blobs, in one piece or as a stream, from any store.

use super::digest::Digest;
use super::error::StoreError;
use super::interface::Store;
use bytes::Bytes;
use futures::stream::{BoxStream, StreamExt, TryStreamExt};
use std::ops::Range;

/// Size in bytes up to which a blob is read in one piece and verified before its first byte is passed on.
pub const WHOLE: u64 = 8 << 20;

/// Size in bytes of the pieces in which larger blobs are read.
const PIECE: u64 = 4 << 20;

/// Operations that every store supports by its contract.
pub(crate) trait StoreExt: Store {
    /// Returns all bytes of a blob, verified.
    fn get(&self, digest: Digest) -> impl Future<Output = Result<Bytes, StoreError>> + Send {
        async move {
            let size = self.size(digest).await?.ok_or(StoreError::NotFound(digest))?;
            let bytes = self.read(digest, 0..size).await?;
            let check = bytes.clone();
            let found = if size > PIECE / 16 {
                tokio::task::spawn_blocking(move || Digest::of(&check)).await.map_err(std::io::Error::other)?
            } else {
                Digest::of(&check)
            };
            if found == digest { Ok(bytes) } else { Err(StoreError::Corrupt { stored: digest, found }) }
        }
    }

    /// Streams the bytes of `range` of a blob of `size` bytes. A whole blob is hashed on its way, and the stream ends
    /// with [`StoreError::Corrupt`] on a mismatch; a part cannot be verified.
    fn stream(
        self: std::sync::Arc<Self>,
        digest: Digest,
        range: Range<u64>,
        size: u64,
    ) -> BoxStream<'static, Result<Bytes, StoreError>>
    where
        Self: 'static,
    {
        let hasher = (range == (0..size)).then(blake3::Hasher::new);
        let state = (self, range, hasher);
        futures::stream::try_unfold(state, move |(store, left, mut hasher)| async move {
            if left.is_empty() {
                return Ok::<_, StoreError>(None);
            }
            let end = left.end.min(left.start + PIECE);
            let piece = store.read(digest, left.start..end).await?;
            if let Some(hasher) = &mut hasher {
                hasher.update(&piece);
                // The last piece of a corrupt blob is withheld, so that a reader never takes it for whole.
                let found = Digest::from(hasher.finalize());
                if end == left.end && found != digest {
                    return Err(StoreError::Corrupt { stored: digest, found });
                }
            }
            Ok(Some((piece, (store, end..left.end, hasher))))
        })
        .boxed()
    }

    /// Recomputes the digest of a blob of any size in bounded memory, and returns its size.
    fn verify(self: std::sync::Arc<Self>, digest: Digest) -> impl Future<Output = Result<u64, StoreError>> + Send
    where
        Self: 'static,
    {
        async move {
            let size = self.size(digest).await?.ok_or(StoreError::NotFound(digest))?;
            if size <= WHOLE {
                self.get(digest).await?;
                return Ok(size);
            }
            self.stream(digest, 0..size, size).try_for_each(|_| async { Ok(()) }).await?;
            Ok(size)
        }
    }
}

impl<S: Store + ?Sized> StoreExt for S {}
