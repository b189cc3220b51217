//! `/v1/uploads`: uploads that a client may continue after a break, by the protocol tus 1.0 (<https://tus.io>).
//!
//! Each request with bytes makes an object of the store, a long one several, under the name of the upload and a number.
//! Any node can therefore continue what another began. A broken connection or a stop with notice loses no byte that has
//! come; the end of a killed process loses one part at most. The complete upload is used by
//! `POST /v1/measurements?upload=…` or `POST /v1/materials?upload=…`, which reads the parts as if they were the body of
//! that request.

mod checksum;
mod headers;
mod part;
mod refusals;
mod used;

pub(super) use used::{receive, upload_parameter};

use super::caller::Caller;
use super::extract::{Id32, linger};
use super::places::Peer;
use super::problem::{Kind, Problem};
use super::route::Route;
use super::schemas::{Binary, OverridingMethod, TusVersion, UploadIdText};
use super::state::{App, Service};
use super::upload::lacks_room;
use crate::catalog::{Begun, Bound, Partial};
use crate::jobs::{Client, most_of_tenant};
use axum::extract::Request;
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use headers::{DEFER_LENGTH, EXPIRES, LENGTH, MAX_SIZE, METADATA, OFFSET, RESUMABLE, VERSION};
use refusals::{absent, expired, locked};
use std::time::{Duration, UNIX_EPOCH};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Version of the protocol tus that is spoken here.
const SPOKEN: &str = "1.0.0";

/// Extensions of the protocol that are spoken here.
const EXTENSIONS: &str = "creation,creation-with-upload,creation-defer-length,termination,expiration,checksum";

/// HTTP routes of resumable uploads.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new()
        .routes(routes!(upload_options, create_upload))
        .routes(routes!(get_upload_offset, append_upload, delete_upload, override_upload))
        .route_layer(axum::middleware::from_fn(protocol))
}

/// Middleware that refuses requests in other versions of the tus protocol and states the version in every answer.
async fn protocol(request: Request, next: Next) -> Response {
    let spoken = request.headers().get(RESUMABLE).map(|value| value == SPOKEN);
    let mut response = if request.method() == Method::OPTIONS || spoken == Some(true) {
        next.run(request).await
    } else {
        let found = request.headers().get(RESUMABLE).and_then(|value| value.to_str().ok()).unwrap_or("none").to_owned();
        linger(request).await;
        let detail = format!("found Tus-Resumable {found}, expected {SPOKEN}");
        Problem::new(Kind::UnknownVersion, detail).with(VERSION, SPOKEN).into_response()
    };
    response.headers_mut().insert(RESUMABLE, HeaderValue::from_static(SPOKEN));
    response
}

/// Get the version, extensions and limits of the protocol of resumable uploads.
#[utoipa::path(
    options, path = "/v1/uploads", tag = "uploads",
    responses((status = 204, description = "Version, extensions and limits of the protocol, in headers", headers(
        ("Tus-Resumable" = String, description = "Version of the tus protocol"),
        ("Tus-Version" = String, description = "Supported versions of the protocol"),
        ("Tus-Extension" = String, description = "Supported extensions of the protocol"),
        ("Tus-Max-Size" = u64, description = "Upper bound on the size of an upload in bytes"),
        ("Tus-Checksum-Algorithm" = String, description = "Supported checksum algorithms"),
    )))
)]
async fn upload_options(app: App) -> Response {
    let mut response = StatusCode::NO_CONTENT.into_response();
    let headers = response.headers_mut();
    headers.insert(VERSION, HeaderValue::from_static(SPOKEN));
    headers.insert(HeaderName::from_static("tus-extension"), HeaderValue::from_static(EXTENSIONS));
    headers.insert(HeaderName::from_static("tus-checksum-algorithm"), HeaderValue::from_static(checksum::NAMES));
    headers.insert(MAX_SIZE, app.engine.limits.upload_bytes.into());
    response
}

