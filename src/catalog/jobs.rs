//! Rows of jobs: the queue, its leases and its fencing epochs.
//!
//! A job is claimed by raising its epoch and setting a lease. Everything its worker writes afterwards names that epoch:
//! if the lease ran out and another worker took the job, the epoch is higher and the late write changes nothing.

use super::database::{Catalog, Write};
use super::dialect::{SKIP_LOCKED, each};
use super::error::CatalogError;
use super::job::{Beat, Claimed, Ended, Ending, Enqueued, JobRow, JobState, NewJob};
use super::materials::insert;
use super::pins::unpin;
use crate::store::Digest;
use sqlx::any::AnyRow;
use sqlx::{AssertSqlSafe, Row};
use std::time::Duration;

macro_rules! columns {
    () => {
        "id, measurement, state, progress, attempts, material, report, problem, created_at, updated_at"
    };
}

impl Catalog {
    /// Queues a job, unless its idempotency key was used before. `most` bounds the jobs that wait.
    pub(crate) async fn enqueue(&self, new: &NewJob, most: u64) -> Result<Enqueued, CatalogError> {
        let mut write = self.write().await?;
        if let Some((key, body)) = &new.idempotency {
            let known = sqlx::query("SELECT body, job FROM idempotency_keys WHERE name = $1")
                .bind(key.clone())
                .fetch_optional(&mut *write.transaction)
                .await?;
            if let Some(known) = known {
                if known.try_get::<String, _>("body")? != body.to_string() {
                    return Ok(Enqueued::KeyTaken);
                }
                return Ok(Enqueued::Known(one(&mut write, known.try_get("job")?).await?));
            }
        }
        let measurement = new.measurement.map(|digest| digest.to_string());
        if let Some(id) = &measurement {
            let there = sqlx::query("SELECT 1 FROM measurements WHERE id = $1")
                .bind(id.clone())
                .fetch_optional(&mut *write.transaction)
                .await?;
            if there.is_none() {
                return Ok(Enqueued::NoMeasurement);
            }
        }
        let waiting: i64 = sqlx::query("SELECT COUNT(*) FROM jobs WHERE state = 'queued'")
            .fetch_one(&mut *write.transaction)
            .await?
            .try_get(0)?;
        if waiting.max(0) as u64 >= most {
            return Ok(Enqueued::Full);
        }
        sqlx::query(
            "INSERT INTO jobs (id, frame, measurement, state, progress, attempts, epoch, not_before, \
             cancel_requested, created_at, updated_at) VALUES ($1, $2, $3, 'queued', 0.0, 0, 0, $4, 0, $4, $4)",
        )
        .bind(new.id.clone())
        .bind(new.frame.clone())
        .bind(measurement)
        .bind(write.now)
        .execute(&mut *write.transaction)
        .await?;
        if let Some((key, body)) = &new.idempotency {
            sqlx::query("INSERT INTO idempotency_keys (name, body, job, created_at) VALUES ($1, $2, $3, $4)")
                .bind(key.clone())
                .bind(body.to_string())
                .bind(new.id.clone())
                .bind(write.now)
                .execute(&mut *write.transaction)
                .await?;
        }
        let row = one(&mut write, new.id.clone()).await?;
        write.commit().await?;
        Ok(Enqueued::New(row))
    }

    /// Returns one job.
    pub(crate) async fn job(&self, id: &str) -> Result<Option<JobRow>, CatalogError> {
        sqlx::query(concat!("SELECT ", columns!(), " FROM jobs WHERE id = $1"))
            .bind(id.to_owned())
            .fetch_optional(&self.pool)
            .await?
            .map(|row| read(&row))
            .transpose()
    }

    /// Returns the number of jobs in each state, for the metrics.
    pub(crate) async fn job_counts(&self) -> Result<Vec<(JobState, u64)>, CatalogError> {
        let rows = sqlx::query("SELECT state, COUNT(*) FROM jobs GROUP BY state").fetch_all(&self.pool).await?;
        rows.iter().map(|row| Ok((state("", row.try_get(0)?)?, row.try_get::<i64, _>(1)?.max(0) as u64))).collect()
    }

