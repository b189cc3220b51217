//! `/v1/jobs`: work that outlives a request.

use super::events;
use super::extract::{JobId, SmallJson, parse_json};
use super::job::{Job, absent, change, find};
use super::places::Peer;
use super::problem::{Kind, Problem};
use super::schemas::{DigestText, DomainName, InterpolationName, JobIdText, PolicyName, StatedQuantityName, Text};
use super::state::App;
use crate::catalog::{Enqueued, JobRow, JobState};
use crate::jobs::{JobRequest, Kind as JobKind, KindOnly};
use crate::store::Digest;
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::time::Duration;
use utoipa::ToSchema;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// The routes of this resource.
pub(crate) fn routes() -> OpenApiRouter<App> {
    OpenApiRouter::new()
        .routes(routes!(post_job))
        .routes(routes!(get_job))
        .routes(routes!(events::get_job_events))
        .routes(routes!(cancel_job))
}

/// Upper bound in seconds on the N of `Prefer: wait=N`. Raising it lets one request hold a place for longer.
const LONGEST_WAIT: u64 = 60;

/// Job request; `kind` selects its type. Default: `compress`.
#[derive(ToSchema)]
#[schema(as = JobRequest)]
#[serde(untagged)]
#[allow(dead_code, reason = "describes jobs::JobRequest, whose types know nothing of OpenAPI")]
enum RequestSchema {
    Compress(Box<CompressSchema>),
    Paper(PaperSchema),
}

/// Request to recompute tables of the paper, beside the printed figures.
#[derive(ToSchema)]
#[schema(as = PaperRequest)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "describes jobs::PaperRequest, whose types know nothing of OpenAPI")]
struct PaperSchema {
    /// Always `paper`.
    kind: Paper,
    /// Table numbers, 1 to 7, each once, in the desired order. Default: all tables.
    #[schema(min_items = 1, max_items = 7)]
    tables: Option<Vec<u8>>,
}

/// Compression request, in the names of the command line.
#[derive(ToSchema)]
#[schema(as = CompressRequest)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "describes jobs::CompressRequest, whose types know nothing of OpenAPI")]
struct CompressSchema {
    /// `compress` (the default).
    #[schema(nullable = false)]
    kind: Option<Compress>,
    /// Id of the measurement.
    measurement: DigestText,
    /// Target: one of `{"er_l2": 0.01}`, `{"er_l1": 0.01}`, `{"max_relative_error": 0.02}`, `{"max_absolute_error":
    /// 0.5}` (in the unit of the samples), `{"relative_rmse": 0.01}`, `{"delta_e": 1}` or `{"delta_e": {"at_most": 1,
    /// "illuminant": "A"}}` (CIEDE2000 of every spectrum; illuminant A, B, C, D50, D65, F11 or E, default D65; policy
    /// `rd`), `{"ratio": 64}`, `{"bytes": 4096}`, `{"step": 0.02}` (no error bound: fixes the quantiser step in
    /// natural-log units; policy `rd`), `"auto"` (er(L2) down to the estimated noise of the measurement, or to its
    /// stated uncertainties where these are larger; policy `rd`), `"lossless"`.
    ///
    /// For a measurement on a grid of angles the bound holds at the samples of the file. `{"er_l2": 0.01}` keeps the
    /// root mean square of (decoded − stated) / stated at most 1 %, over all values above zero at the stated angles and
    /// wavelengths. If samples were averaged over triangles first, the bound holds against these averages, and the
    /// errors at the samples are stated beside it.
    #[schema(value_type = Value, example = json!({"er_l2": 0.01}))]
    target: serde_json::Value,
    /// Selection and coding of the coefficients: `rd` or `conventional`.
    #[schema(nullable = false)]
    policy: Option<PolicyName>,
    /// Name of the spectral basis, or `auto`.
    #[schema(nullable = false)]
    basis: Option<String>,
    /// Relative floor, as a fraction of the maximum: smaller samples leave the relative errors, and their absolute
    /// error is at most the floor.
    floor: Option<f64>,
    /// Upper bound on the relative error of the light of any direction and wavelength (directional albedo, flux);
    /// policy `rd`.
    albedo_error: Option<f64>,
    /// Directions of the tensor. `grid` keeps the grid of angles that the file must state (the default if it states one
    /// and no level is given). `triangles` averages samples over triangles, as a subdivision level also does.
    domain: Option<DomainName>,
    /// Interpolation between the directions of a grid of angles, written into the file: `cubic` (the default) or
    /// `linear`. `cubic` interpolates logarithms, blended with enough linear interpolation to keep a luminaire's flux
    /// within 0.3 % of the zonal flux of its samples.
    #[schema(nullable = false)]
    interpolation: Option<InterpolationName>,
    /// True to replace each value of a BRDF on its own grid by its mean with the value of the exchanged pair of
    /// directions. Errors are then measured against these means.
    #[schema(nullable = false)]
    reciprocal: Option<bool>,
    /// Subdivision level of the triangles of incoming directions.
    incoming_level: Option<u8>,
    /// Subdivision level of the triangles of outgoing directions.
    outgoing_level: Option<u8>,
    /// Wavelengths to resample to: `START:STOP:STEP` in nm.
    wavelengths: Option<String>,
    /// Axes of an array, in the form of its manifest.
    #[schema(value_type = Option<Value>)]
    axes: Option<serde_json::Value>,
    /// Quantity, if the file does not state it. `reflectance-factor` (BRF, HCRF) is divided by π to give a BRDF.
    quantity: Option<StatedQuantityName>,
    /// True (the default) to write the provenance into the file.
    #[schema(nullable = false)]
    metadata: Option<bool>,
    /// True to make each incoming direction decodable without the others (policy `rd`). The material then has no
    /// coarser levels.
    #[schema(nullable = false)]
    random_access: Option<bool>,
    /// True to fail the job (`unreachable-target`) if the material adds more to the noise of scattered samples than
    /// twice the promised error or half of the noise, or if its light differs from theirs. Otherwise these are warnings
    /// among its notes.
    #[schema(nullable = false)]
    strict: Option<bool>,
    /// Name of the material.
    name: Option<Text>,
    /// Licence of the material.
    licence: Option<Text>,
    /// Tags of the material.
    #[schema(nullable = false, max_items = 32)]
    tags: Option<Vec<Text>>,
}

