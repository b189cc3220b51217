//! Rows of jobs as clients see them: queued, looked up, listed, counted, cancelled and repeated.
//!
//! Jobs are started in the order of their ranks. Each share of the queue has a rank of its own that grows with the cost
//! of its jobs, and a share whose rank has been passed begins at the rank that is being served (start-time fair
//! queueing: Goyal, Vin, Cheng 1996). So a share that queues thousands of jobs delays another's first job by the running
//! ones only, and a share that queues one job at a time takes no more turns than others. Each priority is a queue of its
//! own, with ranks of its own.

use super::database::{Catalog, Write};
use super::error::{CatalogError, breaks_reference, digest};
use super::job::{Enqueued, JobRow, JobState, NewJob};
use super::page::{Cursor, Page, filtered};
use super::priority::Priority;
use super::usage::{Limited, OverQuota};
use crate::store::Digest;
use crate::trust::Tenant;
use sqlx::Row;
use sqlx::any::AnyRow;
use std::sync::atomic::Ordering::Relaxed;

macro_rules! columns {
    () => {
        "id, measurement, state, priority, progress, attempts, material, report, problem, created_at, updated_at"
    };
}

/// Cost of a job that reads no measurement: the distance by which it moves later jobs of its share (jobs of one client)
/// back in the queue. A job that reads a measurement costs its size in MiB, plus one. Raising it favours other shares.
pub(super) const COST: i64 = 8;

/// Weight of a tenant with the usual share of the workers: each unit of its jobs' cost is [`STEP`] ranks.
const USUAL: i64 = 100;

/// Ranks for each unit of cost of a job of usual weight. Raising it tells greater weights apart.
const STEP: i64 = 100;

/// Part of the free places in the queue that a process fills before it counts the waiting jobs of all processes again:
/// one in this number. Raising it keeps to the limit more exactly where several processes queue jobs, and counts more
/// often; a count of 10,000 waiting jobs takes longer than all else that queueing a job does.
const ROOM: u64 = 8;

/// Counts of the jobs that wait or run, and the age of the oldest waiting job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct JobCounts {
    /// Number of jobs that wait for a worker.
    pub queued: u64,
    /// Number of jobs that a worker is running.
    pub running: u64,
    /// Time in ms since the oldest waiting job was created.
    pub oldest_ms: u64,
}

/// Filter of a list of jobs.
#[derive(Clone, Debug, Default)]
pub(crate) struct JobFilter {
    /// Restricts the list to jobs in this state.
    pub state: Option<JobState>,
    /// Restricts the list to jobs that read the measurement with this id.
    pub measurement: Option<Digest>,
}

/// Outcome of putting an ended job back in the queue.
#[derive(Clone, Debug)]
pub(crate) enum Retried {
    /// The job was put back, and waits in the queue again.
    Queued(JobRow),
    /// The job was not changed, because it waits, runs or has succeeded.
    Unended(JobState),
    /// The job cannot run again, because the measurement that it reads was deleted.
    NoMeasurement,
    /// No job has the given id.
    Absent,
}

impl Catalog {
    /// Adds a job to the queue, unless its idempotency key was used before. `most` bounds the number of waiting jobs.
    pub(crate) async fn enqueue(&self, new: &NewJob, most: u64) -> Result<Enqueued, CatalogError> {
        self.repeat(|_| async {
            match self.try_enqueue(new, most).await {
                // The measurement was deleted since it was looked up.
                Err(CatalogError::Sql(error)) if breaks_reference(&error) => Ok(Enqueued::NoMeasurement),
                enqueued => enqueued,
            }
        })
        .await
    }

