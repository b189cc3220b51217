//! The catalog's database: opened, and written in transactions that are repeated where that is safe.

use super::dialect::{Dialect, PRAGMAS};
use super::error::CatalogError;
use super::file::{self, check};
use super::lock::Readiness;
use super::place::Database;
use super::reading::Reading;
use super::reserve::Reserve;
use super::result_code::is_of_disk;
use super::schema::{Edition, edition};
use crate::store::Disk;
use crate::trust::Tenant;
use sqlx::any::{AnyConnectOptions, AnyPoolOptions, install_default_drivers};
use sqlx::{Any, AnyConnection, AnyPool, ConnectOptions, Connection, Executor, Row, SqlStr, Transaction};
use std::path::Path;
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
    /// Reserve of disk space beside a SQLite file, given up when its disk is full; `None` for a server.
    pub(super) reserve: Option<Reserve>,
    /// Kept while the catalog is opened for reading alone; `None` if it may be written.
    pub(super) reading: Option<Arc<Reading>>,
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
    readiness: Arc<Readiness>,
    _turn: Option<OwnedMutexGuard<()>>,
}

/// Number of times that a database operation is tried in all before a transient error is returned. Raising it survives
/// longer restarts of the database, but delays the error when the database stays away.
const TRIES: u32 = 5;

/// Pause before a failed database operation is tried a second time; it doubles before each further try.
const PAUSE: Duration = Duration::from_millis(20);

/// Free space in bytes below which the log of a SQLite file is kept small, so that it does not fill the disk. Raising
/// it writes more often into the file itself.
const SMALL_DISK: u64 = 64 << 20;

/// Statement for a connection to a SQLite file on a disk with little space: the log goes into the file after 32 pages.
const SMALL_LOG: &str = "PRAGMA wal_autocheckpoint = 32";

/// Longest time that an operation waits for a connection to a SQLite file, whose writers take turns. Raising it bears
/// longer queues of writers.
const LOCAL_WAIT: Duration = Duration::from_secs(30);

/// Longest time that an operation waits for a connection to a PostgreSQL server. Raising it bears longer queues for a
/// connection, but delays the error when the server is away.
const SERVER_WAIT: Duration = Duration::from_secs(5);

impl Catalog {
    /// Connects to the catalog's database without checking its schema, and makes a missing SQLite file. Opens at most
    /// `connections` connections at once.
    pub(super) async fn connect(place: &Database, connections: u32) -> Result<Self, CatalogError> {
        if let Some(file) = place.file() {
            file::make(file).await?;
        }
        Self::connect_to_existing(place, connections).await
    }

