//! Steps around every handler: request ids, logs and metrics, hosts and origins, panics as problems.

use super::access::{Access, Page};
use super::caller::RequestId;
use super::problem::{Kind, Problem};
use super::route::Route;
use super::state::App;
use super::words::{shown, shown_path};
use crate::trust::{Link, holds_secret};
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::any::Any;
use std::sync::Arc;
use std::time::Instant;

/// Name of the HTTP header that carries the id of a request.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("request-id");

/// Upper bound in characters on a request id chosen by a client. A longer one is replaced, because it is written to the
/// log and the answer.
const LONGEST_ID: usize = 128;

/// Upper bound in characters on a logged URL path; the middle of a longer path is left out.
const LOGGED_PATH: usize = 300;

/// Upper bound in characters on a logged HTTP method.
const LOGGED_METHOD: usize = 20;

/// Value of the header `Strict-Transport-Security`, by which browsers reach the host over TLS only, for a year. Raising
/// it lengthens the time in which a service cannot go back to plain HTTP for them.
const SECURE_ONLY: HeaderValue = HeaderValue::from_static("max-age=31536000");

/// Refuses requests whose body has a transfer coding other than `chunked`: the compressed bytes would be taken for the
/// body itself. Refuses requests that name an unknown host. Refuses requests of web pages of other origins if they
/// write, or if they use a key and the origin is not allowed. Lets pages of allowed origins read the answers.
async fn hosts_and_origins<F: Future<Output = Response>>(
    access: &Access,
    mut request: Request,
    next: impl FnOnce(Request) -> F,
) -> Response {
    if let Err(problem) = framed(request.headers()) {
        return refuse(request, problem).await;
    }
    let host = match access.host(&request) {
        Ok(host) => host,
        Err(problem) => return refuse(request, problem).await,
    };
    let page = access.page(request.headers(), host.as_ref());
    let secure_only = access.is_secure_only(host.as_ref());
    // HTTP/2 carries the host in `:authority`.
    if !request.headers().contains_key(header::HOST) {
        request.headers_mut().extend(host.map(|host| (header::HOST, host)));
    }
    let preflight =
        request.method() == Method::OPTIONS && request.headers().contains_key(header::ACCESS_CONTROL_REQUEST_METHOD);
    let may = match &page {
        Page::Own => true,
        Page::Allowed(_) => request.method().is_safe() || asks(&request),
        Page::Foreign => request.method().is_safe() && !uses_key(&request),
    };
    let mut response = match &page {
        Page::Allowed(_) if preflight => StatusCode::NO_CONTENT.into_response(),
        _ if may => next(request).await,
        Page::Allowed(_) => {
            let detail = "the page that asks is of an origin that --origin allows to read, not to write";
            refuse(request, Problem::new(Kind::CrossOrigin, detail)).await
        }
        _ => {
            let detail = "the page that asks is of another origin than the service, and no --origin allows it to read";
            let kind = if request.method().is_safe() { Kind::CrossOriginRead } else { Kind::CrossOrigin };
            refuse(request, Problem::new(kind, detail)).await
        }
    };
    if secure_only {
        response.headers_mut().insert(header::STRICT_TRANSPORT_SECURITY, SECURE_ONLY);
    }
    if access.varies() {
        response.headers_mut().append(header::VARY, HeaderValue::from_static("origin"));
    }
    if let Page::Allowed(origin) = page {
        let headers = response.headers_mut();
        headers.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, origin);
        let lists: &[(HeaderName, &'static str)] = if preflight {
            &[
                (header::ACCESS_CONTROL_ALLOW_METHODS, "GET, HEAD, POST"),
                (
                    header::ACCESS_CONTROL_ALLOW_HEADERS,
                    "authorization, content-type, range, if-none-match, if-range, last-event-id, request-id, \
                     tus-resumable",
                ),
                (header::ACCESS_CONTROL_MAX_AGE, "600"),
            ]
        } else {
            &[(
                header::ACCESS_CONTROL_EXPOSE_HEADERS,
                "etag, location, retry-after, content-range, accept-ranges, content-disposition, request-id, \
                 wavelume-export-error, tus-resumable, tus-version, tus-extension, tus-max-size, tus-checksum-algorithm, \
                 upload-offset, upload-length, upload-defer-length, upload-metadata, upload-expires",
            )]
        };
        headers.extend(lists.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value))));
    }
    response
}

/// Checks that the body of a request has no transfer coding but `chunked`.
fn framed(headers: &HeaderMap) -> Result<(), Problem> {
    let mut codings = headers.get_all(header::TRANSFER_ENCODING).iter();
    let is_known = |value: &HeaderValue| value.as_bytes().trim_ascii().eq_ignore_ascii_case(b"chunked");
    match (codings.next(), codings.next()) {
        (None, _) => Ok(()),
        (Some(coding), None) if is_known(coding) => Ok(()),
        _ => {
            let detail = "Transfer-Encoding: expected chunked alone; a compressed body has a Content-Encoding";
            Err(Problem::new(Kind::BadHeader, detail))
        }
    }
}

/// Returns true if a web page sends a key with a request, or fetches a signed link in the background. A link that the
/// user follows does not count, because it leaves the page.
fn uses_key(request: &Request) -> bool {
    let headers = request.headers();
    let leaves = headers.get("sec-fetch-mode").is_some_and(|mode| mode == "navigate")
        && headers.get("sec-fetch-dest").is_some_and(|place| place == "document");
    headers.contains_key(header::AUTHORIZATION)
        || (Link::is_like(request.uri().path(), request.uri().query().unwrap_or_default()) && !leaves)
}