    async fn try_enqueue(&self, new: &NewJob, most: u64) -> Result<Enqueued, CatalogError> {
        if let Some(known) = self.known(new).await? {
            return Ok(known);
        }
        let mut write = self.write().await?;
        let measurement = new.measurement.map(|digest| digest.to_string());
        let mut cost = COST;
        if let Some(id) = &measurement {
            let row = sqlx::query("SELECT bytes FROM measurements WHERE tenant = $2 AND id = $1")
                .bind(id.clone())
                .bind(self.tenant.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            let Some(row) = row else { return Ok(Enqueued::NoMeasurement) };
            cost = 1 + (row.try_get::<i64, _>(0)? >> 20);
        }
        let limits = sqlx::query("SELECT weight, most_queued FROM tenants WHERE id = $1")
            .bind(self.tenant.to_string())
            .fetch_optional(&mut *write.transaction)
            .await?;
        if let Some(row) = limits {
            // Heavier tenants go on by smaller steps.
            cost = (cost * STEP * USUAL / row.try_get::<i64, _>(0)?.max(1)).max(1);
            if let Some(most) = row.try_get::<Option<i64>, _>(1)?
                && let Some(over) = self.lacks_places(&mut write, most.max(0)).await?
            {
                return Ok(Enqueued::Over(over));
            }
        }
        if self.room.fetch_update(Relaxed, Relaxed, |room| room.checked_sub(1)).is_err() {
            let waiting: i64 =
                sqlx::query("SELECT COUNT(*) FROM (SELECT 1 FROM jobs WHERE state = 'queued' LIMIT $1) AS waiting")
                    .bind(most.min(i64::MAX as u64) as i64)
                    .fetch_one(&mut *write.transaction)
                    .await?
                    .try_get(0)?;
            let Some(room) = most.checked_sub(waiting.max(0) as u64).filter(|room| *room > 0) else {
                return Ok(Enqueued::Full);
            };
            self.room.store(room / ROOM, Relaxed);
        }
        let share = new.priority.share(&new.share);
        let rank = rank(&mut write, &self.tenant, &share, new.priority, cost).await?;
        let inserted = sqlx::query(
            "INSERT INTO jobs (id, tenant, share, frame, measurement, needs, state, rank, not_before, created_at, \
             updated_at, priority, level) VALUES ($1, $9, $2, $3, $4, $4, 'queued', $5, $6, $6, $6, $7, $8) \
             ON CONFLICT (id) DO NOTHING",
        )
        .bind(new.id.clone())
        .bind(share)
        .bind(new.frame.clone())
        .bind(measurement)
        .bind(rank)
        .bind(write.now)
        .bind(i64::from(new.priority))
        .bind(new.level)
        .bind(self.tenant.to_string())
        .execute(&mut *write.transaction)
        .await?;
        // A repetition after an answer that was lost finds the job that it has queued.
        if inserted.rows_affected() == 1
            && let Some((key, body)) = &new.idempotency
        {
            let kept = sqlx::query(
                "INSERT INTO idempotency_keys (tenant, name, body, job, created_at) \
                 VALUES ($5, $1, $2, $3, $4) ON CONFLICT (tenant, name) DO NOTHING",
            )
            .bind(key.clone())
            .bind(body.to_string())
            .bind(new.id.clone())
            .bind(write.now)
            .bind(self.tenant.to_string())
            .execute(&mut *write.transaction)
            .await?;
            if kept.rows_affected() == 0 {
                // Another request with this key was faster; its job is the answer.
                write.transaction.rollback().await?;
                return Ok(self.known(new).await?.unwrap_or(Enqueued::KeyTaken));
            }
        }
        let row = sqlx::query(concat!("SELECT ", columns!(), " FROM jobs WHERE id = $1"))
            .bind(new.id.clone())
            .fetch_one(&mut *write.transaction)
            .await?;
        let row = read(&row)?;
        write.commit().await?;
        Ok(Enqueued::New(row))
    }

    /// Returns the limit on this tenant's waiting jobs, `most`, if no further one fits.
    async fn lacks_places(&self, write: &mut Write, most: i64) -> Result<Option<OverQuota>, CatalogError> {
        let waiting: i64 = sqlx::query(
            "SELECT COUNT(*) FROM (SELECT 1 FROM jobs WHERE tenant = $1 AND state = 'queued' LIMIT $2) AS waiting",
        )
        .bind(self.tenant.to_string())
        .bind(most)
        .fetch_one(&mut *write.transaction)
        .await?
        .try_get(0)?;
        let over = OverQuota { what: Limited::Queued, limit: most as u64, used: waiting.max(0) as u64 };
        Ok((waiting >= most).then_some(over))
    }

    /// Looks up the idempotency key of a request for a job, and returns the answer to the request if the key was used
    /// before.
    async fn known(&self, new: &NewJob) -> Result<Option<Enqueued>, CatalogError> {
        let Some((key, body)) = &new.idempotency else { return Ok(None) };
        let row = sqlx::query("SELECT body, job FROM idempotency_keys WHERE tenant = $2 AND name = $1")
            .bind(key.clone())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?;
        let Some(row) = row else { return Ok(None) };
        if row.try_get::<String, _>("body")? != body.to_string() {
            return Ok(Some(Enqueued::KeyTaken));
        }
        let job: String = row.try_get("job")?;
        Ok(self.job(&job).await?.map(|row| if row.id == new.id { Enqueued::New(row) } else { Enqueued::Known(row) }))
    }

    /// Returns the job with the given id, if it exists.
    pub(crate) async fn job(&self, id: &str) -> Result<Option<JobRow>, CatalogError> {
        sqlx::query(concat!("SELECT ", columns!(), " FROM jobs WHERE id = $1 AND tenant = $2"))
            .bind(id.to_owned())
            .bind(self.tenant.to_string())
            .fetch_optional(&self.pool)
            .await?
            .map(|row| read(&row))
            .transpose()
    }

    /// Returns the numbers of waiting and running jobs, for the metrics.
    pub(crate) async fn job_counts(&self) -> Result<JobCounts, CatalogError> {
        let row = sqlx::query(self.sql(
            "SELECT (SELECT COUNT(*) FROM jobs WHERE state = 'queued'), \
             (SELECT COUNT(*) FROM jobs WHERE state = 'running'), \
             (SELECT {now} - MIN(created_at) FROM jobs WHERE state = 'queued')",
        ))
        .fetch_one(&self.pool)
        .await?;
        let number = |at: usize| row.try_get::<Option<i64>, _>(at).map(|number| number.unwrap_or(0).max(0) as u64);
        Ok(JobCounts { queued: number(0)?, running: number(1)?, oldest_ms: number(2)? })
    }

    /// Requests that a job stop: a waiting job is cancelled at once, a running one by its worker. Returns the job
    /// afterwards, if it exists.
    pub(crate) async fn cancel(&self, id: &str) -> Result<Option<JobRow>, CatalogError> {
        self.repeat(|_| async {
            let turn = self.turn().await;
            sqlx::query(self.sql(
                "UPDATE jobs SET cancel_requested = 1, needs = CASE state WHEN 'queued' THEN NULL ELSE needs END, \
                 updated_at = CASE state WHEN 'queued' THEN {now} ELSE updated_at END, \
                 state = CASE state WHEN 'queued' THEN 'cancelled' ELSE state END \
                 WHERE id = $1 AND tenant = $2 AND state IN ('queued', 'running')",
            ))
            .bind(id.to_owned())
            .bind(self.tenant.to_string())
            .execute(&self.pool)
            .await?;
            drop(turn);
            self.job(id).await
        })
        .await
    }

    /// Returns a page of jobs, newest first.
    pub(crate) async fn jobs(
        &self,
        filter: &JobFilter,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<JobRow>, CatalogError> {
        let after = after.unwrap_or_else(Cursor::newest);
        let statement = filtered(
            concat!("SELECT ", columns!(), " FROM jobs WHERE tenant = $5 AND (created_at, id) < ($1, $2)"),
            &[
                (filter.state.is_some(), filter.state.map_or("", only)),
                (filter.measurement.is_some(), "measurement = $3"),
            ],
            " ORDER BY created_at DESC, id DESC LIMIT $4",
        );
        let mut list = self.list().await?;
        let rows = sqlx::query(statement)
            .bind(after.created_at)
            .bind(after.id)
            .bind(filter.measurement.map(|digest| digest.to_string()))
            .bind(limit as i64 + 1)
            .bind(self.tenant.to_string())
            .fetch_all(&mut *list)
            .await?;
        list.commit().await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::of(rows, limit, |row| Cursor { created_at: row.created_ms, id: row.id.clone() }))
    }

    /// Puts a job that failed, was given up or was cancelled back in the queue, as if it had never been tried.
    pub(crate) async fn retry(&self, id: &str) -> Result<Retried, CatalogError> {
        let turn = self.turn().await;
        let retried = sqlx::query(self.sql(
            "UPDATE jobs SET state = 'queued', needs = measurement, attempts = 0, lost = 0, problem = NULL, \
             cancel_requested = 0, not_before = {now}, progress = 0.0, updated_at = {now} \
             WHERE id = $1 AND tenant = $2 AND state IN ('failed', 'dead', 'cancelled')",
        ))
        .bind(id.to_owned())
        .bind(self.tenant.to_string())
        .execute(&self.pool)
        .await;
        drop(turn);
        let changed = match retried {
            Err(error) if breaks_reference(&error) => return Ok(Retried::NoMeasurement),
            changed => changed?.rows_affected() == 1,
        };
        Ok(match self.job(id).await? {
            None => Retried::Absent,
            Some(row) if changed => Retried::Queued(row),
            Some(row) => Retried::Unended(row.state),
        })
    }
}

/// Returns the SQL condition that a job is in a state. It repeats the condition of the index that holds such jobs.
fn only(state: JobState) -> &'static str {
    match state {
        JobState::Queued => "state = 'queued'",
        JobState::Running => "state = 'running'",
        JobState::Succeeded => "state = 'succeeded' AND state NOT IN ('queued', 'running')",
        JobState::Failed => "state = 'failed' AND state NOT IN ('queued', 'running')",
        JobState::Dead => "state = 'dead' AND state NOT IN ('queued', 'running')",
        JobState::Cancelled => "state = 'cancelled' AND state NOT IN ('queued', 'running')",
    }
}

