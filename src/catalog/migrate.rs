//! Schema of the catalog: brought up to date, or checked to be one that this program can work with.

use super::database::Catalog;
use super::dialect::Dialect;
use super::error::CatalogError;
use super::examine::is_bytewise;
use super::file::{directory_of, is_hopeless, unusable, url};
use super::indexes;
use super::place::Database;
use super::reading::{may_write, readable};
use super::schema::{REBUILD, TUNING};
use super::texts;
use crate::store::give;
use sqlx::migrate::MigrateError;
use sqlx::{AnyConnection, Connection, Executor, Row};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Upper bound on the database connections of a maintenance command. Raising it lets more statements run at once.
const FEW: u32 = 4;

/// SQL settings of the PostgreSQL connection that changes the schema: as long as it takes, but no lock is waited for so
/// long that the service behind it stands still.
const UNHURRIED: &str =
    "SET statement_timeout = 0; SET lock_timeout = '10s'; SET client_min_messages = warning; SET jit = off";

/// Upper bound on the database connections of a service on SQLite, where one connection writes at a time. Raising it
/// lets more statements read at once.
const LOCAL: u32 = 8;

/// Name of the stored fact about a database that states the lowest schema version whose program still understands it.
const OLDEST_READER: &str = "oldest_reader";

impl Catalog {
    /// Opens the catalog and brings its database schema up to date. Returns the number of migrations applied.
    ///
    /// The migration that makes the first version's tables anew has no way back: on SQLite a copy of the file is kept
    /// beside it, and on PostgreSQL a catalog that holds rows is refused unless `has_backup`.
    pub(crate) async fn migrate(place: &Database, has_backup: bool) -> Result<(Self, usize), CatalogError> {
        let catalog = Self::connect(place, LOCAL).await?;
        let before = catalog.version().await?;
        if (1..REBUILD).contains(&before) {
            match place {
                Database::File(file) => keep_copy(file).await?,
                Database::Server(_) if !has_backup && catalog.holds_rows().await? => {
                    return Err(CatalogError::Schema(format!(
                        "migration {REBUILD} makes the tables of {place} anew and cannot be undone; back the database \
                         up and run `wavelume migrate --i-have-a-backup`"
                    )));
                }
                Database::Server(_) => {}
            }
        }
        catalog.check_locale().await?;
        match place {
            Database::File(_) => {
                catalog.apply(&mut *catalog.pool.acquire().await?, catalog.edition.version()).await?;
                texts::build(&catalog).await?;
            }
            Database::Server(url) => catalog.apply_on_server(url, before).await?,
        }
        let after = catalog.version().await?;
        catalog.check_schema().await?;
        catalog.name_instance().await?;
        Ok((catalog, (after - before).max(0) as usize))
    }

    /// Opens a catalog without changing its schema. It waits up to `patience` if the database does not have the schema
    /// that this program needs, because another program may be migrating it now.
    pub(crate) async fn open_as_is(
        place: &Database,
        connections: u32,
        patience: Duration,
    ) -> Result<Self, CatalogError> {
        let catalog = Self::connect_to_existing(place, connections).await?;
        let (start, mut said) = (Instant::now(), false);
        loop {
            match catalog.check_schema().await {
                Err(CatalogError::Schema(reason)) if start.elapsed() < patience => {
                    if !said {
                        tracing::warn!(reason, "waiting for the schema of the database");
                        said = true;
                    }
                    tokio::time::sleep(Duration::from_millis(500)).await;
                }
                Err(error) => return Err(error),
                Ok(()) => break,
            }
        }
        catalog.name_instance().await?;
        Ok(catalog)
    }

    /// Opens a catalog for a maintenance command, without changing its schema.
    pub(crate) async fn open_few(place: &Database) -> Result<Self, CatalogError> {
        Self::open_as_is(place, FEW, Duration::ZERO).await
    }

    /// Opens an existing catalog for a maintenance command, without changing its schema. A SQLite file that this user
    /// may not write is opened for reading alone.
    pub(crate) async fn open_existing(place: &Database) -> Result<Self, CatalogError> {
        match place {
            Database::File(file) if file.exists() && !may_write(file) => {
                let (url, reading) = readable(file).await?;
                let mut catalog = Self::pooled(place, url, FEW, Dialect::Sqlite.prepare()).await?;
                catalog.reading = Some(Arc::new(reading));
                catalog.check_schema().await?;
                Ok(catalog)
            }
            _ => Self::open_few(place).await,
        }
    }

