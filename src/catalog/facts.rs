//! Facts about the whole catalog: its random id, and whether its store carries that id.

use super::database::Catalog;
use super::dialect::Dialect;
use super::error::CatalogError;
use sqlx::Row;

impl Catalog {
    /// Returns the value of a named property of the whole catalog, if it is set.
    pub(super) async fn fact(&self, name: &str) -> Result<Option<String>, CatalogError> {
        let row = sqlx::query("SELECT value FROM facts WHERE name = $1")
            .bind(name.to_owned())
            .fetch_optional(&self.pool)
            .await?;
        Ok(row.map(|row| row.try_get(0)).transpose()?)
    }

    /// Sets a named property of the whole catalog. A property that is set already changes only if `again` is true.
    pub(super) async fn state(&self, name: &str, value: String, again: bool) -> Result<(), CatalogError> {
        let statement = if again {
            "INSERT INTO facts (name, value) VALUES ($1, $2) ON CONFLICT (name) DO UPDATE SET value = excluded.value"
        } else {
            "INSERT INTO facts (name, value) VALUES ($1, $2) ON CONFLICT (name) DO NOTHING"
        };
        let _turn = self.turn().await;
        sqlx::query(statement).bind(name.to_owned()).bind(value).execute(&self.pool).await?;
        Ok(())
    }

    /// Gives a new catalog its random id, unless it has one.
    pub(super) async fn name_instance(&self) -> Result<(), CatalogError> {
        if self.fact("instance").await?.is_none() {
            self.state("instance", uuid::Uuid::now_v7().to_string(), false).await?;
        }
        Ok(())
    }

    /// Returns the random id of this catalog; the store that belongs to the catalog holds a copy of the id.
    pub(crate) async fn instance(&self) -> Result<String, CatalogError> {
        let missing = || CatalogError::Schema("the catalog has no id; run `wavelume migrate`".to_owned());
        self.fact("instance").await?.ok_or_else(missing)
    }

    /// Gives a copied catalog a new random id, so that it never mistakes the store of the original for its own.
    pub(crate) async fn rename_instance(&self) -> Result<String, CatalogError> {
        let id = uuid::Uuid::now_v7().to_string();
        self.state("instance", id.clone(), true).await?;
        self.state("store", "new".to_owned(), true).await?;
        if let Some(here) = self.here().await? {
            self.state("home", here, true).await?;
        }
        Ok(id)
    }

    /// Returns the id of the original if this catalog was copied to another database. Only PostgreSQL tells its
    /// databases apart; the file of a SQLite catalog may be moved freely. With `may_note` a new catalog notes where it
    /// is.
    pub(crate) async fn copied_from(&self, may_note: bool) -> Result<Option<String>, CatalogError> {
        let Some(here) = self.here().await? else { return Ok(None) };
        match self.fact("home").await? {
            Some(home) if home == here => return Ok(None),
            Some(_) => return Ok(Some(self.instance().await?)),
            None if may_note => self.state("home", here, false).await?,
            None => {}
        }
        Ok(None)
    }

    /// Returns true if this catalog was copied to another database. Unlike [`Self::copied_from`] it writes nothing.
    pub(super) async fn is_copy(&self) -> Result<bool, CatalogError> {
        let Some(home) = self.fact("home").await? else { return Ok(false) };
        Ok(self.here().await?.is_some_and(|here| here != home))
    }

    /// Returns a text that tells this database from every other one of PostgreSQL; `None` for a SQLite file.
    async fn here(&self) -> Result<Option<String>, CatalogError> {
        if self.dialect() == Dialect::Sqlite {
            return Ok(None);
        }
        let row = sqlx::query(
            "SELECT CAST(system_identifier AS TEXT) || '/' || CAST((SELECT CAST(oid AS BIGINT) FROM pg_database \
             WHERE datname = current_database()) AS TEXT) || '/' || current_schema() FROM pg_control_system()",
        )
        .fetch_one(&self.pool)
        .await?;
        Ok(Some(row.try_get(0)?))
    }

    /// Returns true if this catalog's id was ever written to a store.
    pub(crate) async fn has_claimed_store(&self) -> Result<bool, CatalogError> {
        Ok(self.fact("store").await?.as_deref() == Some("claimed"))
    }

    /// Records in the catalog that its id was written to a store.
    pub(crate) async fn note_claimed_store(&self) -> Result<(), CatalogError> {
        self.state("store", "claimed".to_owned(), true).await
    }
}
