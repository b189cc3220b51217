//! A job as the HTTP interface shows it: its JSON, its lookup, and the wait for its next change.

use super::problem::{Kind, Problem, ProblemBody};
use super::schemas::JobIdText;
use super::state::App;
use crate::catalog::{JobRow, JobState, Priority};
use crate::jobs::JobProblem;
use crate::store::Digest;
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use utoipa::ToSchema;

/// Longest time for which a request that follows a job waits for a notification of a change before it looks the job up.
/// Raising it delays the report of a change whose notification was lost.
const LOOK: Duration = Duration::from_secs(10);

/// States that a job can have.
#[derive(ToSchema)]
#[schema(as = JobState)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "describes catalog::JobState")]
pub(super) enum StateSchema {
    Queued,
    Running,
    Succeeded,
    Failed,
    Dead,
    Cancelled,
}

/// Description of a job.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Job {
    #[schema(value_type = JobIdText)]
    id: String,
    /// Current or final state of the job.
    #[schema(value_type = StateSchema)]
    state: &'static str,
    /// Priority of the job. A batch job that has waited for long becomes a usual one.
    priority: Priority,
    /// Progress of the job from 0 to 1.
    #[schema(minimum = 0, maximum = 1)]
    progress: f64,
    /// Id of the measurement that the job reads; null for a job that makes a report and reads no measurement.
    measurement: Option<Digest>,
    /// Id of the material that the job made; null unless the job has succeeded, and for a job that makes a report
    /// instead.
    material: Option<Digest>,
    /// Digest of the report that the job made: an array of tables, as `wavelume paper --json` prints it.
    report: Option<Digest>,
    /// Reason for which the job failed, or for which its worker died.
    problem: Option<ProblemBody>,
    /// Number of attempts of the job that were started.
    attempts: u32,
    /// Time of creation of the job, in milliseconds since the Unix epoch.
    created_ms: i64,
    /// Time of the last change of the job's state, in milliseconds since the Unix epoch.
    updated_ms: i64,
    pub(super) links: Links,
}

/// URLs of the resources related to a job.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = JobLinks)]
pub(super) struct Links {
    #[serde(rename = "self")]
    pub(super) this: String,
    events: String,
    cancel: String,
    /// URL of the material or the report that the job made, once there is one.
    result: Option<String>,
}

impl Job {
    pub(super) fn of(row: JobRow) -> Self {
        let this = format!("/v1/jobs/{}", row.id);
        // The problem of an attempt that will be repeated is not the job's.
        let problem = match row.state {
            JobState::Failed | JobState::Dead => row.problem.as_deref(),
            JobState::Queued | JobState::Running | JobState::Succeeded | JobState::Cancelled => None,
        };
        Self {
            links: Links {
                events: format!("{this}/events"),
                cancel: format!("{this}/cancel"),
                result: row
                    .material
                    .map(|id| format!("/v1/materials/{id}"))
                    .or_else(|| row.report.map(|digest| format!("/v1/blobs/{digest}"))),
                this,
            },
            id: row.id,
            state: row.state.name(),
            priority: row.priority,
            progress: row.progress,
            measurement: row.measurement,
            material: row.material,
            report: row.report,
            problem: problem.map(|text| Problem::from(JobProblem::from_json(text)).body()),
            attempts: row.attempts,
            created_ms: row.created_ms,
            updated_ms: row.updated_ms,
        }
    }
}

/// Reads the current catalog row of a job.
pub(super) async fn find(app: &App, id: &str) -> Result<JobRow, Problem> {
    app.engine.job(id).await?.ok_or_else(|| absent(id))
}

pub(super) fn absent(id: &str) -> Problem {
    Problem::new(Kind::NotFound, format!("there is no job {id}"))
}

/// Waits until `changes`, the notifications of changed jobs, announces that the job with the given id may have changed,
/// at most for [`LOOK`].
pub(super) async fn change(changes: &mut Receiver<Arc<str>>, id: &str) {
    let told = async {
        loop {
            match changes.recv().await {
                Ok(job) if *job == *id => return,
                Ok(_) => {}
                // The receiver lagged; an update of this job may be among the dropped ones.
                Err(RecvError::Lagged(_)) => return,
                Err(RecvError::Closed) => std::future::pending().await,
            }
        }
    };
    // An update may be lost, hence the timeout.
    let _ = tokio::time::timeout(LOOK, told).await;
}