/// Begin a resumable upload, with or without its first bytes.
///
/// The bytes are sent by `PATCH` to the `Location` of the answer, in any number of requests. The complete upload
/// becomes a measurement by `POST /v1/measurements?upload=ID`, or a material by `POST /v1/materials?upload=ID`.
#[utoipa::path(
    post, path = "/v1/uploads", tag = "uploads",
    params(
        ("Tus-Resumable" = TusVersion, Header, description = "Version of the tus protocol"),
        ("Upload-Length" = Option<u64>, Header, description = "Size of the whole upload in bytes"),
        ("Upload-Defer-Length" = Option<u8>, Header, description = "1 if a later request states the size"),
        ("Upload-Metadata" = Option<String>, Header, description = "Pairs of a key and a value in Base64, separated by commas; the value of `filename` becomes the file name"),
    ),
    request_body(content = Option<Binary>, content_type = "application/offset+octet-stream", description = "First bytes of the upload; may be empty"),
    responses((status = 201, description = "The upload has begun", headers(
        ("Location" = String, description = "URL of the upload"),
        ("Upload-Offset" = u64, description = "Number of bytes received"),
        ("Upload-Expires" = String, description = "Time at which the upload expires"),
    )))
)]
async fn create_upload(app: App, caller: Caller, request: Request) -> Result<Response, Problem> {
    let first =
        if headers::has_bytes(request.headers()) { headers::asked(request.headers()).map(Some) } else { Ok(None) };
    let begun = match first {
        Ok(first) => begin(&app, caller.client(), request.headers()).await.map(|begun| (begun, first)),
        Err(problem) => Err(problem),
    };
    let (begun, first) = match begun {
        Ok(begun) => begun,
        Err(problem) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let location = HeaderValue::from_str(&format!("/v1/uploads/{}", begun.id)).ok();
    let partial = match first {
        Some(asked) => {
            let asked = part::Asked { offset: 0, length: None, begins: true, ..asked };
            part::begin(&app, caller, begun.id, asked, request.into_body()).await?
        }
        None => begun,
    };
    let mut response = StatusCode::CREATED.into_response();
    response.headers_mut().extend(location.map(|value| (header::LOCATION, value)));
    progress(&partial, response.headers_mut());
    Ok(response)
}

async fn begin(app: &App, client: Client, headers: &HeaderMap) -> Result<Partial, Problem> {
    let most = app.engine.limits.upload_bytes;
    let length = headers::length_to_begin(headers)?;
    if let Some(length) = length.filter(|length| *length > most) {
        return Err(Problem::new(Kind::TooLarge, format!("an upload of {length} bytes, expected at most {most}")));
    }
    lacks_room(app, length).await?;
    let metadata = headers::metadata(headers)?;
    let limits = &app.engine.limits;
    let address = Peer::at(client.address);
    match app.engine.begin_partial(address.to_string(), length, metadata).await? {
        Begun::Now(partial) => Ok(partial),
        Begun::TooMany(Bound::All) => {
            let detail = format!("{} uploads are unused, the most allowed; try again later", limits.partial_uploads);
            Err(Problem::new(Kind::Overloaded, detail))
        }
        Begun::TooLarge(Bound::All) => {
            let detail = format!(
                "all unused uploads together would have more than {} bytes; try again later",
                limits.partial_bytes
            );
            Err(Problem::new(Kind::Overloaded, detail))
        }
        Begun::TooMany(bound) => {
            let (by, most) =
                (holder(bound, address), most_of(bound, limits.partial_uploads, limits.partial_uploads_each));
            let detail = format!("{by} has {most} unused uploads, the most allowed; use or delete one of them first");
            Err(Problem::new(Kind::TooManyAtOnce, detail))
        }
        Begun::TooLarge(bound) => {
            let (by, most) = (holder(bound, address), most_of(bound, limits.partial_bytes, limits.partial_bytes_each));
            let detail = format!(
                "the unused uploads of {by} would have more than {most} bytes; use or delete one of them first"
            );
            Err(Problem::new(Kind::TooManyAtOnce, detail))
        }
    }
}

/// Returns the limit that applies to the uploads of one client or of one tenant, from the limits on all uploads and on
/// those of one client.
fn most_of(bound: Bound, all: u64, each: u64) -> u64 {
    if bound == Bound::Client { each } else { most_of_tenant(all, each) }
}

/// Returns the client address or `the tenant`, to say in a message whose uploads have reached a limit.
fn holder(bound: Bound, address: Peer) -> String {
    if bound == Bound::Client { address.to_string() } else { "the tenant".to_owned() }
}

/// Get the number of bytes that a resumable upload has received. Waits a few seconds if a request is writing.
#[utoipa::path(
    head, path = "/v1/uploads/{id}", tag = "uploads",
    params(
        ("id" = UploadIdText, Path, description = "Id of the upload"),
        ("Tus-Resumable" = TusVersion, Header, description = "Version of the tus protocol"),
    ),
    responses((status = 200, description = "Progress of the upload, in headers", headers(
        ("Upload-Offset" = u64, description = "Number of bytes received"),
        ("Upload-Length" = u64, description = "Size of the whole upload in bytes, if it is known"),
        ("Upload-Defer-Length" = u8, description = "1 if the size is not known yet"),
        ("Upload-Metadata" = String, description = "Metadata that were sent when the upload began"),
        ("Upload-Expires" = String, description = "Time at which the upload expires"),
    )))
)]
async fn get_upload_offset(app: App, Id32(id): Id32) -> Result<Response, Problem> {
    let partial = app.engine.settled_partial(&id).await?.ok_or_else(|| absent(&id))?;
    if partial.is_expired {
        return Err(expired(&id));
    }
    if partial.is_held {
        return Err(locked(&id));
    }
    let mut response = StatusCode::OK.into_response();
    let headers = response.headers_mut();
    match partial.length {
        Some(length) => headers.insert(LENGTH, length.into()),
        None => headers.insert(DEFER_LENGTH, HeaderValue::from_static("1")),
    };
    if !partial.metadata.is_empty() {
        headers.extend(HeaderValue::from_str(&partial.metadata).ok().map(|value| (METADATA, value)));
    }
    progress(&partial, headers);
    Ok(response)
}

