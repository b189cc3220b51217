//! Ranks of jobs in the queue, by which they are started, and the limits on the number of waiting jobs.
//!
//! Jobs are started in the order of their ranks. Each share of the queue has a rank of its own that grows with the cost
//! of its jobs, and a share whose rank has been passed begins at the rank that is being served (start-time fair
//! queueing: Goyal, Vin, Cheng 1996). So a share that queues thousands of jobs delays another's first job by the
//! running ones only, and a share that queues one job at a time takes no more turns than others. A share of which
//! nothing waits begins one job behind the rank that is being served at most: what it ran on idle workers is forgotten.
//! A job that is cancelled before its start gives its distance back. Each priority is a queue of its own, with ranks of
//! its own. Jobs of closed tenants neither run nor count.

use super::database::{Catalog, Write};
use super::error::CatalogError;
use super::priority::Priority;
use super::usage::{Limited, OverQuota};
use crate::trust::Tenant;
use sqlx::Row;
use std::sync::atomic::Ordering::Relaxed;

/// Cost of a job that reads no measurement: the distance by which it moves later jobs of its share (jobs of one client)
/// back in the queue. A job that reads a measurement costs its size in MiB, plus one. Raising it favours other shares.
pub(super) const COST: i64 = 8;

/// Weight of a tenant with the usual share of the workers. With this weight each unit of the cost of a job is [`STEP`]
/// ranks.
const USUAL: i64 = 100;

/// Number of ranks for each unit of cost of a job whose tenant has the usual weight. Raising it distinguishes larger
/// weights of tenants.
const STEP: i64 = 100;

/// Part of the free places in the queue, one in this number, that a process fills before it counts the waiting jobs of
/// all processes again. Raising it keeps to the limit more exactly where several processes queue jobs, and counts more
/// often; a count of 10,000 waiting jobs takes longer than all else that queueing a job does.
const ROOM: u64 = 8;

/// SQL condition that a row of the table `jobs` belongs to a tenant that is not closed.
macro_rules! of_open_tenant {
    () => {
        "(SELECT t.state FROM tenants t WHERE t.id = jobs.tenant) <> 'closed'"
    };
}
pub(super) use of_open_tenant;

/// A new job that is to wait in the queue.
pub(super) struct Queueing<'a> {
    /// Id of the measurement that the job reads.
    pub(super) measurement: Option<&'a str>,
    /// Name of the share of the queue (such as the jobs of one client) to which the job belongs.
    pub(super) share: &'a str,
    pub(super) priority: Priority,
}

/// Outcome of looking for a place in the queue for a job.
pub(super) enum Admitted {
    /// The job is admitted to the queue with the given rank; jobs of lower rank start first.
    Rank(i64),
    /// The measurement that the job would read does not exist.
    NoMeasurement,
    /// The job is refused, because as many jobs of the tenant are waiting as its limit allows.
    Over(OverQuota),
    /// The job is refused, because the queue is full and the tenant already has its fair part of the waiting jobs.
    Full,
}

/// Weight of a tenant in the queue of jobs, and the limit on its waiting jobs.
pub(super) struct Terms {
    weight: i64,
    most_queued: Option<i64>,
}

impl Terms {
    pub(super) async fn of(write: &mut Write, tenant: &Tenant) -> Result<Self, CatalogError> {
        let row = sqlx::query("SELECT weight, most_queued FROM tenants WHERE id = $1")
            .bind(tenant.to_string())
            .fetch_optional(&mut *write.transaction)
            .await?;
        Ok(match row {
            Some(row) => Self { weight: row.try_get(0)?, most_queued: row.try_get(1)? },
            None => Self { weight: USUAL, most_queued: None },
        })
    }

    /// Returns the number of ranks by which a job of this cost moves the next job of its share back. It is smaller for
    /// tenants of larger weight.
    pub(super) fn distance(&self, cost: i64) -> i64 {
        (cost * STEP * USUAL / self.weight.max(1)).max(1)
    }
}

impl Catalog {
    /// Finds a place in the queue for a job of this tenant. `most` bounds the number of waiting jobs of all tenants.
    pub(super) async fn admit(
        &self,
        write: &mut Write,
        job: &Queueing<'_>,
        most: u64,
    ) -> Result<Admitted, CatalogError> {
        let Some(cost) = cost(write, &self.tenant, job.measurement).await? else { return Ok(Admitted::NoMeasurement) };
        let terms = Terms::of(write, &self.tenant).await?;
        if let Some(most) = terms.most_queued {
            let limit = most.max(0) as u64;
            let used = self.waiting(write, limit).await?;
            if used >= limit {
                return Ok(Admitted::Over(OverQuota { what: Limited::Queued, limit, used, added: 1 }));
            }
        }
        if self.is_full(write, most).await? {
            return Ok(Admitted::Full);
        }
        Ok(Admitted::Rank(rank(write, &self.tenant, job.share, job.priority, terms.distance(cost)).await?))
    }

