//! Rows that are not kept for ever: ended jobs, idempotency keys, the audit trail, ended access keys, and places in the
//! queue that nobody uses.

use super::blobs::unname;
use super::database::Catalog;
use super::error::CatalogError;
use sqlx::Row;
use std::time::Duration;

/// Upper bound on the old rows that one transaction deletes. Raising it makes other writers wait for longer.
const MOST: i64 = 1000;

/// Age after its end at which an access key is deleted. Raising it shows ended keys in lists for longer.
const ENDED: Duration = Duration::from_hours(30 * 24);

/// Ages after which rows of the catalog are deleted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Retention {
    /// Age after which jobs that succeeded or were cancelled are deleted.
    pub succeeded: Duration,
    /// Age after which jobs that failed or were given up are deleted.
    pub failed: Duration,
    /// Age after which idempotency keys are deleted.
    pub keys: Duration,
    /// Age after which records of the audit trail are deleted.
    pub acts: Duration,
}

impl Catalog {
    /// Deletes ended jobs, idempotency keys and records of the audit trail, of all tenants, that are older than `ages`,
    /// and access keys that ended long ago, and returns the number of deleted jobs. The next sweep removes the reports
    /// of the deleted jobs.
    pub(crate) async fn forget(&self, ages: &Retention) -> Result<u64, CatalogError> {
        let mut forgotten = 0;
        for (state, age) in [
            ("succeeded", ages.succeeded),
            ("cancelled", ages.succeeded),
            ("failed", ages.failed),
            ("dead", ages.failed),
        ] {
            loop {
                let gone = self.forget_jobs(state, age).await?;
                forgotten += gone;
                if gone < MOST as u64 {
                    break;
                }
            }
        }
        while self.forget_keys(ages.keys).await? == MOST as u64 {}
        self.forget_acts(ages.acts).await?;
        self.forget_ended_keys(ENDED).await?;
        let _turn = self.turn().await;
        sqlx::query(self.sql(
            "DELETE FROM queue_shares WHERE used_at < {now} - 86400000 AND NOT EXISTS (SELECT 1 FROM jobs \
             WHERE jobs.tenant = queue_shares.tenant AND jobs.share = queue_shares.share AND state = 'queued')",
        ))
        .execute(&self.pool)
        .await?;
        Ok(forgotten)
    }

    async fn forget_jobs(&self, state: &'static str, age: Duration) -> Result<u64, CatalogError> {
        let old = sqlx::query(self.sql(
            "SELECT 1 FROM jobs WHERE state = $1 AND state NOT IN ('queued', 'running') \
             AND updated_at < {now} - $2 LIMIT 1",
        ))
        .bind(state)
        .bind(age.as_millis() as i64)
        .fetch_optional(&self.pool)
        .await?;
        if old.is_none() {
            return Ok(0);
        }
        let mut write = self.write().await?;
        let rows = sqlx::query(write.sql(
            "WITH old AS MATERIALIZED (SELECT id FROM jobs WHERE state = $1 AND state NOT IN ('queued', 'running') \
             AND updated_at < $2 ORDER BY updated_at LIMIT $3{skip}) \
             DELETE FROM jobs WHERE id {among SELECT id FROM old} RETURNING tenant, report",
        ))
        .bind(state)
        .bind(write.now.saturating_sub(age.as_millis() as i64))
        .bind(MOST)
        .fetch_all(&mut *write.transaction)
        .await?;
        for row in &rows {
            if let Some(report) = row.try_get::<Option<String>, _>(1)? {
                unname(&mut write, row.try_get(0)?, report).await?;
            }
        }
        write.commit().await?;
        Ok(rows.len() as u64)
    }

    async fn forget_keys(&self, age: Duration) -> Result<u64, CatalogError> {
        let _turn = self.turn().await;
        let gone = sqlx::query(self.sql(
            "WITH old AS MATERIALIZED (SELECT job FROM idempotency_keys WHERE created_at < {now} - $1 \
             ORDER BY created_at LIMIT $2) DELETE FROM idempotency_keys WHERE job {among SELECT job FROM old}",
        ))
        .bind(age.as_millis() as i64)
        .bind(MOST)
        .execute(&self.pool)
        .await?;
        Ok(gone.rows_affected())
    }
}
