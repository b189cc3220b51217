//! One consistent view of the whole catalog, table by table, in a form that either database can be filled with.

use super::database::Catalog;
use super::dialect::Dialect;
use super::error::CatalogError;
use futures::stream::{BoxStream, StreamExt};
use sqlx::{Any, AnyConnection, AssertSqlSafe, Executor, Row, Transaction};

/// Tables that a copy of a catalog contains, each with the columns by which its rows are sorted. A row comes after
/// those that it refers to, except for the spectrum of a measurement.
///
/// Left out are the facts about the original, and what belongs to its own store: objects that are being written or wait
/// for deletion, and unfinished uploads.
pub(crate) const TABLES: [(&str, &[&str]); 14] = [
    ("tenants", &["id"]),
    ("usage", &["tenant", "shard"]),
    ("keys", &["id"]),
    ("blobs", &["tenant", "digest"]),
    ("measurements", &["tenant", "id"]),
    ("materials", &["tenant", "id"]),
    ("shares", &["tenant", "material", "reader"]),
    ("material_sources", &["tenant", "material", "measurement"]),
    ("material_tags", &["tenant", "material", "tag"]),
    ("queue_shares", &["tenant", "share"]),
    ("jobs", &["id"]),
    ("idempotency_keys", &["tenant", "name"]),
    ("audit", &["id"]),
    ("unnamed", &["tenant", "digest"]),
];

/// Type of a column in a table of the catalog; the schema has no others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Text,
    Integer,
    Real,
}

/// Read transaction that sees the catalog as it was at one moment. Writers are not delayed by it.
pub(crate) struct Snapshot {
    transaction: Transaction<'static, Any>,
    dialect: Dialect,
}

impl Catalog {
    /// Begins a read transaction that sees the catalog as it is now.
    pub(crate) async fn snapshot(&self) -> Result<Snapshot, CatalogError> {
        let begin = match self.dialect {
            Dialect::Sqlite => "BEGIN",
            Dialect::Postgres => "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY",
        };
        let mut transaction = self.pool.begin_with(begin).await?;
        if self.dialect == Dialect::Postgres {
            let patient = "SET LOCAL statement_timeout = 0; SET LOCAL idle_in_transaction_session_timeout = '10min'";
            transaction.execute(patient).await?;
        }
        // The first read fixes the moment.
        transaction.execute("SELECT COUNT(*) FROM facts").await?;
        Ok(Snapshot { transaction, dialect: self.dialect })
    }
}

impl Snapshot {
    /// Returns the names of the columns of a table.
    pub(crate) async fn columns(&mut self, table: &str) -> Result<Vec<String>, CatalogError> {
        let columns = columns(&mut self.transaction, self.dialect, table).await?;
        Ok(columns.into_iter().map(|(name, _)| name).collect())
    }

    /// Returns all rows of a table in order, each as a JSON array of the given columns on one line.
    pub(crate) fn rows<'a>(
        &'a mut self,
        (table, order): (&str, &[&str]),
        columns: &[String],
    ) -> BoxStream<'a, Result<String, CatalogError>> {
        let list = quoted(columns.iter().map(String::as_str));
        let row = match self.dialect {
            Dialect::Sqlite => format!("json_array({list})"),
            Dialect::Postgres => format!("CAST(json_build_array({list}) AS TEXT)"),
        };
        let text = format!("SELECT {row} FROM \"{table}\" ORDER BY {}", quoted(order.iter().copied()));
        let rows = sqlx::query(AssertSqlSafe(text)).fetch(&mut *self.transaction);
        rows.map(|row| Ok(row?.try_get(0)?)).boxed()
    }

    /// Ends the read transaction.
    pub(crate) async fn end(self) -> Result<(), CatalogError> {
        Ok(self.transaction.rollback().await?)
    }
}

pub(super) fn quoted<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}

/// Returns the columns of a table with their types, in the order of its declaration.
pub(super) async fn columns(
    connection: &mut AnyConnection,
    dialect: Dialect,
    table: &str,
) -> Result<Vec<(String, Kind)>, CatalogError> {
    let query = match dialect {
        Dialect::Sqlite => "SELECT name, type FROM pragma_table_info($1) ORDER BY cid",
        Dialect::Postgres => {
            "SELECT CAST(column_name AS TEXT), CAST(data_type AS TEXT) FROM information_schema.columns \
             WHERE table_schema = current_schema() AND table_name = $1 ORDER BY ordinal_position"
        }
    };
    let rows = sqlx::query(query).bind(table.to_owned()).fetch_all(connection).await?;
    let found = rows.iter().map(|row| {
        let (name, kind): (String, String) = (row.try_get(0)?, row.try_get(1)?);
        let kind = match kind.to_ascii_lowercase().as_str() {
            "text" => Kind::Text,
            "bigint" => Kind::Integer,
            "double precision" => Kind::Real,
            other => {
                return Err(CatalogError::Schema(format!(
                    "found the type {other} of the column {name} of {table}, expected text, bigint or double precision"
                )));
            }
        };
        Ok((name, kind))
    });
    found.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing;
    use futures::TryStreamExt;
    use std::collections::BTreeSet;

    #[tokio::test]
    async fn every_table_is_copied_or_left_out_on_purpose() {
        for (catalog, _guard) in testing::catalogs().await {
            let query = match catalog.dialect {
                // The search index is made by triggers, also while a copy is filled in.
                Dialect::Sqlite => {
                    "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%' \
                     AND name NOT LIKE 'm%\\_texts' ESCAPE '\\' AND name NOT LIKE 'm%\\_words%' ESCAPE '\\'"
                }
                Dialect::Postgres => {
                    "SELECT CAST(tablename AS TEXT) FROM pg_tables WHERE schemaname = current_schema()"
                }
            };
            let rows = sqlx::query(query).fetch_all(&catalog.pool).await.unwrap();
            let found: BTreeSet<String> = rows.iter().map(|row| row.try_get(0).unwrap()).collect();
            let known = ["facts", "intents", "doomed", "uploads", "_sqlx_migrations"];
            let known = known.into_iter().chain(TABLES.map(|(name, _)| name)).map(str::to_owned);
            assert_eq!(found, known.collect());
        }
    }

    #[tokio::test]
    async fn a_snapshot_does_not_see_what_is_written_after_it() {
        let mut layouts = Vec::new();
        for (catalog, _guard) in testing::catalogs().await {
            testing::add(&catalog, &testing::measurement("lamp \"1\"\n")).await;
            let mut snapshot = catalog.snapshot().await.unwrap();
            testing::add(&catalog, &testing::measurement("lamp 2")).await;
            let mut layout = Vec::new();
            for (table, order) in TABLES {
                let columns = snapshot.columns(table).await.unwrap();
                let rows: Vec<String> = snapshot.rows((table, order), &columns).try_collect().await.unwrap();
                assert!(rows.iter().all(|row| !row.contains('\n')), "{rows:?}");
                if table == "measurements" {
                    let row: Vec<serde_json::Value> = serde_json::from_str(&rows[0]).unwrap();
                    assert_eq!((rows.len(), &row[4]), (1, &"lamp \"1\"\n".into()));
                }
                layout.push((table, columns));
            }
            snapshot.end().await.unwrap();
            layouts.push(layout);
        }
        assert_eq!(layouts[0], layouts[1], "both databases have the same columns");
    }
}
