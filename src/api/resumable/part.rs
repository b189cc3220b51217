//! Bytes of one request that become a part of a resumable upload, also those of a request that breaks.

use super::checksum::Checksum;
use super::refusals::{absent, expired, locked};
use crate::api::extract::linger_body;
use crate::api::pace::Pace;
use crate::api::problem::{Kind, Problem};
use crate::api::state::App;
use crate::catalog::{Held, Partial};
use crate::jobs::{Client, Holding};
use crate::store::{Staged, StagedWriter, StoreError};
use axum::body::{Body, Bytes};
use bytes::BytesMut;
use futures::StreamExt;
use tokio::time::{Instant, timeout_at};

/// Number of bytes of a part of an upload that are hashed and written to disk at a time.
const PIECE: usize = 1 << 20;

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
pub(super) async fn begin(app: &App, client: Client, id: String, asked: Asked, body: Body) -> Result<Partial, Problem> {
    let app = app.clone();
    let work = tokio::spawn(async move {
        let appended = append(&app, client, id.clone(), asked, body).await;
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
/// that the bytes which arrived are kept.
pub(super) async fn append(
    app: &App,
    client: Client,
    id: String,
    asked: Asked,
    body: Body,
) -> Result<Partial, Problem> {
    let app = app.clone();
    let work = tokio::spawn(client.clone().on_behalf(async move {
        let place = match app.held.uploads.take(client, 1) {
            Ok(place) => place,
            Err(full) => {
                linger_body(body).await;
                return Err(full.into());
            }
        };
        let appended = held(&app, &id, asked, body).await;
        drop(place);
        appended
    }));
    work.await.unwrap_or_else(|error| Err(Problem::internal(&error)))
}

async fn held(app: &App, id: &str, asked: Asked, body: Body) -> Result<Partial, Problem> {
    let holding = match app.engine.hold_partial(id, Some(asked.offset)).await.map_err(Problem::from).and_then(|held| {
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
    let (kept, problem) = match received(app, &holding, asked, body).await {
        Ok(Some(received)) => received,
        Ok(None) => {
            let partial = holding.partial.clone();
            holding.release().await;
            return Ok(partial);
        }
        Err(problem) => {
            holding.release().await;
            return Err(problem);
        }
    };
    let added = holding.add(&kept.0, kept.1).await;
    match added {
        Ok(Some(partial)) => problem.map_or(Ok(partial), Err),
        Ok(None) => Err(locked(id)),
        Err(error) => {
            holding.release().await;
            Err(error.into())
        }
    }
}

/// Part of an upload in a staging file, the size of the whole upload if the request stated it, and the reason if the
/// body broke off after the part.
type Received = ((Staged, Option<u64>), Option<Problem>);

/// Receives the body of a request. Returns `None` for a body without bytes.
async fn received(app: &App, holding: &Holding, asked: Asked, body: Body) -> Result<Option<Received>, Problem> {
    let partial = &holding.partial;
    let limits = &app.engine.limits;
    let checked = || {
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
            let detail = format!(
                "the upload has {} parts, the most allowed; begin another one with larger parts",
                partial.parts
            );
            return Err(Problem::new(Kind::OverLimit, detail));
        }
        Ok(left)
    };
    let left = match checked() {
        Ok(left) => left,
        Err(problem) => {
            linger_body(body).await;
            return Err(problem);
        }
    };
    let states_length = partial.length.is_none() && asked.length.is_some();
    let (staged, checksum, problem) = stage(app, body, left, &asked).await?;
    if let Some(checksum) = checksum {
        // A body that broke cannot have the checksum of the whole one.
        if let Some(problem) = problem {
            return Err(problem);
        }
        if !checksum.matches() {
            let detail = "the bytes do not have the checksum of Upload-Checksum; they were discarded, send them again";
            return Err(Problem::new(Kind::ChecksumMismatch, detail));
        }
    }
    match (staged.bytes(), problem) {
        (0, Some(problem)) => Err(problem),
        (0, None) if !states_length => Ok(None),
        (_, problem) => Ok(Some(((staged, asked.length), problem))),
    }
}

/// Writes a body of at most `left` bytes to a temporary file. A body that breaks or is too slow is cut there, and the
/// reason is returned.
async fn stage(
    app: &App,
    body: Body,
    left: u64,
    asked: &Asked,
) -> Result<(Staged, Option<Checksum>, Option<Problem>), Problem> {
    let limits = &app.engine.limits;
    let fate = if asked.begins { "begin the upload again" } else { "the bytes that arrived were kept" };
    let mut checksum = asked.checksum.clone();
    let deadline = Instant::now() + limits.upload_time;
    let staging = app.engine.archive.staging.clone();
    let mut writer = blocking(move || staging.begin()).await?;
    let (mut stream, mut pace) = (body.into_data_stream(), Pace::new(limits));
    let size = |piece: &Result<Bytes, axum::Error>| piece.as_ref().map_or(0, Bytes::len);
    let (mut buffer, mut total, mut problem) = (BytesMut::new(), 0_u64, None);
    loop {
        let piece = match timeout_at(deadline, pace.next(stream.next(), size)).await {
            Ok(Ok(Some(Ok(piece)))) => Some(piece),
            Ok(Ok(None)) => None,
            Ok(Ok(Some(Err(_)))) => {
                problem = Some(Problem::new(Kind::BadBody, format!("the body ended early; {fate}")));
                None
            }
            Ok(Err(slow)) => {
                problem = Some(slow.into());
                None
            }
            Err(_) => {
                let detail = format!("the request took longer than {:?}; {fate}", limits.upload_time);
                problem = Some(Problem::new(Kind::TooSlow, detail));
                None
            }
        };
        let is_last = piece.is_none();
        if let Some(piece) = piece {
            total += piece.len() as u64;
            if total > left {
                linger_body(Body::from_stream(stream)).await;
                return Err(too_much(left));
            }
            if let Some(checksum) = &mut checksum {
                checksum.update(&piece);
            }
            buffer.extend_from_slice(&piece);
        }
        if is_last || buffer.len() >= PIECE {
            let piece = buffer.split().freeze();
            writer = write(writer, piece).await?;
        }
        if is_last {
            return Ok((blocking(move || writer.finish()).await?, checksum, problem));
        }
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
    Problem::new(Kind::TooLarge, format!("found more bytes than the {left} that the upload still lacks; none was kept"))
}
