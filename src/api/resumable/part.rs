//! Bytes of one request that become parts of a resumable upload, also those of a request that breaks.

use super::checksum::Checksum;
use super::refusals::{absent, expired, locked};
use crate::api::caller::Caller;
use crate::api::expiring::ended;
use crate::api::extract::linger_body;
use crate::api::pace::Pace;
use crate::api::problem::{Kind, Problem};
use crate::api::state::App;
use crate::catalog::{Held, Partial};
use crate::jobs::{BlobError, Holding};
use crate::store::{Staged, StagedWriter, StoreError};
use axum::body::{Body, BodyDataStream, Bytes};
use bytes::BytesMut;
use futures::StreamExt;
use tokio::time::{Instant, timeout_at};

/// Number of bytes of a part of an upload that are hashed and written to disk at a time.
const PIECE: usize = 1 << 20;

/// Number of bytes at which a part of a long request is kept and the next one begins. With the piece that fills it, a
/// part stays below 16 MiB, up to which the store writes an object in one request. Raising it makes fewer objects, but
/// a killed process loses more of what it has received.
const PART: u64 = 15 << 20;

/// Statements of a request about the bytes that it sends.
#[derive(Clone)]
pub(super) struct Asked {
    /// Number of bytes that the upload has received before this request, according to the request.
    pub(super) offset: u64,
    /// Size of the whole upload, if the request states it.
    pub(super) length: Option<u64>,
    /// Number of bytes that the request sends, if it states it.
    pub(super) declared: Option<u64>,
    /// Checksum of the bytes that the request sends.
    pub(super) checksum: Option<Checksum>,
    /// True if the request begins the upload. The client then learns the upload's id only from the answer.
    pub(super) begins: bool,
}

/// Adds the body of the request that begins an upload. If that fails, or the client leaves before the body has ended,
/// nobody can continue the upload, so it is deleted.
pub(super) async fn begin(app: &App, caller: Caller, id: String, asked: Asked, body: Body) -> Result<Partial, Problem> {
    let writing = app.writing.clone();
    let app = app.clone();
    let work = writing.spawn(async move {
        let appended = append(&app, caller, id.clone(), asked, body).await;
        if appended.is_err()
            && let Err(error) = app.engine.end_partial(&id).await
        {
            tracing::warn!(upload = id, %error, "an upload that failed at its beginning was not deleted; it stays until it expires");
        }
        appended
    });
    work.await.unwrap_or_else(|error| Err(Problem::internal(&error)))
}

/// Adds the body of a request to an upload and returns the upload afterwards. The work goes on if the client leaves, so
/// that the bytes which arrived are kept, and the service does not end before it. It ends with the rights of the
/// caller.
pub(super) async fn append(
    app: &App,
    caller: Caller,
    id: String,
    asked: Asked,
    body: Body,
) -> Result<Partial, Problem> {
    let (writing, client) = (app.writing.clone(), caller.client());
    let app = app.clone();
    let work = writing.spawn(client.clone().on_behalf(async move {
        let place = match app.held.uploads.take(client, 1) {
            Ok(place) => place,
            Err(full) => {
                linger_body(body).await;
                return Err(full.into());
            }
        };
        let appended = tokio::select! {
            appended = held(&app, &id, &asked, body) => appended,
            problem = ended(&app, caller.watched()) => Err(problem),
        };
        drop(place);
        appended
    }));
    work.await.unwrap_or_else(|error| Err(Problem::internal(&error)))
}

async fn held(app: &App, id: &str, asked: &Asked, body: Body) -> Result<Partial, Problem> {
    let mut holding =
        match app.engine.hold_partial(id, Some(asked.offset)).await.map_err(Problem::from).and_then(|held| {
            held.map_err(|refused| match refused {
                Held::Absent => absent(id),
                Held::Expired => expired(id),
                Held::Elsewhere(partial) => {
                    let detail = format!("Upload-Offset: found {}, expected {}", asked.offset, partial.received);
                    Problem::new(Kind::WrongOffset, detail)
                }
                Held::Busy | Held::Now(_) => locked(id),
            })
        }) {
            Ok(holding) => holding,
            Err(problem) => {
                linger_body(body).await;
                return Err(problem);
            }
        };
    let received = received(app, &mut holding, asked, body).await;
    let partial = holding.partial.clone();
    if partial.is_held {
        holding.release().await;
    }
    received.map(|()| partial)
}