/// The kind of a request to compress.
#[derive(ToSchema)]
#[schema(as = CompressKind)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "describes jobs::Kind")]
enum Compress {
    Compress,
}

/// The kind of a request for the paper's tables.
#[derive(ToSchema)]
#[schema(as = PaperKind)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "describes jobs::Kind")]
enum Paper {
    Paper,
}

/// Queue a job.
#[utoipa::path(
    post, path = "/v1/jobs", tag = "jobs", request_body = RequestSchema,
    params(
        ("Idempotency-Key" = inline(Option<String>), Header, nullable = false, min_length = 1, max_length = 255,
            pattern = "^[!-~]([ -~]*[!-~])?$", description = "The same key and body are the same job for a day"),
        ("Prefer" = inline(Option<String>), Header, nullable = false, pattern = "^wait=[0-9]{1,4}$",
            description = "`wait=N`: wait up to N (at most 60) seconds for the end"),
    ),
    responses(
        (status = 202, description = "It waits or runs", body = Job, headers(("Location" = String, description = "The job"))),
        (status = 200, description = "It has ended", body = Job, headers(("Location" = String, description = "The job"))),
    )
)]
async fn post_job(
    State(app): State<App>,
    peer: Peer,
    headers: HeaderMap,
    SmallJson(body): SmallJson,
) -> Result<Response, Problem> {
    let request = match parse_json::<KindOnly>(&body.bytes)?.kind {
        JobKind::Compress => JobRequest::Compress(parse_json(&body.bytes)?),
        JobKind::Paper => JobRequest::Paper(parse_json(&body.bytes)?),
    };
    drop(body);
    request.check().map_err(|detail| Problem::new(Kind::InvalidRequest, detail))?;
    let wait = wait(&headers);
    let key = idempotency_key(&headers)?;
    let measurement = request.measurement().map(|id| id.to_string()).unwrap_or_default();
    // Requests are compared as parsed, so white space in the body does not matter.
    let meaning = serde_json::to_vec(&request).map_err(|error| Problem::internal(&error))?;
    let enqueued = app.engine.enqueue(&request, key.map(|key| (key, Digest::of(&meaning)))).await?;
    let (mut row, new) = match enqueued {
        Enqueued::New(row) => (row, true),
        Enqueued::Known(row) => (row, false),
        Enqueued::KeyTaken => {
            return Err(Problem::new(Kind::KeyReused, "the Idempotency-Key came with another body before"));
        }
        Enqueued::NoMeasurement => {
            let detail = format!("measurement: there is no measurement {measurement}");
            return Err(Problem::new(Kind::InvalidRequest, detail));
        }
        Enqueued::Full => {
            let detail = format!("{} jobs are waiting already", app.engine.limits.queued_jobs);
            return Err(Problem::new(Kind::TooManyJobs, detail));
        }
    };
    if new {
        tracing::info!(job = row.id, measurement, "job queued");
    }
    // The job is queued: a client without a place to wait is answered at once.
    let place = wait.map(|_| app.held.followers.take(peer, 1));
    let wait = wait.filter(|_| matches!(place, Some(Ok(_))));
    if let Some(seconds) = wait {
        row = until_final(&app, row, Duration::from_secs(seconds)).await?;
    }
    drop(place);
    let ended = row.state.is_final();
    let status = if ended { StatusCode::OK } else { StatusCode::ACCEPTED };
    let job = Job::of(row);
    let location = HeaderValue::from_str(&job.links.this).ok();
    let mut response = (status, Json(job)).into_response();
    let headers = response.headers_mut();
    headers.extend(location.map(|value| (header::LOCATION, value)));
    if let Some(seconds) = wait {
        let applied = HeaderValue::from_str(&format!("wait={seconds}")).ok();
        headers.extend(applied.map(|value| (HeaderName::from_static("preference-applied"), value)));
    }
    Ok(response)
}

