//! Root of the interface: introduction, health, metrics and description.

use super::figures::page;
use super::guard::AuthMode;
use super::places::Places;
use super::problem::{Kind, Problem};
use super::schemas::Described;
use super::state::{App, Service};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of the start page (first commands to try), the health checks, the metrics and the OpenAPI description.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new()
        .routes(routes!(index))
        .routes(routes!(healthz))
        .routes(routes!(readyz))
        .routes(routes!(metrics_page))
        .routes(routes!(openapi_json))
}

/// Show an introduction with the first commands to try.
#[utoipa::path(
    get, path = "/", tag = "root",
    responses((status = 200, description = "Introduction as plain text", body = String, content_type = "text/plain"))
)]
async fn index(app: App, headers: HeaderMap) -> String {
    // The host is the client's own word and goes back to it as plain text only.
    let host = headers.get(header::HOST).and_then(|value| value.to_str().ok()).unwrap_or("127.0.0.1:8080");
    let key = match app.guard.mode {
        AuthMode::Off => "",
        AuthMode::Keys | AuthMode::KeysAndAnonymousRead => {
            "Requests need a key: add -H 'Authorization: Bearer KEY' to each.\n\n"
        }
    };
    format!(
        "wavelume {version}: acquired radiometric measurements, compressed to a promised error.\n\n\
         {key}Upload a measurement (IES, EULUMDAT, spectral tables, BRDF files, npy …) and see what was understood:\n\
         \n  curl --data-binary @lamp.ies 'http://{host}/v1/measurements?filename=lamp.ies'\n\n\
         Compress it to 1 % (put the id of the answer in):\n\
         \n  curl -H 'Content-Type: application/json' -H 'Prefer: wait=30' \\\n       \
         -d '{{\"measurement\":\"b3-…\",\"target\":{{\"er_l2\":0.01}}}}' http://{host}/v1/jobs\n\n\
         Fetch the material, or ask it (put the material's id in):\n\
         \n  curl -o lamp.wlm 'http://{host}/v1/materials/b3-…/content'\
         \n  curl 'http://{host}/v1/materials/b3-…/spectrum?wo=180,0'\n\n\
         Everything else: http://{host}/openapi.json, /v1/formats, /v1/bases, /v1/materials, /healthz, /metrics\n",
        version = env!("CARGO_PKG_VERSION"),
    )
}

/// Check that the process answers requests.
#[utoipa::path(
    get, path = "/healthz", tag = "root",
    responses((status = 200, description = "The process answers", body = String, content_type = "text/plain"))
)]
async fn healthz() -> &'static str {
    "ok\n"
}

/// Check that the service is ready: the catalog answers, both the catalog and the data directory can be written, and
/// the store answers and belongs to this service. Never waits for another writer; takes at most about four seconds.
#[utoipa::path(
    get, path = "/readyz", tag = "root",
    responses((status = 200, description = "The service is ready: `ready`", body = String, content_type = "text/plain"))
)]
async fn readyz(app: App) -> Result<&'static str, Problem> {
    if app.stopping.is_cancelled() {
        return Err(Problem::new(Kind::Unavailable, "stopping: running requests and jobs end"));
    }
    app.engine.archive.catalog.ping().await?;
    // A disk with space for deletions alone is no reason to send readers elsewhere.
    let staging = app.engine.archive.staging.clone().keeping(0);
    let staged = tokio::task::spawn_blocking(move || staging.stage(b"ready?").map(drop)).await;
    staged.map_err(|error| Problem::internal(&error))??;
    app.engine.archive.answers().await.map_err(|reason| Problem::away(&reason))?;
    Ok("ready\n")
}

/// Get the metrics of the service in the text format of Prometheus.
#[utoipa::path(
    get, path = "/metrics", tag = "root",
    responses((status = 200, description = "The metrics", body = String, content_type = "text/plain"))
)]
async fn metrics_page(app: App) -> Result<Response, Problem> {
    let jobs = app.engine.archive.catalog.job_counts().await?;
    metrics::gauge!("wavelume_jobs", "state" => "queued").set(jobs.queued as f64);
    metrics::gauge!("wavelume_jobs", "state" => "running").set(jobs.running as f64);
    metrics::gauge!("wavelume_oldest_waiting_seconds").set(jobs.oldest_ms as f64 / 1000.0);
    metrics::gauge!("wavelume_uploads_running").set(app.held.uploads.taken() as f64);
    metrics::gauge!("wavelume_streams_running").set(app.held.streams.taken() as f64);
    for (kind, taken) in app.held.kinds().map(Places::figure) {
        metrics::gauge!("wavelume_places_taken", "place" => kind).set(taken as f64);
    }
    let (count, bytes) = app.engine.open_materials().await;
    metrics::gauge!("wavelume_opened_materials").set(count as f64);
    metrics::gauge!("wavelume_opened_bytes").set(bytes as f64);
    let archive = app.engine.archive.clone();
    let disks = tokio::task::spawn_blocking(move || {
        (archive.disks(), archive.catalog.reserve().map(crate::catalog::Reserve::held))
    });
    let (disks, reserve) = disks.await.map_err(|error| Problem::internal(&error))?;
    for (place, disk) in disks {
        metrics::gauge!("wavelume_disk_free_bytes", "place" => place).set(disk.free as f64);
        metrics::gauge!("wavelume_disk_bytes", "place" => place).set(disk.size as f64);
    }
    if let Some(held) = reserve {
        metrics::gauge!("wavelume_reserve_bytes").set(held as f64);
    }
    Ok(page(app.metrics.as_ref()))
}

/// Get the OpenAPI description of this HTTP interface.
#[utoipa::path(
    get, path = "/openapi.json", tag = "root",
    responses((status = 200, description = "OpenAPI 3.1 document", body = Described))
)]
async fn openapi_json(app: App) -> Result<Response, Problem> {
    let write = app.openapi;
    let written = tokio::task::spawn_blocking(move || write().as_deref()).await;
    let text = written.map_err(|error| Problem::internal(&error))?.map_err(|error| Problem::internal(error))?;
    Ok(([(header::CONTENT_TYPE, HeaderValue::from_static("application/json"))], text).into_response())
}
