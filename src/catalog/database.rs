//! The catalog's database: opened, and written in transactions that are repeated where that is safe.

use super::dialect::Dialect;
use super::error::CatalogError;
use super::file::{self, check};
use super::lock::Readiness;
use super::place::Database;
use super::schema::{Edition, edition};
use crate::trust::Tenant;
use sqlx::any::{AnyConnectOptions, AnyPoolOptions, install_default_drivers};
use sqlx::{Any, AnyConnection, AnyPool, ConnectOptions, Connection, Executor, Row, SqlStr, Transaction};
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;
use tokio::sync::{Mutex, OwnedMutexGuard};

/// The catalog: the database of measurements, materials, jobs and stored files. Cheap to clone.
#[derive(Clone, Debug)]
pub(crate) struct Catalog {
    pub(super) pool: AnyPool,
    pub(super) place: Database,
    pub(super) dialect: Dialect,
    /// Tenant whose rows are read and written.
    pub(super) tenant: Tenant,
    /// Edition of the program: the schema migrations that it knows, and the highest version of job arguments that it
    /// runs.
    pub(super) edition: Edition,
    /// Lock that the writers of this process take in turn on SQLite. Waiting for it is fair, unlike SQLite's busy
    /// handler.
    turn: Arc<Mutex<()>>,
    pub(super) readiness: Arc<Readiness>,
    /// Number of further jobs that this process may queue before it counts the waiting jobs of all processes again.
    pub(super) room: Arc<AtomicU64>,
}

/// A write transaction of the catalog, which changes nothing unless it is committed.
pub(super) struct Write {
    pub(super) transaction: Transaction<'static, Any>,
    pub(super) dialect: Dialect,
    /// Tenant that owns the rows written by the transaction.
    pub(super) tenant: Tenant,
    /// Start time of the write transaction by the database's clock, ms of the Unix epoch.
    pub(super) now: i64,
    _turn: Option<OwnedMutexGuard<()>>,
}

/// Number of times that a database operation is tried in all before a transient error is returned. Raising it survives
/// longer restarts of the database, but delays the error when the database stays away.
const TRIES: u32 = 5;

/// Pause before a failed database operation is tried a second time; it doubles before each further try.
const PAUSE: Duration = Duration::from_millis(20);

/// Longest time that an operation waits for a connection to a SQLite file, whose writers take turns. Raising it bears
/// longer queues of writers.
const LOCAL_WAIT: Duration = Duration::from_secs(30);

/// Longest time that an operation waits for a connection to a PostgreSQL server. Raising it bears longer queues for a
/// connection, but delays the error when the server is away.
const SERVER_WAIT: Duration = Duration::from_secs(5);

impl Catalog {
    /// Connects to the catalog's database without checking its schema. Opens at most `connections` connections at once.
    pub(super) async fn connect(place: &Database, connections: u32) -> Result<Self, CatalogError> {
        install_default_drivers();
        let dialect = place.dialect();
        let url = match place {
            Database::File(file) => {
                let url = file::url(file)?;
                check(file, &url).await?;
                url
            }
            Database::Server(url) => {
                reach(place, url).await?;
                url.clone()
            }
        };
        Self::pooled(place, url, connections, dialect.prepare()).await
    }

