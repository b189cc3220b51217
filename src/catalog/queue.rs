//! The queue from the workers' side: claims, leases, ends, and jobs taken back from workers that have vanished.
//!
//! A job is claimed by raising its epoch and setting a lease. Each later write of its worker names that epoch: once
//! another worker has the job, the epoch is higher and the late write changes nothing.

use super::blobs::{Claim, take};
use super::database::Catalog;
use super::error::{CatalogError, breaks_reference, tenant};
use super::job::{Beat, Claimed, Ended, Ending, JobState};
use super::materials::insert;
use super::ranks::of_open_tenant;
use super::usage::{Change, charge};
use sqlx::Row;
use std::time::Duration;

/// Upper bound on the number of jobs taken back from vanished workers at once. Raising it makes one transaction longer.
const REAPED: i64 = 100;

/// SQL statement that takes running jobs back from the workers that meet a condition.
macro_rules! lost {
    ($condition:literal) => {
        concat!(
            "WITH lost AS MATERIALIZED (SELECT id FROM jobs WHERE state = 'running' AND ",
            $condition,
            " LIMIT $4{skip}) UPDATE jobs SET state = CASE WHEN cancel_requested <> 0 THEN 'cancelled' \
             WHEN lost + 1 >= $1 THEN 'dead' ELSE 'queued' END, \
             needs = CASE WHEN cancel_requested <> 0 OR lost + 1 >= $1 THEN NULL ELSE needs END, \
             problem = CASE WHEN cancel_requested = 0 AND lost + 1 >= $1 THEN $2 ELSE problem END, \
             lost = lost + 1, attempts = {greater}(attempts - 1, 0), epoch = epoch + 1, worker = NULL, \
             lease_until = NULL, not_before = {now}, progress = 0.0, updated_at = {now} \
             WHERE id {among SELECT id FROM lost} RETURNING id"
        )
    };
}

impl Catalog {
    /// Claims the next job of the queue for a worker, if there is one, whichever tenant owns it. Jobs of closed tenants
    /// wait until these are opened. Jobs whose ids are in `but` are left to other workers.
    pub(crate) async fn claim(
        &self,
        worker: &str,
        lease: Duration,
        but: &[String],
    ) -> Result<Option<Claimed>, CatalogError> {
        let but = serde_json::json!(but).to_string();
        // Look without the write lock first, so that an idle worker does not disturb writers.
        let any = sqlx::query(concat!("SELECT 1 FROM jobs WHERE state = 'queued' AND ", of_open_tenant!(), " LIMIT 1"));
        if any.fetch_optional(&self.pool).await?.is_none() {
            return Ok(None);
        }
        let _turn = self.turn().await;
        let row = sqlx::query(self.sql(concat!(
            "UPDATE jobs SET state = 'running', epoch = epoch + 1, attempts = attempts + 1, worker = $1, \
             lease_until = {now} + $2, progress = 0.0, updated_at = {now} WHERE id = (SELECT id FROM jobs \
             WHERE state = 'queued' AND not_before <= {now} AND level <= $3 AND id NOT IN ({each $4}) \
             AND ",
            of_open_tenant!(),
            " ORDER BY priority, rank, id LIMIT 1{skip}) RETURNING id, tenant, frame, epoch, attempts, \
             CASE WHEN watched_until > {now} THEN 1 ELSE 0 END AS watched",
        )))
        .bind(worker.to_owned())
        .bind(lease.as_millis() as i64)
        .bind(self.edition.level)
        .bind(but)
        .fetch_optional(&self.pool)
        .await?;
        let Some(row) = row else { return Ok(None) };
        let (id, owner): (String, String) = (row.try_get("id")?, row.try_get("tenant")?);
        Ok(Some(Claimed {
            tenant: tenant("jobs", &id, &owner)?,
            id,
            frame: row.try_get("frame")?,
            epoch: row.try_get("epoch")?,
            attempts: row.try_get::<i64, _>("attempts")?.max(0) as u32,
            watched: row.try_get::<i64, _>("watched")? != 0,
        }))
    }

    /// Renews a worker's lease on its running job, stores the progress of the job, and tells the worker whether to
    /// continue.
    pub(crate) async fn beat(&self, job: &Claimed, progress: f64, lease: Duration) -> Result<Beat, CatalogError> {
        let _turn = self.turn().await;
        let renewed = sqlx::query(self.sql(
            "UPDATE jobs SET lease_until = {now} + $3, progress = $4 \
             WHERE id = $1 AND epoch = $2 AND state = 'running' RETURNING cancel_requested, \
             CASE WHEN watched_until > {now} THEN 1 ELSE 0 END",
        ))
        .bind(job.id.clone())
        .bind(job.epoch)
        .bind(lease.as_millis() as i64)
        .bind(progress.clamp(0.0, 1.0))
        .fetch_optional(&self.pool)
        .await?;
        let Some(row) = renewed else { return Ok(Beat::Lost) };
        let (cancel, watched): (i64, i64) = (row.try_get(0)?, row.try_get(1)?);
        Ok(if cancel == 0 { Beat::Yours(watched != 0) } else { Beat::Cancel })
    }

