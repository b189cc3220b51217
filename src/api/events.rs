//! `/v1/jobs/{id}/events`: state and progress of a job as server-sent events.

use super::extract::JobId;
use super::job::{Job, change, find};
use super::places::Place;
use super::problem::Problem;
use super::schemas::{EventText, JobIdText};
use super::state::App;
use crate::catalog::JobState;
use crate::jobs::{Client, Following};
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::convert::Infallible;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;

/// Interval of keep-alive lines, which prevent proxies from closing a quiet event stream. Raising it risks their
/// timeouts.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

/// Event stream of one client that follows a job, with the job state and progress that the client has received last.
struct Told {
    app: App,
    _place: Place,
    _following: Following,
    id: String,
    changes: Receiver<Arc<str>>,
    last: Option<Last>,
}

/// State and progress of a job as the last event of its stream has told them. They are the `id` of that event, so that
/// any node goes on behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Last {
    state: JobState,
    progress: f64,
}

/// Name of the HTTP header with the `id` of the last event that a client has received.
const LAST_EVENT_ID: HeaderName = HeaderName::from_static("last-event-id");

/// Follow a job through server-sent events: `state` events hold the job, `progress` events its progress. The stream
/// ends with the final state, or breaks off when the caller's key or token is no longer valid. A client that asks again
/// with the `id` of its last event gets what has changed since; after the final state it gets 204, at which an
/// `EventSource` stops.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/events", tag = "jobs",
    params(
        ("id" = JobIdText, Path, description = "Id of the job"),
        ("Last-Event-ID" = Option<String>, Header, description = "`id` of the last event that the client has received"),
    ),
    responses(
        (status = 200, description = "Server-sent events", body = EventText, content_type = "text/event-stream"),
        (status = 204, description = "The client has received the final state: no event follows"),
    )
)]
pub(super) async fn get_job_events(
    app: App,
    client: Client,
    JobId(id): JobId,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let place = app.held.followers.take(client, 1)?;
    // Subscribe before the first read, so that no change is missed.
    let changes = app.engine.hub.listen();
    let row = find(&app, &id).await?;
    let last = headers.get(LAST_EVENT_ID).and_then(|value| Last::read(value.to_str().ok()?));
    if last.is_some_and(|last| last.state == row.state && row.state.is_final()) {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let following = app.engine.hub.follow(&id);
    let told = Told { app, _place: place, _following: following, id, changes, last };
    let events = futures::stream::unfold(Some(told), |told| async move { next(told?).await });
    Ok(Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)).into_response())
}

impl Last {
    /// Reads the id of an event. An id of another form counts as none.
    fn read(text: &str) -> Option<Self> {
        let (name, progress) = text.split_once('-')?;
        let state = JobState::ALL.into_iter().find(|state| state.name() == name)?;
        Some(Self { state, progress: progress.parse().ok()? })
    }
}

impl fmt::Display for Last {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.state.name(), self.progress)
    }
}

/// Makes an event with JSON data. `None`, which ends the stream, if the data cannot be written; the log has the reason.
fn written(name: &str, last: Last, data: impl Serialize) -> Option<Event> {
    let event = Event::default().event(name).id(last.to_string()).json_data(data);
    event.map_err(|error| tracing::error!(%error, event = name, "an event of a job's stream could not be written")).ok()
}

async fn next(mut told: Told) -> Option<(Result<Event, Infallible>, Option<Told>)> {
    loop {
        if told.app.stop.is_cancelled() {
            return None;
        }
        // A failed read (busy database) is retried at the next change or timeout.
        if let Ok(row) = find(&told.app, &told.id).await {
            let now = Last { state: row.state, progress: row.progress };
            let before = told.last.replace(now);
            if before.is_none_or(|before| before.state != now.state) {
                let event = written("state", now, Job::of(row))?;
                return Some((Ok(event), (!now.state.is_final()).then_some(told)));
            }
            if before != Some(now) {
                let event = written("progress", now, serde_json::json!({ "progress": now.progress }))?;
                return Some((Ok(event), Some(told)));
            }
        }
        let app = told.app.clone();
        tokio::select! {
            () = app.stop.cancelled() => return None,
            () = change(&mut told.changes, &told.id) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_id_of_an_event_is_read_back_and_others_are_none() {
        for last in [
            Last { state: JobState::Queued, progress: 0.0 },
            Last { state: JobState::Running, progress: 1.0 / 3.0 },
            Last { state: JobState::Succeeded, progress: 1.0 },
        ] {
            assert_eq!(Last::read(&last.to_string()), Some(last));
        }
        for other in ["", "7", "running", "running-", "running-x", "asleep-0.5"] {
            assert_eq!(Last::read(other), None, "{other}");
        }
    }
}
