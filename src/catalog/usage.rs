//! Counts of the bytes and materials of each tenant: changed in the transactions that add and delete them, and held to
//! the tenant's limits.
//!
//! A tenant has several rows of counts, so that its transactions seldom wait for one another. Each transaction changes
//! one of them, as its last statement. A count of everything, from time to time, corrects what older programs or hands
//! have changed without counting.

use super::database::{Catalog, Write};
use super::dialect::Dialect;
use super::error::{CatalogError, tenant};
use crate::store::Digest;
use crate::trust::Tenant;
use sqlx::{Executor, Row};
use std::fmt;
use std::time::Duration;

/// Number of database rows over which the counts of one tenant's bytes and materials are spread. Raising it lets more
/// transactions of one tenant end at once, and reads more rows for each.
const SHARDS: i64 = 8;

/// Age of the last complete count of a tenant's bytes and materials after which they are counted again. Raising it
/// reads less, and corrects wrong counts later.
const COUNTED: Duration = Duration::from_hours(24);

/// Limit of a tenant that a request would exceed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OverQuota {
    /// Kind of the limited resource: bytes, materials or waiting jobs.
    pub what: Limited,
    /// Limit that the request would exceed, in bytes, materials or waiting jobs.
    pub limit: u64,
    /// Amount that the tenant used before the request, in bytes, materials or waiting jobs.
    pub used: u64,
    /// Amount that the request would add, in bytes, materials or waiting jobs.
    pub added: u64,
}

/// Kind of resource of which a tenant may have a limited amount.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limited {
    /// Total size in bytes of measurements and materials.
    Bytes,
    /// Number of materials.
    Materials,
    /// Number of jobs that wait in the queue.
    Queued,
}

/// Amount by which the counted bytes and materials of a tenant change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Change {
    bytes: i64,
    rows: i64,
    materials: i64,
}

impl fmt::Display for OverQuota {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, limit, used, added } = self;
        match what {
            Limited::Bytes if added > limit => write!(
                f,
                "{added} bytes are more than the tenant may store in all, {limit}; ask the operator for a larger quota"
            ),
            Limited::Bytes => write!(
                f,
                "the tenant uses {used} of {limit} bytes, and {added} more do not fit; delete measurements or materials \
                 first"
            ),
            Limited::Materials => write!(f, "the tenant has {used} of {limit} materials; delete one of them first"),
            Limited::Queued => write!(f, "{used} of {limit} jobs of the tenant are waiting already"),
        }
    }
}

impl Change {
    /// Returns the change of a tenant's counts by a new measurement with this number of bytes.
    pub(super) fn measurement(bytes: u64) -> Self {
        Self { bytes: bytes as i64, rows: 1, materials: 0 }
    }

    /// Returns the change of a tenant's counts by a new material with this number of bytes.
    pub(super) fn material(bytes: u64) -> Self {
        Self { materials: 1, ..Self::measurement(bytes) }
    }

    /// Returns the opposite of this change of a tenant's counts, for the deletion of what was added.
    pub(super) fn undone(self) -> Self {
        Self { bytes: -self.bytes, rows: -self.rows, materials: -self.materials }
    }
}

/// Adds a change, caused by the object `id`, to the counted bytes and materials of the tenant of a transaction. Returns
/// the limit that it would exceed: the transaction must be undone then. Must be the last statement of the transaction,
/// so that transactions that share a row of counts never wait for one another in a circle.
pub(super) async fn charge(write: &mut Write, id: Digest, change: Change) -> Result<Option<OverQuota>, CatalogError> {
    if change.rows > 0 {
        let row = sqlx::query(LIMITS).bind(write.tenant.to_string()).fetch_optional(&mut *write.transaction).await?;
        if let Some(row) = row {
            let added = [change.bytes, change.materials].map(|added| added.max(0) as u64);
            if let Some(over) = over(&row, added)? {
                return Ok(Some(over));
            }
        }
    }
    // The last digit of a digest is as good as random.
    let shard = id.to_string().bytes().last().map_or(0, |digit| i64::from(digit) % SHARDS);
    add(write, shard, change).await?;
    Ok(None)
}

/// Adds a change to one of the database rows that together hold the counted bytes and materials of a tenant.
async fn add(write: &mut Write, shard: i64, change: Change) -> Result<(), CatalogError> {
    sqlx::query(
        "INSERT INTO usage (tenant, shard, bytes, blobs, materials) VALUES ($1, $2, $3, $4, $5) \
         ON CONFLICT (tenant, shard) DO UPDATE SET bytes = usage.bytes + excluded.bytes, \
         blobs = usage.blobs + excluded.blobs, materials = usage.materials + excluded.materials",
    )
    .bind(write.tenant.to_string())
    .bind(shard)
    .bind(change.bytes)
    .bind(change.rows)
    .bind(change.materials)
    .execute(&mut *write.transaction)
    .await?;
    Ok(())
}

