//! What surrounds every handler: request ids, logs and figures, CORS for reads, panics as problems.

use super::problem::{Kind, Problem};
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::any::Any;
use std::time::Instant;
use tower_http::cors::{Any as AnyOrigin, CorsLayer};
use tower_http::request_id::{MakeRequestId, RequestId};

/// The header of a request's id.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("request-id");

/// Ids in order of time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ids;

impl MakeRequestId for Ids {
    fn make_request_id<B>(&mut self, _: &axum::http::Request<B>) -> Option<RequestId> {
        HeaderValue::from_str(&uuid::Uuid::now_v7().to_string()).ok().map(RequestId::new)
    }
}

/// Pages of any origin may read.
pub(crate) fn cors() -> CorsLayer {
    CorsLayer::new()
        .allow_origin(AnyOrigin)
        .allow_methods([Method::GET, Method::HEAD, Method::POST])
        .allow_headers([header::CONTENT_TYPE, header::RANGE, header::IF_NONE_MATCH, header::IF_RANGE])
        .expose_headers([
            header::ETAG,
            header::LOCATION,
            header::RETRY_AFTER,
            header::CONTENT_RANGE,
            header::ACCEPT_RANGES,
            header::CONTENT_DISPOSITION,
            REQUEST_ID,
            super::export::EXPORT_ERROR,
        ])
}

/// A browser says when a page of another origin makes a request. Such a page may read, and ask materials (`evaluate`,
/// `pdf`, `sample` and `albedo` change nothing), but not write.
pub(crate) async fn same_origin_writes(request: Request, next: Next) -> Response {
    let path = request.uri().path();
    let asks = path.starts_with("/v1/materials/")
        && ["/evaluate", "/pdf", "/sample", "/albedo"].iter().any(|question| path.ends_with(question));
    if request.method().is_safe() || asks || !is_cross_origin(request.headers()) {
        return next.run(request).await;
    }
    Problem::new(Kind::CrossOrigin, "the Origin of the page is not the Host of the service").into_response()
}

fn is_cross_origin(headers: &axum::http::HeaderMap) -> bool {
    let Some(origin) = headers.get(header::ORIGIN).and_then(|value| value.to_str().ok()) else { return false };
    let authority = origin.split_once("://").map_or("", |(_, authority)| authority);
    headers.get(header::HOST).and_then(|value| value.to_str().ok()) != Some(authority)
}

/// Logs and counts each request once, by its route.
pub(crate) async fn observe(request: Request, next: Next) -> Response {
    let start = Instant::now();
    let method = request.method().clone();
    let path = request.uri().path().to_owned();
    let route = request.extensions().get::<MatchedPath>().map_or("none".to_owned(), |path| path.as_str().to_owned());
    let request_id = request.headers().get(REQUEST_ID).and_then(|id| id.to_str().ok()).unwrap_or_default().to_owned();
    let response = next.run(request).await;
    let status = response.status().as_u16();
    let seconds = start.elapsed().as_secs_f64();
    let duration_ms = start.elapsed().as_millis() as u64;
    let known = method_name(&method);
    let labels = [("method", known.to_owned()), ("route", route), ("status", status.to_string())];
    metrics::histogram!("wavelume_http_request_duration_seconds", &labels).record(seconds);
    tracing::info!(%method, path, status, duration_ms, request_id, "request answered");
    response
}

/// Methods are the client's word: only known ones become labels.
fn method_name(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}

/// Headers that hold for every answer.
pub(crate) async fn harden(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    response.headers_mut().insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    response
}

/// A handler panicked: a bug of ours.
#[allow(clippy::needless_pass_by_value, reason = "the layer hands the panic over")]
pub(crate) fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let message = crate::jobs::panic_message(panic.as_ref());
    Problem::internal(&format!("a handler panicked: {message}")).into_response()
}

/// No route has this path.
pub(crate) async fn no_route(request: Request) -> Response {
    let path: String = request.uri().path().chars().take(200).collect();
    super::extract::linger(request).await;
    Problem::new(Kind::NotFound, format!("no route is at {path}")).into_response()
}

/// The route has other methods; axum adds `Allow`.
pub(crate) async fn no_method(method: Method) -> Response {
    Problem::new(Kind::MethodNotAllowed, format!("{method} is not for this resource; see Allow")).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderMap;

    #[test]
    fn another_origin_is_told_from_our_own() {
        let headers = |origin: &'static str| {
            HeaderMap::from_iter([
                (header::HOST, HeaderValue::from_static("localhost:8080")),
                (header::ORIGIN, HeaderValue::from_static(origin)),
            ])
        };
        assert!(!is_cross_origin(&headers("http://localhost:8080")));
        assert!(is_cross_origin(&headers("https://example.org")) && is_cross_origin(&headers("null")));
        assert!(!is_cross_origin(&HeaderMap::new()));
    }
}
