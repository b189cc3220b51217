//! Priorities of jobs, and batch jobs that become usual ones after a while.

use super::database::Catalog;
use super::error::CatalogError;
use super::jobs::{COST, rank};
use serde::{Deserialize, Serialize};
use sqlx::Row;
use std::time::Duration;
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

/// Priority of a job: of two waiting jobs the one with the lower number is started first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "i64", into = "i64")]
pub(crate) enum Priority {
    /// -1: before all others.
    Urgent,
    /// 0.
    #[default]
    Usual,
    /// 1: after all others, until it has waited for long.
    Batch,
}

/// Share of the queue to which batch jobs belong once they count as usual ones. All of them together take the turns of
/// one client.
const AGED: &str = "aged";

/// Number of batch jobs, first in the queue, that are examined for their age at once. Raising it makes one transaction
/// longer.
const EXAMINED: i64 = 1000;

impl Priority {
    /// Returns true: a request that is kept, compared or run says nothing about its priority.
    #[expect(clippy::trivially_copy_pass_by_ref, clippy::unused_self, reason = "the signature that serde asks for")]
    pub(crate) fn is_left_out(&self) -> bool {
        true
    }

    /// Returns the name of the share of the queue that a client's jobs of this priority take their turns in. So jobs of
    /// one priority never push back the client's jobs of another.
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
        number.description(Some("Jobs are started by priority: -1 urgent, 0 usual, 1 batch.")).into()
    }
}

impl ToSchema for Priority {}

impl Catalog {
    /// Makes usual jobs of those batch jobs that have waited for `age`, the first ones of the queue, and returns their
    /// number. Otherwise usual jobs could hold up batch jobs for ever.
    pub(crate) async fn age(&self, age: Duration) -> Result<usize, CatalogError> {
        // Look without the write lock first: nearly always there is none.
        let any = sqlx::query(self.sql(
            "SELECT 1 FROM (SELECT not_before FROM jobs WHERE state = 'queued' AND priority = 1 \
             ORDER BY priority, rank, id LIMIT $2) AS first WHERE not_before <= {now} - $1 LIMIT 1",
        ))
        .bind(age.as_millis() as i64)
        .bind(EXAMINED)
        .fetch_optional(&self.pool)
        .await?;
        if any.is_none() {
            return Ok(0);
        }
        let mut write = self.write().await?;
        let aged = write.sql(
            "SELECT id, rank FROM jobs WHERE id IN (SELECT id FROM (SELECT id, not_before FROM jobs \
             WHERE state = 'queued' AND priority = 1 ORDER BY priority, rank, id LIMIT $2) AS first \
             WHERE not_before <= $1) AND state = 'queued' AND priority = 1{skip}",
        );
        let rows = sqlx::query(aged)
            .bind(write.now.saturating_sub(age.as_millis() as i64))
            .bind(EXAMINED)
            .fetch_all(&mut *write.transaction)
            .await?;
        let mut ids = Vec::with_capacity(rows.len());
        let (mut least, mut greatest) = (i64::MAX, i64::MIN);
        for row in &rows {
            ids.push(row.try_get::<String, _>(0)?);
            let rank: i64 = row.try_get(1)?;
            (least, greatest) = (least.min(rank), greatest.max(rank));
        }
        if ids.is_empty() {
            return Ok(0);
        }
        // Among themselves they keep their order, and their distances.
        let start = rank(&mut write, AGED, Priority::Usual, greatest - least + COST).await?;
        let moved = write.sql(
            "UPDATE jobs SET priority = 0, share = $1, rank = rank + $2 WHERE id IN ({each $3}) AND state = 'queued'",
        );
        sqlx::query(moved)
            .bind(AGED)
            .bind(start - least)
            .bind(serde_json::json!(ids).to_string())
            .execute(&mut *write.transaction)
            .await?;
        write.commit().await?;
        Ok(ids.len())
    }
}
