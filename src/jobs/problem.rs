//! Why a job made nothing: a stable code and a sentence, kept with the job.

use serde::{Deserialize, Serialize};

/// Why a job made nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct JobProblem {
    /// The kind, stable.
    pub code: Code,
    /// One sentence for the user.
    pub detail: String,
}

/// The kinds of reasons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Code {
    /// The measurement (or its spectrum) was refused.
    UnreadableMeasurement,
    /// The measurement cannot be put on the axes asked for.
    UnfitAxes,
    /// A setting is out of its range.
    BadSetting,
    /// No file meets the target.
    UnreachableTarget,
    /// Stored bytes are not those of their digest.
    Corrupt,
    /// Our bug.
    Internal,
    /// Disk, database: it may pass.
    Unavailable,
    /// The worker vanished while it ran the job.
    WorkerLost,
}

impl JobProblem {
    pub(crate) fn new(code: Code, detail: impl Into<String>) -> Self {
        Self { code, detail: detail.into() }
    }

    /// The text that is kept with the job.
    pub(crate) fn to_json(&self) -> String {
        serde_json::json!({ "code": self.code, "detail": self.detail }).to_string()
    }

    /// Reads what was kept.
    pub(crate) fn from_json(text: &str) -> Self {
        serde_json::from_str(text).unwrap_or_else(|_| Self::new(Code::Internal, "the reason was lost"))
    }
}
