//! Stored bytes over HTTP: strong `ETag` (the digest), caching, byte ranges, conditional requests.

use super::problem::{Kind, Problem};
use super::state::App;
use crate::jobs::BlobError;
use crate::store::{Digest, WHOLE};
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::Response;
use std::fmt::Write;
use std::ops::Range;
use std::time::Duration;

/// Media type of a material file.
pub(crate) const MATERIAL: &str = "application/vnd.wavelume.material";

/// Value of the header `Cache-Control` of bytes that never change: whoever may read them may keep them for good.
/// Answers to those without a key get another one where materials may become private again.
pub(crate) const FOR_GOOD: HeaderValue = HeaderValue::from_static("public, max-age=31536000, immutable");

/// Number of response headers for which room is made at once. A smaller one makes the table of headers grow several
/// times.
const HEADERS: usize = 24;

/// Upper bound on the byte ranges that a request may ask for at once. A request for more is refused, because it can
/// only be meant to keep the service busy (RFC 9110 section 14.2).
const MOST_RANGES: usize = 100;

/// Builds the HTTP response that sends the stored blob `digest`, whole or in part, as the request asks. A row of the
/// catalog refers to the blob, so a missing blob is reported as corruption of the store.
pub(crate) async fn respond_named(
    app: &App,
    digest: Digest,
    media_type: &'static str,
    file_name: Option<&str>,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let answer = answer(app, digest, media_type, file_name, method, headers).await;
    answer.map_err(|refused| match refused {
        Refused::Blob(error) => Problem::of_named(digest, error),
        Refused::Request(problem) => problem,
    })
}

/// Builds the HTTP response that sends the stored blob `digest`: all of it, a byte range, the headers alone, or status
/// 304, as the request asks.
pub(crate) async fn respond(
    app: &App,
    digest: Digest,
    media_type: &'static str,
    file_name: Option<&str>,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let answer = answer(app, digest, media_type, file_name, method, headers).await;
    answer.map_err(|refused| match refused {
        Refused::Blob(error) => error.into(),
        Refused::Request(problem) => problem,
    })
}

/// Redirects a download of the bytes `digest` to a presigned URL of the object store, if a setting and the store allow
/// it. The URL expires within the time `left` for which the caller may read; `None` stands for no end. Returns `None`
/// if the service is to send the bytes itself.
pub(crate) async fn redirected(
    app: &App,
    digest: Digest,
    media_type: &'static str,
    file_name: Option<&str>,
    method: &Method,
    headers: &HeaderMap,
    left: Option<Duration>,
) -> Result<Option<Response>, Problem> {
    let longest = app.engine.limits.store_redirect.0;
    let life = left.map_or(longest, |left| left.min(longest));
    // The store counts whole seconds.
    if life < Duration::from_secs(1) || method != Method::GET {
        return Ok(None);
    }
    let labels = Labels::new(digest, media_type, file_name);
    let is_unchanged = not_modified(headers, labels.etag.to_str().unwrap_or_default());
    if is_unchanged {
        return Ok(None);
    }
    let disposition = labels.disposition.to_str().unwrap_or("attachment");
    let url = app.engine.archive.presigned(digest, life, media_type, disposition).await;
    let url = url.map_err(|error| Problem::of_named(digest, error))?;
    let Some(location) = url.and_then(|url| HeaderValue::from_str(&url).ok()) else { return Ok(None) };
    let mut response = Response::new(Body::empty());
    *response.status_mut() = StatusCode::TEMPORARY_REDIRECT;
    let headers = response.headers_mut();
    headers.insert(header::LOCATION, location);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(Some(response))
}

/// Reason why a request for a stored file is not answered with bytes of the file.
enum Refused {
    /// The bytes of the stored file that the request asks for cannot be read from the store.
    Blob(BlobError),
    /// The request does not fit the stored file, for example because of a byte range beyond its end.
    Request(Problem),
}