    /// Opens a pool of at most `connections` connections to the database at `url`, each set up by `statements`.
    pub(super) async fn pooled(
        place: &Database,
        url: String,
        connections: u32,
        statements: &'static [&'static str],
    ) -> Result<Self, CatalogError> {
        install_default_drivers();
        let dialect = place.dialect();
        let options = AnyConnectOptions::from_str(&url)?.disable_statement_logging();
        let pool = AnyPoolOptions::new()
            .max_connections(connections)
            .acquire_timeout(if dialect == Dialect::Sqlite { LOCAL_WAIT } else { SERVER_WAIT })
            .after_connect(move |connection, _| {
                Box::pin(async move {
                    for statement in statements {
                        connection.execute(*statement).await?;
                    }
                    Ok(())
                })
            })
            .connect_with(options)
            .await?;
        let readiness = Arc::new(Readiness::new(url));
        let (edition, turn, room) = (edition(), Arc::default(), Arc::default());
        let tenant = Tenant::default();
        Ok(Self { pool, place: place.clone(), dialect, tenant, edition, turn, readiness, room })
    }

    /// Returns the catalog as another tenant sees it: rows of others do not exist there.
    pub(crate) fn of(&self, tenant: &Tenant) -> Self {
        Self { tenant: tenant.clone(), ..self.clone() }
    }

    /// Returns the tenant whose rows this catalog object reads and writes.
    pub(crate) fn tenant(&self) -> &Tenant {
        &self.tenant
    }

    /// Closes all connections to the catalog's database.
    pub(crate) async fn close(&self) {
        self.pool.close().await;
    }

    /// Returns the kind of database behind the catalog: SQLite or PostgreSQL.
    pub(crate) fn dialect(&self) -> Dialect {
        self.dialect
    }

    /// Adapts an SQL statement to the kind of database in use; see [`Dialect::sql`].
    pub(super) fn sql(&self, text: &'static str) -> SqlStr {
        self.dialect.sql(text)
    }

    /// Waits for this process's turn to write to SQLite, which has one writer at a time; returns at once on PostgreSQL.
    /// A statement that writes outside a transaction needs a turn too.
    pub(super) async fn turn(&self) -> Option<OwnedMutexGuard<()>> {
        match self.dialect {
            Dialect::Sqlite => Some(Arc::clone(&self.turn).lock_owned().await),
            Dialect::Postgres => None,
        }
    }

    /// Begins a write transaction of the catalog.
    pub(super) async fn write(&self) -> Result<Write, CatalogError> {
        let turn = self.turn().await;
        let mut transaction = self.pool.begin_with(self.dialect.begin()).await?;
        self.readiness.wrote();
        let now = sqlx::query(self.sql("SELECT {now}")).fetch_one(&mut *transaction).await?.try_get(0)?;
        Ok(Write { transaction, dialect: self.dialect, tenant: self.tenant.clone(), now, _turn: turn })
    }

    /// Begins a transaction for reading a page of a list.
    pub(super) async fn list(&self) -> Result<Transaction<'static, Any>, CatalogError> {
        Ok(self.pool.begin_with(self.dialect.begin_list()).await?)
    }

    /// Runs a whole database operation, and repeats it after a short pause if another transaction was in its way or its
    /// connection broke. Its argument is true for a repetition: the earlier try may have been committed although its
    /// answer was lost.
    pub(super) async fn repeat<T, F>(&self, operation: impl Fn(bool) -> F) -> Result<T, CatalogError>
    where
        F: Future<Output = Result<T, CatalogError>>,
    {
        let mut pause = PAUSE;
        for tried in 1.. {
            match operation(tried > 1).await {
                Err(CatalogError::Sql(error)) if tried < TRIES && self.dialect.is_passing(&error) => {
                    tracing::debug!(%error, tried, "a failed operation of the catalog is tried again");
                    // Two that were in each other's way must not meet again.
                    let jitter = uuid::Uuid::now_v7().as_bytes()[15] % 16;
                    tokio::time::sleep(pause + Duration::from_millis(u64::from(jitter))).await;
                    pause *= 2;
                }
                done => return done,
            }
        }
        Err(CatalogError::Locked)
    }
}

/// Connects once to a database server, without a pool, whose retries would hide a fault for long.
pub(super) async fn reach(place: &Database, url: &str) -> Result<(), CatalogError> {
    install_default_drivers();
    let unreachable =
        |error: sqlx::Error| CatalogError::Unreachable { place: place.to_string(), reason: error.to_string() };
    Ok(AnyConnection::connect(url).await.map_err(unreachable)?.close().await?)
}

impl Write {
    pub(super) fn sql(&self, text: &'static str) -> SqlStr {
        self.dialect.sql(text)
    }

    pub(super) async fn commit(self) -> Result<(), CatalogError> {
        Ok(self.transaction.commit().await?)
    }

    /// Undoes the transaction at once. A transaction that is only dropped keeps its locks for a moment, during which
    /// other workers skip the rows that it has locked.
    pub(super) async fn undo(self) -> Result<(), CatalogError> {
        Ok(self.transaction.rollback().await?)
    }
}

#[cfg(test)]
mod tests {
    use crate::catalog::testing;

    #[tokio::test]
    async fn the_clock_is_in_milliseconds_of_the_epoch() {
        for (catalog, _guard) in testing::catalogs().await {
            let now = catalog.write().await.unwrap().now;
            let here = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_millis() as i64;
            assert!((now - here).abs() < 60_000, "{now} {here}");
        }
    }
}