/// SQL query for the limits of the tenant `$1`, and for the bytes and materials that it has.
const LIMITS: &str = "SELECT t.most_bytes, t.most_materials, \
    CAST(COALESCE((SELECT SUM(u.bytes) FROM usage u WHERE u.tenant = t.id), 0) AS BIGINT), \
    CAST(COALESCE((SELECT SUM(u.materials) FROM usage u WHERE u.tenant = t.id), 0) AS BIGINT) \
    FROM tenants t WHERE t.id = $1 AND (t.most_bytes IS NOT NULL OR t.most_materials IS NOT NULL)";

/// Returns the limit of a tenant that the given numbers of further bytes and materials would exceed.
fn over(row: &sqlx::any::AnyRow, added: [u64; 2]) -> Result<Option<OverQuota>, CatalogError> {
    for (at, what) in [Limited::Bytes, Limited::Materials].into_iter().enumerate() {
        let limit: Option<i64> = row.try_get(at)?;
        let used = row.try_get::<i64, _>(at + 2)?.max(0) as u64;
        let Some(limit) = limit.map(|limit| limit.max(0) as u64) else { continue };
        if added[at] > 0 && used.saturating_add(added[at]) > limit {
            return Ok(Some(OverQuota { what, limit, used, added: added[at] }));
        }
    }
    Ok(None)
}

impl Catalog {
    /// Returns the limit of this tenant that the given numbers of further bytes and materials would exceed, before they
    /// are stored.
    pub(crate) async fn lacks_room(&self, bytes: u64, materials: u64) -> Result<Option<OverQuota>, CatalogError> {
        let row = sqlx::query(LIMITS).bind(self.tenant.to_string()).fetch_optional(&self.pool).await?;
        row.map_or(Ok(None), |row| over(&row, [bytes, materials]))
    }

    /// Counts the bytes and materials of each tenant whose last complete count is older than a day.
    pub(crate) async fn recount(&self) -> Result<(), CatalogError> {
        let due = sqlx::query(self.sql("SELECT id FROM tenants WHERE counted_at < {now} - $1 ORDER BY counted_at"))
            .bind(COUNTED.as_millis() as i64)
            .fetch_all(&self.pool)
            .await?;
        for row in &due {
            let id: String = row.try_get(0)?;
            let tenant = tenant("tenants", &id, &id)?;
            // One of several processes counts.
            if self.is_to_count(&tenant).await?
                && let Err(error) = self.count(&tenant).await
            {
                tracing::error!(%tenant, %error, "the bytes and materials of a tenant were not counted; the next try is in a day");
            }
        }
        Ok(())
    }

    /// Records that a complete count of a tenant's bytes and materials begins now. Returns false if another process has
    /// begun one within the last day.
    async fn is_to_count(&self, tenant: &Tenant) -> Result<bool, CatalogError> {
        let _turn = self.turn().await;
        let noted =
            sqlx::query(self.sql("UPDATE tenants SET counted_at = {now} WHERE id = $1 AND counted_at < {now} - $2"))
                .bind(tenant.to_string())
                .bind(COUNTED.as_millis() as i64)
                .execute(&self.pool)
                .await?;
        Ok(noted.rows_affected() == 1)
    }

