//! Verified reading of objects, in one piece or as a stream, from any store.

use super::digest::Digest;
use super::error::StoreError;
use super::interface::Store;
use super::object::Object;
use bytes::Bytes;
use futures::stream::{BoxStream, StreamExt, TryStreamExt};
use std::ops::Range;
use std::sync::Arc;

/// Size in bytes up to which an object is read in one piece, and its digest checked, before its first byte is passed
/// on. Raising it needs more memory.
pub const WHOLE: u64 = 8 << 20;

/// Size in bytes of the pieces in which a large object is read. Raising it needs more memory for each reader.
const PIECE: u64 = 4 << 20;

/// Operations on objects of any store: reading with a check of the digest, streaming, and recomputing the digest.
pub(crate) trait StoreExt: Store {
    /// Returns the size of an object in bytes; asks the store if the size is not known.
    fn size_of(&self, object: &Object, known: Option<u64>) -> impl Future<Output = Result<u64, StoreError>> + Send {
        async move {
            match known {
                Some(size) => Ok(size),
                None => self.size(object).await?.ok_or(StoreError::NotFound(object.digest())),
            }
        }
    }

    /// Returns all bytes of an object, after checking its digest. Needs one request, if the size is known.
    fn get(&self, object: &Object, size: Option<u64>) -> impl Future<Output = Result<Bytes, StoreError>> + Send {
        async move {
            let (digest, size) = (object.digest(), self.size_of(object, size).await?);
            let bytes = match self.read(object, 0..size).await {
                // It is shorter than it was when it was stored.
                Err(StoreError::Range { .. }) => {
                    let size = self.size(object).await?.ok_or(StoreError::NotFound(digest))?;
                    self.read(object, 0..size).await?
                }
                read => read?,
            };
            let check = bytes.clone();
            let found = if size > PIECE / 16 {
                tokio::task::spawn_blocking(move || Digest::of(&check)).await.map_err(std::io::Error::other)?
            } else {
                Digest::of(&check)
            };
            if found == digest { Ok(bytes) } else { Err(StoreError::Corrupt { stored: digest, found }) }
        }
    }

    /// Streams the bytes of `range` of an object of `size` bytes. The digest of a whole object is checked on the way,
    /// and the stream ends with [`StoreError::Corrupt`] on a mismatch. Part of an object cannot be checked.
    fn stream(
        self: Arc<Self>,
        object: Object,
        range: Range<u64>,
        size: u64,
    ) -> BoxStream<'static, Result<Bytes, StoreError>>
    where
        Self: 'static,
    {
        let hasher = (range == (0..size)).then(blake3::Hasher::new);
        let state = (self, object, range, hasher);
        futures::stream::try_unfold(state, move |(store, object, left, mut hasher)| async move {
            if left.is_empty() {
                return Ok::<_, StoreError>(None);
            }
            let end = left.end.min(left.start + PIECE);
            let piece = store.read(&object, left.start..end).await?;
            if let Some(hasher) = &mut hasher {
                hasher.update(&piece);
                // The last piece of a corrupt object is withheld, so that a reader never takes it for whole.
                let (stored, found) = (object.digest(), Digest::from(hasher.finalize()));
                if end == left.end && found != stored {
                    return Err(StoreError::Corrupt { stored, found });
                }
            }
            Ok(Some((piece, (store, object, end..left.end, hasher))))
        })
        .boxed()
    }

    /// Recomputes and checks the digest of an object of any size in bounded memory, and returns its size in bytes.
    fn verify(self: Arc<Self>, object: &Object) -> impl Future<Output = Result<u64, StoreError>> + Send
    where
        Self: 'static,
    {
        async move {
            let size = self.size(object).await?.ok_or(StoreError::NotFound(object.digest()))?;
            if size <= WHOLE {
                self.get(object, Some(size)).await?;
                return Ok(size);
            }
            self.stream(object.clone(), 0..size, size).try_for_each(|_| async { Ok(()) }).await?;
            Ok(size)
        }
    }
}

impl<S: Store + ?Sized> StoreExt for S {}