    /// Connects to the catalog's database without checking its schema. Opens at most `connections` connections at once.
    pub(super) async fn connect_to_existing(place: &Database, connections: u32) -> Result<Self, CatalogError> {
        let dialect = place.dialect();
        let url = match place {
            Database::File(file) => {
                let url = file::url(file)?;
                check(file, &url, dialect.prepare()).await?;
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
        let file = place.file().map(Path::to_owned);
        let pool = AnyPoolOptions::new()
            .max_connections(connections)
            .acquire_timeout(if dialect == Dialect::Sqlite { LOCAL_WAIT } else { SERVER_WAIT })
            .after_connect(move |connection, _| {
                let has_small_disk = file.as_deref().is_some_and(has_small_disk);
                Box::pin(async move {
                    for statement in statements.iter().chain(has_small_disk.then_some(&SMALL_LOG)) {
                        connection.execute(*statement).await?;
                    }
                    Ok(())
                })
            })
            .after_release(move |connection, _| Box::pin(async move { ended_cleanly(connection, dialect).await }))
            .connect_with(options)
            .await?;
        let readiness = Arc::new(Readiness::new(url));
        let (edition, turn, room) = (edition(), Arc::default(), Arc::default());
        let (tenant, reserve) = (Tenant::default(), place.file().map(|file| Reserve::beside(file, 0)));
        let (place, reading) = (place.clone(), None);
        Ok(Self { pool, place, dialect, tenant, edition, turn, readiness, reserve, reading, room })
    }

    /// Returns the catalog as another tenant sees it: rows of others do not exist there.
    pub(crate) fn of(&self, tenant: &Tenant) -> Self {
        Self { tenant: tenant.clone(), ..self.clone() }
    }

    /// Returns the catalog with a reserve of `bytes` bytes of disk space, if it is a SQLite file. Makes no file.
    pub(crate) fn with_reserve(self, bytes: u64) -> Self {
        let reserve = self.place.file().map(|file| Reserve::beside(file, bytes));
        Self { reserve, ..self }
    }

    /// Returns the reserve of disk space beside the catalog; `None` for a server.
    pub(crate) fn reserve(&self) -> Option<&Reserve> {
        self.reserve.as_ref()
    }

    /// Fails if the disk of the catalog has no more space than is kept for deletions. Blocks the thread.
    pub(crate) fn has_room(&self) -> Result<(), CatalogError> {
        if self.reserve.as_ref().is_some_and(Reserve::is_short) { Err(CatalogError::NoSpace) } else { Ok(()) }
    }

    /// Fails if the disk of the catalog has no space for new rows of clients. Blocks the thread.
    pub(crate) fn takes_rows(&self) -> Result<(), CatalogError> {
        if self.reserve.as_ref().is_some_and(Reserve::is_short_for_clients) {
            Err(CatalogError::NoSpace)
        } else {
            Ok(())
        }
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

    /// Returns true if the catalog is opened for reading alone: no row can be written.
    pub(crate) fn is_read_only(&self) -> bool {
        self.reading.is_some()
    }

    /// Refuses to go on if the catalog is opened for reading alone.
    pub(crate) fn must_write(&self) -> Result<(), CatalogError> {
        match self.place.file().filter(|_| self.is_read_only()) {
            Some(file) => Err(CatalogError::Unusable {
                file: file.to_owned(),
                reason: "the file or its directory is read-only; let this user write both".to_owned(),
            }),
            None => Ok(()),
        }
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
        self.readiness.began();
        let now = sqlx::query(self.sql("SELECT {now}")).fetch_one(&mut *transaction).await?.try_get(0)?;
        let (tenant, readiness) = (self.tenant.clone(), Arc::clone(&self.readiness));
        Ok(Write { transaction, dialect: self.dialect, tenant, now, readiness, _turn: turn })
    }

    /// Begins a transaction for reading a page of a list.
    pub(super) async fn list(&self) -> Result<Transaction<'static, Any>, CatalogError> {
        Ok(self.pool.begin_with(self.dialect.begin_list()).await?)
    }

    /// Runs a whole database operation, and repeats it after a short pause if another transaction was in its way or its
    /// connection broke; if the disk is full, in the space that the log or the reserve gives up. Its argument is true
    /// for a repetition: the earlier try may have been committed although its answer was lost.
    pub(crate) async fn repeat<T, F>(&self, operation: impl Fn(bool) -> F) -> Result<T, CatalogError>
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
                Err(error) if error.is_full() && tried < TRIES && self.find_space(tried > 1).await => {}
                Err(error) if error.is_full() => {
                    self.readiness.failed();
                    return Err(CatalogError::NoSpace);
                }
                Err(CatalogError::Sql(error)) if is_of_disk(&error) => {
                    self.readiness.failed();
                    return Err(error.into());
                }
                done => return done,
            }
        }
        Err(CatalogError::Locked)
    }

    /// Frees space on the full disk of a SQLite file: that of its log, as far as its pages fit into the file; if that
    /// is nothing, or did not suffice before (`again`), that of the reserve. Returns true if there is space now.
    async fn find_space(&self, again: bool) -> bool {
        let Some(file) = self.place.file() else { return false };
        let log = file::log_of(file);
        let size = || std::fs::metadata(&log).map_or(0, |metadata| metadata.len());
        let before = size();
        let _turn = self.turn().await;
        let emptied = self.empty_log().await.is_ok() && size() < before;
        if emptied && !again {
            return true;
        }
        self.reserve.as_ref().is_some_and(Reserve::give_up) || emptied
    }

    /// Moves the pages of the log of a SQLite file into the file, and cuts the log. A long reader prevents the cut, and
    /// is hardly waited for, because all writers wait meanwhile.
    async fn empty_log(&self) -> Result<(), sqlx::Error> {
        let mut connection = self.pool.acquire().await?;
        connection.execute("PRAGMA busy_timeout = 500").await?;
        let emptied = connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").await;
        connection.execute(PRAGMAS[0]).await?;
        emptied.map(drop)
    }
}

fn has_small_disk(file: &Path) -> bool {
    Disk::of(file).is_ok_and(|disk| disk.free < SMALL_DISK)
}