    /// Lowers the next rank of a share (jobs of one client) by the distance of a job that was cancelled before its
    /// start, so that later jobs of the share do not wait for it. Later jobs may start before waiting ones of the
    /// share, but overtake no more jobs of others.
    pub(super) async fn give_back(
        &self,
        write: &mut Write,
        share: &str,
        measurement: Option<&str>,
    ) -> Result<(), CatalogError> {
        let cost = cost(write, &self.tenant, measurement).await?.unwrap_or(COST);
        let distance = Terms::of(write, &self.tenant).await?.distance(cost);
        sqlx::query("UPDATE queue_shares SET next_rank = next_rank - $3 WHERE tenant = $1 AND share = $2")
            .bind(self.tenant.to_string())
            .bind(share.to_owned())
            .bind(distance)
            .execute(&mut *write.transaction)
            .await?;
        Ok(())
    }

    /// Returns the number of waiting jobs of this tenant, counted up to `most`.
    async fn waiting(&self, write: &mut Write, most: u64) -> Result<u64, CatalogError> {
        let waiting: i64 = sqlx::query(
            "SELECT COUNT(*) FROM (SELECT 1 FROM jobs WHERE tenant = $1 AND state = 'queued' LIMIT $2) AS waiting",
        )
        .bind(self.tenant.to_string())
        .bind(most.min(i64::MAX as u64) as i64)
        .fetch_one(&mut *write.transaction)
        .await?
        .try_get(0)?;
        Ok(waiting.max(0) as u64)
    }

    /// Returns true if `most` jobs wait, and this tenant already has its part of them: as many as each tenant with
    /// waiting jobs would have if all had equally many. So no tenant fills the queue for the others.
    async fn is_full(&self, write: &mut Write, most: u64) -> Result<bool, CatalogError> {
        if self.room.fetch_update(Relaxed, Relaxed, |room| room.checked_sub(1)).is_ok() {
            return Ok(false);
        }
        let waiting: i64 = sqlx::query(
            "SELECT COUNT(*) FROM (SELECT 1 FROM jobs WHERE state = 'queued' \
                 AND tenant NOT IN (SELECT id FROM tenants WHERE state = 'closed') LIMIT $1) AS waiting",
        )
        .bind(most.min(i64::MAX as u64) as i64)
        .fetch_one(&mut *write.transaction)
        .await?
        .try_get(0)?;
        let room = most.saturating_sub(waiting.max(0) as u64);
        if room > 0 {
            self.room.store(room / ROOM, Relaxed);
            return Ok(false);
        }
        let others: i64 = sqlx::query(
            "SELECT COUNT(*) FROM tenants t WHERE t.id <> $1 AND t.state <> 'closed' \
             AND EXISTS (SELECT 1 FROM jobs WHERE tenant = t.id AND state = 'queued')",
        )
        .bind(self.tenant.to_string())
        .fetch_one(&mut *write.transaction)
        .await?
        .try_get(0)?;
        let part = most.div_ceil(1 + others.max(0) as u64);
        Ok(self.waiting(write, part).await? >= part)
    }
}

/// Returns the cost of a job that reads this measurement; `None` if the measurement does not exist.
pub(super) async fn cost(
    write: &mut Write,
    tenant: &Tenant,
    measurement: Option<&str>,
) -> Result<Option<i64>, CatalogError> {
    let Some(id) = measurement else { return Ok(Some(COST)) };
    let row = sqlx::query("SELECT bytes FROM measurements WHERE tenant = $2 AND id = $1")
        .bind(id.to_owned())
        .bind(tenant.to_string())
        .fetch_optional(&mut *write.transaction)
        .await?;
    let bytes = row.map(|row| row.try_get::<i64, _>(0)).transpose()?;
    Ok(bytes.map(|bytes| 1 + (bytes >> 20)))
}

/// Returns the rank in the queue of the next job of a share (jobs of one client with one priority), and raises the
/// share's next rank by `distance`. Jobs of one priority are started in ascending order of rank, whoever owns them.
pub(super) async fn rank(
    write: &mut Write,
    tenant: &Tenant,
    share: &str,
    priority: Priority,
    distance: i64,
) -> Result<i64, CatalogError> {
    // The running job that was started last has the rank that is being served.
    let served: i64 = sqlx::query(concat!(
        "SELECT COALESCE((SELECT MAX(rank) FROM jobs WHERE state = 'running' AND priority = $1), \
         (SELECT rank FROM jobs WHERE state = 'queued' AND priority = $1 \
         AND ",
        of_open_tenant!(),
        " ORDER BY priority, rank, id LIMIT 1), (SELECT MAX(next_rank) FROM queue_shares), 0)",
    ))
    .bind(i64::from(priority))
    .fetch_one(&mut *write.transaction)
    .await?
    .try_get(0)?;
    let moved = write.sql(
        "INSERT INTO queue_shares (tenant, share, next_rank, used_at) VALUES ($5, $1, $2 + $3, $4) \
         ON CONFLICT (tenant, share) DO UPDATE SET used_at = $4, \
         next_rank = $3 + {greater}($2, CASE WHEN EXISTS \
         (SELECT 1 FROM jobs WHERE tenant = $5 AND share = $1 AND state = 'queued') \
         THEN queue_shares.next_rank ELSE {lesser}(queue_shares.next_rank, $2 + $3) END) RETURNING next_rank",
    );
    let next: i64 = sqlx::query(moved)
        .bind(share.to_owned())
        .bind(served)
        .bind(distance)
        .bind(write.now)
        .bind(tenant.to_string())
        .fetch_one(&mut *write.transaction)
        .await?
        .try_get(0)?;
    Ok(next - distance)
}