async fn answer(
    app: &App,
    digest: Digest,
    media_type: &'static str,
    file_name: Option<&str>,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response, Refused> {
    let archive = &app.engine.archive;
    let (blob, size) = archive.blob(digest).await.map_err(Refused::Blob)?;
    let labels = Labels::new(digest, media_type, file_name);
    let asked = labels.asked(method, headers, size).map_err(Refused::Request)?;
    let body = match &asked {
        Some((_, range)) if method != Method::HEAD => {
            if size <= WHOLE {
                let bytes = archive.read(&blob).await.map_err(Refused::Blob)?;
                Body::from(bytes.slice(range.start as usize..range.end as usize))
            } else {
                Body::from_stream(archive.stream(blob, range.clone(), size))
            }
        }
        _ => Body::empty(),
    };
    Ok(labels.response(size, asked, body))
}

/// Response headers common to all answers that concern one stored blob: entity tag, media type and file name.
#[derive(Clone, Debug)]
struct Labels {
    etag: HeaderValue,
    media_type: HeaderValue,
    disposition: HeaderValue,
}

impl Labels {
    fn new(digest: Digest, media_type: &'static str, file_name: Option<&str>) -> Self {
        let etag = HeaderValue::from_str(&format!("\"{digest}\"")).unwrap_or(HeaderValue::from_static("\"\""));
        // Uploaded bytes are never shown as a page of this origin.
        Self { etag, media_type: HeaderValue::from_static(media_type), disposition: disposition(file_name) }
    }

    /// Returns the status and the byte range that a request selects from a blob of `size` bytes. Only `GET` asks for a
    /// range (RFC 9110 section 14.2). Returns `None` for status 304 (not modified).
    fn asked(
        &self,
        method: &Method,
        headers: &HeaderMap,
        size: u64,
    ) -> Result<Option<(StatusCode, Range<u64>)>, Problem> {
        let etag = self.etag.to_str().unwrap_or_default();
        if not_modified(headers, etag) {
            return Ok(None);
        }
        match if method == Method::GET && current(headers, etag) { part(headers, size) } else { Part::Whole } {
            Part::Whole => Ok(Some((StatusCode::OK, 0..size))),
            Part::Some(range) => Ok(Some((StatusCode::PARTIAL_CONTENT, range))),
            Part::TooMany(count) => {
                let detail = format!("found {count} ranges, expected one; more than {MOST_RANGES} are refused");
                Err(Problem::new(Kind::RangeNotSatisfiable, detail))
            }
            Part::None => {
                let detail = format!("the content has {size} bytes, none of them in the requested range");
                let problem = Problem::new(Kind::RangeNotSatisfiable, detail);
                Err(problem.with(header::CONTENT_RANGE, &format!("bytes */{size}")))
            }
        }
    }

    fn response(&self, size: u64, asked: Option<(StatusCode, Range<u64>)>, body: Body) -> Response {
        let mut response = Response::new(body);
        let headers = response.headers_mut();
        headers.reserve(HEADERS);
        headers.insert(header::ETAG, self.etag.clone());
        headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("bytes"));
        headers.insert(header::CACHE_CONTROL, FOR_GOOD);
        let Some((status, range)) = asked else {
            *response.status_mut() = StatusCode::NOT_MODIFIED;
            return response;
        };
        headers.insert(header::CONTENT_LENGTH, HeaderValue::from(range.end - range.start));
        headers.insert(header::CONTENT_TYPE, self.media_type.clone());
        headers.insert(header::CONTENT_DISPOSITION, self.disposition.clone());
        if status == StatusCode::PARTIAL_CONTENT {
            let text = format!("bytes {}-{}/{size}", range.start, range.end - 1);
            headers.extend(HeaderValue::from_str(&text).ok().map(|value| (header::CONTENT_RANGE, value)));
        }
        *response.status_mut() = status;
        response
    }
}

/// Builds the HTTP response that sends bytes from memory: all of them, a byte range, the headers alone, or status 304,
/// as the request asks.
pub(crate) fn respond_with(
    bytes: &Bytes,
    digest: Digest,
    media_type: &'static str,
    file_name: Option<&str>,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    let (size, labels) = (bytes.len() as u64, Labels::new(digest, media_type, file_name));
    let asked = labels.asked(method, headers, size)?;
    let body = match &asked {
        Some((_, range)) if method != Method::HEAD => Body::from(bytes.slice(range.start as usize..range.end as usize)),
        _ => Body::empty(),
    };
    Ok(labels.response(size, asked, body))
}

#[derive(Debug, PartialEq, Eq)]
enum Part {
    Whole,
    Some(Range<u64>),
    None,
    /// The header `Range` names more than [`MOST_RANGES`] ranges, so that the request is refused. Holds their number.
    TooMany(usize),
}