/// Send bytes to a resumable upload. If the connection breaks, the bytes that arrived are kept.
#[utoipa::path(
    patch, path = "/v1/uploads/{id}", tag = "uploads",
    params(
        ("id" = UploadIdText, Path, description = "Id of the upload"),
        ("Tus-Resumable" = TusVersion, Header, description = "Version of the tus protocol"),
        ("Upload-Offset" = u64, Header, description = "Number of bytes that the upload received before this request"),
        ("Upload-Length" = Option<u64>, Header, description = "Size of the whole upload in bytes, if no earlier request stated it"),
        ("Upload-Checksum" = Option<String>, Header, description = "Algorithm, `sha1` or `sha256`, and checksum of this body in Base64; a body that does not match it is discarded"),
    ),
    request_body(content = Binary, content_type = "application/offset+octet-stream", description = "Next bytes of the upload"),
    responses((status = 204, description = "The bytes were added to the upload", headers(
        ("Upload-Offset" = u64, description = "Number of bytes received"),
        ("Upload-Expires" = String, description = "Time at which the upload expires"),
    )))
)]
async fn append_upload(app: App, caller: Caller, Id32(id): Id32, request: Request) -> Result<Response, Problem> {
    append(&app, caller, id, request).await
}

async fn append(app: &App, caller: Caller, id: String, request: Request) -> Result<Response, Problem> {
    let asked = match headers::asked(request.headers()) {
        Ok(asked) => asked,
        Err(problem) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let partial = part::append(app, caller, id, asked, request.into_body()).await?;
    let mut response = StatusCode::NO_CONTENT.into_response();
    progress(&partial, response.headers_mut());
    Ok(response)
}

/// Delete a resumable upload. The next clean-up of the store removes its bytes.
#[utoipa::path(
    delete, path = "/v1/uploads/{id}", tag = "uploads",
    params(
        ("id" = UploadIdText, Path, description = "Id of the upload"),
        ("Tus-Resumable" = TusVersion, Header, description = "Version of the tus protocol"),
    ),
    responses((status = 204, description = "The upload is deleted"))
)]
async fn delete_upload(app: App, Id32(id): Id32) -> Result<StatusCode, Problem> {
    delete(&app, &id).await
}