/// Returns the rank in the queue of the next job of a share (jobs of one client with one priority), and raises the
/// share's next rank by the cost of the job. Jobs of one priority are started in ascending order of rank, whoever owns
/// them.
pub(super) async fn rank(
    write: &mut Write,
    tenant: &Tenant,
    share: &str,
    priority: Priority,
    cost: i64,
) -> Result<i64, CatalogError> {
    // The running job that was started last has the rank that is being served.
    let served: i64 = sqlx::query(
        "SELECT COALESCE((SELECT MAX(rank) FROM jobs WHERE state = 'running' AND priority = $1), \
         (SELECT rank FROM jobs WHERE state = 'queued' AND priority = $1 ORDER BY priority, rank, id LIMIT 1), \
         (SELECT MAX(next_rank) FROM queue_shares), 0)",
    )
    .bind(i64::from(priority))
    .fetch_one(&mut *write.transaction)
    .await?
    .try_get(0)?;
    let moved = write.sql(
        "INSERT INTO queue_shares (tenant, share, next_rank, used_at) VALUES ($5, $1, $2 + $3, $4) \
         ON CONFLICT (tenant, share) DO UPDATE SET used_at = $4, \
         next_rank = $3 + {greater}(queue_shares.next_rank, $2) RETURNING next_rank",
    );
    let next: i64 = sqlx::query(moved)
        .bind(share.to_owned())
        .bind(served)
        .bind(cost)
        .bind(write.now)
        .bind(tenant.to_string())
        .fetch_one(&mut *write.transaction)
        .await?
        .try_get(0)?;
    Ok(next - cost)
}