    /// Claims the job that has waited longest and may start, if there is one. Jobs whose ids are in `but` are left to
    /// other workers.
    pub(crate) async fn claim(
        &self,
        worker: &str,
        lease: Duration,
        but: &[String],
    ) -> Result<Option<Claimed>, CatalogError> {
        let but = serde_json::json!(but).to_string();
        // Look without the write lock first, so that an idle worker does not disturb writers.
        let any = format!("SELECT 1 FROM jobs WHERE state = 'queued' AND id NOT IN ({}) LIMIT 1", each("$1"));
        let any = sqlx::query(AssertSqlSafe(any)).bind(but.clone()).fetch_optional(&self.pool).await?;
        if any.is_none() {
            return Ok(None);
        }
        let ready = format!(
            "SELECT id, frame, epoch, attempts FROM jobs WHERE state = 'queued' AND not_before <= $1 \
             AND id NOT IN ({}) ORDER BY not_before, id LIMIT 1{SKIP_LOCKED}",
            each("$2")
        );
        let mut write = self.write().await?;
        let ready = sqlx::query(AssertSqlSafe(ready)).bind(write.now).bind(but);
        let row = ready.fetch_optional(&mut *write.transaction).await?;
        let Some(row) = row else { return Ok(None) };
        let claimed = Claimed {
            id: row.try_get("id")?,
            frame: row.try_get("frame")?,
            epoch: row.try_get::<i64, _>("epoch")? + 1,
            attempts: row.try_get::<i64, _>("attempts")?.max(0) as u32 + 1,
        };
        sqlx::query(
            "UPDATE jobs SET state = 'running', epoch = $2, attempts = $3, worker = $4, lease_until = $5, \
             progress = 0.0, updated_at = $6 WHERE id = $1",
        )
        .bind(claimed.id.clone())
        .bind(claimed.epoch)
        .bind(i64::from(claimed.attempts))
        .bind(worker.to_owned())
        .bind(write.now.saturating_add(lease.as_millis() as i64))
        .bind(write.now)
        .execute(&mut *write.transaction)
        .await?;
        write.commit().await?;
        Ok(Some(claimed))
    }

    /// Renews the lease of a running job, stores its progress and tells its worker whether to continue.
    pub(crate) async fn beat(&self, job: &Claimed, progress: f64, lease: Duration) -> Result<Beat, CatalogError> {
        let mut write = self.write().await?;
        let renewed = sqlx::query(
            "UPDATE jobs SET lease_until = $3, progress = $4 WHERE id = $1 AND epoch = $2 AND state = 'running'",
        )
        .bind(job.id.clone())
        .bind(job.epoch)
        .bind(write.now.saturating_add(lease.as_millis() as i64))
        .bind(progress.clamp(0.0, 1.0))
        .execute(&mut *write.transaction)
        .await?;
        if renewed.rows_affected() == 0 {
            return Ok(Beat::Lost);
        }
        let cancel: i64 = sqlx::query("SELECT cancel_requested FROM jobs WHERE id = $1")
            .bind(job.id.clone())
            .fetch_one(&mut *write.transaction)
            .await?
            .try_get(0)?;
        write.commit().await?;
        Ok(if cancel == 0 { Beat::Yours } else { Beat::Cancel })
    }

    /// Ends an attempt.
    pub(crate) async fn end(&self, job: &Claimed, ended: &Ended) -> Result<Ending, CatalogError> {
        let mut write = self.write().await?;
        let owned = sqlx::query("SELECT cancel_requested FROM jobs WHERE id = $1 AND epoch = $2 AND state = 'running'")
            .bind(job.id.clone())
            .bind(job.epoch)
            .fetch_optional(&mut *write.transaction)
            .await?;
        let Some(owned) = owned else { return Ok(Ending::Lost) };
        let cancel = owned.try_get::<i64, _>(0)? != 0;
        let published = match ended {
            Ended::Material(new, holder) => Some((new.id, holder)),
            Ended::Report(digest, holder) => Some((*digest, holder)),
            Ended::Failed(_) | Ended::Retry { .. } | Ended::Cancelled | Ended::Released => None,
        };
        if let Some((digest, holder)) = published
            && !unpin(&mut write, digest, holder).await?
        {
            return Ok(Ending::Unpinned);
        }
        let (mut material, mut report) = (None, None);
        let (state, problem, wait, attempts) = match ended {
            Ended::Material(new, _) => {
                insert(&mut write, new).await?;
                material = Some(new.id.to_string());
                (JobState::Succeeded, None, 0, job.attempts)
            }
            Ended::Report(digest, _) => {
                report = Some(digest.to_string());
                (JobState::Succeeded, None, 0, job.attempts)
            }
            Ended::Failed(problem) => (JobState::Failed, Some(problem.clone()), 0, job.attempts),
            Ended::Cancelled => (JobState::Cancelled, None, 0, job.attempts),
            // After a cancel request no further attempt is wanted.
            Ended::Retry { .. } | Ended::Released if cancel => (JobState::Cancelled, None, 0, job.attempts),
            Ended::Retry { problem, attempts, .. } if job.attempts >= *attempts => {
                (JobState::Dead, Some(problem.clone()), 0, job.attempts)
            }
            Ended::Retry { problem, delay, .. } => {
                (JobState::Queued, Some(problem.clone()), delay.as_millis() as i64, job.attempts)
            }
            Ended::Released => (JobState::Queued, None, 0, job.attempts.saturating_sub(1)),
        };
        let progress = if state == JobState::Succeeded { 1.0 } else { 0.0 };
        sqlx::query(
            "UPDATE jobs SET state = $2, problem = $3, material = $4, not_before = $5, attempts = $6, progress = $7, \
             worker = NULL, lease_until = NULL, updated_at = $8, report = $9 WHERE id = $1",
        )
        .bind(job.id.clone())
        .bind(state.name().to_owned())
        .bind(problem)
        .bind(material)
        .bind(write.now.saturating_add(wait))
        .bind(i64::from(attempts))
        .bind(progress)
        .bind(write.now)
        .bind(report)
        .execute(&mut *write.transaction)
        .await?;
        write.commit().await?;
        Ok(Ending::Now(state))
    }

