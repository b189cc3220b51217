//! Facts about the database of a catalog, read without creating or changing anything.

use super::database::{Catalog, reach};
use super::dialect::Dialect;
use super::error::CatalogError;
use super::file::{look, unusable, url};
use super::filling::COPYING;
use super::lock::is_free;
use super::place::Database;
use sqlx::Row;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Facts about the database of a catalog at one moment.
#[derive(Clone, Debug)]
pub(crate) struct Examined {
    /// Time that the database took to answer a query for its clock.
    pub answered: Duration,
    /// Milliseconds by which the clock of the database is ahead of this machine's.
    pub ahead: i64,
    /// Number of the last migration applied; 0 for an empty database.
    pub schema: i64,
    /// Oldest version of the schema whose programs may use this database.
    pub oldest_reader: i64,
    /// Id of the catalog; `None` before its first start.
    pub instance: Option<String>,
    /// True if the database was made by restoring a dump of another one.
    pub is_copy: bool,
    /// True if the id of the catalog was ever written to a store.
    pub has_claimed_store: bool,
    /// Name of the original whose copy into this catalog was begun and has not ended.
    pub copying: Option<String>,
    /// Facts about the database that depend on its kind, SQLite or PostgreSQL.
    pub engine: Engine,
}

/// Facts about the database that depend on its kind, SQLite or PostgreSQL.
#[derive(Clone, Debug)]
pub(crate) enum Engine {
    /// Facts about a SQLite file.
    File {
        /// Journal mode of the file, such as `wal`.
        journal: String,
        /// Level of `PRAGMA synchronous` on a connection of this program: 2 is FULL.
        synchronous: i64,
        /// True if no other program holds the write lock at this moment.
        is_free: bool,
    },
    /// Facts about a PostgreSQL server.
    Server(Server),
}

/// Facts about a PostgreSQL server.
#[derive(Clone, Debug)]
pub(crate) struct Server {
    /// Version of PostgreSQL as a number: 150018 is 15.18.
    pub version: i64,
    /// Version of PostgreSQL as a text, as the server states it.
    pub version_text: String,
    /// Character encoding of the database.
    pub encoding: String,
    /// Order of texts (collation) of the database.
    pub order: String,
    /// True if the PostgreSQL server is a standby, which cannot be written.
    pub is_standby: bool,
    /// Value of the PostgreSQL setting `fsync`.
    pub fsync: String,
    /// Value of the PostgreSQL setting `full_page_writes`.
    pub full_page_writes: String,
    /// Value of the PostgreSQL setting `synchronous_commit`.
    pub synchronous_commit: String,
    /// Number of connections that the PostgreSQL server grants to users who are not superusers.
    pub connections: i64,
    /// Number of client connections that are open on the PostgreSQL server now, without this one.
    pub in_use: i64,
}

/// SQL statements that set up a connection for examining a SQLite database. It waits for less long than those of the
/// service.
const LOOK: [&str; 2] = ["PRAGMA busy_timeout = 2000", "PRAGMA synchronous = FULL"];

/// SQL statements that set up a connection for examining a PostgreSQL database. The connection then refuses to write.
const READ_ONLY: [&str; 1] =
    ["SET default_transaction_read_only = on; SET statement_timeout = '5s'; SET lock_timeout = '2s'"];

/// Oldest version of PostgreSQL that the catalog works with, as a number.
pub(crate) const OLDEST_SERVER: i64 = 130_000;

impl Server {
    /// Returns true if the database compares texts byte by byte, which the catalog needs.
    pub(crate) fn is_bytewise(&self) -> bool {
        is_bytewise(&self.encoding, &self.order)
    }
}

/// Returns true if texts compare byte by byte in a PostgreSQL database with this character encoding and this collation.
pub(super) fn is_bytewise(encoding: &str, order: &str) -> bool {
    encoding == "UTF8" && matches!(order, "C" | "POSIX" | "C.UTF-8" | "C.utf8")
}

