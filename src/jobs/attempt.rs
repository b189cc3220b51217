//! What the attempts at every kind of job share: how they fail, and how the bytes they made are published.

use super::engine::Engine;
use super::ingest::PIN;
use super::maths::MathsError;
use super::problem::{Code, JobProblem};
use crate::catalog::CatalogError;
use crate::store::{Digest, StoreError};

/// Why an attempt made nothing.
pub(crate) enum Failure {
    /// It would end the same way again.
    Final(JobProblem),
    /// It may pass.
    Passing(String),
    /// It was asked to stop.
    Stopped,
}

/// Publishes what a job made: its digest, and the holder of the pin that keeps it until a row names it.
pub(super) async fn publish(engine: &Engine, bytes: Vec<u8>) -> Result<(Digest, String), Failure> {
    let staging = engine.archive.staging.clone();
    let staged = tokio::task::spawn_blocking(move || staging.stage(&bytes))
        .await
        .map_err(|e| Failure::Passing(e.to_string()))??;
    let holder = uuid::Uuid::now_v7().simple().to_string();
    engine.archive.catalog.pin(staged.digest(), &holder, PIN).await?;
    engine.archive.store.publish(&staged).await?;
    Ok((staged.digest(), holder))
}

/// A failure that another attempt would have too.
pub(super) fn last(code: Code, detail: impl std::fmt::Display) -> Failure {
    Failure::Final(JobProblem::new(code, detail.to_string()))
}

impl From<MathsError> for Failure {
    fn from(error: MathsError) -> Self {
        match error {
            MathsError::Busy => Self::Passing(error.to_string()),
            // The same input would panic again. Its message is for the log.
            MathsError::Panicked(message) => {
                tracing::error!(message, "a computation panicked");
                last(Code::Internal, "the computation failed; this is a bug of the service, not of the request")
            }
        }
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Corrupt { .. } | StoreError::NotFound(_) | StoreError::Range { .. } => {
                tracing::error!(%error, "a stored blob is damaged");
                last(Code::Corrupt, "the stored bytes of the measurement are damaged; upload the file again")
            }
            StoreError::Io(_) | StoreError::Objects(_) => Self::Passing(error.to_string()),
        }
    }
}

impl From<CatalogError> for Failure {
    fn from(error: CatalogError) -> Self {
        Self::Passing(error.to_string())
    }
}
