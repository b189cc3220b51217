//! Queries, bodies and path segments that become problems when they are not understood.

use super::problem::{Kind, Problem};
use super::state::App;
use crate::store::Digest;
use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, FromRequestParts, RawPathParams, Request};
use axum::http::{HeaderMap, header, request::Parts};
use bytes::BytesMut;
use futures::StreamExt;
use serde::de::DeserializeOwned;
use std::sync::Arc;
use tokio::sync::OwnedSemaphorePermit;

/// The query string as `T`.
#[derive(Clone, Debug)]
pub(crate) struct Query<T>(pub(crate) T);

/// The `{id}` or `{digest}` of the path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Id(pub(crate) Digest);

/// The `{id}` of a job in the path.
#[derive(Clone, Debug)]
pub(crate) struct JobId(pub(crate) String);

/// A whole JSON body as bytes, its media type checked; it is parsed where the maths run.
#[derive(Debug)]
pub(crate) struct JsonBytes {
    pub(crate) bytes: Bytes,
    /// Its share of the memory for bodies.
    _share: OwnedSemaphorePermit,
}

/// A whole JSON body that is no batch.
#[derive(Debug)]
pub(crate) struct SmallJson(pub(crate) JsonBytes);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        axum::extract::Query::try_from_uri(&parts.uri)
            .map(|axum::extract::Query(value)| Self(value))
            .map_err(|rejection| Problem::new(Kind::BadQuery, rejection.body_text()))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Id {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let text = segment(parts, state).await?;
        text.parse()
            .map(Self)
            .map_err(|error: crate::store::NotADigest| Problem::new(Kind::NotFound, error.to_string()))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for JobId {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let text = segment(parts, state).await?;
        let id = uuid::Uuid::try_parse(&text).map_err(|_| {
            let shown: String = text.chars().take(80).collect();
            Problem::new(Kind::NotFound, format!("`{shown}` is no job id, expected a UUID"))
        })?;
        Ok(Self(id.to_string()))
    }
}

/// The only parameter of the path.
async fn segment<S: Send + Sync>(parts: &mut Parts, state: &S) -> Result<String, Problem> {
    let params = RawPathParams::from_request_parts(parts, state)
        .await
        .map_err(|rejection| Problem::new(Kind::NotFound, rejection.to_string()))?;
    Ok(params.iter().next().map(|(_, value)| value.to_owned()).unwrap_or_default())
}

/// The size of a JSON body that is no batch.
const SMALL: usize = 512 << 10;

impl FromRequest<App> for JsonBytes {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        read_json(request, app, app.engine.limits.json_bytes).await
    }
}

impl FromRequest<App> for SmallJson {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        read_json(request, app, SMALL.min(app.engine.limits.json_bytes)).await.map(Self)
    }
}

async fn read_json(request: Request, app: &App, limit: usize) -> Result<JsonBytes, Problem> {
    let limits = &app.engine.limits;
    let headers = request.headers();
    let declared = declared_length(headers);
    let checked = check_json(headers).and_then(|()| match declared {
        Some(length) if length > limit as u64 => Err(too_large(limit)),
        _ => Ok(()),
    });
    // Without a declared length the whole limit must be free.
    let share = (declared.unwrap_or(limit as u64).min(limit as u64) / 1024 + 1) as u32;
    let share = checked.and_then(|()| {
        let share = Arc::clone(&app.bodies).try_acquire_many_owned(share);
        share.map_err(|_| Problem::new(Kind::Overloaded, "too many large bodies are under way"))
    });
    let share = match share {
        Ok(share) => share,
        Err(problem) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let mut stream = request.into_body().into_data_stream();
    let mut bytes = BytesMut::new();
    let whole = async {
        loop {
            match tokio::time::timeout(limits.idle, stream.next()).await {
                Ok(None) => return Ok(()),
                Ok(Some(Ok(piece))) if bytes.len() + piece.len() > limit => return Err(too_large(limit)),
                Ok(Some(Ok(piece))) => bytes.extend_from_slice(&piece),
                Ok(Some(Err(_))) => return Err(Problem::new(Kind::BadBody, "the body ended early")),
                Err(_) => return Err(Problem::new(Kind::TooSlow, format!("nothing came for {:?}", limits.idle))),
            }
        }
    };
    let received = tokio::time::timeout(limits.upload_time, whole).await;
    received
        .unwrap_or_else(|_| Err(Problem::new(Kind::TooSlow, format!("a body may take {:?}", limits.upload_time))))?;
    if bytes.is_empty() {
        return Err(Problem::new(Kind::EmptyBody, "expected a JSON object"));
    }
    Ok(JsonBytes { bytes: bytes.freeze(), _share: share })
}

/// A JSON object as `T`: 400 if it is no JSON, 422 if it is not what was expected.
pub(crate) fn parse_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    // serde would fill a struct from an array by position.
    let is_object = bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
    let parsed = if is_object { Some(serde_json::from_slice(bytes)) } else { None };
    if let Some(Ok(value)) = parsed {
        return Ok(value);
    }
    // serde_json's own categories do not tell apart what is no JSON and what is other JSON.
    match (serde_json::from_slice::<serde::de::IgnoredAny>(bytes), parsed) {
        (Err(error), _) => Err(Problem::new(Kind::BadBody, error.to_string())),
        (Ok(_), Some(Err(error))) => Err(Problem::new(Kind::InvalidRequest, error.to_string())),
        (Ok(_), _) => Err(Problem::new(Kind::InvalidRequest, "expected a JSON object")),
    }
}

/// The declared length of a body.
pub(crate) fn declared_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

fn check_json(headers: &HeaderMap) -> Result<(), Problem> {
    if let Some(encoding) = headers.get(header::CONTENT_ENCODING)
        && encoding != "identity"
    {
        return Err(Problem::new(Kind::UnsupportedEncoding, "JSON bodies come without Content-Encoding"));
    }
    let found = headers.get(header::CONTENT_TYPE).map(|value| value.to_str().unwrap_or("?"));
    let essence = found.map(|value| value.split(';').next().unwrap_or_default().trim().to_ascii_lowercase());
    match essence.as_deref() {
        Some("application/json") => Ok(()),
        Some(other) if other.starts_with("application/") && other.ends_with("+json") => Ok(()),
        _ => Err(Problem::new(
            Kind::UnsupportedMediaType,
            format!("found Content-Type {}, expected application/json", found.unwrap_or("none")),
        )),
    }
}

fn too_large(limit: usize) -> Problem {
    Problem::new(Kind::TooLarge, format!("a JSON body may have {limit} bytes"))
}

/// Takes what is left of a request that was refused: most clients read the answer only after they have sent a good part
/// of their body.
pub(crate) async fn linger(request: Request) {
    // Who asks before sending hears the answer without.
    if !request.headers().contains_key(header::EXPECT) {
        linger_body(request.into_body()).await;
    }
}

/// Takes what is left of a body.
pub(crate) async fn linger_body(body: Body) {
    let mut left: usize = 32 << 20;
    let mut stream = body.into_data_stream();
    let drain = async {
        while let Some(Ok(piece)) = stream.next().await {
            left = left.saturating_sub(piece.len());
            if left == 0 {
                return;
            }
        }
    };
    // However it goes, the answer follows.
    let _ = tokio::time::timeout(std::time::Duration::from_secs(2), drain).await;
}