/// Returns true if a connection that comes back to the pool has no open transaction. After an error of its disk SQLite
/// may have rolled a transaction back by itself; the statement of the driver then fails, the driver still counts the
/// transaction, and no other could begin on this connection.
async fn ended_cleanly(connection: &mut AnyConnection, dialect: Dialect) -> Result<bool, sqlx::Error> {
    if dialect == Dialect::Postgres {
        // A connection that breaks is noticed by the pool.
        return Ok(true);
    }
    // The rollback of a dropped transaction is queued before this.
    connection.ping().await?;
    let is_open = connection.is_in_transaction();
    if is_open {
        tracing::warn!("a transaction did not end cleanly: its connection to the catalog is closed");
    }
    Ok(!is_open)
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
        let committed = self.transaction.commit().await;
        match &committed {
            Ok(()) => self.readiness.committed(),
            Err(_) => self.readiness.failed(),
        }
        Ok(committed?)
    }

    /// Undoes the transaction at once. A transaction that is only dropped keeps its locks for a moment, during which
    /// other workers skip the rows that it has locked.
    pub(super) async fn undo(self) -> Result<(), CatalogError> {
        Ok(self.transaction.rollback().await?)
    }
}

#[cfg(test)]
mod tests {
    use crate::catalog::{Catalog, CatalogError, Database, Dialect, testing};
    use sqlx::Executor;
    use std::time::Duration;

    /// Opens a catalog in a SQLite file with a single connection, and a reserve of 1 MiB.
    async fn with_one_connection() -> (Catalog, tempfile::TempDir) {
        let directory = tempfile::tempdir().unwrap();
        let place = Database::File(directory.path().join("catalog.sqlite"));
        Catalog::migrate(&place, false).await.unwrap().0.close().await;
        let catalog = Catalog::open_as_is(&place, 1, Duration::ZERO).await.unwrap().with_reserve(1 << 20);
        catalog.reserve().unwrap().make().unwrap();
        (catalog, directory)
    }

    #[tokio::test]
    async fn a_connection_that_lost_its_transaction_is_not_used_again() {
        let (catalog, _guard) = with_one_connection().await;
        for _ in 0..3 {
            let mut write = catalog.write().await.unwrap();
            // As SQLite does by itself when its disk is full: the statement of the driver then finds no transaction.
            write.transaction.execute("ROLLBACK").await.unwrap();
            drop(write);
            testing::add(&catalog, &testing::measurement("lamp")).await;
            catalog.list().await.unwrap();
        }
    }

    #[tokio::test]
    async fn a_full_disk_takes_the_reserve_and_then_is_not_ready_until_there_is_space() {
        let (catalog, _guard) = with_one_connection().await;
        let limit = async |pages: u32| {
            let statement = format!("PRAGMA max_page_count = {pages}");
            catalog.pool.execute(sqlx::AssertSqlSafe(statement)).await.unwrap();
        };
        // SQLite takes the present size for a smaller one: no page can be added.
        limit(1).await;
        let fill = async || {
            for number in 0..200 {
                catalog.state("filler", "x".repeat(100 * number), true).await?;
            }
            Ok::<_, CatalogError>(())
        };
        let full = async || catalog.repeat(|_| async { fill().await }).await;
        assert!(matches!(full().await, Err(CatalogError::NoSpace)));
        assert_eq!(catalog.reserve().unwrap().held(), 0, "given up");
        assert!(!catalog.readiness.is_fresh());
        limit(1_000_000).await;
        catalog.ping().await.unwrap();
        assert!(catalog.readiness.is_fresh(), "a row was written");
        full().await.unwrap();
    }

    #[tokio::test]
    async fn a_full_disk_of_the_server_is_told_from_other_faults() {
        for (catalog, _guard) in testing::catalogs().await {
            if catalog.dialect() == Dialect::Postgres {
                let raise = "DO $$ BEGIN RAISE EXCEPTION 'no space' USING ERRCODE = '53100'; END $$";
                let full = catalog.repeat(|_| async { Ok(catalog.pool.execute(raise).await?) }).await;
                assert!(matches!(full, Err(CatalogError::NoSpace)), "{full:?}");
            }
        }
    }

    #[tokio::test]
    async fn the_clock_is_in_milliseconds_of_the_epoch() {
        for (catalog, _guard) in testing::catalogs().await {
            let now = catalog.write().await.unwrap().now;
            let here = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_millis() as i64;
            assert!((now - here).abs() < 60_000, "{now} {here}");
        }
    }
}
