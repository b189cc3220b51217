//! From an uploaded body to a staged file: streamed, decoded and hashed in bounded memory, within size, ratio and time.

use super::caller::client;
use super::extract::{declared_length, linger, linger_body};
use super::pace::{Pace, Slow};
use super::problem::{Kind, Problem};
use super::state::App;
use super::zstd::ZstdReader;
use crate::jobs::{BlobError, Client, Limits};
use crate::store::{Staged, StagedWriter, StoreError};
use async_compression::tokio::bufread::GzipDecoder;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use futures::{Stream, StreamExt};
use std::io;
use std::pin::Pin;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::io::{AsyncRead, AsyncReadExt};
use tokio_util::io::StreamReader;

/// Number of bytes of an upload that are hashed and written to disk at a time.
const PIECE: usize = 1 << 20;

/// Number of decoded bytes of an upload that are exempt from the limit on the compression ratio: a small file may well
/// be all zeros.
const FREE: u64 = 1 << 20;

/// Content coding (compression) of an uploaded body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Coding {
    Identity,
    Gzip,
    Zstd,
}

/// Reason for which an uploaded body ended early; carried through the decompressors inside an I/O error.
#[derive(Clone, Copy, Debug, thiserror::Error)]
enum Cut {
    #[error("the connection ended inside the uploaded body")]
    Broken,
    #[error(transparent)]
    Slow(Slow),
}

/// Reason for which the bytes of a resumable upload ended early: a part cannot be read from the store. Holds the kind
/// of the answer.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("a part of the upload cannot be read from the store")]
pub(crate) struct Lost(pub(crate) Kind);

/// Streams the bytes of a resumable upload, which `headers` describe, into a staging file.
pub(crate) async fn receive_stream(
    app: &App,
    client: Client,
    headers: &HeaderMap,
    mut bytes: Pin<Box<dyn Stream<Item = io::Result<axum::body::Bytes>> + Send>>,
) -> Result<Staged, Problem> {
    let coding = coding(headers)?;
    let _place = app.held.uploads.take(client, 1)?;
    let limits = &app.engine.limits;
    let received = tokio::time::timeout(limits.upload_time, stage(app, coding, bytes.as_mut())).await;
    received.unwrap_or_else(|_| {
        Err(Problem::new(
            Kind::Unavailable,
            format!("the parts of the upload were not read from the store within {:?}", limits.upload_time),
        ))
    })
}

/// Streams an uploaded body into a staging file.
pub(crate) async fn receive(app: &App, request: Request) -> Result<Staged, Problem> {
    let limits = &app.engine.limits;
    let client = client(request.extensions());
    let admitted = coding(request.headers()).and_then(|coding| {
        if declared_length(request.headers()).is_some_and(|length| length > limits.upload_bytes) {
            return Err(too_large(limits));
        }
        Ok((coding, app.held.uploads.take(client, 1)?))
    });
    let (coding, _place) = match (admitted, lacks_room(app, declared_length(request.headers())).await) {
        (Ok(admitted), Ok(())) => admitted,
        (Err(problem), _) | (_, Err(problem)) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let stream = request.into_body().into_data_stream();
    let mut body = Box::pin(stream.map(|piece| piece.map_err(|_| io::Error::other(Cut::Broken))));
    let received = tokio::time::timeout(limits.upload_time, stage(app, coding, body.as_mut())).await;
    let received = received.unwrap_or_else(|_| {
        Err(Problem::new(Kind::TooSlow, format!("the upload took longer than {:?}", limits.upload_time)))
    });
    if received.is_err() {
        linger_body(Body::from_stream(body)).await;
    }
    received
}

/// Refuses an upload of this size that the disks or the limits of the tenant do not allow, before its bytes are
/// received.
pub(crate) async fn lacks_room(app: &App, bytes: Option<u64>) -> Result<(), Problem> {
    app.engine.archive.takes_upload(bytes.unwrap_or(0)).await.map_err(BlobError::from)?;
    let Some(bytes) = bytes else { return Ok(()) };
    let over = app.engine.archive.catalog.lacks_room(bytes, 0).await?;
    over.map_or(Ok(()), |over| Err(over.into()))
}

async fn stage(
    app: &App,
    coding: Coding,
    body: Pin<&mut (impl Stream<Item = io::Result<axum::body::Bytes>> + Send + ?Sized)>,
) -> Result<Staged, Problem> {
    let limits = &app.engine.limits;
    let encoded = AtomicU64::new(0);
    let pieces = futures::stream::unfold((body, Pace::new(limits)), |(mut body, mut pace)| {
        let encoded = &encoded;
        async move {
            let size = |piece: &io::Result<axum::body::Bytes>| piece.as_ref().map_or(0, axum::body::Bytes::len);
            let piece = match pace.next(body.next(), size).await {
                Ok(None) => return None,
                Ok(Some(piece)) => piece,
                Err(slow) => Err(io::Error::other(Cut::Slow(slow))),
            };
            if let Ok(piece) = &piece {
                encoded.fetch_add(piece.len() as u64, Ordering::Relaxed);
            }
            Some((piece, (body, pace)))
        }
    });
    let reader = StreamReader::new(Box::pin(pieces));
    let mut decoded: Pin<Box<dyn AsyncRead + Send + '_>> = match coding {
        Coding::Identity => Box::pin(reader),
        Coding::Gzip => {
            let mut decoder = GzipDecoder::new(reader);
            decoder.multiple_members(true);
            Box::pin(decoder)
        }
        Coding::Zstd => Box::pin(ZstdReader::new(reader)),
    };
    let staging = app.engine.archive.staging.clone();
    let mut writer = blocking(move || staging.begin()).await?;
    let mut piece = Vec::with_capacity(PIECE);
    let mut total: u64 = 0;
    loop {
        let read = decoded.read_buf(&mut piece).await.map_err(|error| broken(&error, coding))?;
        total += read as u64;
        if total > limits.upload_bytes {
            return Err(too_large(limits));
        }
        let ratio = limits.upload_ratio.saturating_mul(encoded.load(Ordering::Relaxed));
        if coding != Coding::Identity && total > FREE.saturating_add(ratio) {
            let detail = format!("more than {} bytes from each encoded one", limits.upload_ratio);
            return Err(Problem::new(Kind::DecompressionRatio, detail));
        }
        if read == 0 || piece.len() >= PIECE {
            (writer, piece) = write(writer, piece).await?;
            piece.clear();
        }
        if read == 0 {
            break;
        }
    }
    if total == 0 {
        return Err(Problem::new(Kind::EmptyBody, "the body has no bytes, expected those of a file"));
    }
    Ok(blocking(move || writer.finish()).await?)
}

