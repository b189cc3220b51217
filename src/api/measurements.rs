//! `/v1/measurements`: uploads and their descriptions.

use super::content;
use super::extract::{Id, Query, linger, word};
use super::page::page;
use super::problem::{Kind, Problem};
use super::resumable;
use super::schemas::{Binary, CursorText, FileForm, PageSize, Word};
use super::state::{App, Service};
use super::upload::Received;
use super::upload_query::UploadQuery;
use crate::catalog::{Deleted, MeasurementFilter, MeasurementRow};
use crate::domain::Quantity;
use crate::jobs::{Ingested, Understood, check_text};
use crate::store::Digest;
use axum::Json;
use axum::extract::{FromRequestParts, Request};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of measurements.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new()
        .routes(routes!(post_measurement, list_measurements))
        .routes(routes!(get_measurement, delete_measurement))
        .routes(routes!(get_measurement_content))
}

/// Filter of a list of measurements.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// Cursor of the wanted page: the value `next` of an earlier answer.
    #[param(value_type = Option<CursorText>)]
    cursor: Option<String>,
    /// Largest number of items on a page.
    #[param(value_type = Option<PageSize>)]
    limit: Option<usize>,
    /// Physical quantity to filter by: only measurements of this quantity are listed.
    quantity: Option<Quantity>,
    /// File format to filter by: only measurements of this format are listed.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    format: Option<String>,
    /// Text to filter by: only measurements with this text in their name, file name or format are listed.
    #[serde(default, deserialize_with = "word")]
    #[param(value_type = Option<Word>)]
    q: Option<String>,
}

/// Description of an uploaded measurement.
#[derive(Debug, Serialize, ToSchema)]
struct Measurement {
    /// Id of the measurement: digest of the uploaded bytes or, for an upload with options, of bytes and options.
    id: Digest,
    /// Digest of the uploaded bytes.
    content_digest: Digest,
    name: Option<String>,
    file_name: Option<String>,
    /// Size of the uploaded file in bytes.
    bytes: u64,
    #[serde(flatten)]
    understood: Understood,
    /// Time of the upload, in milliseconds since the Unix epoch.
    created_ms: i64,
    links: Links,
}

/// URLs of the resources related to a measurement.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = MeasurementLinks)]
struct Links {
    #[serde(rename = "self")]
    this: String,
    content: String,
    materials: String,
}

/// One page of the list of measurements.
#[derive(Debug, Serialize, ToSchema)]
struct MeasurementPage {
    items: Vec<Measurement>,
    /// Cursor of the next page of measurements; null on the last page.
    next: Option<String>,
}

/// Result of unpacking an uploaded archive.
#[derive(Debug, Serialize, ToSchema)]
struct Unpacked {
    /// Measurements found in the archive, one for each readable file, sorted by file name.
    items: Vec<Measurement>,
    /// Files of the archive that are not measurements.
    skipped: Vec<Skipped>,
}

/// A file of an uploaded archive that is not a measurement.
#[derive(Debug, Serialize, ToSchema)]
struct Skipped {
    file_name: String,
    reason: String,
}

/// Answer to the upload of a single file or of a zip archive.
#[derive(Debug, Serialize, ToSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "describes the two answers in the OpenAPI document")]
enum Uploaded {
    /// Answer to the upload of a single file.
    One(Box<Measurement>),
    /// Answer to the upload of a zip archive, with one measurement for each measurement file in it.
    Several(Unpacked),
}

