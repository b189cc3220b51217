//! Uploads that a client may continue after a break: reserved for one request at a time, kept in parts, and read whole.

use super::blobs::BlobError;
use super::engine::Engine;
use super::publish::publish_part;
use super::turns::most_of_tenant;
use crate::catalog::{Begun, CatalogError, Held, NewPartial, Partial, PartialLimits};
use crate::store::{Digest, Staged, StoreError, StoreExt};
use bytes::Bytes;
use futures::stream::{self, BoxStream, StreamExt, TryStreamExt};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::{interval, sleep};
use tokio_util::task::AbortOnDropHandle;

/// Longest time that a request waits for another one that holds the same upload. Raising it bears slower stores after a
/// break, and delays the answer to a client that writes twice at once.
const PATIENCE: Duration = Duration::from_secs(5);

/// Pause between two looks at an upload that another request holds. Raising it delays the next part after a break.
const LOOK: Duration = Duration::from_millis(100);

/// Hours for which the parts of an upload are kept after it was used or given up. Raising it gives slow readers longer
/// to finish.
const GRACE: Duration = Duration::from_hours(1);

/// Reservation of a resumable upload by one request. It is prolonged until it is released or dropped.
#[derive(Debug)]
pub(crate) struct Holding {
    engine: Arc<Engine>,
    holder: String,
    /// State of the upload when this request reserved it, or after the last part that this request has added.
    pub(crate) partial: Partial,
    _keeping: AbortOnDropHandle<()>,
}

impl Engine {
    /// Begins an upload of the client `client`.
    pub(crate) async fn begin_partial(
        &self,
        client: String,
        length: Option<u64>,
        metadata: String,
    ) -> Result<Begun, CatalogError> {
        let limits = &self.limits;
        let new = NewPartial { id: uuid::Uuid::now_v7().simple().to_string(), client, length, metadata };
        let of_tenant = |all, each| if self.by_tenant { most_of_tenant(all, each) } else { all };
        let bounds = PartialLimits {
            all: limits.partial_uploads,
            each: limits.partial_uploads_each,
            tenant: of_tenant(limits.partial_uploads, limits.partial_uploads_each),
            bytes: limits.partial_bytes,
            bytes_each: limits.partial_bytes_each,
            bytes_tenant: of_tenant(limits.partial_bytes, limits.partial_bytes_each),
            largest: limits.upload_bytes,
            keep: limits.partial_keep,
        };
        self.archive.catalog.begin_partial(&new, &bounds).await
    }

    /// Returns an upload as soon as no request holds it, or in its present state if a request holds it for too long;
    /// `None` if there is no such upload.
    pub(crate) async fn settled_partial(&self, id: &str) -> Result<Option<Partial>, CatalogError> {
        let start = Instant::now();
        loop {
            let partial = self.archive.catalog.partial(id).await?;
            if partial.as_ref().is_none_or(|partial| !partial.is_held) || start.elapsed() >= PATIENCE {
                return Ok(partial);
            }
            sleep(LOOK).await;
        }
    }

    /// Reserves an upload, and waits for a while if another request holds it. With `at`, the upload must have received
    /// that many bytes.
    pub(crate) async fn hold_partial(
        self: &Arc<Self>,
        id: &str,
        at: Option<u64>,
    ) -> Result<Result<Holding, Held>, CatalogError> {
        let holder = uuid::Uuid::now_v7().simple().to_string();
        let (lease, start) = (self.limits.partial_lease, Instant::now());
        loop {
            match self.archive.catalog.hold_partial(id, &holder, lease, at).await? {
                Held::Now(partial) => {
                    let keeping = tokio::spawn(keep(Arc::clone(self), partial.id.clone(), holder.clone()));
                    let keeping = AbortOnDropHandle::new(keeping);
                    return Ok(Ok(Holding { engine: Arc::clone(self), holder, partial, _keeping: keeping }));
                }
                Held::Busy if start.elapsed() < PATIENCE => sleep(LOOK).await,
                refused => return Ok(Err(refused)),
            }
        }
    }

    /// Deletes an upload, whoever holds it. Returns false if there is no such upload.
    pub(crate) async fn end_partial(&self, id: &str) -> Result<bool, CatalogError> {
        self.archive.catalog.end_partial(id, GRACE).await
    }
}

async fn keep(engine: Arc<Engine>, id: String, holder: String) {
    let mut beats = interval(engine.limits.partial_lease / 3);
    loop {
        beats.tick().await;
        match engine.archive.catalog.keep_partial(&id, &holder, engine.limits.partial_lease).await {
            Ok(true) => {}
            // The lease is lost: later writes of the request will be refused.
            Ok(false) => return,
            Err(error) => tracing::warn!(upload = id, %error, "the lease of an upload was not extended"),
        }
    }
}

impl Holding {
    /// Stores a part and adds it to the upload. `length` is the size of the whole upload, if the request states it. The
    /// last part of the request (`is_last`) ends the reservation. Returns false if another request holds the upload.
    pub(crate) async fn add(&mut self, staged: &Staged, length: Option<u64>, is_last: bool) -> Result<bool, BlobError> {
        let archive = &self.engine.archive;
        let part = publish_part(archive, staged, &self.partial).await?;
        let (part, keep) = ((&part, staged.bytes()), self.engine.limits.partial_keep);
        let added = archive.catalog.add_part(&self.partial, &self.holder, part, length, keep, is_last).await?;
        let is_added = added.is_some();
        self.partial = added.unwrap_or_else(|| self.partial.clone());
        Ok(is_added)
    }

    /// Ends the reservation of the upload, so that the next request need not wait until it expires.
    pub(crate) async fn release(self) {
        let Self { engine, holder, partial, _keeping: keeping } = self;
        drop(keeping);
        if let Err(error) = engine.archive.catalog.release_partial(&partial.id, &holder).await {
            tracing::warn!(upload = partial.id, %error, "an upload stays reserved until its lease ends");
        }
    }

    /// Streams the bytes of the upload: all its parts in their order, each checked against its digest on the way.
    pub(crate) async fn bytes(&self) -> Result<BoxStream<'static, Result<Bytes, BlobError>>, BlobError> {
        let archive = self.engine.archive.clone();
        let parts = archive.catalog.parts_of(&self.partial.id).await?;
        if parts.iter().map(|(_, bytes)| bytes).sum::<u64>() != self.partial.received {
            return Err(StoreError::NotFound(parts.first().map_or(Digest::of(b""), |(part, _)| part.digest())).into());
        }
        let store = Arc::clone(&archive.store);
        let streams = parts
            .into_iter()
            .map(move |(part, bytes)| Ok::<_, StoreError>(Arc::clone(&store).stream(part, 0..bytes, bytes)));
        let pieces = stream::iter(streams).try_flatten().then(move |piece| {
            let archive = archive.clone();
            async move {
                if piece.as_ref().is_err_and(|error| error.damage().is_some()) {
                    // A store that is away lacks all parts, and will be back with them.
                    archive.belongs().await?;
                }
                Ok(piece?)
            }
        });
        Ok(pieces.boxed())
    }
}
