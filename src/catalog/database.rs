//! The catalog's database: opened, brought up to date, and written in one transaction at a time.

use super::dialect::{CLOCK, PRAGMAS};
use super::error::CatalogError;
use super::file::{check, is_hopeless, unusable, url};
use super::lock::Readiness;
use super::schema;
use sqlx::any::{AnyPoolOptions, install_default_drivers};
use sqlx::migrate::MigrateError;
use sqlx::{Any, AnyPool, Executor, Row, Transaction};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{Mutex, OwnedMutexGuard};

/// The catalog; cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Catalog {
    pub(super) pool: AnyPool,
    /// Turn of a writer of this process: waiting here is fair, SQLite's busy handler is not.
    turn: Arc<Mutex<()>>,
    pub(super) readiness: Arc<Readiness>,
}

/// A write transaction, which changes nothing unless it is committed.
pub(super) struct Write {
    pub(super) transaction: Transaction<'static, Any>,
    /// Start time by the database's clock, ms of the Unix epoch.
    pub(super) now: i64,
    _turn: OwnedMutexGuard<()>,
}

impl Catalog {
    /// Opens the SQLite catalog in `file`, makes it if it is missing, and brings its schema up to date.
    #[cfg(test)]
    pub(crate) async fn open(file: &Path) -> Result<Self, CatalogError> {
        Ok(Self::migrate(file).await?.0)
    }

    /// Opens the catalog, brings its schema up to date and returns the number of migrations applied.
    pub(crate) async fn migrate(file: &Path) -> Result<(Self, usize), CatalogError> {
        install_default_drivers();
        let url = url(file)?;
        check(file, &url).await?;
        let pool = AnyPoolOptions::new()
            .max_connections(8)
            .acquire_timeout(Duration::from_secs(30))
            .after_connect(|connection, _| {
                Box::pin(async move {
                    for pragma in PRAGMAS {
                        connection.execute(pragma).await?;
                    }
                    Ok(())
                })
            })
            .connect(&url)
            .await?;
        let catalog = Self { pool, turn: Arc::default(), readiness: Arc::new(Readiness::new(url)) };
        let before = catalog.applied().await;
        // Two processes may start at once; the second finds the tables of the first and tries again.
        let migrations = schema::migrator();
        let (mut tries, start) = (0, Instant::now());
        while let Err(error) = migrations.run(&catalog.pool).await {
            tries += 1;
            let last = tries == 10;
            match error {
                MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _)
                    if last || is_hopeless(&error, start) =>
                {
                    return Err(unusable(file, error));
                }
                MigrateError::Execute(_) | MigrateError::ExecuteMigration(..) => {}
                other => return Err(other.into()),
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        let after = catalog.applied().await;
        Ok((catalog, after.saturating_sub(before)))
    }

    /// Closes all connections.
    pub(crate) async fn close(&self) {
        self.pool.close().await;
    }

    async fn applied(&self) -> usize {
        // Before the first migration the table is missing: none were applied.
        let count = sqlx::query("SELECT COUNT(*) FROM _sqlx_migrations").fetch_one(&self.pool).await;
        count.and_then(|row| row.try_get::<i64, _>(0)).map_or(0, |count| count.max(0) as usize)
    }

    pub(super) async fn write(&self) -> Result<Write, CatalogError> {
        let turn = Arc::clone(&self.turn).lock_owned().await;
        let mut transaction = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        self.readiness.wrote();
        let now = sqlx::query(CLOCK).fetch_one(&mut *transaction).await?.try_get(0)?;
        Ok(Write { transaction, now, _turn: turn })
    }
}

impl Write {
    pub(super) async fn commit(self) -> Result<(), CatalogError> {
        Ok(self.transaction.commit().await?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;

    #[tokio::test]
    async fn the_schema_is_applied_once_even_by_two_at_a_time() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("catalog.sqlite");
        let (first, second) = tokio::join!(Catalog::migrate(&file), Catalog::migrate(&file));
        let (first, second) = (first.unwrap(), second.unwrap());
        assert!(first.1 + second.1 >= 1);
        assert_eq!(Catalog::migrate(&file).await.unwrap().1, 0);
        first.0.ping().await.unwrap();
        second.0.ping().await.unwrap();
    }

    #[tokio::test]
    async fn the_clock_is_in_milliseconds_of_the_epoch() {
        let (catalog, _directory) = testing::catalog().await;
        let now = catalog.write().await.unwrap().now;
        let here = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_millis() as i64;
        assert!((now - here).abs() < 60_000, "{now} {here}");
    }
}
