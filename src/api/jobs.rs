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

/// The longest that a client may wait for a job in one request.
const LONGEST_WAIT: u64 = 60;

/// What to do; `kind` says which, and is `compress` if nothing is said.
#[derive(ToSchema)]
#[schema(as = JobRequest)]
#[serde(untagged)]
#[allow(dead_code, reason = "describes jobs::JobRequest, whose types know nothing of OpenAPI")]
enum RequestSchema {
    Compress(Box<CompressSchema>),
    Paper(PaperSchema),
}

/// A wish for the tables of the paper, made again beside the printed figures.
#[derive(ToSchema)]
#[schema(as = PaperRequest)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "describes jobs::PaperRequest, whose types know nothing of OpenAPI")]
struct PaperSchema {
    /// `paper`.
    kind: Paper,
    /// Their numbers, 1 to 7, each once, in the order wanted; all tables if nothing is said.
    #[schema(min_items = 1, max_items = 7)]
    tables: Option<Vec<u8>>,
}

/// A wish to compress, in the command line's names.
#[derive(ToSchema)]
#[schema(as = CompressRequest)]
#[serde(deny_unknown_fields)]
#[allow(dead_code, reason = "describes jobs::CompressRequest, whose types know nothing of OpenAPI")]
struct CompressSchema {
    /// `compress`, which is also what is done if nothing is said.
    #[schema(nullable = false)]
    kind: Option<Compress>,
    /// The id of the measurement.
    measurement: DigestText,
    /// The promise: one of `{"er_l2": 0.01}`, `{"er_l1": 0.01}`, `{"max_relative_error": 0.02}`,
    /// `{"max_absolute_error": 0.5}` (in the unit of the samples), `{"relative_rmse": 0.01}`, `{"delta_e": 1}` or
    /// `{"delta_e": {"at_most": 1, "illuminant": "A"}}` (CIEDE2000 of every spectrum; illuminant A, B, C, D50, D65, F11
    /// or E, D65 if nothing is said; policy `rd`), `{"ratio": 64}`, `{"bytes": 4096}`, `{"step": 0.02}` (no promise:
    /// the quantiser's step in natural logarithms; policy `rd`), `"auto"` (er(L2) down to the estimated noise of the
    /// measurement, or to the uncertainties that it states where these are larger; policy `rd`), `"lossless"`.
    ///
    /// A measurement on a grid of angles keeps its promise at the samples of the file: `{"er_l2": 0.01}` keeps the root mean
    /// square of (decoded − stated) / stated, over all values above zero at the angles and wavelengths that the file states, at
    /// most 1 %. Where samples were averaged over triangles first, it is one against these averages, and the errors at the
    /// samples are stated beside it.
    #[schema(value_type = Value, example = json!({"er_l2": 0.01}))]
    target: serde_json::Value,
    /// `rd` or `conventional`.
    #[schema(nullable = false)]
    policy: Option<PolicyName>,
    /// The spectral basis, or `auto`.
    #[schema(nullable = false)]
    basis: Option<String>,
    /// Relative floor.
    floor: Option<f64>,
    /// The largest relative error of the light of any direction and wavelength (directional albedo, flux); policy `rd`.
    albedo_error: Option<f64>,
    /// `grid`: directions stay on the angles of the file, which has to state a grid of them (what is done where it does and
    /// nothing is asked for); `triangles`: samples are averaged over triangles, as a level asks, too.
    domain: Option<DomainName>,
    /// The function between the directions of a grid of angles, written into the file: `cubic`, of logarithms and with as much of
    /// straight lines as keeps a luminaire's flux within 0.3 % of the zonal flux of its samples, or `linear`. Default `cubic`.
    #[schema(nullable = false)]
    interpolation: Option<InterpolationName>,
    /// Replaces each value of a BRDF on its own grid with the mean of it and that of the exchanged pair of directions; errors are
    /// then those against these means.
    #[schema(nullable = false)]
    reciprocal: Option<bool>,
    /// Subdivision level of the incoming triangles.
    incoming_level: Option<u8>,
    /// Subdivision level of the outgoing triangles.
    outgoing_level: Option<u8>,
    /// `START:STOP:STEP` in nm.
    wavelengths: Option<String>,
    /// The axes of an array, as its manifest would say.
    #[schema(value_type = Option<Value>)]
    axes: Option<serde_json::Value>,
    /// The quantity, where the file does not say; `reflectance-factor` (BRF, HCRF) is divided by π: a BRDF.
    quantity: Option<StatedQuantityName>,
    /// Whether the file carries its provenance.
    #[schema(nullable = false)]
    metadata: Option<bool>,
    /// Whether one incoming direction is decoded without the others (policy `rd`; the material has no coarser levels then).
    #[schema(nullable = false)]
    random_access: Option<bool>,
    /// Fails the job (`unreachable-target`) where the material adds more to the noise of scattered samples than twice the
    /// promised error or half of the noise, or has another light than they; else that is a warning among its notes.
    #[schema(nullable = false)]
    strict: Option<bool>,
    /// What to call the material.
    name: Option<Text>,
    /// Under which licence it is.
    licence: Option<Text>,
    /// Tags to find it by.
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
    // The body's meaning, not its white space, is what must be the same.
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
    // The job is queued: a client for which there is no place to wait hears that at once.
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

/// How a job is doing.
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

/// Waits for the end of a job, for some time.
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

/// RFC 7240: `wait=N` among the preferences; what is not understood is not preferred.
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
