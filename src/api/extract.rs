//! Extractors of queries, bodies and path segments, whose errors become problems.

use super::caller::client;
use super::pace::Pace;
use super::places::{KIB, Place};
use super::problem::{Kind, Problem};
use super::state::{App, Service};
use super::words::percent_decoded;
use crate::store::Digest;
use crate::trust::{KeyId, NotAKeyId};
use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, FromRequestParts, RawPathParams, Request};
use axum::http::{HeaderMap, header, request::Parts};
use bytes::BytesMut;
use futures::StreamExt;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::time::Duration;

/// Query string parsed as `T`.
#[derive(Clone, Debug)]
pub(crate) struct Query<T>(pub(crate) T);

/// Digest that the parameter `{id}` or `{digest}` of the request path contains.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Id(pub(crate) Digest);

/// Job id that the parameter `{id}` of the request path contains.
#[derive(Clone, Debug)]
pub(crate) struct JobId(pub(crate) String);

/// A complete JSON request body as bytes, whose media type is checked. It is parsed later, on the threads that evaluate
/// queries.
#[derive(Debug)]
pub(crate) struct JsonBytes {
    pub(crate) bytes: Bytes,
    /// Permit for as many bytes of request-body memory as were received.
    _share: Place,
}

/// A complete JSON request body of at most 512 KiB, for requests other than batch evaluations.
#[derive(Debug)]
pub(crate) struct SmallJson(pub(crate) JsonBytes);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        check_query(parts.uri.query().unwrap_or_default())?;
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

/// Id of an access key that the parameter `{id}` of the request path contains.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KeyIdPath(pub(crate) KeyId);

impl<S: Send + Sync> FromRequestParts<S> for KeyIdPath {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let text = segment(parts, state).await?;
        let id = text.parse().map_err(|error: NotAKeyId| Problem::new(Kind::NotFound, error.to_string()));
        id.map(Self)
    }
}

/// Id of a resumable upload that the parameter `{id}` of the request path contains.
#[derive(Clone, Debug)]
pub(crate) struct Id32(pub(crate) String);

impl<S: Send + Sync> FromRequestParts<S> for Id32 {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let text = segment(parts, state).await?;
        check_upload_id(&text).map_err(|reason| Problem::new(Kind::NotFound, reason))?;
        Ok(Self(text))
    }
}

/// Checks that a text may be the id of a resumable upload: 32 lower-case hexadecimal digits.
pub(crate) fn check_upload_id(text: &str) -> Result<(), String> {
    if text.len() == 32 && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')) {
        return Ok(());
    }
    let shown: String = text.chars().take(80).collect();
    Err(format!("`{shown}` is no id of an upload, expected 32 hexadecimal digits"))
}

/// Returns the refusal of an unknown query parameter, with the names of the known ones.
pub(crate) fn unknown_parameter<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<String> = known.map(|name| format!("`{name}`")).collect();
    let shown: String = name.chars().take(40).collect();
    format!("unknown field `{shown}`, expected one of {}", known.join(", "))
}

/// Text of the parameter `{name}` of the request path.
#[derive(Clone, Debug)]
pub(crate) struct Name(pub(crate) String);

impl<S: Send + Sync> FromRequestParts<S> for Name {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        segment(parts, state).await.map(Self)
    }
}

/// Upper bound in bytes on a query string: half of the default limit on the request head. Longer lists of wavelengths
/// belong in the body of a POST.
pub(crate) const LONGEST_QUERY: usize = 16 << 10;

/// Upper bound in characters on a text by which a list is filtered: longer than any stored name or tag.
pub(crate) const LONGEST_WORD: usize = 255;

/// Refuses query strings that are too long, are not UTF-8 or contain U+0000.
fn check_query(query: &str) -> Result<(), Problem> {
    if query.len() > LONGEST_QUERY {
        let detail = format!("a query string of {} bytes, expected at most {LONGEST_QUERY}", query.len());
        return Err(Problem::new(Kind::LongQuery, detail));
    }
    let text = std::str::from_utf8(&percent_decoded(query)).map(|text| text.contains('\0'));
    match text {
        Ok(false) => Ok(()),
        Ok(true) => {
            Err(Problem::new(Kind::BadQuery, "found the character U+0000 (%00) in the query string, expected text"))
        }
        Err(_) => {
            Err(Problem::new(Kind::BadQuery, "found bytes that are no UTF-8 in the query string, expected UTF-8"))
        }
    }
}

/// Deserialises a text by which a list is filtered, for `deserialize_with`. An empty text filters nothing.
pub(crate) fn word<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let text = String::deserialize(deserializer)?;
    match text.chars().count() {
        0 => Ok(None),
        1..=LONGEST_WORD => Ok(Some(text)),
        length => {
            let message = format!("found a text of {length} characters to filter by, expected at most {LONGEST_WORD}");
            Err(serde::de::Error::custom(message))
        }
    }
}

/// Returns the value of the only parameter of the request path.
async fn segment<S: Send + Sync>(parts: &mut Parts, state: &S) -> Result<String, Problem> {
    let params = RawPathParams::from_request_parts(parts, state)
        .await
        .map_err(|rejection| Problem::new(Kind::NotFound, rejection.to_string()))?;
    Ok(params.iter().next().map(|(_, value)| value.to_owned()).unwrap_or_default())
}