/// Receives the body of a request and adds it to the upload part by part, so that what a part holds is kept whatever
/// becomes of the rest. A body with a checksum is one part, because a wrong one is discarded whole.
async fn received(app: &App, holding: &mut Holding, asked: &Asked, body: Body) -> Result<(), Problem> {
    let limits = &app.engine.limits;
    let left = match room(app, &holding.partial, asked) {
        Ok(left) => left,
        Err(problem) => {
            linger_body(body).await;
            return Err(problem);
        }
    };
    let mut states_length = holding.partial.length.is_none() && asked.length.is_some();
    let mut incoming = Incoming::new(app, body, left, asked);
    loop {
        // The last part that the upload may have takes all that is left.
        let is_whole = asked.checksum.is_some() || holding.partial.parts + 1 >= limits.partial_parts;
        let (staged, end) = incoming.part(if is_whole { u64::MAX } else { PART }).await?;
        if let Some(checksum) = incoming.checksum.take() {
            // A body that broke cannot have the checksum of the whole one.
            if let Some(End::Broken(problem)) = end {
                return Err(problem);
            }
            if !checksum.matches() {
                let detail =
                    "the bytes do not have the checksum of Upload-Checksum; they were discarded, send them again";
                return Err(Problem::new(Kind::ChecksumMismatch, detail));
            }
        }
        if staged.bytes() > 0 || (states_length && matches!(end, Some(End::Whole))) {
            if !holding.add(&staged, asked.length, end.is_some()).await? {
                return Err(locked(&holding.partial.id));
            }
            states_length = false;
        }
        match end {
            None => {}
            Some(End::Whole) => return Ok(()),
            Some(End::Broken(problem)) => return Err(problem),
            // The client has no address yet at which it could continue: the answer tells it, and how much was kept.
            Some(End::Stopped) if asked.begins && holding.partial.received > 0 => return Ok(()),
            Some(End::Stopped) => {
                let detail =
                    "the service stops; the bytes that arrived were kept: ask with HEAD for their number, and go on";
                return Err(Problem::new(Kind::Unavailable, detail));
            }
        }
    }
}

/// Returns the number of bytes that the upload still lacks, if the request may add its bytes.
fn room(app: &App, partial: &Partial, asked: &Asked) -> Result<u64, Problem> {
    let limits = &app.engine.limits;
    let length = match (partial.length, asked.length) {
        (Some(known), Some(stated)) if known != stated => {
            let detail = format!("Upload-Length: found {stated}, expected {known} as before");
            return Err(Problem::new(Kind::BadHeader, detail));
        }
        (known, stated) => known.or(stated).unwrap_or(limits.upload_bytes),
    };
    if length > limits.upload_bytes {
        let detail = format!("an upload of {length} bytes, expected at most {}", limits.upload_bytes);
        return Err(Problem::new(Kind::TooLarge, detail));
    }
    let left = length.saturating_sub(partial.received);
    if asked.declared.is_some_and(|declared| declared > left) || length < partial.received {
        return Err(too_much(left));
    }
    if partial.parts >= limits.partial_parts {
        let detail =
            format!("the upload has {} parts, the most allowed; begin another one with larger parts", partial.parts);
        return Err(Problem::new(Kind::OverLimit, detail));
    }
    Ok(left)
}

/// Way in which the body of a request ended.
enum End {
    /// The client has sent the whole body.
    Whole,
    /// The client has left, or is too slow.
    Broken(Problem),
    /// The service stops.
    Stopped,
}

