//! What is known about which digest: SQL and its migrations.
//!
//! The same queries serve SQLite and PostgreSQL: `$n` placeholders, three column types, and two fragments that differ
//! (the clock, and how rows are locked while a job is claimed). Writes on SQLite begin with `BEGIN IMMEDIATE`, so that a
//! transaction never has to give up because it read before it wrote.

#[cfg(test)]
mod job_tests;
mod jobs;
mod materials;
mod measurements;
mod page;
mod pins;
mod ready;
mod schema;

pub use jobs::{Beat, Claimed, Ended, Ending, Enqueued, JobRow, JobState, NewJob};
pub use materials::{MaterialFilter, MaterialRow, NewMaterial};
pub use measurements::{Added, Deleted, MeasurementFilter, MeasurementRow, NewMeasurement};
pub use page::{Cursor, NotACursor, Page};
pub use pins::Namer;

use sqlx::any::{AnyPoolOptions, install_default_drivers};
use sqlx::migrate::MigrateError;
use sqlx::{Any, AnyPool, Executor, Row, Transaction};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{Mutex, OwnedMutexGuard};

/// Now, in ms of the Unix epoch, by the database's own clock: workers on several hosts share it.
const CLOCK: &str = "SELECT CAST(ROUND((julianday('now') - 2440587.5) * 86400000.0) AS BIGINT)";

/// Rows that another worker is claiming are skipped; SQLite has one writer at a time and needs nothing.
const SKIP_LOCKED: &str = "";

/// Statements that make a connection wait for others, and its commits durable. Waiting comes first: the switch to WAL
/// itself needs the lock.
const PRAGMAS: [&str; 3] = ["PRAGMA busy_timeout = 20000", "PRAGMA journal_mode = WAL", "PRAGMA synchronous = FULL"];

/// Query of the texts in a parameter that holds a JSON array: `Any` has no arrays of its own.
fn each(parameter: &str) -> String {
    format!("SELECT value FROM json_each({parameter})")
}

/// The catalog; cheap to clone.
#[derive(Clone, Debug)]
pub struct Catalog {
    pool: AnyPool,
    /// One writer of this process at a time: waiting here is fair, SQLite's busy handler is not.
    turn: Arc<Mutex<()>>,
    readiness: Arc<ready::Readiness>,
}

