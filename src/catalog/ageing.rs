//! Batch jobs that have waited for long and become usual ones.

use super::database::Catalog;
use super::error::{CatalogError, tenant};
use super::priority::Priority;
use super::ranks::{COST, Terms, cost, rank};
use crate::trust::Tenant;
use sqlx::Row;
use std::collections::BTreeMap;
use std::time::Duration;

/// Share of the queue to which a tenant's batch jobs belong once they count as usual ones. All of them together take
/// the turns of one client.
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
            "SELECT id, tenant, rank, measurement FROM jobs WHERE id IN (SELECT id FROM (SELECT id, not_before FROM jobs \
             WHERE state = 'queued' AND priority = 1 ORDER BY priority, rank, id LIMIT $2) AS first \
             WHERE not_before <= $1) AND state = 'queued' AND priority = 1{skip}",
        );
        let rows = sqlx::query(aged)
            .bind(write.now.saturating_sub(age.as_millis() as i64))
            .bind(EXAMINED)
            .fetch_all(&mut *write.transaction)
            .await?;
        let mut aged: BTreeMap<Tenant, Vec<(i64, String, Option<String>)>> = BTreeMap::new();
        for row in &rows {
            let (id, owner): (String, String) = (row.try_get(0)?, row.try_get(1)?);
            let owner = tenant("jobs", &id, &owner)?;
            aged.entry(owner).or_default().push((row.try_get(2)?, id, row.try_get(3)?));
        }
        for (tenant, jobs) in aged {
            let (Some((least, ..)), Some((greatest, _, last))) = (jobs.iter().min(), jobs.iter().max()) else {
                continue;
            };
            // Among themselves they keep their order, and their distances; the last one pays for its turn like others.
            let cost = cost(&mut write, &tenant, last.as_deref()).await?.unwrap_or(COST);
            let distance = greatest - least + Terms::of(&mut write, &tenant).await?.distance(cost);
            let start = rank(&mut write, &tenant, AGED, Priority::Usual, distance).await?;
            let moved = write.sql(
                "UPDATE jobs SET priority = 0, share = $1, rank = rank + $2 \
                 WHERE id IN ({each $3}) AND state = 'queued'",
            );
            let ids: Vec<&str> = jobs.iter().map(|(_, id, _)| id.as_str()).collect();
            sqlx::query(moved)
                .bind(AGED)
                .bind(start - least)
                .bind(serde_json::json!(ids).to_string())
                .execute(&mut *write.transaction)
                .await?;
        }
        write.commit().await?;
        Ok(rows.len())
    }
}
