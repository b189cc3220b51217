//! Jobs as other processes see them: watched in one query, told by notifications, listed, and put back to the queue.

use super::database::Catalog;
use super::dialect::Dialect;
use super::error::{CatalogError, breaks_reference};
use super::job::{JobRow, JobState};
use super::jobs::{read, state};
use super::page::{Cursor, Page};
use super::place::Database;
use crate::store::Digest;
use sqlx::Row;
use sqlx::postgres::PgListener;
use std::time::Duration;

/// State and progress of a job that a client follows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seen {
    /// Id of the job.
    pub id: String,
    /// Current state of the job.
    pub state: JobState,
    /// Progress of the job from 0 to 1.
    pub progress: f64,
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

/// Notification about jobs from another process.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Notice {
    /// Another process queued a job.
    Queued,
    /// The running job with this id is to stop.
    Stop(String),
    /// Somebody has begun to follow the running job with this id.
    Watch(String),
    /// Notifications may have been missed, because the connection was lost.
    Missed,
}

/// Stream of notifications about jobs from other processes. Only PostgreSQL has them; without them, polling finds the
/// same changes later.
#[derive(Debug)]
pub(crate) struct Notices(PgListener);

/// Name of the PostgreSQL channel on which processes notify each other about jobs.
const CHANNEL: &str = "wavelume";

impl Catalog {
    /// Returns the state and progress of the jobs with the given ids, in one query for any number of jobs.
    pub(crate) async fn seen(&self, ids: &[String]) -> Result<Vec<Seen>, CatalogError> {
        let rows = sqlx::query(self.sql("SELECT id, state, progress FROM jobs WHERE id IN ({each $1})"))
            .bind(serde_json::json!(ids).to_string())
            .fetch_all(&self.pool)
            .await?;
        let seen = rows.iter().map(|row| {
            let id: String = row.try_get(0)?;
            Ok(Seen { state: state(&id, row.try_get(1)?)?, progress: row.try_get(2)?, id })
        });
        seen.collect()
    }

    /// Asks the workers of the given jobs to store progress often, for the duration `time`.
    pub(crate) async fn watch(&self, ids: &[String], time: Duration) -> Result<(), CatalogError> {
        let _turn = self.turn().await;
        sqlx::query(self.sql(
            "UPDATE jobs SET watched_until = {now} + $2 WHERE id IN ({each $1}) AND state IN ('queued', 'running')",
        ))
        .bind(serde_json::json!(ids).to_string())
        .bind(time.as_millis() as i64)
        .execute(&self.pool)
        .await?;
        Ok(())
    }

    /// Returns a page of jobs, newest first.
    pub(crate) async fn jobs(
        &self,
        filter: &JobFilter,
        after: Option<Cursor>,
        limit: usize,
    ) -> Result<Page<JobRow>, CatalogError> {
        let after = after.unwrap_or_else(Cursor::newest);
        let rows = sqlx::query(concat!(
            "SELECT ",
            "id, measurement, state, progress, attempts, material, report, problem, created_at, updated_at",
            " FROM jobs WHERE tenant = 'default' AND (created_at, id) < ($1, $2) AND ($3 IS NULL OR state = $3) \
             AND ($4 IS NULL OR measurement = $4) ORDER BY created_at DESC, id DESC LIMIT $5"
        ))
        .bind(after.created_at)
        .bind(after.id)
        .bind(filter.state.map(|state| state.name().to_owned()))
        .bind(filter.measurement.map(|digest| digest.to_string()))
        .bind(limit as i64 + 1)
        .fetch_all(&self.pool)
        .await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::of(rows, limit, |row| Cursor { created_at: row.created_ms, id: row.id.clone() }))
    }

    /// Puts a job that failed, was given up or was cancelled back in the queue, as if it had never been tried.
    pub(crate) async fn retry(&self, id: &str) -> Result<Retried, CatalogError> {
        let turn = self.turn().await;
        let retried = sqlx::query(self.sql(
            "UPDATE jobs SET state = 'queued', needs = measurement, attempts = 0, lost = 0, problem = NULL, \
             cancel_requested = 0, not_before = {now}, progress = 0.0, updated_at = {now} \
             WHERE id = $1 AND state IN ('failed', 'dead', 'cancelled')",
        ))
        .bind(id.to_owned())
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

    /// Notifies other processes that a job was queued. It is best called seldom: PostgreSQL sends one notification at a
    /// time.
    pub(crate) async fn tell_queued(&self) -> Result<(), CatalogError> {
        self.tell("q").await
    }

    /// Notifies other processes that a running job is to stop.
    pub(crate) async fn tell_stop(&self, id: &str) -> Result<(), CatalogError> {
        self.tell(&format!("c:{id}")).await
    }

    /// Sends other processes a notification that somebody follows a running job: its worker stores progress more often
    /// from then on.
    pub(crate) async fn tell_watch(&self, id: &str) -> Result<(), CatalogError> {
        self.tell(&format!("w:{id}")).await
    }

    /// Sends a notification by a statement of its own, never inside a transaction for which other processes wait.
    async fn tell(&self, text: &str) -> Result<(), CatalogError> {
        if self.dialect == Dialect::Postgres {
            sqlx::query("SELECT 1 FROM pg_notify($1, $2)")
                .bind(CHANNEL)
                .bind(text.to_owned())
                .execute(&self.pool)
                .await?;
        }
        Ok(())
    }

    /// Starts to listen to notifications from other processes; returns `None` if the database has no notifications.
    pub(crate) async fn listen(&self) -> Result<Option<Notices>, CatalogError> {
        let Database::Server(url) = &self.place else { return Ok(None) };
        let mut listener = PgListener::connect(url).await?;
        listener.listen(CHANNEL).await?;
        Ok(Some(Notices(listener)))
    }
}

