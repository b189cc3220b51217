//! Reason why a job made nothing: a stable code and a sentence, stored with the job.

use serde::{Deserialize, Serialize};

/// Reason why a job made nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct JobProblem {
    /// Stable kind of the reason.
    pub code: Code,
    /// One sentence for the user.
    pub detail: String,
}

/// Kinds of reasons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Code {
    /// The measurement (or its spectrum) was refused.
    UnreadableMeasurement,
    /// The measurement cannot be put on the requested axes.
    UnfitAxes,
    /// A setting is out of its range.
    BadSetting,
    /// No file meets the target.
    UnreachableTarget,
    /// Stored bytes do not match their digest.
    Corrupt,
    /// A bug of the service.
    Internal,
    /// A transient failure of disk or database.
    Unavailable,
    /// The worker vanished while it ran the job.
    WorkerLost,
}

impl JobProblem {
    pub(crate) fn new(code: Code, detail: impl Into<String>) -> Self {
        Self { code, detail: detail.into() }
    }

    /// Encodes the problem as stored with the job.
    pub(crate) fn to_json(&self) -> String {
        serde_json::json!({ "code": self.code, "detail": self.detail }).to_string()
    }

    /// Decodes a stored problem.
    pub(crate) fn from_json(text: &str) -> Self {
        serde_json::from_str(text).unwrap_or_else(|_| Self::new(Code::Internal, "the reason was lost"))
    }
}
