//! The interface that every store implements, with the contract behind it.

use super::digest::Digest;
use super::error::StoreError;
use super::staging::{Retired, Staged};
use bytes::Bytes;
use futures::future::BoxFuture;
use futures::stream::BoxStream;
use std::fmt;
use std::ops::Range;

/// A content-addressed store of immutable blobs.
///
/// # Contract
/// * `publish` returns only when the blob and its name are durable. Before that no reader sees it; after that every
///   reader sees all of it. Publishing a digest that is there already is allowed and replaces it by equal bytes, which
///   heals a corrupt blob. A crash at any moment leaves the blob whole or absent.
/// * `size` and `read` of a digest that was never published, or was removed, are `None` and [`StoreError::NotFound`].
/// * `read` returns exactly the bytes of `range` or fails, [`StoreError::Range`] if they are not inside the blob. It
///   does not verify the digest: [`StoreExt::get`](super::StoreExt::get) does.
/// * `list` names every blob that was there during the whole listing, and nothing that is not a whole blob.
/// * A blob is removed in two steps. `retire` takes its name away at once: one metadata operation, no waiting, so it
///   may run inside a database transaction; it is done when it returns, and a later `publish` of the digest makes a new
///   blob. `discard` frees the bytes, may take long, and cannot touch a blob published after `retire`. A crash between
///   the two leaves bytes without a name, which [`Staging::sweep`](super::Staging::sweep) removes. Readers that have
///   begun may fail afterwards, but never get other bytes.
/// * All calls may be made at any time from any thread or process.
pub(crate) trait Store: Send + Sync + fmt::Debug {
    /// Makes staged bytes durable under their digest.
    fn publish<'a>(&'a self, staged: &'a Staged) -> BoxFuture<'a, Result<(), StoreError>>;
    /// The size of a blob in bytes, if it is there.
    fn size(&self, digest: Digest) -> BoxFuture<'_, Result<Option<u64>, StoreError>>;
    /// Returns the bytes of `range`, not verified.
    fn read(&self, digest: Digest, range: Range<u64>) -> BoxFuture<'_, Result<Bytes, StoreError>>;
    /// Every blob and its size, in no order.
    fn list(&self) -> BoxStream<'_, Result<(Digest, u64), StoreError>>;
    /// Takes the name of a blob away; `None` if there is no such blob. Blocking, for one rename.
    fn retire(&self, digest: Digest) -> Result<Option<Retired>, StoreError>;
    /// Frees the bytes of a retired blob.
    fn discard(&self, retired: Retired) -> BoxFuture<'_, Result<(), StoreError>>;
}
