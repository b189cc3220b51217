//! Priorities of jobs.

use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

/// Priority of a job: of two waiting jobs the one with the lower number is started first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "i64", into = "i64")]
pub(crate) enum Priority {
    /// Priority -1: jobs that start before all jobs of other priorities.
    Urgent,
    /// Priority 0, the default: jobs that start after urgent ones and before batch ones.
    #[default]
    Usual,
    /// Priority 1: jobs that start after all others, until they have waited so long that they count as usual ones.
    Batch,
}

impl Priority {
    /// Returns true, so that `serde` never writes the priority of a request: requests are stored, compared and run
    /// without it.
    #[expect(clippy::trivially_copy_pass_by_ref, clippy::unused_self, reason = "the signature that serde asks for")]
    pub(crate) fn is_left_out(&self) -> bool {
        true
    }

    /// Returns the name of the share of the queue in which a client's jobs of this priority take turns. Jobs of one
    /// priority therefore never push back the client's jobs of another.
    pub(super) fn share(self, client: &str) -> String {
        match self {
            Self::Urgent => format!("{client} urgent"),
            Self::Usual => client.to_owned(),
            Self::Batch => format!("{client} batch"),
        }
    }
}

impl From<Priority> for i64 {
    fn from(priority: Priority) -> Self {
        match priority {
            Priority::Urgent => -1,
            Priority::Usual => 0,
            Priority::Batch => 1,
        }
    }
}

impl TryFrom<i64> for Priority {
    type Error = String;

    fn try_from(number: i64) -> Result<Self, String> {
        [Self::Urgent, Self::Usual, Self::Batch]
            .into_iter()
            .find(|priority| i64::from(*priority) == number)
            .ok_or_else(|| format!("priority: found {number}, expected -1 (urgent), 0 (usual) or 1 (batch)"))
    }
}

impl PartialSchema for Priority {
    fn schema() -> RefOr<Schema> {
        let number = ObjectBuilder::new().schema_type(Type::Integer).minimum(Some(-1)).maximum(Some(1));
        let help = "Jobs are started by priority: -1 urgent, 0 usual (the default), 1 batch. A priority is no part of the \
                    result, nor of what an `Idempotency-Key` stands for.";
        number.description(Some(help)).into()
    }
}

impl ToSchema for Priority {}