/// Returns true for POST requests that only query a material: `evaluate`, `pdf`, `sample` and `albedo` change nothing.
fn asks(request: &Request) -> bool {
    let path = request.uri().path();
    request.method() == Method::POST
        && path.starts_with("/v1/materials/")
        && ["/evaluate", "/pdf", "/sample", "/albedo"].iter().any(|question| path.ends_with(question))
}

/// Sends an error response after reading the rest of the request, which most clients send before they read an answer.
pub(super) async fn refuse(request: Request, problem: Problem) -> Response {
    super::extract::linger(request).await;
    problem.into_response()
}

/// Outermost step of answering an HTTP request, around all other steps, `next`. Checks the host and the origin of the
/// request, adds security headers to the answer, assigns an id to the request, logs it once, and records its duration
/// by route.
pub(crate) async fn outermost<F: Future<Output = Response>>(
    app: &App,
    mut request: Request,
    next: impl FnOnce(Request) -> F,
) -> Response {
    let start = Instant::now();
    let method = request.method().clone();
    let path = shown_path(request.uri().path(), LOGGED_PATH);
    let route = Route::of(request.extensions()).unwrap_or("none");
    let request_id = request_id(request.headers());
    request.extensions_mut().insert(RequestId(Arc::clone(&request_id)));
    let mut response = hosts_and_origins(&app.access, request, next).await;
    harden(response.headers_mut());
    let status = response.status().as_u16();
    let seconds = start.elapsed().as_secs_f64();
    let duration_ms = start.elapsed().as_millis() as u64;
    app.durations.record(method_name(&method), route, status, seconds);
    let method = shown(method.as_str(), LOGGED_METHOD);
    tracing::info!(method, path, status, duration_ms, request_id = &*request_id, "request answered");
    response.headers_mut().extend(HeaderValue::from_str(&request_id).ok().map(|id| (REQUEST_ID, id)));
    response
}

/// Returns the client's request id if it is safe to log, otherwise a new id that sorts by time.
fn request_id(headers: &HeaderMap) -> Arc<str> {
    let mut ids = headers.get_all(REQUEST_ID).iter();
    let id = ids.next().and_then(|id| id.to_str().ok()).filter(|_| ids.next().is_none());
    let known = |b: u8| b.is_ascii_alphanumeric() || b"-_.~:/+=@".contains(&b);
    match id {
        Some(id) if (1..=LONGEST_ID).contains(&id.len()) && id.bytes().all(known) && !holds_secret(id) => id.into(),
        _ => Arc::from(&*uuid::Uuid::now_v7().hyphenated().encode_lower(&mut uuid::Uuid::encode_buffer())),
    }
}

/// Returns the label of an HTTP method in the metrics. Clients choose methods freely, so unknown ones become `other`.
fn method_name(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// Adds the security headers common to all answers.
fn harden(headers: &mut HeaderMap) {
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    // No answer is a page with scripts or a part of another page.
    let nothing = HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'");
    headers.insert(header::CONTENT_SECURITY_POLICY, nothing);
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    let own = HeaderValue::from_static("same-origin");
    headers.insert(HeaderName::from_static("cross-origin-resource-policy"), own);
}

/// Answers a request whose handler panicked, which is a bug of the service.
#[allow(clippy::needless_pass_by_value, reason = "the panic is not used again")]
pub(crate) fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let message = crate::jobs::panic_message(panic.as_ref());
    Problem::internal(&format!("a handler panicked: {message}")).into_response()
}

/// Answers a request whose path has no route.
pub(crate) async fn no_route(request: Request) -> Response {
    let detail = format!("no route is at {}", shown_path(request.uri().path(), LOGGED_PATH));
    refuse(request, Problem::new(Kind::NotFound, detail)).await
}

/// Answers a request whose HTTP method its route does not support; axum adds the header `Allow`.
pub(crate) async fn no_method(request: Request) -> Response {
    let problem = wrong_method(request.method());
    refuse(request, problem).await
}

/// Builds the error response to a request whose HTTP method its route does not support, without the header `Allow`.
pub(super) fn wrong_method(method: &Method) -> Problem {
    let method = shown(method.as_str(), LOGGED_METHOD);
    let detail = format!("the method {method} is not for this resource, expected one of those in the header Allow");
    Problem::new(Kind::MethodNotAllowed, detail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_is_chunked_or_not_and_nothing_else() {
        let is_framed = |values: &[&'static str]| {
            let values = values.iter().map(|value| (header::TRANSFER_ENCODING, HeaderValue::from_static(value)));
            let mut headers = HeaderMap::new();
            for (name, value) in values {
                headers.append(name, value);
            }
            framed(&headers).is_ok()
        };
        assert!(is_framed(&[]) && is_framed(&["chunked"]) && is_framed(&[" Chunked "]));
        for other in [&["gzip, chunked"][..], &["gzip", "chunked"], &["chunked", "chunked"], &["identity"], &[""]] {
            assert!(!is_framed(other), "{other:?}");
        }
    }

    #[test]
    fn ids_of_clients_are_kept_where_they_may_stand_in_a_log() {
        let id = |ids: &[&'static [u8]]| {
            let mut headers = HeaderMap::new();
            for id in ids {
                headers.append(REQUEST_ID, HeaderValue::from_bytes(id).unwrap());
            }
            request_id(&headers)
        };
        for known in ["7", "0190b1e2-0000-7000-8000-000000000000", "Root=1-67891233-abcdef", "a/b:c@d~e"] {
            assert_eq!(*id(&[known.as_bytes()]), *known);
        }
        let long = "x".repeat(LONGEST_ID + 1).leak().as_bytes();
        for other in [&[][..], &[&b""[..]], &[b"a b"], &[b"\t"], &[b"\xff"], &[b"\"quoted\""], &[b"a", b"b"], &[long]] {
            assert!(uuid::Uuid::try_parse(&id(other)).is_ok(), "{other:?}");
        }
    }
}
