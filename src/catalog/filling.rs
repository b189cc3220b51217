//! Copy of another catalog on its way into an empty one: stored bytes first, batch by batch, then all rows at once.

use super::database::{Catalog, Write};
use super::dialect::Dialect;
use super::error::CatalogError;
use super::snapshot::{Kind, columns, quoted};
use super::texts;
use crate::store::Object;
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, Executor, Row};
use std::time::Duration;

/// Name of the fact that a copy into this catalog was begun and has not ended; its value names the original.
pub(super) const COPYING: &str = "copying";

/// Write transaction that copies rows into a catalog. Others see none of its rows before it is committed.
pub(crate) struct Filling(Write);

impl Catalog {
    /// Returns the name of the original whose copy into this catalog was begun and has not ended, if there is one.
    pub(crate) async fn copying(&self) -> Result<Option<String>, CatalogError> {
        self.fact(COPYING).await
    }

    /// Notes that a copy into this catalog begins. Until it has ended, no process serves the catalog.
    pub(crate) async fn begin_copy(&self, original: &str) -> Result<(), CatalogError> {
        self.state(COPYING, original.to_owned(), true).await
    }

    /// Returns the number of rows of each table that holds any, such as `2 measurements, 1 jobs`; `None` if the catalog
    /// is empty.
    pub(crate) async fn contents(&self) -> Result<Option<String>, CatalogError> {
        let row = sqlx::query(
            "SELECT (SELECT COUNT(*) FROM measurements), (SELECT COUNT(*) FROM materials), \
             (SELECT COUNT(*) FROM jobs), (SELECT COUNT(*) FROM blobs)",
        )
        .fetch_one(&self.pool)
        .await?;
        let mut found = Vec::new();
        for (at, name) in ["measurements", "materials", "jobs", "stored files"].iter().enumerate() {
            let count: i64 = row.try_get(at)?;
            if count > 0 {
                found.push(format!("{count} {name}"));
            }
        }
        Ok((!found.is_empty()).then(|| found.join(", ")))
    }

    /// Announces that these objects, each with its size in bytes, are about to be written; see [`Self::intend`].
    pub(crate) async fn intend_all(&self, objects: &[(Object, u64)], time: Duration) -> Result<(), CatalogError> {
        let mut write = self.write().await?;
        let until = write.now.saturating_add(time.as_millis() as i64);
        let rows = objects.iter().map(|(object, bytes)| {
            json!([object.to_string(), object.tenant().as_str(), object.digest().to_string(), bytes, until])
        });
        let columns = ["object", "tenant", "digest", "bytes", "expires_at"].map(str::to_owned);
        insert(&mut write, "intents", &columns, &rows.collect::<Vec<_>>()).await?;
        write.commit().await
    }

    /// Lists copied objects as stored, each with its size in bytes and the time of the original's row. Returns false,
    /// and lists none, if an announcement has expired.
    pub(crate) async fn add_copied(&self, objects: &[(Object, u64, i64)]) -> Result<bool, CatalogError> {
        let mut write = self.write().await?;
        let names: Vec<String> = objects.iter().map(|(object, ..)| object.to_string()).collect();
        let live = sqlx::query(write.sql("DELETE FROM intents WHERE expires_at > $2 AND object IN ({each $1})"))
            .bind(json!(names).to_string())
            .bind(write.now)
            .execute(&mut *write.transaction)
            .await?;
        if live.rows_affected() != objects.len() as u64 {
            return Ok(false);
        }
        let now = write.now;
        let rows = objects.iter().map(|(object, bytes, created_at)| {
            let tenant = object.tenant().as_str();
            json!([tenant, object.digest().to_string(), object.generation(), bytes, 0, now, created_at])
        });
        insert(&mut write, "blobs", &blob_columns(), &rows.collect::<Vec<_>>()).await?;
        write.commit().await?;
        Ok(true)
    }

    /// Begins to fill the catalog with the rows of its original.
    pub(crate) async fn fill(&self) -> Result<Filling, CatalogError> {
        let mut write = self.write().await?;
        if self.dialect == Dialect::Postgres {
            let patient = "SET LOCAL statement_timeout = 0; SET LOCAL idle_in_transaction_session_timeout = '10min'";
            write.transaction.execute(patient).await?;
        } else {
            texts::remove(&mut write).await?;
        }
        Ok(Filling(write))
    }
}

impl Filling {
    /// Adds rows to a table, each a JSON array of values in the order of `columns`.
    pub(crate) async fn insert(&mut self, table: &str, columns: &[String], rows: &[Value]) -> Result<(), CatalogError> {
        insert(&mut self.0, table, columns, rows).await
    }

    /// Adds the row of stored bytes that could not be copied. The next upload of the same bytes stores them.
    pub(crate) async fn insert_lost(&mut self, object: &Object) -> Result<(), CatalogError> {
        let now = self.0.now;
        let tenant = object.tenant().as_str();
        let row = json!([tenant, object.digest().to_string(), object.generation(), -1, 1, now, now]);
        insert(&mut self.0, "blobs", &blob_columns(), &[row]).await
    }

