//! Reason why a job made nothing: a stable code and a sentence, stored with the job.

use serde::{Deserialize, Serialize};

/// Reason why a job failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct JobProblem {
    /// Kind of the reason why a job failed, a code that programs can rely on.
    pub code: Code,
    /// Reason why the job failed, in one sentence for the user.
    pub detail: String,
}

/// Kinds of reasons why a job failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Code {
    /// The measurement to be compressed, or the spectrum by which a measured luminaire is to be multiplied, cannot be
    /// read.
    UnreadableMeasurement,
    /// The measurement cannot be resampled to the requested axes.
    UnfitAxes,
    /// An option of the compression is out of its range.
    BadSetting,
    /// No compressed file can keep the promised error or size.
    UnreachableTarget,
    /// Stored bytes do not match their digest.
    Corrupt,
    /// A bug of the service.
    Internal,
    /// A transient failure of disk or database.
    Unavailable,
    /// The job needs more memory than one job may use, or the machine has not enough of it.
    OutOfMemory,
    /// The worker vanished while it ran the job.
    WorkerLost,
    /// The result would exceed a limit of the tenant.
    QuotaExceeded,
}

impl JobProblem {
    pub(crate) fn new(code: Code, detail: impl Into<String>) -> Self {
        Self { code, detail: detail.into() }
    }

    /// Encodes the reason of a failure as the JSON text that is stored with the job.
    pub(crate) fn to_json(&self) -> String {
        serde_json::json!({ "code": self.code, "detail": self.detail }).to_string()
    }

    /// Decodes the reason of a failure from the JSON text that is stored with a job.
    pub(crate) fn from_json(text: &str) -> Self {
        serde_json::from_str(text)
            .unwrap_or_else(|_| Self::new(Code::Internal, "the reason why the job failed cannot be read"))
    }
}
