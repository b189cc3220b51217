//! A job in the catalog: its states, its row, and the outcomes that clients and workers get.

use super::blobs::Claim;
use super::materials::NewMaterial;
use crate::store::Digest;
use std::fmt;
use std::time::Duration;

/// State of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum JobState {
    /// Waits for a worker. → running when claimed, → cancelled when asked.
    Queued,
    /// Belongs to a worker. → succeeded, failed or cancelled by its worker; → queued when the lease runs out or the
    /// attempt failed for a transient reason; → dead when attempts are used up.
    Running,
    /// A material or a report was made. Final.
    Succeeded,
    /// The input or the request is at fault: another attempt would fail alike. Final.
    Failed,
    /// Given up after the last attempt. Final.
    Dead,
    /// Stopped on request. Final.
    Cancelled,
}

/// A job to queue.
#[derive(Clone, Debug)]
pub(crate) struct NewJob {
    /// Id of the job.
    pub id: String,
    /// Arguments, encoded for the queue.
    pub frame: String,
    /// Measurement that the job reads, if any.
    pub measurement: Option<Digest>,
    /// Share of the queue whose turn the job takes: jobs of different shares are started in turn.
    pub share: String,
    /// Idempotency key of the client, and the digest of the request that came with it.
    pub idempotency: Option<(String, Digest)>,
}

/// A job as stored.
#[derive(Clone, Debug)]
pub(crate) struct JobRow {
    /// Id of the job.
    pub id: String,
    /// Measurement that the job reads, if any.
    pub measurement: Option<Digest>,
    /// Current state.
    pub state: JobState,
    /// Progress from 0 to 1.
    pub progress: f64,
    /// Number of attempts started, without those whose worker vanished.
    pub attempts: u32,
    /// Material that the job made.
    pub material: Option<Digest>,
    /// Digest of the report that the job made.
    pub report: Option<Digest>,
    /// Problem as JSON: why the job failed, or why its last attempt did.
    pub problem: Option<String>,
    /// Time of creation, ms of the Unix epoch.
    pub created_ms: i64,
    /// Time of the last change of state, ms of the Unix epoch.
    pub updated_ms: i64,
}

/// Outcome of enqueueing.
#[derive(Clone, Debug)]
pub(crate) enum Enqueued {
    /// A new job.
    New(JobRow),
    /// The job that the same key and request made before.
    Known(JobRow),
    /// The key was used with another request.
    KeyTaken,
    /// There is no such measurement.
    NoMeasurement,
    /// Too many jobs are waiting.
    Full,
}

/// A job claimed by a worker.
#[derive(Clone, Debug)]
pub(crate) struct Claimed {
    /// Id of the job.
    pub id: String,
    /// Arguments, encoded for the queue.
    pub frame: String,
    /// The fencing epoch that every later write must name.
    pub epoch: i64,
    /// Number of attempts started, this one included, without those whose worker vanished.
    pub attempts: u32,
}

/// Answer to a worker that renews its lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beat {
    /// The job is still this worker's: continue. True if somebody follows it.
    Yours(bool),
    /// A cancel was requested.
    Cancel,
    /// Another worker owns the job now.
    Lost,
}

/// End of a worker's attempt.
#[derive(Clone, Debug)]
pub(crate) enum Ended {
    /// Success with a material, and the claim under which its file was published.
    Material(Box<NewMaterial>, Claim),
    /// Success with a report, and the claim under which its bytes were published.
    Report(Claim),
    /// Permanent failure: a problem (JSON) that another attempt would have too.
    Failed(String),
    /// Transient failure with a problem (JSON): retried after the delay, unless attempts are used up.
    Retry {
        /// The problem.
        problem: String,
        /// Time before the next attempt.
        delay: Duration,
        /// Upper bound on the number of attempts.
        attempts: u32,
    },
    /// Stopped on request.
    Cancelled,
    /// Back to the queue, because the worker stops or cannot read the job. The attempt does not count.
    Released,
}

/// Outcome of ending an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The attempt has ended and the job is in this state.
    Now(JobState),
    /// Another worker owned the job already; nothing was written.
    Lost,
    /// The claim on the bytes of the result holds no longer; nothing was written. Publish them again.
    Unpublished,
}

impl JobState {
    /// All states.
    pub(crate) const ALL: [Self; 6] =
        [Self::Queued, Self::Running, Self::Succeeded, Self::Failed, Self::Dead, Self::Cancelled];

    /// The stable name.
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

    /// Returns true if no other state can follow.
    pub(crate) fn is_final(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

impl fmt::Display for JobState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