    /// Asks a job to stop: a queued one is cancelled at once, a running one by its worker. Returns the job afterwards,
    /// if it exists.
    pub(crate) async fn cancel(&self, id: &str) -> Result<Option<JobRow>, CatalogError> {
        let mut write = self.write().await?;
        sqlx::query("UPDATE jobs SET state = 'cancelled', updated_at = $2 WHERE id = $1 AND state = 'queued'")
            .bind(id.to_owned())
            .bind(write.now)
            .execute(&mut *write.transaction)
            .await?;
        sqlx::query("UPDATE jobs SET cancel_requested = 1 WHERE id = $1 AND state = 'running'")
            .bind(id.to_owned())
            .execute(&mut *write.transaction)
            .await?;
        let row = sqlx::query(concat!("SELECT ", columns!(), " FROM jobs WHERE id = $1"))
            .bind(id.to_owned())
            .fetch_optional(&mut *write.transaction)
            .await?
            .map(|row| read(&row))
            .transpose()?;
        write.commit().await?;
        Ok(row)
    }

    /// Takes back jobs whose lease has expired or whose worker is in `gone`, and returns their ids.
    ///
    /// A worker that vanished may have been killed by the job itself, so the attempt counts. After `attempts` of them
    /// the job is dead of `problem` (JSON).
    pub(crate) async fn reap(
        &self,
        gone: &[String],
        attempts: u32,
        problem: &str,
    ) -> Result<Vec<String>, CatalogError> {
        let running = sqlx::query("SELECT 1 FROM jobs WHERE state = 'running' LIMIT 1").fetch_optional(&self.pool);
        if running.await?.is_none() {
            return Ok(Vec::new());
        }
        let mut write = self.write().await?;
        let rows = sqlx::query("SELECT id, worker, lease_until FROM jobs WHERE state = 'running'")
            .fetch_all(&mut *write.transaction)
            .await?;
        let mut reaped = Vec::new();
        for row in rows {
            let worker: Option<String> = row.try_get("worker")?;
            let until: Option<i64> = row.try_get("lease_until")?;
            let alive =
                until.is_some_and(|until| until > write.now) && worker.is_some_and(|worker| !gone.contains(&worker));
            if !alive {
                reaped.push(row.try_get::<String, _>("id")?);
            }
        }
        for id in &reaped {
            sqlx::query(
                "UPDATE jobs SET state = CASE WHEN cancel_requested <> 0 THEN 'cancelled' \
                 WHEN attempts >= $2 THEN 'dead' ELSE 'queued' END, \
                 problem = CASE WHEN cancel_requested = 0 AND attempts >= $2 THEN $3 ELSE problem END, \
                 epoch = epoch + 1, worker = NULL, lease_until = NULL, not_before = $4, progress = 0.0, \
                 updated_at = $4 WHERE id = $1",
            )
            .bind(id.clone())
            .bind(i64::from(attempts))
            .bind(problem.to_owned())
            .bind(write.now)
            .execute(&mut *write.transaction)
            .await?;
        }
        write.commit().await?;
        Ok(reaped)
    }
}

async fn one(write: &mut Write, id: String) -> Result<JobRow, CatalogError> {
    let row = sqlx::query(concat!("SELECT ", columns!(), " FROM jobs WHERE id = $1"))
        .bind(id)
        .fetch_one(&mut *write.transaction)
        .await?;
    read(&row)
}

fn state(id: &str, name: &str) -> Result<JobState, CatalogError> {
    JobState::ALL.into_iter().find(|state| state.name() == name).ok_or_else(|| CatalogError::Row {
        table: "jobs",
        id: id.to_owned(),
        reason: format!("unknown state `{name}`"),
    })
}

fn read(row: &AnyRow) -> Result<JobRow, CatalogError> {
    let id: String = row.try_get("id")?;
    let digest = |text: String| {
        text.parse::<Digest>().map_err(|e| CatalogError::Row { table: "jobs", id: id.clone(), reason: e.to_string() })
    };
    Ok(JobRow {
        measurement: row.try_get::<Option<String>, _>("measurement")?.map(digest).transpose()?,
        state: state(&id, row.try_get("state")?)?,
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