/// Upload a measurement of any supported format, or a zip archive of them.
#[utoipa::path(
    post, path = "/v1/measurements", tag = "measurements", params(UploadQuery),
    request_body(content((Binary = "application/octet-stream"), (FileForm = "multipart/form-data")),
        description = "The bytes of the file, or a form (`multipart/form-data`) with one file, which also gives the file name. \
                       `Content-Encoding: gzip` and `zstd` are decoded; any other `Content-Type` is ignored. \
                       Each file of a zip archive becomes a measurement, read with the options given. Bytes that were uploaded before keep \
                       the name and file name of their first upload"),
    responses(
        (status = 201, description = "New measurement; for an archive, at least one is new", body = Uploaded, headers(("Location" = String, description = "URL of the measurement"))),
        (status = 200, description = "The measurement was stored before; for an archive, all its measurements", body = Uploaded),
    )
)]
async fn post_measurement(app: App, request: Request) -> Result<Response, Problem> {
    let start = std::time::Instant::now();
    let (mut parts, body) = request.into_parts();
    let stated = Query::<UploadQuery>::from_request_parts(&mut parts, &app).await;
    let request = Request::from_parts(parts, body);
    let (mut upload, id) = match stated {
        Ok(Query(UploadQuery(upload, id))) => (upload, id),
        Err(problem) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let (Received { staged, file_name, lines }, used) = resumable::receive(&app, id.as_deref(), request).await?;
    let bytes = staged.bytes();
    if upload.file_name.is_none() {
        upload.file_name = file_name.filter(|name| check_text("filename", name).is_ok());
    }
    let ingested = app.engine.ingest_any(staged, upload).await;
    if let Some(used) = used {
        used.end(&app, ingested.is_ok()).await;
    }
    let ingested = ingested.map_err(|error| lines.explain(error.into()))?;
    metrics::counter!("wavelume_uploaded_bytes_total").increment(bytes);
    let duration_ms = start.elapsed().as_millis() as u64;
    let created = |new: bool| if new { StatusCode::CREATED } else { StatusCode::OK };
    let (row, new) = match ingested {
        Ingested::One(row, new) => (row, new),
        Ingested::Several { items, skipped } => {
            let new = items.iter().filter(|(_, new)| *new).count();
            tracing::info!(bytes, items = items.len(), new, skipped = skipped.len(), duration_ms, "archive uploaded");
            let items = items.into_iter().map(|(row, _)| Measurement::of(row)).collect::<Result<_, _>>()?;
            let skipped = skipped.into_iter().map(|(file_name, reason)| Skipped { file_name, reason }).collect();
            return Ok((created(new > 0), Json(Unpacked { items, skipped })).into_response());
        }
    };
    tracing::info!(measurement = %row.id, bytes, new, duration_ms, "measurement uploaded");
    let status = created(new);
    let measurement = Measurement::of(row)?;
    let location = HeaderValue::from_str(&measurement.links.this).ok();
    let mut response = (status, Json(measurement)).into_response();
    response.headers_mut().extend(location.map(|value| (header::LOCATION, value)));
    Ok(response)
}

/// List measurements, newest first.
#[utoipa::path(
    get, path = "/v1/measurements", tag = "measurements", params(ListQuery),
    responses((status = 200, description = "One page of the list", body = MeasurementPage))
)]
async fn list_measurements(app: App, Query(query): Query<ListQuery>) -> Result<Json<MeasurementPage>, Problem> {
    let (cursor, limit) = page(query.cursor.as_deref(), query.limit)?;
    let filter = MeasurementFilter { quantity: query.quantity, format: query.format, q: query.q };
    let page = app.engine.archive.catalog.measurements(&filter, cursor, limit).await?;
    let items = page.items.into_iter().map(Measurement::of).collect::<Result<_, _>>()?;
    Ok(Json(MeasurementPage { items, next: page.next.map(|cursor| cursor.to_string()) }))
}

/// Get the description of a measurement.
#[utoipa::path(
    get, path = "/v1/measurements/{id}", tag = "measurements", params(("id" = Digest, Path, description = "Id of the measurement")),
    responses((status = 200, description = "Description of the measurement", body = Measurement))
)]
async fn get_measurement(app: App, Id(id): Id) -> Result<Json<Measurement>, Problem> {
    Measurement::of(row(&app, id).await?).map(Json)
}

/// Delete a measurement. The next clean-up of the store removes its bytes.
#[utoipa::path(
    delete, path = "/v1/measurements/{id}", tag = "measurements", params(("id" = Digest, Path, description = "Id of the measurement")),
    responses((status = 204, description = "The measurement is deleted"))
)]
async fn delete_measurement(app: App, Id(id): Id) -> Result<StatusCode, Problem> {
    deleted(app.engine.archive.catalog.delete_measurement(id).await?, &format!("there is no measurement {id}"))
}

/// Get the uploaded bytes of a measurement, with the content coding of the upload removed.
#[utoipa::path(
    get, path = "/v1/measurements/{id}/content", tag = "measurements",
    params(("id" = Digest, Path, description = "Id of the measurement")),
    responses(
        (status = 200, description = "The uploaded bytes", body = Binary, content_type = "application/octet-stream"),
        (status = 206, description = "The requested range of the bytes", body = Binary, content_type = "application/octet-stream"),
        (status = 304, description = "The content still has the entity tag of `If-None-Match`"),
    )
)]
async fn get_measurement_content(
    app: App,
    method: Method,
    headers: HeaderMap,
    Id(id): Id,
) -> Result<Response, Problem> {
    let row = row(&app, id).await?;
    let name = row.file_name.as_deref();
    content::respond_named(&app, row.content, "application/octet-stream", name, &method, &headers).await
}

async fn row(app: &App, id: Digest) -> Result<MeasurementRow, Problem> {
    let row = app.engine.archive.catalog.measurement(id).await?;
    row.ok_or_else(|| Problem::new(Kind::NotFound, format!("there is no measurement {id}")))
}

/// Maps the outcome of deleting a measurement or a material to the status or the error of the HTTP answer.
pub(super) fn deleted(deleted: Deleted, absent: &str) -> Result<StatusCode, Problem> {
    match deleted {
        Deleted::Done => Ok(StatusCode::NO_CONTENT),
        Deleted::Absent => Err(Problem::new(Kind::NotFound, absent)),
        Deleted::InUse(detail) => Err(Problem::new(Kind::InUse, detail)),
    }
}

impl Measurement {
    fn of(row: MeasurementRow) -> Result<Self, Problem> {
        let understood = serde_json::from_str(&row.document)
            .map_err(|error| Problem::internal(&format!("document of measurement {}: {error}", row.id)))?;
        let this = format!("/v1/measurements/{}", row.id);
        Ok(Self {
            links: Links {
                content: format!("{this}/content"),
                materials: format!("/v1/materials?measurement={}", row.id),
                this,
            },
            id: row.id,
            content_digest: row.content,
            name: row.name,
            file_name: row.file_name,
            bytes: row.bytes,
            understood,
            created_ms: row.created_ms,
        })
    }
}