/// Body of a request that is being received.
struct Incoming<'a> {
    app: &'a App,
    stream: BodyDataStream,
    pace: Pace,
    deadline: Instant,
    /// Number of bytes that the upload lacks when this request begins.
    left: u64,
    /// Number of bytes that this request has brought.
    total: u64,
    checksum: Option<Checksum>,
    /// Words for the client about the bytes that arrived before its body broke.
    fate: &'static str,
}

impl<'a> Incoming<'a> {
    fn new(app: &'a App, body: Body, left: u64, asked: &Asked) -> Self {
        let limits = &app.engine.limits;
        Self {
            app,
            stream: body.into_data_stream(),
            pace: Pace::new(limits),
            deadline: Instant::now() + limits.upload_time,
            left,
            total: 0,
            checksum: asked.checksum.clone(),
            fate: if asked.begins { "begin the upload again" } else { "the bytes that arrived were kept" },
        }
    }

    /// Writes the next part of the body, up to the piece with which it has `most` bytes, to a temporary file. Returns
    /// the end of the body, too, if this part is the last one.
    async fn part(&mut self, most: u64) -> Result<(Staged, Option<End>), Problem> {
        self.app.engine.archive.takes_upload(0).await.map_err(BlobError::from)?;
        let staging = self.app.engine.archive.staging.clone();
        let mut writer = blocking(move || staging.begin()).await?;
        let (mut buffer, before) = (BytesMut::new(), self.total);
        loop {
            let end = match self.next().await {
                Ok(piece) => {
                    self.total += piece.len() as u64;
                    if self.total > self.left {
                        let rest = std::mem::replace(&mut self.stream, Body::empty().into_data_stream());
                        linger_body(Body::from_stream(rest)).await;
                        return Err(too_much(self.left));
                    }
                    if let Some(checksum) = &mut self.checksum {
                        checksum.update(&piece);
                    }
                    buffer.extend_from_slice(&piece);
                    None
                }
                Err(end) => Some(end),
            };
            let is_last = end.is_some() || self.total - before >= most;
            if is_last || buffer.len() >= PIECE {
                writer = write(writer, buffer.split().freeze()).await?;
            }
            if is_last {
                return Ok((blocking(move || writer.finish()).await?, end));
            }
        }
    }

    /// Waits for the next piece of the body, or its end. When the service stops, a body ends here, but for one with a
    /// checksum, of which nothing could be kept.
    async fn next(&mut self) -> Result<Bytes, End> {
        let size = |piece: &Result<Bytes, axum::Error>| piece.as_ref().map_or(0, Bytes::len);
        let piece = tokio::select! {
            biased;
            () = self.app.stop.cancelled(), if self.checksum.is_none() => return Err(End::Stopped),
            piece = timeout_at(self.deadline, self.pace.next(self.stream.next(), size)) => piece,
        };
        let broken = match piece {
            Ok(Ok(Some(Ok(piece)))) => return Ok(piece),
            Ok(Ok(None)) => return Err(End::Whole),
            Ok(Ok(Some(Err(_)))) => Problem::new(Kind::BadBody, format!("the body ended early; {}", self.fate)),
            Ok(Err(slow)) => slow.into(),
            Err(_) => {
                let most = self.app.engine.limits.upload_time;
                Problem::new(Kind::TooSlow, format!("the request took longer than {most:?}; {}", self.fate))
            }
        };
        Err(End::Broken(broken))
    }
}

async fn write(mut writer: StagedWriter, piece: Bytes) -> Result<StagedWriter, StoreError> {
    blocking(move || {
        writer.write(&piece)?;
        Ok(writer)
    })
    .await
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, StoreError> + Send + 'static,
) -> Result<T, StoreError> {
    tokio::task::spawn_blocking(work).await.map_err(std::io::Error::other)?
}

fn too_much(left: u64) -> Problem {
    let detail = format!("found more bytes than the {left} that the upload lacked; ask with HEAD how many were kept");
    Problem::new(Kind::TooLarge, detail)
}
