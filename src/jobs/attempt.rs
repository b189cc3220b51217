//! Common parts of all attempts at jobs: their failures, and the publication of the bytes they made.

use super::blobs::BlobError;
use super::engine::Engine;
use super::maths::MathsError;
use super::problem::{Code, JobProblem};
use super::publish::Published;
use crate::catalog::{CatalogError, Ended};
use crate::store::{Staged, StoreError};

/// Reason why an attempt to run a job ended without a result.
pub(crate) enum Failure {
    /// The attempt to run the job failed for a permanent reason: another attempt would fail, too.
    Final(JobProblem),
    /// The attempt to run the job failed for a transient reason, such as an error of the disk or database: another
    /// attempt may succeed.
    Passing(String),
    /// Stored bytes that the job reads are missing or damaged. They may be back for another attempt; the job is dead
    /// after the last one.
    Damaged,
    /// The attempt to run the job found no space on a disk: the job waits, and the attempt does not count.
    NoSpace(String),
    /// The attempt to run the job was stopped on request.
    Stopped,
    /// The job, or its measurement, contains something that only a newer version understands: a newer worker must take
    /// it.
    Newer(String),
}

/// Result of a successful attempt to run a job: the database entry to write, and the stored file that the entry refers
/// to.
pub(crate) struct Made {
    pub(crate) ended: Ended,
    pub(crate) published: Published,
}

/// Stores the staged result of a job, protected from removal until a database entry refers to it.
pub(super) async fn publish(engine: &Engine, staged: Staged) -> Result<Published, Failure> {
    Ok(Published::new(&engine.archive, staged).await?)
}

/// Classifies a failure to read JSON that was valid when it was written. Well-formed JSON that does not fit comes from
/// a newer version; anything else is damage.
pub(super) fn unread(what: &str, error: &serde_json::Error) -> Failure {
    let detail = format!("{what}: {error}");
    if error.is_data() { Failure::Newer(detail) } else { last(Code::Internal, detail) }
}

/// Builds the permanent failure of a job, from its kind and a sentence for the user.
pub(super) fn last(code: Code, detail: impl std::fmt::Display) -> Failure {
    Failure::Final(JobProblem::new(code, detail.to_string()))
}

impl From<MathsError> for Failure {
    fn from(error: MathsError) -> Self {
        match error {
            MathsError::Busy => Self::Passing(error.to_string()),
            // A second attempt would panic, too. The message of the panic is for the log.
            MathsError::Panicked(message) => {
                tracing::error!(message, "a computation panicked");
                last(Code::Internal, "the computation failed; this is a bug of the service, not of the request")
            }
        }
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        if error.is_full() {
            return Self::NoSpace(error.to_string());
        }
        match error {
            StoreError::Corrupt { .. } | StoreError::NotFound(_) | StoreError::Range { .. } => {
                tracing::error!(%error, "stored bytes that a job reads are missing or damaged");
                Self::Damaged
            }
            StoreError::NoSpace { .. } | StoreError::Io(_) | StoreError::Objects(_) => Self::Passing(error.to_string()),
        }
    }
}

impl From<BlobError> for Failure {
    fn from(error: BlobError) -> Self {
        match error {
            BlobError::Store(error) => error.into(),
            BlobError::Catalog(error) => error.into(),
            BlobError::Away(reason) => Self::Passing(reason),
        }
    }
}

impl From<CatalogError> for Failure {
    fn from(error: CatalogError) -> Self {
        if error.is_full() { Self::NoSpace(error.to_string()) } else { Self::Passing(error.to_string()) }
    }
}