impl Notices {
    /// Waits for the next notification from another process. A broken connection is made again; notifications sent
    /// meanwhile are lost.
    pub(crate) async fn next(&mut self) -> Result<Notice, CatalogError> {
        loop {
            let Some(sent) = self.0.try_recv().await? else { return Ok(Notice::Missed) };
            match sent.payload().split_once(':') {
                None if sent.payload() == "q" => return Ok(Notice::Queued),
                Some(("c", id)) => return Ok(Notice::Stop(id.to_owned())),
                Some(("w", id)) => return Ok(Notice::Watch(id.to_owned())),
                // A newer program's.
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Ended, NewJob, testing};

    const LEASE: Duration = Duration::from_mins(1);

    async fn queue(catalog: &Catalog, id: &str) {
        let measurement = Some(Digest::of(b"lamp"));
        let new =
            NewJob { id: id.to_owned(), frame: "00".to_owned(), measurement, share: String::new(), idempotency: None };
        catalog.enqueue(&new, 99).await.unwrap();
    }

    #[tokio::test]
    async fn a_failed_job_is_queued_again_unless_its_measurement_is_gone() {
        for (catalog, _guard) in testing::catalogs().await {
            testing::add(&catalog, &testing::measurement("lamp")).await;
            queue(&catalog, "1").await;
            assert!(matches!(catalog.retry("1").await.unwrap(), Retried::Unended(JobState::Queued)));
            let job = catalog.claim("w", LEASE, &[]).await.unwrap().unwrap();
            catalog.end(&job, &Ended::Failed("{}".to_owned())).await.unwrap();
            let Retried::Queued(row) = catalog.retry("1").await.unwrap() else { panic!() };
            assert_eq!((row.state, row.attempts, row.problem), (JobState::Queued, 0, None));
            let again = catalog.claim("w", LEASE, &[]).await.unwrap().unwrap();
            assert!(again.epoch > job.epoch);
            catalog.end(&again, &Ended::Failed("{}".to_owned())).await.unwrap();
            catalog.delete_measurement(Digest::of(b"lamp")).await.unwrap();
            assert!(matches!(catalog.retry("1").await.unwrap(), Retried::NoMeasurement));
            assert!(matches!(catalog.retry("2").await.unwrap(), Retried::Absent));
        }
    }

    #[tokio::test]
    async fn jobs_are_listed_by_state_and_measurement_and_seen_together() {
        for (catalog, _guard) in testing::catalogs().await {
            testing::add(&catalog, &testing::measurement("lamp")).await;
            for id in ["a", "b", "c", "d"] {
                queue(&catalog, id).await;
            }
            catalog.claim("w", LEASE, &[]).await.unwrap().unwrap();
            let listed = async |filter: JobFilter| {
                let page = catalog.jobs(&filter, None, 9).await.unwrap();
                page.items.into_iter().map(|row| row.id).collect::<Vec<_>>()
            };
            assert_eq!(listed(JobFilter::default()).await.len(), 4);
            assert_eq!(listed(JobFilter { state: Some(JobState::Running), ..JobFilter::default() }).await, ["a"]);
            let other = JobFilter { measurement: Some(Digest::of(b"other")), ..JobFilter::default() };
            assert!(listed(other).await.is_empty());
            let (mut ids, mut cursor) = (Vec::new(), None);
            loop {
                let page = catalog.jobs(&JobFilter::default(), cursor, 3).await.unwrap();
                ids.extend(page.items.into_iter().map(|row| row.id));
                cursor = page.next;
                if cursor.is_none() {
                    break;
                }
            }
            ids.sort();
            assert_eq!(ids, ["a", "b", "c", "d"]);
            let wanted = ["a".to_owned(), "d".to_owned(), "absent".to_owned()];
            catalog.watch(&wanted, LEASE).await.unwrap();
            let mut seen = catalog.seen(&wanted).await.unwrap();
            seen.sort_by(|a, b| a.id.cmp(&b.id));
            let states: Vec<_> = seen.iter().map(|seen| (seen.id.as_str(), seen.state)).collect();
            assert_eq!(states, [("a", JobState::Running), ("d", JobState::Queued)]);
        }
    }

    #[tokio::test]
    async fn notifications_reach_the_processes_that_listen() {
        let (catalog, _) = Catalog::migrate(&testing::server().await, false).await.unwrap();
        let mut notices = catalog.listen().await.unwrap().unwrap();
        let id = uuid::Uuid::now_v7().to_string();
        catalog.tell_stop(&id).await.unwrap();
        // Other tests share the channel.
        while notices.next().await.unwrap() != Notice::Stop(id.clone()) {}
    }
}
