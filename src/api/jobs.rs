//! `/v1/jobs`: work that outlives a request.

use super::caller::{Actor, Caller};
use super::events;
use super::extract::{JobId, JsonBytes, Query, SmallJson, parse_json};
use super::job::{Job, StateSchema, absent, change, find};
use super::page::page;
use super::problem::{Kind, Problem};
use super::schemas::{CursorText, JobIdText, LONGEST_REQUEST_KEY, PageSize, RequestKey};
use super::state::{App, Service};
use crate::catalog::{Cancelling, Enqueued, JobFilter, JobRow, JobState, Priority, Retried};
use crate::jobs::{Client, JobRequest, KindOnly, Queued, RequestError, Source};
use crate::store::Digest;
use axum::Json;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::time::Duration;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of jobs.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new()
        .routes(routes!(list_jobs, post_job))
        .routes(routes!(get_job))
        .routes(routes!(events::get_job_events))
        .routes(routes!(cancel_job))
        .routes(routes!(retry_job))
}

/// Upper bound in seconds on the N of the request header `Prefer: wait=N`. Raising it lets one waiting request occupy
/// the service for longer.
const LONGEST_WAIT: u64 = 60;

impl Source for JsonBytes {
    type Error = Problem;

    fn read<T: DeserializeOwned>(&self) -> Result<T, Problem> {
        parse_json(&self.bytes)
    }
}

/// Queue a job.
#[utoipa::path(
    post, path = "/v1/jobs", tag = "jobs", request_body = JobRequest,
    params(
        ("Idempotency-Key" = Option<RequestKey>, Header, nullable = false,
            description = "Key of the request: for a day, a request with the same key and body gives the same job"),
        ("Prefer" = inline(Option<String>), Header, nullable = false, pattern = "^wait=[0-9]{1,4}$",
            description = format!("`wait=N`: answer when the job has ended, or after N (at most {LONGEST_WAIT}) seconds")),
    ),
    responses(
        (status = 202, description = "The job is queued or running", body = Job, headers(("Location" = String, description = "URL of the job"))),
        (status = 200, description = "The job has ended", body = Job, headers(("Location" = String, description = "URL of the job"))),
    )
)]
async fn post_job(
    app: App,
    caller: Caller,
    client: Client,
    headers: HeaderMap,
    SmallJson(body): SmallJson,
) -> Result<Response, Problem> {
    let kind = parse_json::<KindOnly>(&body.bytes)?.kind;
    let request = JobRequest::read(kind, &body)?;
    drop(body);
    request.check().map_err(|error| {
        let kind = match error {
            RequestError::Text(_) => Kind::InvalidRequest,
            RequestError::Option(_) => Kind::BadSetting,
        };
        Problem::new(kind, error.to_string())
    })?;
    if request.priority() == Priority::Urgent && !caller.is_operator() {
        let detail =
            "priority: -1 comes before the jobs of all tenants, expected 0 or 1, or a key with the scope `instance`";
        return Err(Problem::new(Kind::MissingScope, detail));
    }
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
        Enqueued::Over(over) => return Err(over.into()),
        Enqueued::Full => return Err(full(&app)),
    };
    if new {
        tracing::info!(job = row.id, measurement, "job queued");
        record(&app, &caller, "job.create", &row.id).await;
    }
    // The job is queued: a client without a place to wait is answered at once.
    let place = wait.map(|_| app.held.followers.take(client, 1));
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

/// Query of one page of the list of jobs: filters, the cursor at which the page starts, and its length.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct ListQuery {
    /// State to filter by: only jobs in this state are listed
    #[param(value_type = Option<StateSchema>, nullable = false)]
    state: Option<String>,
    /// Id of a measurement to filter by: only jobs that read this measurement are listed
    #[param(nullable = false)]
    measurement: Option<Digest>,
    /// Cursor at which the page starts: `next` of the previous page of the list; none for the first page
    #[param(value_type = Option<CursorText>)]
    cursor: Option<String>,
    /// Largest number of items on a page.
    #[param(value_type = Option<PageSize>, nullable = false)]
    limit: Option<usize>,
}

/// One page of the list of jobs, newest first.
#[derive(Debug, Serialize, ToSchema)]
struct JobPage {
    items: Vec<Job>,
    /// Cursor of the next page of jobs; null on the last page.
    next: Option<String>,
}