/// Parses the header `Range` (RFC 9110 section 14). One byte range is served; up to [`MOST_RANGES`] ranges, other units
/// and malformed values get the whole content.
fn part(headers: &HeaderMap, size: u64) -> Part {
    let Some(text) = headers.get(header::RANGE).and_then(|value| value.to_str().ok()) else { return Part::Whole };
    let Some((unit, set)) = text.split_once('=') else { return Part::Whole };
    if !unit.trim().eq_ignore_ascii_case("bytes") {
        return Part::Whole;
    }
    match set.split(',').count() {
        1 => {}
        2..=MOST_RANGES => return Part::Whole,
        count => return Part::TooMany(count),
    }
    let Some((first, last)) = set.trim().split_once('-') else { return Part::Whole };
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let number = |text: &str| text.parse::<u64>().unwrap_or(u64::MAX);
    match (first, last) {
        ("", last) if digits(last) => match number(last).min(size) {
            0 => Part::None,
            suffix => Part::Some(size - suffix..size),
        },
        (first, "") if digits(first) => {
            let first = number(first);
            if first < size { Part::Some(first..size) } else { Part::None }
        }
        (first, last) if digits(first) && digits(last) => {
            let (first, last) = (number(first), number(last));
            if last < first {
                Part::Whole
            } else if first < size {
                Part::Some(first..last.saturating_add(1).min(size))
            } else {
                Part::None
            }
        }
        _ => Part::Whole,
    }
}

/// Returns true if the header `If-Range` is absent or names the entity tag `etag`. A date never matches, because blobs
/// have no dates.
fn current(headers: &HeaderMap, etag: &str) -> bool {
    headers.get(header::IF_RANGE).is_none_or(|value| value == etag)
}

/// Returns true if the header `If-None-Match` names the entity tag `etag` (weak comparison).
pub(super) fn not_modified(headers: &HeaderMap, etag: &str) -> bool {
    headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok()).any(|text| {
        text.split(',').map(str::trim).any(|tag| tag == "*" || tag.strip_prefix("W/").unwrap_or(tag) == etag)
    })
}

fn disposition(file_name: Option<&str>) -> HeaderValue {
    let plain = HeaderValue::from_static("attachment");
    let Some(name) = file_name else { return plain };
    // RFC 8187: anything but unreserved ASCII is percent-encoded.
    let mut text = String::from("attachment; filename*=UTF-8''");
    for b in name.bytes() {
        if b.is_ascii_alphanumeric() || b".-_".contains(&b) {
            text.push(char::from(b));
        } else {
            let _ = write!(text, "%{b:02X}");
        }
    }
    HeaderValue::from_str(&text).unwrap_or(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(name: header::HeaderName, value: &'static str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_static(value))])
    }

    #[test]
    fn ranges_are_read_as_the_standard_says() {
        let range = |value| part(&with(header::RANGE, value), 100);
        for (value, expected) in [
            ("bytes=0-9", Part::Some(0..10)),
            ("bytes=90-", Part::Some(90..100)),
            ("bytes=90-1000", Part::Some(90..100)),
            ("bytes=-10", Part::Some(90..100)),
            ("bytes=-1000", Part::Some(0..100)),
            ("bytes=99-99999999999999999999999", Part::Some(99..100)),
            ("bytes=100-", Part::None),
            ("bytes=100-200", Part::None),
            ("bytes=-0", Part::None),
            ("bytes=9-0", Part::Whole),
            ("bytes=0-1,5-6", Part::Whole),
            ("lines=0-9", Part::Whole),
            ("bytes=a-b", Part::Whole),
            ("bytes=-", Part::Whole),
            ("bytes", Part::Whole),
        ] {
            assert_eq!(range(value), expected, "{value}");
        }
        assert_eq!(part(&with(header::RANGE, "bytes=0-"), 0), Part::None);
        let many =
            |count: usize| part(&with(header::RANGE, format!("bytes={}", ["-1"].repeat(count).join(",")).leak()), 100);
        assert_eq!((many(MOST_RANGES), many(10_000)), (Part::Whole, Part::TooMany(10_000)));
        assert_eq!(part(&HeaderMap::new(), 100), Part::Whole);
    }

    #[test]
    fn conditions_compare_the_digest() {
        let tag = "\"b3-1\"";
        for (value, expected) in
            [("\"b3-1\"", true), ("W/\"b3-1\"", true), ("\"x\", \"b3-1\"", true), ("*", true), ("\"x\"", false)]
        {
            assert_eq!(not_modified(&with(header::IF_NONE_MATCH, value), tag), expected, "{value}");
        }
        assert!(current(&HeaderMap::new(), tag) && current(&with(header::IF_RANGE, "\"b3-1\""), tag));
        assert!(!current(&with(header::IF_RANGE, "Wed, 21 Oct 2026 07:28:00 GMT"), tag));
    }

    #[test]
    fn file_names_cannot_break_the_header() {
        assert_eq!(disposition(Some("a \"b\"\r\n.ies")), "attachment; filename*=UTF-8''a%20%22b%22%0D%0A.ies");
    }
}
