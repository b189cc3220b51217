//! `/v1/jobs/{id}/events`: state and progress of a job as server-sent events.

use super::extract::JobId;
use super::job::{Job, change, find};
use super::places::Place;
use super::problem::Problem;
use super::schemas::{EventText, JobIdText};
use super::state::App;
use crate::catalog::JobState;
use crate::jobs::{Client, Following};
use axum::response::sse::{Event, KeepAlive, Sse};
use futures::Stream;
use serde::Serialize;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;

/// Interval of keep-alive lines, which prevent proxies from closing a quiet event stream. Raising it risks their
/// timeouts.
const KEEP_ALIVE: Duration = Duration::from_secs(10);

/// Event stream of one client that follows a job, with the job state and progress that were sent last.
struct Told {
    app: App,
    _place: Place,
    _following: Following,
    id: String,
    changes: Receiver<Arc<str>>,
    state: Option<JobState>,
    progress: f64,
}

/// Follow a job through server-sent events: `state` events hold the job, `progress` events its progress. The stream
/// ends with the final state, or breaks off when the caller's key or token is no longer valid.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/events", tag = "jobs", params(("id" = JobIdText, Path, description = "Id of the job")),
    responses((status = 200, description = "Server-sent events", body = EventText, content_type = "text/event-stream"))
)]
pub(super) async fn get_job_events(
    app: App,
    client: Client,
    JobId(id): JobId,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, Problem> {
    let place = app.held.followers.take(client, 1)?;
    // Subscribe before the first read, so that no change is missed.
    let changes = app.engine.hub.listen();
    find(&app, &id).await?;
    let following = app.engine.hub.follow(&id);
    let told = Told { app, _place: place, _following: following, id, changes, state: None, progress: 0.0 };
    let events = futures::stream::unfold(Some(told), |told| async move { next(told?).await });
    Ok(Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)))
}

/// Makes an event with JSON data. `None`, which ends the stream, if the data cannot be written; the log has the reason.
fn written(name: &str, data: impl Serialize) -> Option<Event> {
    let event = Event::default().event(name).json_data(data);
    event.map_err(|error| tracing::error!(%error, event = name, "an event of a job's stream could not be written")).ok()
}

async fn next(mut told: Told) -> Option<(Result<Event, Infallible>, Option<Told>)> {
    loop {
        if told.app.stop.is_cancelled() {
            return None;
        }
        // A failed read (busy database) is retried at the next change or timeout.
        if let Ok(row) = find(&told.app, &told.id).await {
            let (state, progress) = (row.state, row.progress);
            if told.state != Some(state) {
                told.state = Some(state);
                told.progress = progress;
                let event = written("state", Job::of(row))?;
                return Some((Ok(event), (!state.is_final()).then_some(told)));
            }
            if progress != told.progress {
                told.progress = progress;
                let event = written("progress", serde_json::json!({ "progress": progress }))?;
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