/// List jobs, newest first.
#[utoipa::path(
    get, path = "/v1/jobs", tag = "jobs", params(ListQuery),
    responses((status = 200, description = "One page of the list", body = JobPage))
)]
async fn list_jobs(app: App, Query(query): Query<ListQuery>) -> Result<Json<JobPage>, Problem> {
    let (cursor, limit) = page(query.cursor.as_deref(), query.limit)?;
    let state = query.state.as_deref().map(|name| {
        JobState::ALL.into_iter().find(|state| state.name() == name).ok_or_else(|| {
            let known = JobState::ALL.map(JobState::name).join(", ");
            Problem::new(Kind::BadQuery, format!("state: found `{name}`, expected one of {known}"))
        })
    });
    let filter = JobFilter { state: state.transpose()?, measurement: query.measurement };
    let page = app.engine.archive.catalog.jobs(&filter, cursor, limit).await?;
    Ok(Json(JobPage {
        items: page.items.into_iter().map(Job::of).collect(),
        next: page.next.map(|cursor| cursor.to_string()),
    }))
}

/// Put a job that has failed, died or was cancelled back to the queue.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/retry", tag = "jobs", params(("id" = JobIdText, Path, description = "Id of the job")),
    responses((status = 202, description = "The job is queued again", body = Job))
)]
async fn retry_job(app: App, caller: Caller, JobId(id): JobId) -> Result<Response, Problem> {
    match app.engine.retry(&id).await? {
        Retried::Queued(row) => {
            record(&app, &caller, "job.retry", &id).await;
            Ok((StatusCode::ACCEPTED, Json(Job::of(row))).into_response())
        }
        Retried::Unended(state) => Err(Problem::new(
            Kind::JobFinished,
            format!("job {id} is {state}, expected one that has failed, died or was cancelled"),
        )),
        Retried::NoMeasurement => {
            Err(Problem::new(Kind::JobFinished, format!("the measurement of job {id} was deleted; upload it again")))
        }
        Retried::Over(over) => Err(over.into()),
        Retried::Full => Err(full(&app)),
        Retried::Absent => Err(absent(&id)),
    }
}

/// Get the state of a job.
#[utoipa::path(
    get, path = "/v1/jobs/{id}", tag = "jobs", params(("id" = JobIdText, Path, description = "Id of the job")),
    responses((status = 200, description = "The job", body = Job))
)]
async fn get_job(app: App, JobId(id): JobId) -> Result<Json<Job>, Problem> {
    Ok(Json(Job::of(find(&app, &id).await?)))
}

/// Ask a job to stop.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/cancel", tag = "jobs", params(("id" = JobIdText, Path, description = "Id of the job")),
    responses(
        (status = 200, description = "The job is cancelled", body = Job),
        (status = 202, description = "The worker of the job was asked to stop", body = Job),
    )
)]
async fn cancel_job(app: App, caller: Caller, JobId(id): JobId) -> Result<Response, Problem> {
    let Cancelling { job: row, is_first } = app.engine.cancel(&id).await?.ok_or_else(|| absent(&id))?;
    if is_first {
        record(&app, &caller, "job.cancel", &id).await;
    }
    match row.state {
        JobState::Cancelled => Ok(Json(Job::of(row)).into_response()),
        JobState::Queued | JobState::Running => Ok((StatusCode::ACCEPTED, Json(Job::of(row))).into_response()),
        JobState::Succeeded | JobState::Failed | JobState::Dead => {
            Err(Problem::new(Kind::JobFinished, format!("job {id} has {} already", row.state)))
        }
    }
}

/// Records in the audit trail that a job was made, cancelled or repeated, if the service has keys.
async fn record(app: &App, caller: &Caller, action: &'static str, id: &str) {
    if caller.actor != Actor::Off {
        app.record(&caller.act(action, id)).await;
    }
}

/// Builds the error response to a request for a job that finds the queue full.
fn full(app: &App) -> Problem {
    Problem::new(
        Kind::TooManyJobs,
        format!("the queue of {} jobs is full; try again when some of them have begun", app.engine.limits.queued_jobs),
    )
}

/// Waits for a job to end, at most for `time`. Returns the last catalog row of the job.
async fn until_final(app: &App, mut row: JobRow, time: Duration) -> Result<JobRow, Problem> {
    let mut changes = app.engine.hub.listen();
    let _following = app.engine.hub.follow(&row.id);
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

/// Parses `wait=N` from the header `Prefer` (RFC 7240), capped at [`LONGEST_WAIT`] seconds. Other preferences are
/// ignored.
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
    if key.is_empty() || key.len() > LONGEST_REQUEST_KEY {
        let detail = format!("Idempotency-Key: expected 1 to {LONGEST_REQUEST_KEY} visible ASCII characters");
        return Err(Problem::new(Kind::BadHeader, detail));
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