/// Get the state of a job.
#[utoipa::path(
    get, path = "/v1/jobs/{id}", tag = "jobs", params(("id" = JobIdText, Path, description = "Its id")),
    responses((status = 200, description = "The job", body = Job))
)]
async fn get_job(State(app): State<App>, JobId(id): JobId) -> Result<Json<Job>, Problem> {
    Ok(Json(Job::of(find(&app, &id).await?)))
}

/// Ask a job to stop.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/cancel", tag = "jobs", params(("id" = JobIdText, Path, description = "Its id")),
    responses(
        (status = 200, description = "It is cancelled", body = Job),
        (status = 202, description = "Its worker was asked", body = Job),
    )
)]
async fn cancel_job(State(app): State<App>, JobId(id): JobId) -> Result<Response, Problem> {
    let row = app.engine.cancel(&id).await?.ok_or_else(|| absent(&id))?;
    match row.state {
        JobState::Cancelled => Ok(Json(Job::of(row)).into_response()),
        JobState::Queued | JobState::Running => Ok((StatusCode::ACCEPTED, Json(Job::of(row))).into_response()),
        JobState::Succeeded | JobState::Failed | JobState::Dead => {
            Err(Problem::new(Kind::JobFinished, format!("job {id} has {} already", row.state)))
        }
    }
}

/// Waits up to `time` for a job to end.
async fn until_final(app: &App, mut row: JobRow, time: Duration) -> Result<JobRow, Problem> {
    let mut changes = app.engine.hub.listen();
    let deadline = tokio::time::Instant::now() + time;
    while !row.state.is_final() {
        row = find(app, &row.id).await?;
        if row.state.is_final() {
            break;
        }
        tokio::select! {
            () = tokio::time::sleep_until(deadline) => break,
            () = app.stop.cancelled() => break,
            () = change(&mut changes, &row.id) => {}
        }
    }
    Ok(row)
}

/// Parses `wait=N` from `Prefer` (RFC 7240), capped at [`LONGEST_WAIT`]. Other preferences are ignored.
fn wait(headers: &HeaderMap) -> Option<u64> {
    headers
        .get_all("prefer")
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|text| text.split([',', ';']))
        .find_map(|preference| {
            let (name, value) = preference.split_once('=')?;
            name.trim().eq_ignore_ascii_case("wait").then_some(())?;
            value.trim().trim_matches('"').parse::<u64>().ok()
        })
        .map(|seconds| seconds.min(LONGEST_WAIT))
}

fn idempotency_key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let Some(value) = headers.get("idempotency-key") else { return Ok(None) };
    let key = value.to_str().unwrap_or_default().trim();
    if key.is_empty() || key.len() > 255 {
        return Err(Problem::new(Kind::BadHeader, "Idempotency-Key: expected 1 to 255 visible ASCII characters"));
    }
    Ok(Some(key.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_are_found_among_preferences_and_capped() {
        let prefer = |text: &'static str| {
            wait(&HeaderMap::from_iter([(HeaderName::from_static("prefer"), HeaderValue::from_static(text))]))
        };
        assert_eq!(prefer("wait=5"), Some(5));
        assert_eq!(prefer("respond-async, Wait = \"7\""), Some(7));
        assert_eq!(prefer("wait=9999"), Some(60));
        assert_eq!(prefer("wait=soon"), None);
        assert_eq!(prefer("return=minimal"), None);
    }
}
