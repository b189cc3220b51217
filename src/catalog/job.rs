//! A job as the catalog knows it: its states, its row, and the answers that clients and workers get about it.

use super::materials::NewMaterial;
use crate::store::Digest;
use std::fmt;
use std::time::Duration;

/// Where a job is in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum JobState {
    /// Waits for a worker. → running when claimed, → cancelled when asked.
    Queued,
    /// Belongs to a worker. → succeeded, failed or cancelled by its worker; → queued when the lease runs out or the
    /// attempt failed for a passing reason; → dead when attempts are used up.
    Running,
    /// A material or a report was made. Final.
    Succeeded,
    /// The input or the request is at fault: another attempt would fail alike. Final.
    Failed,
    /// Given up after the last attempt. Final.
    Dead,
    /// Stopped because somebody asked. Final.
    Cancelled,
}

/// A job to queue.
#[derive(Clone, Debug)]
pub(crate) struct NewJob {
    /// Its id.
    pub id: String,
    /// Its arguments.
    pub frame: String,
    /// What it reads, if it reads a measurement.
    pub measurement: Option<Digest>,
    /// The client's key and the digest of the body it came with.
    pub idempotency: Option<(String, Digest)>,
}

/// A job remembered.
#[derive(Clone, Debug)]
pub(crate) struct JobRow {
    /// Its id.
    pub id: String,
    /// What it reads, if it reads a measurement.
    pub measurement: Option<Digest>,
    /// Where it is.
    pub state: JobState,
    /// How far it is, 0..=1.
    pub progress: f64,
    /// How often it was begun.
    pub attempts: u32,
    /// The material it made.
    pub material: Option<Digest>,
    /// The bytes of the report it made.
    pub report: Option<Digest>,
    /// JSON: why it failed, or why the last attempt did.
    pub problem: Option<String>,
    /// When it came, ms of the Unix epoch.
    pub created_ms: i64,
    /// When its state changed last.
    pub updated_ms: i64,
}

/// What became of a wish to queue.
#[derive(Clone, Debug)]
pub(crate) enum Enqueued {
    /// A new job.
    New(JobRow),
    /// The job that the same key and body made before.
    Known(JobRow),
    /// The key was used with another body.
    KeyTaken,
    /// There is no such measurement.
    NoMeasurement,
    /// Too many jobs wait.
    Full,
}

/// A job in the hands of a worker.
#[derive(Clone, Debug)]
pub(crate) struct Claimed {
    /// Its id.
    pub id: String,
    /// Its arguments.
    pub frame: String,
    /// The fencing epoch that every later write must name.
    pub epoch: i64,
    /// How often it was begun, this time included.
    pub attempts: u32,
}

/// What a worker hears when it says that it lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beat {
    /// Go on.
    Yours,
    /// Somebody asked to cancel.
    Cancel,
    /// The job is another's now.
    Lost,
}

/// How a worker ends its attempt.
#[derive(Clone, Debug)]
pub(crate) enum Ended {
    /// With a material, published and pinned under this holder.
    Material(Box<NewMaterial>, String),
    /// With the bytes of a report, published and pinned under this holder.
    Report(Digest, String),
    /// With a problem (JSON) that another attempt would have too.
    Failed(String),
    /// With a problem (JSON) that may pass: again after the delay, unless attempts are used up.
    Retry {
        /// The problem.
        problem: String,
        /// When to try again.
        delay: Duration,
        /// How many attempts there are in all.
        attempts: u32,
    },
    /// Because somebody asked.
    Cancelled,
    /// Back to the queue, because the worker stops or cannot read the job: the attempt does not count.
    Released,
}

/// Outcome of ending an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// The attempt has ended and the job is in this state.
    Now(JobState),
    /// The job was another worker's already; nothing was written.
    Lost,
    /// The pin of the result has run out, so a sweep may have taken its bytes; nothing was written. Publish them again.
    Unpinned,
}

impl JobState {
    pub(super) const ALL: [Self; 6] =
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

    /// Whether nothing follows.
    pub(crate) fn is_final(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

impl fmt::Display for JobState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
