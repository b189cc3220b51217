//! The interface that every store implements, with the contract behind it.

use super::error::StoreError;
use super::object::Object;
use super::staging::Staged;
use crate::trust::Tenant;
use bytes::Bytes;
use futures::future::BoxFuture;
use futures::stream::BoxStream;
use std::fmt;
use std::ops::Range;
use std::time::Duration;

/// A store of immutable objects (files that are written once).
///
/// # Contract
/// * `publish` returns only when the object is durable. Before that no reader sees it; after that every reader sees all
///   of it. A crash at any moment leaves the object whole or absent. An object's name is published once; publishing the
///   same bytes under it again is allowed.
/// * `size` and `read` of an object that was never published, or was removed, are `None` and [`StoreError::NotFound`].
/// * `read` returns exactly the bytes of `range` or fails, [`StoreError::Range`] if they are not inside the object. It
///   does not verify the digest: [`StoreExt::get`](super::StoreExt::get) does.
/// * `list` names every object below a folder that was there during the whole listing, and nothing that is not a whole
///   object.
/// * `remove` frees an object's bytes; an object that is absent already is removed. Nobody publishes under its name
///   again.
/// * `note` and `set_note` read and write a small text beside the objects.
/// * `presigned` tells no secret of the store but the URL, which reads one object and nothing else.
/// * All calls may be made at any time from any thread or process.
pub(crate) trait Store: Send + Sync + fmt::Debug {
    /// Makes a staged (temporary) file a durable object of the store.
    fn publish<'a>(&'a self, staged: &'a Staged, object: &'a Object) -> BoxFuture<'a, Result<(), StoreError>>;
    /// Returns the size of an object in bytes, if the store holds the object.
    fn size<'a>(&'a self, object: &'a Object) -> BoxFuture<'a, Result<Option<u64>, StoreError>>;
    /// Returns the bytes of `range` of an object, without checking its digest.
    fn read<'a>(&'a self, object: &'a Object, range: Range<u64>) -> BoxFuture<'a, Result<Bytes, StoreError>>;
    /// Returns a URL from which anybody can read an object for the time `life`, with these headers of the answer;
    /// `None` if the store has no such URLs. Sends no request for the object, so that it may be absent.
    fn presigned<'a>(
        &'a self,
        _object: &'a Object,
        _life: Duration,
        _media_type: &'a str,
        _disposition: &'a str,
    ) -> BoxFuture<'a, Result<Option<String>, StoreError>> {
        Box::pin(std::future::ready(Ok(None)))
    }
    /// Lists the objects below a folder of the store with their sizes in bytes, in no particular order.
    fn list<'a>(&'a self, folder: &'a str) -> BoxStream<'a, Result<(Object, u64), StoreError>>;
    /// Returns the tenants that may have objects in the store, in no particular order: those after which a folder is
    /// named.
    fn tenants(&self) -> BoxFuture<'_, Result<Vec<Tenant>, StoreError>>;
    /// Removes objects from the store, and returns one outcome for each, in the order of `objects`.
    fn remove<'a>(&'a self, objects: &'a [Object]) -> BoxFuture<'a, Vec<Result<(), StoreError>>>;
    /// Returns a small named text that the store keeps beside the objects, if there is one.
    fn note<'a>(&'a self, name: &'a str) -> BoxFuture<'a, Result<Option<String>, StoreError>>;
    /// Writes a small named text to the store, beside the objects.
    fn set_note<'a>(&'a self, name: &'a str, text: String) -> BoxFuture<'a, Result<(), StoreError>>;
}
