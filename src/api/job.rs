//! A job as the interface shows it: its JSON, a look at it, and the wait for its next change.

use super::problem::{Kind, Problem, ProblemBody};
use super::schemas::{DigestText, JobIdText};
use super::state::App;
use crate::catalog::{JobRow, JobState};
use crate::jobs::JobProblem;
use crate::store::Digest;
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use utoipa::ToSchema;

/// How often a job of another process is looked at.
const LOOK: Duration = Duration::from_secs(1);

/// The states of a job.
#[derive(ToSchema)]
#[schema(as = JobState)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "describes catalog::JobState")]
enum StateSchema {
    Queued,
    Running,
    Succeeded,
    Failed,
    Dead,
    Cancelled,
}

/// A job.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct Job {
    #[schema(value_type = JobIdText)]
    id: String,
    /// The state in which it is or ended.
    #[schema(value_type = StateSchema)]
    state: &'static str,
    /// 0 to 1.
    #[schema(minimum = 0, maximum = 1)]
    progress: f64,
    /// What it reads; null for a report.
    #[schema(value_type = Option<DigestText>)]
    measurement: Option<Digest>,
    /// The material it made.
    #[schema(value_type = Option<DigestText>)]
    material: Option<Digest>,
    /// The digest of the report it made: an array of tables, as `wavelume paper --json` prints it.
    #[schema(value_type = Option<DigestText>)]
    report: Option<Digest>,
    /// Why it failed or died.
    problem: Option<ProblemBody>,
    /// How often it was begun.
    attempts: u32,
    /// When it came, ms of the Unix epoch.
    created_ms: i64,
    /// When its state changed last, ms of the Unix epoch.
    updated_ms: i64,
    pub(super) links: Links,
}

/// Where to go from a job.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = JobLinks)]
pub(super) struct Links {
    #[serde(rename = "self")]
    pub(super) this: String,
    events: String,
    cancel: String,
    /// The material or the report, once there is one.
    result: Option<String>,
}

impl Job {
    pub(super) fn of(row: JobRow) -> Self {
        let this = format!("/v1/jobs/{}", row.id);
        // A problem of an attempt that is made again is not the job's.
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

/// The job, as of now.
pub(super) async fn find(app: &App, id: &str) -> Result<JobRow, Problem> {
    app.engine.job(id).await?.ok_or_else(|| absent(id))
}

pub(super) fn absent(id: &str) -> Problem {
    Problem::new(Kind::NotFound, format!("there is no job {id}"))
}

/// Waits until something about the job may be new.
pub(super) async fn change(changes: &mut Receiver<Arc<str>>, id: &str) {
    let told = async {
        loop {
            match changes.recv().await {
                Ok(job) if *job == *id => return,
                Ok(_) => {}
                // Some news were missed: this job's may be among them.
                Err(RecvError::Lagged(_)) => return,
                Err(RecvError::Closed) => std::future::pending().await,
            }
        }
    };
    // Jobs of other processes are not told here.
    let _ = tokio::time::timeout(LOOK, told).await;
}
