//! From an uploaded body to a staged file: streamed, decoded and hashed in bounded memory, within size, ratio and time.

use super::caller::client;
use super::extract::{declared_length, linger, linger_body};
use super::form::{ENVELOPE, Form};
use super::pace::{Pace, Slow};
use super::problem::{Kind, Problem};
use super::state::App;
use super::zstd::ZstdReader;
use crate::jobs::{BlobError, Client, Limits};
use crate::store::{Staged, StagedWriter, StoreError};
use async_compression::tokio::bufread::GzipDecoder;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode, header};
use futures::{Stream, StreamExt};
use std::io;
use std::pin::Pin;
use std::sync::atomic::{AtomicU64, Ordering};
use tokio::io::{AsyncRead, AsyncReadExt};
use tokio_util::io::StreamReader;

/// Number of bytes of an upload that are hashed and written to disk at a time.
const PIECE: usize = 1 << 20;

/// Number of bytes of a form that are searched for the end of the file at a time. Raising it costs memory.
const PIECE_OF_FORM: usize = 64 << 10;

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

/// Uploaded body in a temporary file.
#[derive(Debug)]
pub(crate) struct Received {
    /// Bytes of the body, or of the file in a form.
    pub(crate) staged: Staged,
    /// Name of the file in a form; `None` for any other body.
    pub(crate) file_name: Option<String>,
    /// Line breaks of the body, for the answer if it cannot be read.
    pub(crate) lines: Lines,
}

/// Line breaks of a body, which `curl --data @FILE` removes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lines {
    first: Option<u8>,
    is_binary: bool,
    /// True if the body has line breaks, or was not sent as `curl --data` sends it.
    has_breaks: bool,
}

impl Lines {
    /// Line breaks of a body that was not sent as `curl --data` sends it.
    pub(crate) const KEPT: Self = Self { first: None, is_binary: false, has_breaks: true };

    const ADVICE: &str =
        "the body has no line break, as `curl --data @FILE` sends a file: use `curl --data-binary @FILE`";

    fn see(&mut self, bytes: &[u8]) {
        if !self.has_breaks {
            self.first = self.first.or(bytes.first().copied());
            self.has_breaks = bytes.iter().any(|byte| matches!(byte, b'\n' | b'\r'));
            self.is_binary |= bytes.iter().any(|byte| *byte < b' ' && *byte != b'\t');
        }
    }

    /// Refuses a text without line breaks, unless it is JSON or XML, which need none.
    fn check(self) -> Result<(), Problem> {
        if self.has_breaks || self.is_binary || matches!(self.first, None | Some(b'{' | b'<')) {
            return Ok(());
        }
        let detail =
            format!("{}; if it has one line alone, name its type: -H 'content-type: text/plain'", Self::ADVICE);
        Err(Problem::new(Kind::BadBody, detail))
    }

    /// Returns the problem of a body that cannot be read: without its line breaks, that is probably why.
    pub(crate) fn explain(self, problem: Problem) -> Problem {
        let body = problem.body();
        if self.has_breaks || body.status != StatusCode::UNPROCESSABLE_ENTITY.as_u16() {
            return problem;
        }
        Problem::new(Kind::BadBody, format!("{}; as it is: {}", Self::ADVICE, body.detail))
    }
}

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
    let staged = async { Ok(stage(app, coding, None, bytes.as_mut()).await?.staged) };
    tokio::time::timeout(limits.upload_time, staged).await.unwrap_or_else(|_| {
        Err(Problem::new(
            Kind::Unavailable,
            format!("the parts of the upload were not read from the store within {:?}", limits.upload_time),
        ))
    })
}

/// Streams an uploaded body, or the file in an uploaded form, into a staging file.
pub(crate) async fn receive(app: &App, request: Request) -> Result<Received, Problem> {
    let limits = &app.engine.limits;
    let client = client(request.extensions());
    let admitted = coding(request.headers()).and_then(|coding| {
        let form = Form::of(request.headers()).map_err(bad_form)?;
        if declared_length(request.headers()).is_some_and(|length| length > most(limits, form.as_ref())) {
            return Err(too_large(limits));
        }
        Ok((coding, form, app.held.uploads.take(client, 1)?))
    });
    let (coding, form, _place) = match (admitted, lacks_room(app, declared_length(request.headers())).await) {
        (Ok(admitted), Ok(())) => admitted,
        (Err(problem), _) | (_, Err(problem)) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let is_url_encoded = is_url_encoded(request.headers());
    let stream = request.into_body().into_data_stream();
    let mut body = Box::pin(stream.map(|piece| piece.map_err(|_| io::Error::other(Cut::Broken))));
    let received = tokio::time::timeout(limits.upload_time, stage(app, coding, form, body.as_mut())).await;
    let received = received.unwrap_or_else(|_| {
        Err(Problem::new(Kind::TooSlow, format!("the upload took longer than {:?}", limits.upload_time)))
    });
    match received {
        Ok(received) if is_url_encoded => received.lines.check().map(|()| received),
        Ok(received) => Ok(Received { lines: Lines::KEPT, ..received }),
        Err(problem) => {
            linger_body(Body::from_stream(body)).await;
            Err(problem)
        }
    }
}

/// Returns the upper bound on the bytes of an uploaded body.
fn most(limits: &Limits, form: Option<&Form>) -> u64 {
    limits.upload_bytes.saturating_add(form.map_or(0, |_| ENVELOPE))
}

/// Returns true for the media type with which `curl --data` and `curl --data-binary` send a file.
fn is_url_encoded(headers: &HeaderMap) -> bool {
    let stated = headers.get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let essence = stated.map(|text| text.split(';').next().unwrap_or_default().trim());
    essence.is_some_and(|essence| essence.eq_ignore_ascii_case("application/x-www-form-urlencoded"))
}

fn bad_form(reason: String) -> Problem {
    Problem::new(Kind::BadBody, reason)
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
    mut form: Option<Form>,
    body: Pin<&mut (impl Stream<Item = io::Result<axum::body::Bytes>> + Send + ?Sized)>,
) -> Result<Received, Problem> {
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
    let mut envelope = Vec::new();
    let (mut total, mut kept, mut lines) = (0_u64, 0_u64, Lines::default());
    loop {
        let before = piece.len();
        let mut into = &mut piece;
        if form.is_some() {
            envelope.clear();
            envelope.reserve(PIECE_OF_FORM);
            into = &mut envelope;
        }
        let read = decoded.read_buf(into).await.map_err(|error| broken(&error, coding))?;
        if let Some(form) = &mut form {
            form.read(&envelope, &mut piece).map_err(bad_form)?;
        }
        total += read as u64;
        kept += (piece.len() - before) as u64;
        if kept > limits.upload_bytes || total > most(limits, form.as_ref()) {
            return Err(too_large(limits));
        }
        lines.see(&piece[before..]);
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
    let file_name = form.map(Form::end).transpose().map_err(bad_form)?;
    if kept == 0 {
        return Err(Problem::new(Kind::EmptyBody, "the body has no bytes, expected those of a file"));
    }
    Ok(Received { staged: blocking(move || writer.finish()).await?, file_name, lines })
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
