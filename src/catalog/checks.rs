//! Rows about stored bytes as checks take them: those whose last check is oldest, and those that nothing refers to.

use super::blobs::{Blob, low, read};
use super::database::Catalog;
use super::error::{CatalogError, digest};
use crate::store::Digest;
use crate::trust::Tenant;
use sqlx::Row;
use std::collections::BTreeMap;

/// Stored bytes that one process has reserved to check their digest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Due {
    /// Catalog row about the stored bytes to check.
    pub blob: Blob,
    /// Time of the previous check of the stored bytes, and time at which they were reserved for this one, in ms of the
    /// Unix epoch.
    checked_at: [i64; 2],
}

impl Catalog {
    /// Returns the time of the database's clock, in ms of the Unix epoch.
    pub(crate) async fn time(&self) -> Result<i64, CatalogError> {
        Ok(sqlx::query(self.sql("SELECT {now}")).fetch_one(&self.pool).await?.try_get(0)?)
    }

    /// Reserves at most `most` stored files of all tenants whose last check was before the time `before`, the oldest
    /// first. They count as checked now, so that no other process takes them.
    pub(crate) async fn claim_checks(&self, before: i64, most: u32) -> Result<Vec<Due>, CatalogError> {
        let due = "SELECT 1 FROM blobs WHERE checked_at < $1 LIMIT 1";
        if sqlx::query(due).bind(before).fetch_optional(&self.pool).await?.is_none() {
            return Ok(Vec::new());
        }
        let mut write = self.write().await?;
        let oldest = write.sql(
            "SELECT tenant, digest, generation, bytes, suspect, checked_at FROM blobs \
             WHERE checked_at < $1 ORDER BY checked_at LIMIT $2{skip}",
        );
        let rows = sqlx::query(oldest).bind(before).bind(i64::from(most)).fetch_all(&mut *write.transaction).await?;
        let now = write.now.max(before);
        let mut claimed = Vec::with_capacity(rows.len());
        for row in &rows {
            claimed.push(Due { blob: read(row)?, checked_at: [row.try_get("checked_at")?, now] });
        }
        let mut digests: BTreeMap<&Tenant, Vec<String>> = BTreeMap::new();
        for Due { blob, .. } in &claimed {
            digests.entry(blob.object.tenant()).or_default().push(blob.object.digest().to_string());
        }
        for (tenant, digests) in digests {
            sqlx::query(write.sql("UPDATE blobs SET checked_at = $1 WHERE tenant = $3 AND digest IN ({each $2})"))
                .bind(now)
                .bind(serde_json::json!(digests).to_string())
                .bind(tenant.to_string())
                .execute(&mut *write.transaction)
                .await?;
        }
        write.commit().await?;
        Ok(claimed)
    }

    /// Gives back reserved files that were not checked, so that another process takes them.
    pub(crate) async fn unclaim_checks(&self, unchecked: &[Due]) -> Result<(), CatalogError> {
        if unchecked.is_empty() {
            return Ok(());
        }
        let mut write = self.write().await?;
        for Due { blob, checked_at: [before, claimed] } in unchecked {
            sqlx::query("UPDATE blobs SET checked_at = $3 WHERE tenant = $4 AND digest = $1 AND checked_at = $2")
                .bind(blob.object.digest().to_string())
                .bind(*claimed)
                .bind(*before)
                .bind(blob.object.tenant().to_string())
                .execute(&mut *write.transaction)
                .await?;
        }
        write.commit().await
    }

    /// Returns the digests up to `last` to which no row of the catalog refers, and which are not listed for removal.
    /// They begin with byte `first` (any byte if `None`) and follow the digest `after`.
    pub(crate) async fn orphans(
        &self,
        first: Option<u8>,
        after: Option<Digest>,
        last: Digest,
    ) -> Result<Vec<Digest>, CatalogError> {
        let rows = sqlx::query(
            "SELECT b.digest FROM blobs b WHERE b.tenant = $3 AND b.digest > $1 AND b.digest <= $2 \
             AND NOT EXISTS (SELECT 1 FROM measurements m WHERE m.tenant = b.tenant AND m.content = b.digest) \
             AND NOT EXISTS (SELECT 1 FROM materials m WHERE m.tenant = b.tenant AND m.id = b.digest) \
             AND NOT EXISTS (SELECT 1 FROM jobs j WHERE j.tenant = b.tenant AND j.report = b.digest) \
             AND NOT EXISTS (SELECT 1 FROM unnamed u WHERE u.tenant = b.tenant AND u.digest = b.digest)",
        )
        .bind(low(first, after))
        .bind(last.to_string())
        .bind(self.tenant.to_string())
        .fetch_all(&self.pool)
        .await?;
        let found = rows.iter().map(|row| {
            let text: String = row.try_get(0)?;
            digest("blobs", &text, &text)
        });
        found.collect()
    }
}

#[cfg(test)]
impl Catalog {
    /// Makes every stored file look as if it had never been checked and as if its size were unknown.
    pub(crate) async fn forget_checks(&self) {
        sqlx::query("UPDATE blobs SET checked_at = 0, bytes = -1").execute(&self.pool).await.unwrap();
    }
}

#[cfg(test)]
mod tests {
    use crate::catalog::testing;

    #[tokio::test]
    async fn a_file_is_checked_by_one_process_unless_it_gives_it_back() {
        for (catalog, _guard) in testing::catalogs().await {
            for number in 0..5 {
                testing::add(&catalog, &testing::measurement(&format!("lamp {number}"))).await;
            }
            assert_eq!(catalog.claim_checks(1, 9).await.unwrap(), [], "they are new");
            catalog.forget_checks().await;
            let now = catalog.time().await.unwrap();
            let (first, second) = tokio::join!(catalog.claim_checks(now, 3), catalog.claim_checks(now, 3));
            let (first, second) = (first.unwrap(), second.unwrap());
            let third = catalog.claim_checks(now, 9).await.unwrap();
            let mut claimed: Vec<_> =
                [&*first, &*second, &*third].concat().iter().map(|due| due.blob.object.digest()).collect();
            claimed.sort_unstable();
            claimed.dedup();
            assert_eq!((claimed.len(), first.len() + second.len() + third.len()), (5, 5));
            assert_eq!(catalog.claim_checks(now, 9).await.unwrap(), []);
            catalog.unclaim_checks(&first).await.unwrap();
            assert_eq!(catalog.claim_checks(now, 9).await.unwrap().len(), first.len());
        }
    }
}