    /// Opens a catalog that a copy is to fill. A database without any table gets the schema, and so does one where an
    /// earlier try was killed while it made them.
    pub(crate) async fn open_to_fill(place: &Database) -> Result<Self, CatalogError> {
        let catalog = Self::connect(place, FEW).await?;
        let version = catalog.version().await?;
        let is_new = version == 0 || (version < catalog.edition.version() && !catalog.holds_rows().await?);
        catalog.close().await;
        if is_new { Ok(Self::migrate(place, false).await?.0) } else { Self::open_few(place).await }
    }

    /// Refuses a PostgreSQL database that is not encoded in UTF-8 or that sorts texts by the rules of a language.
    async fn check_locale(&self) -> Result<(), CatalogError> {
        if self.dialect == Dialect::Sqlite {
            return Ok(());
        }
        let row = sqlx::query(
            "SELECT CAST(pg_encoding_to_char(encoding) AS TEXT), CAST(datcollate AS TEXT) FROM pg_database \
             WHERE datname = current_database()",
        )
        .fetch_one(&self.pool)
        .await?;
        let (encoding, order): (String, String) = (row.try_get(0)?, row.try_get(1)?);
        if is_bytewise(&encoding, &order) {
            return Ok(());
        }
        Err(CatalogError::Schema(format!(
            "found the encoding {encoding} and the order of texts {order} in {}, expected UTF8 and C: make the database \
             with CREATE DATABASE … TEMPLATE template0 ENCODING 'UTF8' LOCALE 'C'",
            self.place
        )))
    }

    /// Brings the schema of a PostgreSQL database up to date, on a connection of its own, because an index of a large
    /// table takes longer than a statement of the service may.
    async fn apply_on_server(&self, url: &str, before: i64) -> Result<(), CatalogError> {
        let mut connection = AnyConnection::connect(url).await?;
        connection.execute(UNHURRIED).await?;
        // An empty database has no writers that an index could block.
        let online = before >= REBUILD;
        indexes::wait_for_turn(&mut connection).await?;
        if online {
            indexes::drop_unfinished(&mut connection).await?;
            for (version, added) in self.edition.later() {
                indexes::build(&mut connection, &added).await?;
                self.apply(&mut connection, version).await?;
            }
        }
        self.apply(&mut connection, self.edition.version()).await?;
        for statement in TUNING {
            connection.execute(statement).await?;
        }
        indexes::build_search(&mut connection, online).await?;
        Ok(connection.close().await?)
    }

