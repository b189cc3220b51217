//! Result of a check: a verdict, what was found, and what to do.

use serde::Serialize;

/// Result of one check of `wavelume doctor`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Finding {
    /// Verdict on what the check has found.
    pub verdict: Verdict,
    /// Name of the check, beginning with the part of the service that it examines: `database`, `store` or `local`.
    pub check: String,
    /// Description, for the operator, of what the check has found.
    pub found: String,
    /// Advice on what to do; empty if there is nothing to do.
    pub remedy: String,
}

/// Verdict of a check of `wavelume doctor` on a service.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Verdict {
    /// The check found nothing that the operator should change.
    Ok,
    /// The service works, but may not for long, or not as intended.
    Warning,
    /// The service does not work, or may lose data.
    Fault,
}

impl Verdict {
    /// Returns the name of the verdict in lower case, such as `warning`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warning => "warning",
            Self::Fault => "fault",
        }
    }
}

impl Finding {
    pub(crate) fn ok(check: &str, found: impl Into<String>) -> Self {
        Self { verdict: Verdict::Ok, check: check.to_owned(), found: found.into(), remedy: String::new() }
    }

    pub(crate) fn warning(check: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { verdict: Verdict::Warning, remedy: remedy.into(), ..Self::ok(check, found) }
    }

    pub(crate) fn fault(check: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { verdict: Verdict::Fault, remedy: remedy.into(), ..Self::ok(check, found) }
    }
}
