//! A job in the catalog: its states, its row, and the outcomes that clients and workers get.

use super::blobs::Claim;
use super::materials::NewMaterial;
use super::priority::Priority;
use super::usage::OverQuota;
use crate::store::Digest;
use crate::trust::Tenant;
use std::fmt;
use std::time::Duration;

/// State of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum JobState {
    /// The job waits for a worker. It becomes running when a worker claims it, or cancelled on request.
    Queued,
    /// A worker runs the job. It then succeeds, fails or is cancelled. It is queued again when the worker's lease runs
    /// out or after a transient fault, and is dead when its attempts are used up.
    Running,
    /// The job has ended: it made a material or a report.
    Succeeded,
    /// The job has ended: its input or request is at fault, so that another attempt would fail in the same way.
    Failed,
    /// The job has ended: it was given up after its last permitted attempt.
    Dead,
    /// The job has ended: it was stopped on request.
    Cancelled,
}

/// A job to add to the queue.
#[derive(Clone, Debug)]
pub(crate) struct NewJob {
    /// Id of the job.
    pub id: String,
    /// Arguments of the job, encoded as a text for the queue.
    pub frame: String,
    /// Lowest version of the arguments that a worker must understand.
    pub level: i64,
    /// Id of the measurement that the job reads, if any.
    pub measurement: Option<Digest>,
    /// Priority of the job.
    pub priority: Priority,
    /// Name of the share of the queue to which the job belongs, such as its client: jobs of different shares are
    /// started in turn.
    pub share: String,
    /// Idempotency key sent by the client, and the digest of the request that came with it.
    pub idempotency: Option<(String, Digest)>,
}

/// A job as stored in the catalog.
#[derive(Clone, Debug)]
pub(crate) struct JobRow {
    /// Id of the job.
    pub id: String,
    /// Id of the measurement that the job reads, if any.
    pub measurement: Option<Digest>,
    /// Current state of the job.
    pub state: JobState,
    /// Priority of the job.
    pub priority: Priority,
    /// Progress of the job from 0 to 1.
    pub progress: f64,
    /// Number of attempts to run the job started so far, without those whose worker vanished.
    pub attempts: u32,
    /// Id of the material that the job made, if any.
    pub material: Option<Digest>,
    /// Digest of the report that the job made, if any.
    pub report: Option<Digest>,
    /// Problem, as JSON, that made the job or its last attempt fail, if any.
    pub problem: Option<String>,
    /// Time at which the job was created, ms of the Unix epoch.
    pub created_ms: i64,
    /// Time at which the job last changed its state, ms of the Unix epoch.
    pub updated_ms: i64,
}

/// Outcome of adding a job to the queue.
#[derive(Clone, Debug)]
pub(crate) enum Enqueued {
    /// The job is new, and was added to the queue.
    New(JobRow),
    /// The job was created before, by the same request with the same idempotency key.
    Known(JobRow),
    /// The idempotency key was used before with a different request.
    KeyTaken,
    /// The measurement that the job would read does not exist.
    NoMeasurement,
    /// The queue is full: too many jobs are waiting.
    Full,
    /// The job is refused, because as many jobs of the tenant are waiting as its limit allows.
    Over(OverQuota),
}

/// A job that a worker has claimed to run it.
#[derive(Clone, Debug)]
pub(crate) struct Claimed {
    /// Id of the job.
    pub id: String,
    /// Owner of the job, of what it reads and of what it makes.
    pub tenant: Tenant,
    /// Arguments of the job, encoded as a text for the queue.
    pub frame: String,
    /// Fencing epoch: a number that rises with each claim of the job, and that every later write of the worker must
    /// match.
    pub epoch: i64,
    /// Number of attempts to run the job so far, including the attempt for which the worker has just claimed it.
    /// Attempts whose worker vanished or was stopped do not count.
    pub attempts: u32,
    /// True if somebody follows the job, so that its progress is to be stored often.
    pub watched: bool,
}

/// Answer of the catalog to a worker that renews its lease on a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beat {
    /// The worker still owns the job and continues. The flag is true if a client follows the progress of the job.
    Yours(bool),
    /// Cancellation of the job was requested.
    Cancel,
    /// The worker has lost the job: another worker owns it, or it has ended.
    Lost,
}

/// Outcome of a worker's attempt to run a job.
#[derive(Clone, Debug)]
pub(crate) enum Ended {
    /// The attempt made a material, and its file is in the store. The claim permits a row of the catalog to refer to
    /// the file.
    Material(Box<NewMaterial>, Claim),
    /// The attempt made a report. Its bytes were stored under the claim, which lets a row refer to the bytes.
    Report(Claim),
    /// The attempt failed permanently with this problem (JSON): another attempt would fail in the same way.
    Failed(String),
    /// The attempt failed for a transient reason. The job is tried again after a delay, unless its attempts are used
    /// up.
    Retry {
        /// Problem that made the attempt fail, as JSON.
        problem: String,
        /// Time before the next attempt to run the job.
        delay: Duration,
        /// Upper bound on the number of attempts to run the job.
        attempts: u32,
    },
    /// The attempt was stopped, because cancellation of the job was requested.
    Cancelled,
    /// The job goes back to the queue, because the worker stops or cannot read the job. The attempt does not count.
    Released,
}

/// Outcome of recording the end of a job attempt in the catalog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The end of the attempt was recorded, and the job is now in this state.
    Now(JobState),
    /// The worker no longer owned the job, so nothing was written.
    Lost,
    /// The result's stored bytes were deleted, or the permission to refer to them has expired, so the catalog was not
    /// changed. The bytes must be stored again.
    Unpublished,
    /// The material would exceed a limit of the tenant, so the catalog was not changed.
    Over(OverQuota),
}

impl JobState {
    /// All states of a job.
    pub(crate) const ALL: [Self; 6] =
        [Self::Queued, Self::Running, Self::Succeeded, Self::Failed, Self::Dead, Self::Cancelled];

    /// Returns the stable name of the job state, as clients see it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Dead => "dead",
            Self::Cancelled => "cancelled",
        }
    }

    /// Returns true if a job in this state has ended.
    pub(crate) fn is_final(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

impl fmt::Display for JobState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