/// Bytes of memory reserved when the first piece of a request body arrives.
const FIRST: usize = 16 << 10;

/// Upper bound in bytes on a JSON request body that is not a batch evaluation.
const SMALL: usize = 512 << 10;

impl JsonBytes {
    /// Receives the JSON body of a request, up to the size limit of the service.
    pub(crate) async fn receive(request: Request, app: &App) -> Result<Self, Problem> {
        read_json(request, app, app.engine.limits.json_bytes).await
    }
}

impl FromRequest<Service> for SmallJson {
    type Rejection = Problem;

    async fn from_request(request: Request, service: &Service) -> Result<Self, Problem> {
        let app = service.of(request.extensions())?;
        read_json(request, &app, SMALL.min(app.engine.limits.json_bytes)).await.map(Self)
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
    let share = checked.and_then(|()| Ok(app.held.bodies.take(client(request.extensions()), 0)?));
    let mut share = match share {
        Ok(share) => share,
        Err(problem) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let mut stream = request.into_body().into_data_stream();
    let mut bytes = BytesMut::new();
    let mut reserved = 0;
    let whole = async {
        let mut pace = Pace::new(limits);
        let size = |piece: &Result<Bytes, axum::Error>| piece.as_ref().map_or(0, Bytes::len);
        while let Some(piece) = pace.next(stream.next(), size).await? {
            let piece = piece.map_err(|_| Problem::new(Kind::BadBody, "the body ended early"))?;
            let length = bytes.len() + piece.len();
            if length > limit {
                return Err(too_large(limit));
            }
            // Memory is reserved for received bytes, not for the declared length. Doubling copies each byte once or
            // twice.
            if length > reserved {
                let room = length.max(2 * reserved).max(FIRST).min(limit).next_multiple_of(KIB);
                share.grow((room - reserved) / KIB)?;
                reserved = room;
                bytes.reserve(room - bytes.len());
            }
            bytes.extend_from_slice(&piece);
        }
        Ok(())
    };
    let received = tokio::time::timeout(limits.upload_time, whole).await.unwrap_or_else(|_| {
        let most = limits.upload_time;
        let detail = format!("the request body took longer than the limit of {most:?}; send it in parts");
        Err(Problem::new(Kind::TooSlow, detail))
    });
    if let Err(problem) = received {
        drop((bytes, share));
        linger_body(Body::from_stream(stream)).await;
        return Err(problem);
    }
    if bytes.is_empty() {
        return Err(Problem::new(Kind::EmptyBody, "expected a JSON object"));
    }
    Ok(JsonBytes { bytes: bytes.freeze(), _share: share })
}

/// Parses a JSON object as `T`. The error has status 400 if the bytes are not JSON, and 422 if the content is not as
/// expected.
pub(crate) fn parse_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    // serde would fill a struct from an array by position.
    let is_object = bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
    let parsed = if is_object { Some(serde_json::from_slice(bytes)) } else { None };
    if let Some(Ok(value)) = parsed {
        return Ok(value);
    }
    // The error categories of serde_json do not separate malformed JSON from JSON of another shape.
    match (serde_json::from_slice::<serde::de::IgnoredAny>(bytes), parsed) {
        (Err(error), _) => Err(Problem::new(Kind::BadBody, error.to_string())),
        (Ok(_), Some(Err(error))) => Err(Problem::new(Kind::InvalidRequest, error.to_string())),
        (Ok(_), _) => Err(Problem::new(Kind::InvalidRequest, "expected a JSON object")),
    }
}

/// Returns the length of a request body that the header `Content-Length` declares.
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
    Problem::new(Kind::TooLarge, format!("the JSON request body is longer than the limit of {limit} bytes"))
}

/// Reads and discards the rest of a refused request: most clients read the answer only after sending a good part of
/// their body.
pub(crate) async fn linger(request: Request) {
    // With `Expect: 100-continue` no body was sent: nothing to drain.
    if !request.headers().contains_key(header::EXPECT) {
        linger_body(request.into_body()).await;
    }
}

/// Reads and discards a request body: at most 32 MiB within 2 s.
pub(crate) async fn linger_body(body: Body) {
    drain(body, Duration::from_secs(2)).await;
}

/// Reads and discards a request body: at most 32 MiB within the given time.
pub(crate) async fn drain(body: Body, time: Duration) {
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
    // The answer follows whether or not the body was drained.
    let _ = tokio::time::timeout(time, drain).await;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn query_strings_are_bounded_text() {
        let kind = |query: &str| check_query(query).map_err(|problem| problem.body().status);
        for good in ["", "q=a%20b+c", "q=%C3%BC", "q=%", "q=%zz", "q=50%"] {
            assert_eq!(kind(good), Ok(()), "{good}");
        }
        for bad in ["q=%00", "q=a%00b", "q=%ff", "q=%C3", "%c3=x"] {
            assert_eq!(kind(bad), Err(400), "{bad}");
        }
        assert_eq!(kind(&"x".repeat(LONGEST_QUERY + 1)), Err(414));
    }
}