/// Why the catalog did not answer.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// The database.
    #[error("database: {0}")]
    Sql(#[from] sqlx::Error),
    /// The schema is not this version's.
    #[error("database schema: {0}")]
    Migrate(#[from] MigrateError),
    /// The file cannot serve as the catalog.
    #[error("catalog {}: {reason}", file.display())]
    Unusable {
        /// The file.
        file: PathBuf,
        /// The fault, and what to do about it.
        reason: String,
    },
    /// Another program has held the write lock for longer than a writer should.
    #[error("the catalog is locked: another program has been writing to it for a while; end that program")]
    Locked,
    /// A row holds what this version never writes.
    #[error("{table} row {id}: {reason}")]
    Row {
        /// The table.
        table: &'static str,
        /// The row.
        id: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// A write transaction: nothing happened unless it is committed.
struct Write {
    transaction: Transaction<'static, Any>,
    /// When it began, by the database's clock.
    now: i64,
    _turn: OwnedMutexGuard<()>,
}

impl Catalog {
    /// Opens the SQLite catalog in `file`, makes it if it is missing, and brings its schema up to date.
    pub async fn open(file: &Path) -> Result<Self, CatalogError> {
        Ok(Self::migrate(file).await?.0)
    }

    /// Opens it, brings the schema up to date and says how many migrations that took.
    pub async fn migrate(file: &Path) -> Result<(Self, usize), CatalogError> {
        install_default_drivers();
        let url = url(file)?;
        ready::check(file, &url).await?;
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
        let catalog = Self { pool, turn: Arc::default(), readiness: Arc::new(ready::Readiness::new(url)) };
        let before = catalog.applied().await;
        // Two processes may start at once; the second finds the tables of the first and looks again.
        let migrations = schema::migrator();
        let (mut tries, start) = (0, Instant::now());
        while let Err(error) = migrations.run(&catalog.pool).await {
            tries += 1;
            let last = tries == 10;
            match error {
                MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _)
                    if last || ready::is_hopeless(&error, start) =>
                {
                    return Err(ready::unusable(file, error));
                }
                MigrateError::Execute(_) | MigrateError::ExecuteMigration(..) => {}
                other => return Err(other.into()),
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        let after = catalog.applied().await;
        Ok((catalog, after.saturating_sub(before)))
    }

    /// Ends all connections.
    pub async fn close(&self) {
        self.pool.close().await;
    }

    async fn applied(&self) -> usize {
        // Before the first migration the table is missing: none were applied.
        let count = sqlx::query("SELECT COUNT(*) FROM _sqlx_migrations").fetch_one(&self.pool).await;
        count.and_then(|row| row.try_get::<i64, _>(0)).map_or(0, |count| count.max(0) as usize)
    }

    async fn write(&self) -> Result<Write, CatalogError> {
        let turn = Arc::clone(&self.turn).lock_owned().await;
        let mut transaction = self.pool.begin_with("BEGIN IMMEDIATE").await?;
        self.readiness.wrote();
        let now = sqlx::query(CLOCK).fetch_one(&mut *transaction).await?.try_get(0)?;
        Ok(Write { transaction, now, _turn: turn })
    }
}

impl Write {
    async fn commit(self) -> Result<(), CatalogError> {
        Ok(self.transaction.commit().await?)
    }
}

/// A database URL holds a path percent-encoded.
fn url(file: &Path) -> Result<String, CatalogError> {
    let path = file
        .to_str()
        .ok_or_else(|| CatalogError::Sql(sqlx::Error::Configuration("the path of the catalog is not UTF-8".into())))?;
    let encoded: String = path
        .bytes()
        .map(|b| match b {
            b'/' | b'.' | b'-' | b'_' => char::from(b).to_string(),
            b if b.is_ascii_alphanumeric() => char::from(b).to_string(),
            b => format!("%{b:02X}"),
        })
        .collect();
    Ok(format!("sqlite:{encoded}?mode=rwc"))
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use crate::domain::Quantity;
    use crate::store::Digest;

    /// A catalog in a directory with an awkward name.
    pub(crate) async fn catalog() -> (Catalog, tempfile::TempDir) {
        let directory = tempfile::Builder::new().prefix("odd name %?#").tempdir().unwrap();
        let catalog = Catalog::open(&directory.path().join("catalog.sqlite")).await.unwrap();
        (catalog, directory)
    }

    /// A lamp whose content is `text`.
    pub(crate) fn measurement(text: &str) -> NewMeasurement {
        NewMeasurement {
            id: Digest::of(text.as_bytes()),
            content: Digest::of(text.as_bytes()),
            spectrum: None,
            name: Some(text.to_owned()),
            file_name: None,
            bytes: text.len() as u64,
            format: "ies".to_owned(),
            quantity: Some(Quantity::Edf),
            document: "{}".to_owned(),
        }
    }

    /// Pins and adds it, as an upload does.
    pub(crate) async fn add(catalog: &Catalog, new: &NewMeasurement) -> (MeasurementRow, bool) {
        catalog.pin(new.content, "test", Duration::from_mins(1)).await.unwrap();
        match catalog.add_measurement(new, "test").await.unwrap() {
            Added::Row(row, fresh) => (row, fresh),
            other => panic!("{other:?}"),
        }
    }

    /// Lets every pin run out now.
    pub(crate) async fn expire_pins(catalog: &Catalog) {
        sqlx::query("UPDATE pins SET expires_at = 0").execute(&catalog.pool).await.unwrap();
    }

    /// Number of rows of a table.
    pub(crate) async fn count(catalog: &Catalog, table: &str) -> i64 {
        let query = sqlx::AssertSqlSafe(format!("SELECT COUNT(*) FROM {table}"));
        sqlx::query(query).fetch_one(&catalog.pool).await.unwrap().try_get(0).unwrap()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
