//! Batch jobs that have waited for long and become usual ones.

use super::database::Catalog;
use super::error::CatalogError;
use super::jobs::{COST, rank};
use super::priority::Priority;
use sqlx::Row;
use std::time::Duration;

/// Share of the queue to which batch jobs belong once they count as usual ones. All of them together take the turns of
/// one client.
const AGED: &str = "aged";

/// Number of batch jobs, first in the queue, that are examined for their age at once. Raising it makes one transaction
/// longer.
const EXAMINED: i64 = 1000;

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