    /// Records the end of a worker's attempt to run a job. An expired lease does not matter as long as no other worker
    /// has claimed the job.
    pub(crate) async fn end(&self, job: &Claimed, ended: &Ended) -> Result<Ending, CatalogError> {
        match self.try_end(job, ended).await {
            // The bytes of the result were deleted since they were looked up.
            Err(CatalogError::Sql(error)) if breaks_reference(&error) => Ok(Ending::Unpublished),
            ending => ending,
        }
    }

    async fn try_end(&self, job: &Claimed, ended: &Ended) -> Result<Ending, CatalogError> {
        let mut write = self.of(&job.tenant).write().await?;
        let owned =
            write.sql("SELECT cancel_requested FROM jobs WHERE id = $1 AND epoch = $2 AND state = 'running'{lock}");
        let owned =
            sqlx::query(owned).bind(job.id.clone()).bind(job.epoch).fetch_optional(&mut *write.transaction).await?;
        let Some(owned) = owned else {
            write.undo().await?;
            return Ok(Ending::Lost);
        };
        let cancel = owned.try_get::<i64, _>(0)? != 0;
        if let Some(claim) = ended.claim()
            && !take(&mut write, claim).await?
        {
            return Ok(Ending::Unpublished);
        }
        let (mut material, mut report, mut change) = (None, None, None);
        let (state, problem, wait, attempts) = match ended {
            Ended::Material(new, _) => {
                let is_new = insert(&mut write, new).await?;
                change = is_new.then(|| (new.id, Change::material(new.bytes)));
                material = Some(new.id.to_string());
                (JobState::Succeeded, None, 0, job.attempts)
            }
            Ended::Report(claim) => {
                report = Some(claim.digest().to_string());
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
        let written = sqlx::query(
            "UPDATE jobs SET state = $3, problem = $4, material = $5, not_before = $6, attempts = $7, progress = $8, \
             worker = NULL, lease_until = NULL, updated_at = $9, report = $10, \
             needs = CASE WHEN $11 <> 0 THEN NULL ELSE needs END \
             WHERE id = $1 AND epoch = $2 AND state = 'running'",
        )
        .bind(job.id.clone())
        .bind(job.epoch)
        .bind(state.name().to_owned())
        .bind(problem)
        .bind(material)
        .bind(write.now.saturating_add(wait))
        .bind(i64::from(attempts))
        .bind(progress)
        .bind(write.now)
        .bind(report)
        .bind(i64::from(state.is_final()))
        .execute(&mut *write.transaction)
        .await?;
        if written.rows_affected() != 1 {
            write.undo().await?;
            return Ok(Ending::Lost);
        }
        if let Some((id, change)) = change
            && let Some(over) = charge(&mut write, id, change).await?
        {
            write.undo().await?;
            return Ok(Ending::Over(over));
        }
        write.commit().await?;
        Ok(Ending::Now(state))
    }

    /// Takes running jobs back from vanished workers: from those listed in `gone`, and, if `expired`, from those whose
    /// lease has run out. Returns the ids of the jobs.
    ///
    /// A worker that vanished may have been killed by the job itself. After `most` such attempts the job is dead of
    /// `problem` (JSON).
    pub(crate) async fn reap(
        &self,
        gone: &[String],
        expired: bool,
        most: u32,
        problem: &str,
    ) -> Result<Vec<String>, CatalogError> {
        let mut reaped = Vec::new();
        // Look first, so that the many processes that reap do not disturb writers.
        let late = "SELECT 1 FROM jobs WHERE state = 'running' AND lease_until <= {now} LIMIT 1";
        if expired && sqlx::query(self.sql(late)).fetch_optional(&self.pool).await?.is_some() {
            reaped = self.take_back(lost!("lease_until <= {now}"), &[], most, problem).await?;
        }
        if !gone.is_empty() {
            reaped.extend(self.take_back(lost!("worker {among $3}"), gone, most, problem).await?);
        }
        Ok(reaped)
    }

    async fn take_back(
        &self,
        statement: &'static str,
        gone: &[String],
        most: u32,
        problem: &str,
    ) -> Result<Vec<String>, CatalogError> {
        let _turn = self.turn().await;
        let rows = sqlx::query(self.sql(statement))
            .bind(i64::from(most))
            .bind(problem.to_owned())
            .bind(serde_json::json!(gone).to_string())
            .bind(REAPED)
            .fetch_all(&self.pool)
            .await?;
        rows.iter().map(|row| Ok(row.try_get(0)?)).collect()
    }
}

impl Ended {
    /// Returns the claim (permission for a row of the catalog to refer to stored bytes) of the attempt's result; `None`
    /// if the attempt has no result.
    fn claim(&self) -> Option<&Claim> {
        match self {
            Self::Material(_, claim) | Self::Report(claim) => Some(claim),
            Self::Failed(_) | Self::Retry { .. } | Self::Cancelled | Self::Released => None,
        }
    }

    /// Replaces the claim (permission for a row of the catalog to refer to stored bytes) of a job's result, after the
    /// bytes of the result were stored again.
    pub(crate) fn reclaim(&mut self, again: Claim) {
        match self {
            Self::Material(_, claim) | Self::Report(claim) => *claim = again,
            Self::Failed(_) | Self::Retry { .. } | Self::Cancelled | Self::Released => {}
        }
    }
}