pub(super) fn state(id: &str, name: &str) -> Result<JobState, CatalogError> {
    JobState::ALL.into_iter().find(|state| state.name() == name).ok_or_else(|| CatalogError::Row {
        table: "jobs",
        id: id.to_owned(),
        reason: format!("unknown state `{name}`"),
    })
}

fn priority(id: &str, number: i64) -> Result<Priority, CatalogError> {
    Priority::try_from(number).map_err(|reason| CatalogError::Row { table: "jobs", id: id.to_owned(), reason })
}

fn read(row: &AnyRow) -> Result<JobRow, CatalogError> {
    let id: String = row.try_get("id")?;
    let digest = |text: String| digest("jobs", &id, &text);
    Ok(JobRow {
        measurement: row.try_get::<Option<String>, _>("measurement")?.map(digest).transpose()?,
        state: state(&id, row.try_get("state")?)?,
        priority: priority(&id, row.try_get("priority")?)?,
        progress: row.try_get("progress")?,
        attempts: row.try_get::<i64, _>("attempts")?.max(0) as u32,
        material: row.try_get::<Option<String>, _>("material")?.map(digest).transpose()?,
        report: row.try_get::<Option<String>, _>("report")?.map(digest).transpose()?,
        problem: row.try_get("problem")?,
        created_ms: row.try_get("created_at")?,
        updated_ms: row.try_get("updated_at")?,
        id,
    })
}
