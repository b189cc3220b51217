//! Rows of jobs as clients see them: queued, looked up, listed, counted, cancelled and repeated.

use super::database::{Catalog, Write};
use super::error::{CatalogError, breaks_reference, digest};
use super::job::{Enqueued, JobRow, JobState, NewJob};
use super::page::{Cursor, Page, filtered};
use super::priority::Priority;
use super::ranks::{Admitted, Queueing};
use super::usage::OverQuota;
use crate::store::Digest;
use sqlx::Row;
use sqlx::any::AnyRow;

macro_rules! columns {
    () => {
        "id, measurement, state, priority, progress, attempts, material, report, problem, created_at, updated_at"
    };
}

/// Counts of the jobs that wait or run, and the age of the oldest waiting job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct JobCounts {
    /// Number of jobs that wait for a worker.
    pub queued: u64,
    /// Number of jobs that a worker is running.
    pub running: u64,
    /// Time in ms since the oldest of the waiting jobs was created.
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

/// A job that was asked to stop.
#[derive(Clone, Debug)]
pub(crate) struct Cancelling {
    /// The job after the request: cancelled if it waited, otherwise still running or at its end.
    pub job: JobRow,
    /// True if the job had not ended, and nobody had asked it to stop before.
    pub is_first: bool,
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
    /// The job is refused, because the queue is full: too many jobs are waiting.
    Full,
    /// The job is refused, because as many jobs of the tenant are waiting as its limit allows.
    Over(OverQuota),
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
        let share = new.priority.share(&new.share);
        let queueing = Queueing { measurement: measurement.as_deref(), share: &share, priority: new.priority };
        let rank = match self.admit(&mut write, &queueing, most).await? {
            Admitted::Rank(rank) => rank,
            Admitted::NoMeasurement => return Ok(Enqueued::NoMeasurement),
            Admitted::Over(over) => return Ok(Enqueued::Over(over)),
            Admitted::Full => return Ok(Enqueued::Full),
        };
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
                write.undo().await?;
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
    pub(crate) async fn cancel(&self, id: &str) -> Result<Option<Cancelling>, CatalogError> {
        self.repeat(|_| async {
            let mut write = self.write().await?;
            let found =
                write.sql("SELECT state, share, measurement, attempts, cancel_requested FROM jobs WHERE id = $1 AND tenant = $2{lock}");
            let found = sqlx::query(found)
                .bind(id.to_owned())
                .bind(self.tenant.to_string())
                .fetch_optional(&mut *write.transaction)
                .await?;
            let Some(found) = found else { return Ok(None) };
            let now = state(id, found.try_get("state")?)?;
            let is_first = found.try_get::<i64, _>("cancel_requested")? == 0;
            if now.is_final() {
                write.undo().await?;
                return Ok(self.job(id).await?.map(|job| Cancelling { job, is_first: false }));
            }
            sqlx::query(
                "UPDATE jobs SET cancel_requested = 1, needs = CASE state WHEN 'queued' THEN NULL ELSE needs END, \
                 updated_at = CASE state WHEN 'queued' THEN $3 ELSE updated_at END, \
                 state = CASE state WHEN 'queued' THEN 'cancelled' ELSE state END WHERE id = $1 AND tenant = $2",
            )
            .bind(id.to_owned())
            .bind(self.tenant.to_string())
            .bind(write.now)
            .execute(&mut *write.transaction)
            .await?;
            // Whoever was tried has had its turn.
            if now == JobState::Queued && found.try_get::<i64, _>("attempts")? == 0 {
                let (share, measurement): (String, Option<String>) = (found.try_get(1)?, found.try_get(2)?);
                self.give_back(&mut write, &share, measurement.as_deref()).await?;
            }
            write.commit().await?;
            Ok(self.job(id).await?.map(|job| Cancelling { job, is_first }))
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

    /// Puts a job that failed, was given up or was cancelled back in the queue, as if it had never been tried: behind
    /// the jobs of its share that wait already, and within the limits that new jobs have. `most` bounds the number of
    /// waiting jobs.
    pub(crate) async fn retry(&self, id: &str, most: u64) -> Result<Retried, CatalogError> {
        self.repeat(|_| async {
            match self.try_retry(id, most).await {
                // The measurement was deleted since it was looked up.
                Err(CatalogError::Sql(error)) if breaks_reference(&error) => Ok(Retried::NoMeasurement),
                retried => retried,
            }
        })
        .await
    }

    async fn try_retry(&self, id: &str, most: u64) -> Result<Retried, CatalogError> {
        let mut write = self.write().await?;
        let retried = self.retry_within(&mut write, id, most).await?;
        match retried {
            Retried::Queued(_) => write.commit().await?,
            _ => write.undo().await?,
        }
        Ok(retried)
    }

    async fn retry_within(&self, write: &mut Write, id: &str, most: u64) -> Result<Retried, CatalogError> {
        let found =
            write.sql("SELECT state, measurement, share, priority FROM jobs WHERE id = $1 AND tenant = $2{lock}");
        let found = sqlx::query(found)
            .bind(id.to_owned())
            .bind(self.tenant.to_string())
            .fetch_optional(&mut *write.transaction)
            .await?;
        let Some(found) = found else { return Ok(Retried::Absent) };
        let now = state(id, found.try_get("state")?)?;
        if !matches!(now, JobState::Failed | JobState::Dead | JobState::Cancelled) {
            return Ok(Retried::Unended(now));
        }
        let (measurement, share): (Option<String>, String) = (found.try_get("measurement")?, found.try_get("share")?);
        let priority = priority(id, found.try_get("priority")?)?;
        let queueing = Queueing { measurement: measurement.as_deref(), share: &share, priority };
        let rank = match self.admit(write, &queueing, most).await? {
            Admitted::Rank(rank) => rank,
            Admitted::NoMeasurement => return Ok(Retried::NoMeasurement),
            Admitted::Over(over) => return Ok(Retried::Over(over)),
            Admitted::Full => return Ok(Retried::Full),
        };
        sqlx::query(
            "UPDATE jobs SET state = 'queued', needs = measurement, attempts = 0, lost = 0, problem = NULL, \
             cancel_requested = 0, not_before = $3, progress = 0.0, updated_at = $3, rank = $4 \
             WHERE id = $1 AND tenant = $2",
        )
        .bind(id.to_owned())
        .bind(self.tenant.to_string())
        .bind(write.now)
        .bind(rank)
        .execute(&mut *write.transaction)
        .await?;
        let row = sqlx::query(concat!("SELECT ", columns!(), " FROM jobs WHERE id = $1"))
            .bind(id.to_owned())
            .fetch_one(&mut *write.transaction)
            .await?;
        Ok(Retried::Queued(read(&row)?))
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