    /// Counts all bytes and materials of a tenant, and corrects the stored counts. One statement reads the data and the
    /// stored counts as they are at one moment, so that it locks nothing however long it takes, and the difference
    /// stays true afterwards.
    pub(crate) async fn count(&self, tenant: &Tenant) -> Result<(), CatalogError> {
        let mut reading = self.pool.begin().await?;
        if self.dialect == Dialect::Postgres {
            reading.execute("SET LOCAL statement_timeout = 0").await?;
        }
        let row = sqlx::query(
            "SELECT CAST((SELECT COALESCE(SUM(m.bytes), 0) FROM measurements m WHERE m.tenant = $1) \
             + (SELECT COALESCE(SUM(m.bytes), 0) FROM materials m WHERE m.tenant = $1) \
             - (SELECT COALESCE(SUM(u.bytes), 0) FROM usage u WHERE u.tenant = $1) AS BIGINT), \
             CAST((SELECT COUNT(*) FROM measurements m WHERE m.tenant = $1) \
             + (SELECT COUNT(*) FROM materials m WHERE m.tenant = $1) \
             - (SELECT COALESCE(SUM(u.blobs), 0) FROM usage u WHERE u.tenant = $1) AS BIGINT), \
             CAST((SELECT COUNT(*) FROM materials m WHERE m.tenant = $1) \
             - (SELECT COALESCE(SUM(u.materials), 0) FROM usage u WHERE u.tenant = $1) AS BIGINT)",
        )
        .bind(tenant.to_string())
        .fetch_one(&mut *reading)
        .await?;
        reading.rollback().await?;
        let difference = Change { bytes: row.try_get(0)?, rows: row.try_get(1)?, materials: row.try_get(2)? };
        if difference == (Change { bytes: 0, rows: 0, materials: 0 }) {
            return Ok(());
        }
        let mut write = self.of(tenant).write().await?;
        add(&mut write, 0, difference).await?;
        write.commit().await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing::{self, add, material, measurement, publish};
    use crate::catalog::{Added, Deleted, Limit, Settled, TenantChange, TenantRow, Uploaded};

    async fn used(catalog: &Catalog) -> (u64, u64) {
        let TenantRow { bytes, materials, .. } = catalog.tenant_row(catalog.tenant()).await.unwrap().unwrap();
        (bytes, materials)
    }

    #[tokio::test]
    async fn what_a_tenant_has_is_counted_and_held_to_its_limits() {
        for (all, _guard) in testing::catalogs().await {
            let lab: Tenant = "lab".parse().unwrap();
            let limits = TenantChange {
                bytes: Some(Limit(Some(30))),
                materials: Some(Limit(Some(1))),
                ..TenantChange::default()
            };
            assert!(matches!(all.create_tenant(&lab, &limits).await.unwrap(), Settled::Row(_)));
            let catalog = all.of(&lab);
            let lamp = measurement("lamp of 16 bytes");
            for _ in 0..2 {
                add(&catalog, &lamp).await;
                assert_eq!(used(&catalog).await, (16, 0), "once, however often it is uploaded");
            }
            let long = measurement("another of 16 B!");
            let claim = publish(&catalog, long.content, 16).await;
            let over = OverQuota { what: Limited::Bytes, limit: 30, used: 16, added: 16 };
            assert_eq!(
                over.to_string(),
                "the tenant uses 16 of 30 bytes, and 16 more do not fit; delete measurements or materials first"
            );
            let huge = catalog.lacks_room(31, 0).await.unwrap().unwrap().to_string();
            assert!(huge.starts_with("31 bytes are more than the tenant may store in all, 30; ask"), "{huge}");
            assert!(
                matches!(catalog.add_measurement(&long, &claim).await.unwrap(), Added::Over(found) if found == over)
            );
            assert_eq!(catalog.lacks_room(15, 0).await.unwrap(), Some(OverQuota { added: 15, ..over }));
            assert_eq!(catalog.lacks_room(14, 0).await.unwrap(), None);
            assert!(catalog.measurement(long.id).await.unwrap().is_none() && used(&catalog).await == (16, 0));
            assert!(add(&all, &long).await.1, "another tenant has no limit");

            let store = async |text: &str| {
                let new = material(text);
                let claim = publish(&catalog, new.id, new.bytes).await;
                catalog.add_material(&new, &claim).await.unwrap()
            };
            assert_eq!(store("one").await, Uploaded::Stored(true));
            assert_eq!(store("one").await, Uploaded::Stored(false));
            assert_eq!(used(&catalog).await, (26, 1));
            assert_eq!(catalog.delete_measurement(lamp.id).await.unwrap(), Deleted::Done);
            assert_eq!(used(&catalog).await, (10, 1), "a deletion counts at once");
            let over = OverQuota { what: Limited::Materials, limit: 1, used: 1, added: 1 };
            assert_eq!(catalog.lacks_room(1, 1).await.unwrap(), Some(over));
            assert_eq!(store("two").await, Uploaded::Over(over));
            assert_eq!(catalog.delete_material(Digest::of(b"one")).await.unwrap(), Deleted::Done);
            assert_eq!(store("two").await, Uploaded::Stored(true));
            assert_eq!(used(&catalog).await, (10, 1));
        }
    }

    #[tokio::test]
    async fn a_count_corrects_what_was_not_counted() {
        for (catalog, _guard) in testing::catalogs().await {
            add(&catalog, &measurement("lamp")).await;
            sqlx::query("UPDATE usage SET bytes = 77, materials = 5").execute(&catalog.pool).await.unwrap();
            catalog.recount().await.unwrap();
            assert_eq!(used(&catalog).await, (4, 0));
            sqlx::query("UPDATE usage SET bytes = bytes + 77 WHERE shard = 0").execute(&catalog.pool).await.unwrap();
            catalog.recount().await.unwrap();
            assert_eq!(used(&catalog).await, (81, 0), "it was counted today");
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn counts_are_exact_while_tenants_write_and_everything_is_counted() {
        for (catalog, _guard) in testing::catalogs().await {
            let writers = (0..4).map(|writer| {
                let catalog = catalog.clone();
                tokio::spawn(async move {
                    for number in 0..10 {
                        let lamp = measurement(&format!("lamp {writer} {number}"));
                        add(&catalog, &lamp).await;
                        if number % 2 == 0 {
                            assert_eq!(catalog.delete_measurement(lamp.id).await.unwrap(), Deleted::Done);
                        }
                    }
                })
            });
            let writers: Vec<_> = writers.collect();
            for _ in 0..10 {
                catalog.count(catalog.tenant()).await.unwrap();
            }
            for writer in writers {
                writer.await.unwrap();
            }
            assert_eq!(used(&catalog).await, (4 * 5 * 8, 0));
        }
    }
}