    /// Applies the migrations up to a version of the schema that were not applied yet.
    async fn apply(&self, connection: &mut AnyConnection, version: i64) -> Result<(), CatalogError> {
        // Two processes may start at once; the second finds the tables of the first and tries again.
        let migrations = self.edition.migrator();
        let (mut tries, start) = (0, Instant::now());
        while let Err(error) = migrations.run_to(version, &mut *connection).await {
            tries += 1;
            let last = tries == 10;
            match error {
                MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => match self.place.file() {
                    Some(file) if last || is_hopeless(&error, start) => return Err(unusable(file, error)),
                    None if last || !self.dialect.is_passing(&error) => return Err(error.into()),
                    _ => {}
                },
                other => return Err(other.into()),
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        Ok(())
    }

    /// Returns the number of the last schema migration applied to the database; 0 for an empty database.
    pub(crate) async fn version(&self) -> Result<i64, CatalogError> {
        if !self.has_table("_sqlx_migrations").await? {
            return Ok(0);
        }
        let last = sqlx::query("SELECT COALESCE(MAX(version), 0) FROM _sqlx_migrations").fetch_one(&self.pool).await?;
        Ok(last.try_get(0)?)
    }

    pub(super) async fn has_table(&self, name: &'static str) -> Result<bool, CatalogError> {
        let query = match self.dialect {
            Dialect::Sqlite => "SELECT COUNT(*) FROM sqlite_master WHERE type = 'table' AND name = $1",
            Dialect::Postgres => {
                "SELECT COUNT(*) FROM pg_tables WHERE schemaname = current_schema() AND tablename = $1"
            }
        };
        let count: i64 = sqlx::query(query).bind(name).fetch_one(&self.pool).await?.try_get(0)?;
        Ok(count > 0)
    }

    async fn holds_rows(&self) -> Result<bool, CatalogError> {
        let query = "SELECT COUNT(*) FROM (SELECT 1 FROM measurements UNION ALL SELECT 1 FROM materials \
                     UNION ALL SELECT 1 FROM jobs) AS held";
        let count: i64 = sqlx::query(query).fetch_one(&self.pool).await?.try_get(0)?;
        Ok(count > 0)
    }

    /// Refuses a database schema that this program cannot work with: an older one, or one that a newer program has
    /// marked as unreadable to it.
    async fn check_schema(&self) -> Result<(), CatalogError> {
        let (version, ours) = (self.version().await?, self.edition.version());
        if version < ours {
            let found =
                if version == 0 { "found an empty database".to_owned() } else { format!("found version {version}") };
            return Err(CatalogError::Schema(format!(
                "{found}, expected version {ours} or newer; run `wavelume migrate`"
            )));
        }
        let reader = self.oldest_reader().await?;
        if reader > ours {
            return Err(CatalogError::Schema(format!(
                "found version {version}, which needs a program of schema version {reader} or newer; this one has \
                 {ours}: use the newer program"
            )));
        }
        Ok(())
    }

    /// Returns the lowest schema version whose program still understands this database; 0 if the database states none.
    pub(super) async fn oldest_reader(&self) -> Result<i64, CatalogError> {
        let Some(stated) = self.fact(OLDEST_READER).await? else { return Ok(0) };
        stated.parse().map_err(|_| CatalogError::Row {
            table: "facts",
            id: OLDEST_READER.to_owned(),
            reason: format!("found `{stated}`, expected the version of a schema, a whole number"),
        })
    }
}

#[cfg(test)]
impl Catalog {
    /// Makes the schema look like that of a newer program.
    pub(crate) async fn pretend_newer(&self) {
        let last =
            "UPDATE _sqlx_migrations SET version = 99 WHERE version = (SELECT MAX(version) FROM _sqlx_migrations)";
        self.pool.execute(last).await.unwrap();
    }
}

/// Copies the SQLite file of a catalog with the first version of the schema to `NAME.before-0002`, and checks that the
/// copy is intact.
async fn keep_copy(file: &Path) -> Result<(), CatalogError> {
    let suffixed = |suffix: &str| {
        let mut name = file.as_os_str().to_owned();
        name.push(suffix);
        PathBuf::from(name)
    };
    let kept = suffixed(&format!(".before-{REBUILD:04}"));
    let partial = suffixed(&format!(".copy-{}", uuid::Uuid::now_v7().simple()));
    let unfit = |reason: String| CatalogError::Unusable { file: kept.clone(), reason };
    let mut connection = AnyConnection::connect(&url(file)?).await?;
    connection.execute("PRAGMA busy_timeout = 20000").await?;
    let text = partial.to_str().ok_or_else(|| unfit("the path of its copy is not UTF-8".to_owned()))?.to_owned();
    sqlx::query("VACUUM INTO $1").bind(text).execute(&mut connection).await?;
    connection.close().await?;
    let mut copy = AnyConnection::connect(&url(&partial)?).await?;
    let sound: String = sqlx::query("PRAGMA integrity_check").fetch_one(&mut copy).await?.try_get(0)?;
    let version: i64 =
        sqlx::query("SELECT COALESCE(MAX(version), 0) FROM _sqlx_migrations").fetch_one(&mut copy).await?.try_get(0)?;
    copy.close().await?;
    let io = |error: std::io::Error| unfit(format!("the copy of the catalog cannot be kept: {error}"));
    if version >= REBUILD {
        // Another process has migrated meanwhile, and kept its copy.
        return std::fs::remove_file(&partial).map_err(io);
    }
    if sound != "ok" {
        std::fs::remove_file(&partial).map_err(io)?;
        return Err(unfit(format!("the catalog is damaged ({sound}); restore it from a backup before it is migrated")));
    }
    let copy = std::fs::File::open(&partial).map_err(io)?;
    give(&copy, directory_of(file)).and_then(|()| copy.sync_all()).map_err(io)?;
    std::fs::rename(&partial, &kept).map_err(io)?;
    tracing::info!(copy = %kept.display(), "the catalog was copied before its tables are made anew");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;

    fn file_of(directory: &tempfile::TempDir) -> Database {
        Database::File(directory.path().join("catalog.sqlite"))
    }

    #[tokio::test]
    async fn the_schema_is_applied_once_even_by_two_at_a_time() {
        for (place, _guard) in testing::places().await {
            let (first, second) = tokio::join!(Catalog::migrate(&place, false), Catalog::migrate(&place, false));
            let (first, second) = (first.unwrap(), second.unwrap());
            assert!(first.1 + second.1 >= 1);
            assert_eq!(Catalog::migrate(&place, false).await.unwrap().1, 0);
            first.0.ping().await.unwrap();
            second.0.ping().await.unwrap();
        }
    }

    #[tokio::test]
    async fn a_command_that_only_looks_does_not_change_the_schema() {
        for (place, _guard) in testing::places().await {
            if let Some(file) = place.file() {
                let missing = Catalog::open_few(&place).await.unwrap_err();
                assert!(matches!(missing, CatalogError::Unusable { .. }) && !file.exists(), "{missing}");
                std::fs::write(file, b"").unwrap();
            }
            let error = Catalog::open_few(&place).await.unwrap_err().to_string();
            assert!(error.contains("empty database") && error.contains("run `wavelume migrate`"), "{error}");
            let (catalog, _) = Catalog::migrate(&place, false).await.unwrap();
            Catalog::open_few(&place).await.unwrap();
            sqlx::query("UPDATE facts SET value = '99' WHERE name = 'oldest_reader'")
                .execute(&catalog.pool)
                .await
                .unwrap();
            let error = Catalog::open_few(&place).await.unwrap_err().to_string();
            assert!(error.contains("schema version 99 or newer"), "{error}");
            sqlx::query("UPDATE facts SET value = 'ninety' WHERE name = 'oldest_reader'")
                .execute(&catalog.pool)
                .await
                .unwrap();
            let error = Catalog::open_few(&place).await.unwrap_err().to_string();
            assert!(error.contains("found `ninety`, expected the version of a schema"), "{error}");
        }
    }

    /// Creates a catalog with the first version of the schema only, and fills its tables as a program of that version
    /// did.
    async fn first_version(place: &Database) -> Catalog {
        let catalog = Catalog::connect(place, 2).await.unwrap();
        catalog.edition.migrator().run_to(1, &catalog.pool).await.unwrap();
        for statement in [
            "INSERT INTO measurements VALUES ('m', 'c', NULL, 'Lamp', NULL, 5, 'ies', 'edf', 'lamp', '{}', 1)",
            "INSERT INTO measurements VALUES ('n', 'c', 'm', NULL, NULL, 5, 'ies', 'edf', '', '{}', 2)",
            "INSERT INTO materials VALUES ('x', 'p', 'edf', 7, NULL, '', '{}', 3)",
            "INSERT INTO material_sources VALUES ('x', 'm')",
            "INSERT INTO material_sources VALUES ('gone', 'm')",
            "INSERT INTO material_tags VALUES ('x', 'clay')",
            "INSERT INTO jobs VALUES ('j', '00', 'm', 'succeeded', 1.0, 1, 1, NULL, NULL, 0, 0, NULL, 'r', NULL, 4, 5)",
            "INSERT INTO jobs VALUES ('k', '00', 'n', 'queued', 0.0, 0, 0, NULL, NULL, 0, 0, NULL, NULL, NULL, 4, 5)",
            "INSERT INTO idempotency_keys VALUES ('key', 'b', 'j', 4)",
        ] {
            catalog.pool.execute(statement).await.unwrap();
        }
        catalog
    }

    #[tokio::test]
    async fn rows_of_the_first_version_are_kept_with_a_copy_or_a_backup() {
        for (place, _guard) in testing::places().await {
            first_version(&place).await.close().await;
            if place.dialect() == Dialect::Postgres {
                let error = Catalog::migrate(&place, false).await.unwrap_err().to_string();
                assert!(error.contains("--i-have-a-backup"), "{error}");
            }
            let (catalog, applied) = Catalog::migrate(&place, true).await.unwrap();
            assert_eq!(applied as i64, catalog.edition.version() - 1);
            for (table, rows) in [
                ("measurements", 2),
                ("materials", 1),
                ("material_sources", 1),
                ("material_tags", 1),
                ("jobs", 2),
                ("idempotency_keys", 1),
                ("blobs", 3),
            ] {
                assert_eq!(testing::count(&catalog, table).await, rows, "{table}");
            }
            let kept = sqlx::query("SELECT COUNT(*) FROM jobs WHERE needs = 'n' AND state = 'queued'");
            assert_eq!(kept.fetch_one(&catalog.pool).await.unwrap().try_get::<i64, _>(0).unwrap(), 1);
            let joined = sqlx::query("SELECT spectrum FROM measurements WHERE id = 'n'").fetch_one(&catalog.pool).await;
            assert_eq!(joined.unwrap().try_get::<String, _>(0).unwrap(), "m");
            if let Some(file) = place.file() {
                let copy = Database::File(file.with_file_name("catalog.sqlite.before-0002"));
                let before = Catalog::connect(&copy, 1).await.unwrap();
                assert_eq!((before.version().await.unwrap(), testing::count(&before, "jobs").await), (1, 2));
            }
        }
    }

    #[tokio::test]
    async fn a_new_catalog_has_no_copy() {
        let directory = tempfile::tempdir().unwrap();
        Catalog::migrate(&file_of(&directory), false).await.unwrap();
        assert!(!directory.path().join("catalog.sqlite.before-0002").exists());
    }
}
