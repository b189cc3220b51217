//! Jobs of other processes: watched in one query, and told by notifications.

use super::database::Catalog;
use super::dialect::Dialect;
use super::error::CatalogError;
use super::job::JobState;
use super::jobs::state;
use super::place::Database;
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
        let rows = sqlx::query(self.sql("SELECT id, state, progress FROM jobs WHERE id {among $1}"))
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
        sqlx::query(
            self.sql(
                "UPDATE jobs SET watched_until = {now} + $2 WHERE id {among $1} AND state IN ('queued', 'running')",
            ),
        )
        .bind(serde_json::json!(ids).to_string())
        .bind(time.as_millis() as i64)
        .execute(&self.pool)
        .await?;
        Ok(())
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
    use crate::catalog::testing;

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