impl Catalog {
    /// Examines the database of a catalog. A SQLite file must exist; it is not created, and no schema is changed.
    pub(crate) async fn examine(place: &Database) -> Result<Examined, CatalogError> {
        let url = match place {
            Database::File(file) => {
                let url = url(file)?;
                look(&url, &LOOK).await.map_err(|error| unusable(file, error))?;
                url
            }
            Database::Server(url) => {
                reach(place, url).await?;
                url.clone()
            }
        };
        let statements: &'static [&'static str] = if place.dialect() == Dialect::Sqlite { &LOOK } else { &READ_ONLY };
        let catalog = Self::pooled(place, url, 1, statements).await?;
        let examined = catalog.examined().await;
        catalog.close().await;
        examined
    }

    async fn examined(&self) -> Result<Examined, CatalogError> {
        let (start, before) = (Instant::now(), here());
        let now: i64 = sqlx::query(self.sql("SELECT {now}")).fetch_one(&self.pool).await?.try_get(0)?;
        let answered = start.elapsed();
        let ahead = now - (before + answered.as_millis() as i64 / 2);
        let schema = self.version().await?;
        let has_facts = self.has_table("facts").await?;
        let fact = async |name| if has_facts { self.fact(name).await } else { Ok(None) };
        Ok(Examined {
            answered,
            ahead,
            schema,
            oldest_reader: if has_facts { self.oldest_reader().await? } else { 0 },
            instance: fact("instance").await?,
            is_copy: has_facts && self.is_copy().await?,
            has_claimed_store: has_facts && self.has_claimed_store().await?,
            copying: fact(COPYING).await?,
            engine: match self.place.file() {
                Some(file) => self.file_facts(file).await?,
                None => Engine::Server(self.server_facts().await?),
            },
        })
    }

    async fn file_facts(&self, file: &Path) -> Result<Engine, CatalogError> {
        let journal = sqlx::query("PRAGMA journal_mode").fetch_one(&self.pool).await?.try_get(0)?;
        let synchronous = sqlx::query("PRAGMA synchronous").fetch_one(&self.pool).await?.try_get(0)?;
        let free = is_free(&self.readiness.url).await;
        let is_free = free.map_err(|error| match error {
            CatalogError::Sql(error) => unusable(file, error),
            other => other,
        })?;
        Ok(Engine::File { journal, synchronous, is_free })
    }

    async fn server_facts(&self) -> Result<Server, CatalogError> {
        let row = sqlx::query(
            "SELECT CAST(current_setting('server_version_num') AS BIGINT), current_setting('server_version'), \
             CAST(pg_encoding_to_char(encoding) AS TEXT), CAST(datcollate AS TEXT), pg_is_in_recovery(), \
             current_setting('fsync'), current_setting('full_page_writes'), current_setting('synchronous_commit'), \
             CAST(current_setting('max_connections') AS BIGINT) \
             - CAST(current_setting('superuser_reserved_connections') AS BIGINT) \
             - CAST(COALESCE(current_setting('reserved_connections', true), '0') AS BIGINT), \
             (SELECT COUNT(*) FROM pg_stat_activity WHERE backend_type = 'client backend' AND pid <> pg_backend_pid()) \
             FROM pg_database WHERE datname = current_database()",
        )
        .fetch_one(&self.pool)
        .await?;
        Ok(Server {
            version: row.try_get(0)?,
            version_text: row.try_get(1)?,
            encoding: row.try_get(2)?,
            order: row.try_get(3)?,
            is_standby: row.try_get(4)?,
            fsync: row.try_get(5)?,
            full_page_writes: row.try_get(6)?,
            synchronous_commit: row.try_get(7)?,
            connections: row.try_get(8)?,
            in_use: row.try_get(9)?,
        })
    }
}

fn here() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;

    #[tokio::test]
    async fn an_examination_changes_nothing() {
        for (place, guard) in testing::places().await {
            if let Some(file) = place.file() {
                let missing = Catalog::examine(&place).await.unwrap_err();
                assert!(matches!(missing, CatalogError::Unusable { .. }), "{missing}");
                assert!(!file.exists());
                std::fs::write(file, b"").unwrap();
            }
            let empty = Catalog::examine(&place).await.unwrap();
            assert_eq!((empty.schema, empty.instance, empty.has_claimed_store), (0, None, false));
            if let Some(file) = place.file() {
                assert_eq!(file.metadata().unwrap().len(), 0);
                assert_eq!(std::fs::read_dir(guard.as_ref().unwrap()).unwrap().count(), 1);
            }
            let (catalog, _) = Catalog::migrate(&place, false).await.unwrap();
            let id = catalog.instance().await.unwrap();
            let seen = Catalog::examine(&place).await.unwrap();
            assert_eq!((seen.schema, seen.instance), (super::super::schema::VERSION, Some(id)));
            assert!(seen.ahead.abs() < 60_000 && !seen.is_copy && !seen.has_claimed_store, "{}", seen.ahead);
            // The examination has not noted where the catalog lives, which its first start does.
            assert_eq!(catalog.fact("home").await.unwrap(), None);
            match seen.engine {
                Engine::File { journal, synchronous, is_free } => {
                    assert_eq!((journal.as_str(), synchronous, is_free), ("wal", 2, true));
                }
                Engine::Server(server) => {
                    assert!(server.version >= OLDEST_SERVER && server.is_bytewise() && !server.is_standby);
                    assert!(server.connections > 0 && server.in_use >= 1, "{server:?}");
                }
            }
        }
    }
}