    /// Commits the rows that were copied so far, so that others see them. Further rows of the copy follow in another
    /// transaction.
    pub(crate) async fn pause(self) -> Result<(), CatalogError> {
        self.0.commit().await
    }

    /// Joins a measurement with its spectrum.
    pub(crate) async fn join(&mut self, tenant: &str, id: &str, spectrum: &str) -> Result<(), CatalogError> {
        sqlx::query("UPDATE measurements SET spectrum = $3 WHERE tenant = $1 AND id = $2")
            .bind(tenant.to_owned())
            .bind(id.to_owned())
            .bind(spectrum.to_owned())
            .execute(&mut *self.0.transaction)
            .await?;
        Ok(())
    }

    /// Ends the copy: its rows become visible. Jobs that were running are queued again, and stored bytes that nothing
    /// names are listed for the next sweep.
    pub(crate) async fn finish(mut self) -> Result<(), CatalogError> {
        let write = &mut self.0;
        sqlx::query(
            "UPDATE jobs SET state = CASE WHEN cancel_requested <> 0 THEN 'cancelled' ELSE 'queued' END, \
             needs = CASE WHEN cancel_requested <> 0 THEN NULL ELSE needs END, attempts = attempts - 1, \
             epoch = epoch + 1, worker = NULL, lease_until = NULL, progress = 0.0, watched_until = 0, \
             not_before = $1, updated_at = $1 WHERE state = 'running'",
        )
        .bind(write.now)
        .execute(&mut *write.transaction)
        .await?;
        sqlx::query(
            "INSERT INTO unnamed (tenant, digest, not_before) SELECT b.tenant, b.digest, $1 FROM blobs b \
             WHERE NOT EXISTS (SELECT 1 FROM measurements m WHERE m.tenant = b.tenant AND m.content = b.digest) \
             AND NOT EXISTS (SELECT 1 FROM materials m WHERE m.tenant = b.tenant AND m.id = b.digest) \
             AND NOT EXISTS (SELECT 1 FROM jobs j WHERE j.tenant = b.tenant AND j.report = b.digest) \
             ON CONFLICT (tenant, digest) DO NOTHING",
        )
        .bind(write.now)
        .execute(&mut *write.transaction)
        .await?;
        sqlx::query("DELETE FROM facts WHERE name = $1")
            .bind(COPYING.to_owned())
            .execute(&mut *write.transaction)
            .await?;
        if write.dialect == Dialect::Sqlite {
            texts::make(write).await?;
        }
        self.0.commit().await
    }
}

fn blob_columns() -> [String; 7] {
    ["tenant", "digest", "generation", "bytes", "suspect", "checked_at", "created_at"].map(str::to_owned)
}

/// Inserts rows in one statement. Rows that a service makes at its first start (tenants, keys, usage) are overwritten.
async fn insert(write: &mut Write, table: &str, names: &[String], rows: &[Value]) -> Result<(), CatalogError> {
    let known = columns(&mut write.transaction, write.dialect, table).await?;
    let mut values = Vec::with_capacity(names.len());
    for (at, name) in names.iter().enumerate() {
        let Some((_, kind)) = known.iter().find(|(known, _)| known == name) else {
            return Err(CatalogError::Schema(format!(
                "the copy has a column {name} of {table}, which this program does not know; use the program that made it"
            )));
        };
        values.push(match (write.dialect, kind) {
            (Dialect::Sqlite, _) => format!("json_extract(value, '$[{at}]')"),
            (Dialect::Postgres, Kind::Text) => format!("value ->> {at}"),
            (Dialect::Postgres, Kind::Integer) => format!("CAST(value ->> {at} AS BIGINT)"),
            (Dialect::Postgres, Kind::Real) => format!("CAST(value ->> {at} AS DOUBLE PRECISION)"),
        });
    }
    let each = match write.dialect {
        Dialect::Sqlite => "json_each($1)",
        Dialect::Postgres => "json_array_elements(CAST($1 AS json))",
    };
    let list = quoted(names.iter().map(String::as_str));
    let own = match table {
        "tenants" | "keys" => Some("id"),
        "usage" => Some("tenant, shard"),
        _ => None,
    };
    let overwrite = own.map_or_else(String::new, |own| {
        let set: Vec<String> = names.iter().map(|name| format!("\"{name}\" = excluded.\"{name}\"")).collect();
        format!(" ON CONFLICT ({own}) DO UPDATE SET {}", set.join(", "))
    });
    let text =
        format!("INSERT INTO \"{table}\" ({list}) SELECT {} FROM {each} WHERE true{overwrite}", values.join(", "));
    sqlx::query(AssertSqlSafe(text)).bind(Value::from(rows).to_string()).execute(&mut *write.transaction).await?;
    Ok(())
}
