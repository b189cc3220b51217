//! Bytes under their digest: publish, verify, sweep; knows nothing of measurements.
//!
//! The naive store writes a file under its name and reads it back. A crash leaves half a file under a whole name, a
//! failing disk gives other bytes back, and two writers race. So: bytes are hashed while they are staged beside the
//! store, made durable, and renamed to their digest in one step; nothing under a digest ever changes; and whoever reads
//! a whole blob gets bytes whose digest was computed again.

mod digest;
mod local;
mod staging;

pub use digest::{Digest, NotADigest};
pub use local::LocalStore;
pub use staging::{Retired, Staged, StagedWriter, Staging};

use bytes::Bytes;
use futures::future::BoxFuture;
use futures::stream::{BoxStream, StreamExt, TryStreamExt};
use std::fmt;
use std::ops::Range;

/// Blobs up to this size are read in one piece and verified before their first byte is given away.
pub const WHOLE: u64 = 8 << 20;

/// The piece in which larger blobs are read.
const PIECE: u64 = 4 << 20;

/// Why bytes were not stored or not found.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No blob has this digest.
    #[error("no blob has the digest {0}")]
    NotFound(Digest),
    /// The bytes stored under a digest are others.
    #[error("the bytes stored as {stored} have the digest {found}")]
    Corrupt {
        /// The digest asked for.
        stored: Digest,
        /// The digest of the bytes found.
        found: Digest,
    },
    /// The range asked for is not inside the blob.
    #[error("bytes {}..{} of a blob of {size} bytes", range.start, range.end)]
    Range {
        /// The range asked for.
        range: Range<u64>,
        /// The size of the blob.
        size: u64,
    },
    /// The file system said no.
    #[error("file system: {0}")]
    Io(#[from] std::io::Error),
    /// The object store said no.
    #[error("object store: {0}")]
    Objects(#[from] object_store::Error),
}

/// A content-addressed store of immutable blobs.
///
/// # Contract
/// * `publish` returns only when the blob and its name are durable. Before that nobody sees it; after that everybody
///   sees all of it. Publishing a digest that is there already is allowed and replaces it by equal bytes, which heals
///   a corrupt blob. A crash at any moment leaves the blob whole or absent.
/// * `size` and `read` of a digest that was never published, or was removed, are `None` and [`StoreError::NotFound`].
/// * `read` returns exactly the bytes of `range` or fails, [`StoreError::Range`] if they are not inside the blob. It
///   does not verify the digest: [`StoreExt::get`] does.
/// * `list` names every blob that was there during the whole listing, and nothing that is not a whole blob.
/// * A blob is removed in two steps. `retire` takes its name away at once: one metadata operation, no waiting, so it may
///   run inside a database transaction; it is done when it returns, and a later `publish` of the digest makes a new blob.
///   `discard` frees the bytes, may take long, and cannot touch a blob published after `retire`. A crash between the two
///   leaves bytes without a name, which [`Staging::sweep`] removes. Readers that have begun may fail afterwards, but
///   never get other bytes.
/// * All calls may be made at any time from any thread or process.
pub trait Store: Send + Sync + fmt::Debug {
    /// Makes staged bytes durable under their digest.
    fn publish<'a>(&'a self, staged: &'a Staged) -> BoxFuture<'a, Result<(), StoreError>>;
    /// The size of a blob in bytes, if it is there.
    fn size(&self, digest: Digest) -> BoxFuture<'_, Result<Option<u64>, StoreError>>;
    /// The bytes of `range`, not verified.
    fn read(&self, digest: Digest, range: Range<u64>) -> BoxFuture<'_, Result<Bytes, StoreError>>;
    /// Every blob and its size, in no order.
    fn list(&self) -> BoxStream<'_, Result<(Digest, u64), StoreError>>;
    /// Takes the name of a blob away; `None` if there is no such blob. Blocking, for one rename.
    fn retire(&self, digest: Digest) -> Result<Option<Retired>, StoreError>;
    /// Frees the bytes of a retired blob.
    fn discard(&self, retired: Retired) -> BoxFuture<'_, Result<(), StoreError>>;
}

/// What every store can do by its contract.
pub trait StoreExt: Store {
    /// All bytes of a blob, verified.
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

    /// The bytes of `range` of a blob of `size` bytes in pieces. The whole blob is hashed on its way and the stream ends
    /// with [`StoreError::Corrupt`] if it was another; a part cannot be verified.
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
                // The last piece is withheld from a reader who must not take it for whole.
                let found = Digest::from(hasher.finalize());
                if end == left.end && found != digest {
                    return Err(StoreError::Corrupt { stored: digest, found });
                }
            }
            Ok(Some((piece, (store, end..left.end, hasher))))
        })
        .boxed()
    }

    /// Recomputes the digest of a blob of any size in bounded memory.
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

#[cfg(test)]
pub(crate) mod contract {
    //! The suite that every store passes.

    use super::*;
    use std::sync::Arc;

    pub(crate) async fn holds<S: Store + 'static>(store: Arc<S>, staging: &Staging) {
        let absent = Digest::of(b"never published");
        assert_eq!(store.size(absent).await.unwrap(), None);
        assert!(matches!(store.read(absent, 0..1).await, Err(StoreError::NotFound(_))));
        assert!(matches!(store.get(absent).await, Err(StoreError::NotFound(_))));
        assert_eq!(store.retire(absent).unwrap(), None);

        let large: Vec<u8> = (0..WHOLE as u32 + 70_000).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        for bytes in [b"".as_slice(), b"x", &[7; 1000], &large] {
            let staged = staging.stage(bytes).unwrap();
            let (digest, size) = (staged.digest(), bytes.len() as u64);
            assert_eq!(store.size(digest).await.unwrap(), None, "not visible before it is published");
            store.publish(&staged).await.unwrap();
            store.publish(&staging.stage(bytes).unwrap()).await.unwrap();
            drop(staged);
            assert_eq!(store.size(digest).await.unwrap(), Some(size));
            assert_eq!(store.get(digest).await.unwrap(), bytes);
            assert_eq!(Arc::clone(&store).verify(digest).await.unwrap(), size);
            let streamed: Vec<Bytes> = Arc::clone(&store).stream(digest, 0..size, size).try_collect().await.unwrap();
            assert_eq!(streamed.concat(), bytes);
            if size > 0 {
                assert_eq!(store.read(digest, size - 1..size).await.unwrap(), &bytes[bytes.len() - 1..]);
            }
            assert!(matches!(store.read(digest, 0..size + 1).await, Err(StoreError::Range { .. })));
        }
        assert_eq!(store.list().try_collect::<Vec<_>>().await.unwrap().len(), 4);
        let x = Digest::of(b"x");
        let retired = store.retire(x).unwrap().unwrap();
        assert_eq!(store.size(x).await.unwrap(), None);
        assert_eq!(store.list().try_collect::<Vec<_>>().await.unwrap().len(), 3);
        store.publish(&staging.stage(b"x").unwrap()).await.unwrap();
        store.discard(retired).await.unwrap();
        assert_eq!(store.get(x).await.unwrap(), b"x".as_slice(), "published after it was retired");
        store.discard(store.retire(x).unwrap().unwrap()).await.unwrap();
        assert_eq!(store.list().try_collect::<Vec<_>>().await.unwrap().len(), 3);
    }
}