async fn write(mut writer: StagedWriter, piece: Vec<u8>) -> Result<(StagedWriter, Vec<u8>), Problem> {
    Ok(blocking(move || {
        writer.write(&piece)?;
        Ok((writer, piece))
    })
    .await?)
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, StoreError> + Send + 'static,
) -> Result<T, StoreError> {
    tokio::task::spawn_blocking(work).await.map_err(io::Error::other)?
}

fn coding(headers: &HeaderMap) -> Result<Coding, Problem> {
    let mut named = Vec::new();
    for value in headers.get_all(header::CONTENT_ENCODING) {
        let text = value.to_str().unwrap_or("?");
        named.extend(text.split(',').map(|name| name.trim().to_ascii_lowercase()).filter(|name| !name.is_empty()));
    }
    named.retain(|name| name != "identity");
    match named.as_slice() {
        [] => Ok(Coding::Identity),
        [name] if name == "gzip" || name == "x-gzip" => Ok(Coding::Gzip),
        [name] if name == "zstd" => Ok(Coding::Zstd),
        _ => {
            let shown: String = named.join(", ").chars().take(80).collect();
            let detail = format!("found Content-Encoding {shown}, expected one of gzip, zstd, identity");
            Err(Problem::new(Kind::UnsupportedEncoding, detail).with(header::ACCEPT_ENCODING, "gzip, zstd, identity"))
        }
    }
}

fn broken(error: &io::Error, coding: Coding) -> Problem {
    if let Some(Lost(kind)) = error.get_ref().and_then(|inner| inner.downcast_ref()) {
        return Problem::new(
            *kind,
            "the upload cannot be read from the store; repeat this request, or begin another upload",
        );
    }
    match error.get_ref().and_then(|inner| inner.downcast_ref::<Cut>()) {
        Some(Cut::Broken) => Problem::new(Kind::BadBody, "the body ended early"),
        Some(Cut::Slow(slow)) => (*slow).into(),
        None if coding == Coding::Identity => Problem::new(Kind::BadBody, "the body ended early"),
        None if error.kind() == io::ErrorKind::UnexpectedEof => {
            Problem::new(Kind::BadBody, "the compressed body ended early")
        }
        None => Problem::new(Kind::BadBody, format!("the body is not what its Content-Encoding says: {error}")),
    }
}

fn too_large(limits: &Limits) -> Problem {
    Problem::new(
        Kind::TooLarge,
        format!("the upload is too large: it may have {} bytes after decoding", limits.upload_bytes),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn one_known_coding_is_taken() {
        let coded = |text: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static(text));
            coding(&headers)
        };
        assert_eq!(coding(&HeaderMap::new()).unwrap(), Coding::Identity);
        assert_eq!(coded("GZIP").unwrap(), Coding::Gzip);
        assert_eq!(coded("identity, zstd").unwrap(), Coding::Zstd);
        for other in ["br", "gzip, gzip", "deflate", "?"] {
            assert!(coded(other).is_err(), "{other}");
        }
    }
}
