//! Queries, bodies and path segments that become problems when they are not understood.

use super::problem::{Kind, Problem};
use super::state::App;
use crate::store::Digest;
use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, FromRequestParts, RawPathParams, Request};
use axum::http::{HeaderMap, header, request::Parts};
use serde::de::DeserializeOwned;

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
#[derive(Clone, Debug)]
pub(crate) struct JsonBytes(pub(crate) Bytes);

/// A JSON body as `T`.
#[derive(Clone, Debug)]
pub(crate) struct Json<T>(pub(crate) T);

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

impl FromRequest<App> for JsonBytes {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        check_json(request.headers())?;
        let limits = &app.engine.limits;
        let limit = limits.json_bytes;
        if declared_length(request.headers()).is_some_and(|length| length > limit as u64) {
            return Err(too_large(limit));
        }
        let whole = axum::body::to_bytes(request.into_body(), limit);
        match tokio::time::timeout(limits.idle, whole).await {
            Ok(Ok(bytes)) if bytes.is_empty() => Err(Problem::new(Kind::EmptyBody, "expected a JSON object")),
            Ok(Ok(bytes)) => Ok(Self(bytes)),
            Ok(Err(error)) if is_limit(&error) => Err(too_large(limit)),
            Ok(Err(_)) => Err(Problem::new(Kind::BadBody, "the body ended early")),
            Err(_) => Err(Problem::new(Kind::TooSlow, format!("expected the whole body within {:?}", limits.idle))),
        }
    }
}

impl<T: DeserializeOwned> FromRequest<App> for Json<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, app: &App) -> Result<Self, Problem> {
        let JsonBytes(bytes) = JsonBytes::from_request(request, app).await?;
        parse_json(&bytes).map(Self)
    }
}

/// JSON as `T`: 400 if it is no JSON, 422 if it is not what was expected.
pub(crate) fn parse_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    serde_json::from_slice(bytes).map_err(|error| {
        let kind = if error.is_data() { Kind::InvalidRequest } else { Kind::BadBody };
        Problem::new(kind, error.to_string())
    })
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

fn is_limit(error: &axum::Error) -> bool {
    std::error::Error::source(error).is_some_and(|source| source.to_string().contains("length limit"))
}

/// What is left of a body that was refused: most clients read the answer only after they have sent a good part of it.
pub(crate) async fn linger(body: Body) {
    use futures::StreamExt;
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
