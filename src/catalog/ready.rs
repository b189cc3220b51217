//! Readiness check of the catalog that never waits for a writer.

use super::database::Catalog;
use super::dialect::Dialect;
use super::error::CatalogError;
use super::lock::{PAUSE, is_free};
use std::time::Duration;
use tokio::time::{sleep, timeout};

/// Seconds that the readiness check gives the database to answer a read, and its write lock to become free. Raising it
/// delays the answer *not ready*.
const PATIENCE: Duration = Duration::from_secs(1);

impl Catalog {
    /// Checks within about two seconds that the catalog's database answers and can be written.
    ///
    /// Never waits for a writer: a write of this process within the last 5 s is proof enough, unless the last one
    /// failed. Otherwise a separate connection looks whether the write lock is free, and a row is written through the
    /// pool that requests use.
    pub(crate) async fn ping(&self) -> Result<(), CatalogError> {
        let read = sqlx::query("SELECT 1 FROM facts LIMIT 1").fetch_optional(&self.pool);
        timeout(PATIENCE, read).await.map_err(|_| self.silent())??;
        // A server has no lock of the whole database that a writer could hold.
        if self.dialect == Dialect::Postgres {
            return Ok(());
        }
        let looking = async {
            while !self.readiness.is_fresh() {
                if is_free(&self.readiness.url).await? {
                    return self.write_probe().await;
                }
                sleep(PAUSE).await;
            }
            Ok(())
        };
        timeout(PATIENCE, looking).await.unwrap_or(Err(CatalogError::Locked))
    }

    /// Writes a row that nothing reads, to see that the catalog can be written.
    async fn write_probe(&self) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        let statement = "INSERT INTO facts (name, value) VALUES ('probe', $1) \
                         ON CONFLICT (name) DO UPDATE SET value = excluded.value";
        let written = sqlx::query(statement).bind(write.now.to_string()).execute(&mut *write.transaction).await;
        match written {
            Ok(_) => write.commit().await,
            Err(error) => {
                self.readiness.failed();
                Err(error.into())
            }
        }
    }

    /// Returns the error for a database that does not answer in time.
    fn silent(&self) -> CatalogError {
        match self.dialect {
            Dialect::Sqlite => CatalogError::Locked,
            Dialect::Postgres => CatalogError::Unreachable {
                place: self.place.to_string(),
                reason: "the server did not answer in time".to_owned(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::Database;
    use crate::catalog::file::url;
    use crate::catalog::testing;
    use sqlx::{AnyConnection, Connection, Executor};

    #[tokio::test]
    async fn a_ping_does_not_wait_for_a_writer_of_this_process() {
        for (catalog, _guard) in testing::catalogs().await {
            let write = catalog.write().await.unwrap();
            catalog.ping().await.unwrap();
            drop(write);
            catalog.ping().await.unwrap();
        }
    }

    #[tokio::test]
    async fn a_catalog_that_another_program_has_locked_is_not_ready() {
        let directory = tempfile::tempdir().unwrap();
        let place = Database::File(directory.path().join("catalog.sqlite"));
        let (catalog, _) = Catalog::migrate(&place, false).await.unwrap();
        let url = url(&directory.path().join("catalog.sqlite")).unwrap();
        let mut other = AnyConnection::connect(&url).await.unwrap();
        other.execute("BEGIN IMMEDIATE").await.unwrap();
        // As after a while without writes.
        *catalog.readiness.written.lock().unwrap() = None;
        assert!(matches!(catalog.ping().await, Err(CatalogError::Locked)));
        other.execute("ROLLBACK").await.unwrap();
        catalog.ping().await.unwrap();
        assert!(catalog.readiness.is_fresh(), "the lock was seen free");
    }
}