async fn delete(app: &App, id: &str) -> Result<StatusCode, Problem> {
    if app.engine.end_partial(id).await? { Ok(StatusCode::NO_CONTENT) } else { Err(absent(id)) }
}

/// Send bytes to a resumable upload, or delete it, from a network that only passes `POST`: the header
/// `X-HTTP-Method-Override` names `PATCH` or `DELETE`.
#[utoipa::path(
    post, path = "/v1/uploads/{id}", tag = "uploads",
    params(
        ("id" = UploadIdText, Path, description = "Id of the upload"),
        ("Tus-Resumable" = TusVersion, Header, description = "Version of the tus protocol"),
        ("X-HTTP-Method-Override" = OverridingMethod, Header, description = "Method to carry out: `PATCH` or `DELETE`"),
        ("Upload-Offset" = Option<u64>, Header, description = "For `PATCH`: number of bytes that the upload received before this request"),
    ),
    request_body(content = Binary, content_type = "application/offset+octet-stream", description = "For `PATCH`: next bytes of the upload"),
    responses((status = 204, description = "The bytes were added to the upload (`PATCH`), or the upload is deleted (`DELETE`)"))
)]
async fn override_upload(app: App, caller: Caller, Id32(id): Id32, request: Request) -> Result<Response, Problem> {
    match overriding(request.headers()) {
        Some(Overriding::Patch) => append(&app, caller, id, request).await,
        Some(Overriding::Delete) => delete(&app, &id).await.map(IntoResponse::into_response),
        None => {
            linger(request).await;
            Err(Problem::new(Kind::BadHeader, "X-HTTP-Method-Override: expected PATCH or DELETE"))
        }
    }
}

/// HTTP method that a `POST` request carries out instead, as its header `X-HTTP-Method-Override` states.
#[derive(Clone, Copy, Debug)]
enum Overriding {
    Patch,
    Delete,
}

fn overriding(headers: &HeaderMap) -> Option<Overriding> {
    match headers.get("x-http-method-override")?.as_bytes() {
        b"PATCH" => Some(Overriding::Patch),
        b"DELETE" => Some(Overriding::Delete),
        _ => None,
    }
}

/// Returns the HTTP method that a request carries out: on the route of a resumable upload the one in
/// `X-HTTP-Method-Override`, otherwise its own.
pub(super) fn carried_out(parts: &Parts) -> &str {
    let route = Route::of(&parts.extensions);
    let is_overridden = parts.method == Method::POST && route == Some("/v1/uploads/{id}");
    match overriding(&parts.headers).filter(|_| is_overridden) {
        Some(Overriding::Patch) => "PATCH",
        Some(Overriding::Delete) => "DELETE",
        None => parts.method.as_str(),
    }
}

/// Writes the headers that say how far an upload is.
fn progress(partial: &Partial, headers: &mut HeaderMap) {
    headers.insert(OFFSET, partial.received.into());
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    let expires = UNIX_EPOCH + Duration::from_millis(partial.expires_ms.max(0) as u64);
    headers.extend(HeaderValue::from_str(&httpdate::fmt_http_date(expires)).ok().map(|value| (EXPIRES, value)));
}
