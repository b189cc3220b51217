//! Indexes of large tables on PostgreSQL, built while the service goes on writing.

use super::error::CatalogError;
use sqlx::{AnyConnection, AssertSqlSafe, Executor, Row};
use std::time::Duration;

/// Pause between two tries to become the only process that changes the schema. Raising it delays the second process.
const PAUSE: Duration = Duration::from_millis(200);

/// Waits until no other process changes the schema, and keeps all others from changing it while `connection` is open.
pub(super) async fn wait_for_turn(connection: &mut AnyConnection) -> Result<(), CatalogError> {
    // A statement that waited here would itself delay an index, which waits for every statement that began before it.
    let taken = "SELECT pg_try_advisory_lock(hashtext('wavelume indexes of ' || current_schema()))";
    let mut said = false;
    while !sqlx::query(taken).fetch_one(&mut *connection).await?.try_get::<bool, _>(0)? {
        if !said {
            tracing::warn!("waiting for another process that changes the schema of the same database");
            said = true;
        }
        tokio::time::sleep(PAUSE).await;
    }
    Ok(())
}

/// Builds the indexes of one migration, where they are missing, without blocking writers. Each of `indexes` is the text
/// after `CREATE INDEX IF NOT EXISTS`.
pub(super) async fn build(connection: &mut AnyConnection, indexes: &[&'static str]) -> Result<(), CatalogError> {
    for index in indexes {
        create(connection, index, true).await?;
    }
    Ok(())
}

/// Builds the indexes that find a part of a name or tag, if PostgreSQL's extension `pg_trgm` is installed or can be.
/// Without it a search reads along the list.
pub(super) async fn build_search(connection: &mut AnyConnection, online: bool) -> Result<(), CatalogError> {
    let find = "SELECT CAST(quote_ident(nspname) AS TEXT) FROM pg_extension JOIN pg_namespace \
                ON pg_namespace.oid = extnamespace WHERE extname = 'pg_trgm'";
    let mut found = sqlx::query(find).fetch_optional(&mut *connection).await?;
    if found.is_none() {
        if let Err(error) = connection.execute("CREATE EXTENSION IF NOT EXISTS pg_trgm SCHEMA public").await {
            tracing::debug!(%error, "the PostgreSQL extension pg_trgm was not created");
        }
        found = sqlx::query(find).fetch_optional(&mut *connection).await?;
    }
    let Some(row) = found else {
        tracing::warn!(
            "PostgreSQL's extension pg_trgm is missing: a search in names reads whole lists; install it with CREATE \
             EXTENSION pg_trgm and run `wavelume migrate` again"
        );
        return Ok(());
    };
    let place: String = row.try_get(0)?;
    for table in ["materials", "measurements"] {
        let index = format!("{table}_by_search ON {table} USING gin (search {place}.gin_trgm_ops)");
        create(connection, &index, online).await?;
    }
    Ok(())
}

/// Creates an index, unless it exists; `online` lets writers go on meanwhile.
async fn create(connection: &mut AnyConnection, index: &str, online: bool) -> Result<(), CatalogError> {
    let how = if online { "CONCURRENTLY " } else { "" };
    if online && !is_there(connection, index).await? {
        let name = name_of(index);
        tracing::info!("building the index {name}: writers go on, and the build waits for older transactions to end");
    }
    // A build that lets writers go on blocks nobody while it waits for earlier transactions.
    connection.execute(if online { "SET lock_timeout = 0" } else { "SET lock_timeout = '10s'" }).await?;
    connection.execute(AssertSqlSafe(format!("CREATE INDEX {how}IF NOT EXISTS {index}"))).await?;
    connection.execute("SET lock_timeout = '10s'").await?;
    Ok(())
}

/// Returns the name of an index from the index's definition, which begins with the name.
fn name_of(index: &str) -> &str {
    index.split(' ').next().unwrap_or_default()
}

async fn is_there(connection: &mut AnyConnection, index: &str) -> Result<bool, CatalogError> {
    let known = sqlx::query("SELECT to_regclass(CAST($1 AS TEXT)) IS NOT NULL").bind(name_of(index).to_owned());
    Ok(known.fetch_one(connection).await?.try_get(0)?)
}

/// Removes indexes whose build was broken off: PostgreSQL keeps them, and never uses them.
pub(super) async fn drop_unfinished(connection: &mut AnyConnection) -> Result<(), CatalogError> {
    let unfinished = sqlx::query(
        "SELECT CAST(quote_ident(c.relname) AS TEXT) FROM pg_index i JOIN pg_class c ON c.oid = i.indexrelid \
         JOIN pg_namespace n ON n.oid = c.relnamespace WHERE NOT i.indisvalid AND n.nspname = current_schema()",
    )
    .fetch_all(&mut *connection)
    .await?;
    for row in unfinished {
        let name: String = row.try_get(0)?;
        tracing::warn!(index = name, "an index whose build was broken off is removed and built anew");
        connection.execute(AssertSqlSafe(format!("DROP INDEX CONCURRENTLY IF EXISTS {name}"))).await?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::catalog::{Catalog, testing};
    use sqlx::{Executor, Row};

    /// Returns the names of all valid indexes of a catalog.
    async fn valid(catalog: &Catalog) -> Vec<String> {
        let rows = sqlx::query(
            "SELECT CAST(c.relname AS TEXT) FROM pg_index i JOIN pg_class c ON c.oid = i.indexrelid \
             JOIN pg_namespace n ON n.oid = c.relnamespace WHERE i.indisvalid AND n.nspname = current_schema() ORDER BY 1",
        );
        rows.fetch_all(&catalog.pool).await.unwrap().iter().map(|row| row.try_get(0).unwrap()).collect()
    }

    #[tokio::test]
    async fn a_catalog_in_use_gets_the_same_indexes_as_a_new_one() {
        let place = testing::server().await;
        let catalog = Catalog::migrate(&place, false).await.unwrap().0;
        let all = valid(&catalog).await;
        assert!(
            ["jobs_by_measurement", "materials_by_search"].iter().all(|name| all.iter().any(|known| known == name))
        );
        testing::add(&catalog, &testing::measurement("lamp")).await;
        for statement in [
            "DROP INDEX jobs_by_measurement",
            "DROP INDEX materials_by_search",
            // Broken off.
            "UPDATE pg_index SET indisvalid = false WHERE indexrelid = CAST('measurements_by_format' AS regclass)",
            "ALTER TABLE keys DROP COLUMN verifier",
            "ALTER TABLE tenants DROP COLUMN most_bytes, DROP COLUMN most_materials, DROP COLUMN most_queued, \
             DROP COLUMN counted_at, DROP COLUMN most_requests",
            "ALTER TABLE usage DROP COLUMN materials",
            "ALTER TABLE material_tags DROP COLUMN created_at",
            "DELETE FROM _sqlx_migrations WHERE version > 2",
        ] {
            catalog.pool.execute(statement).await.unwrap();
        }
        // The indexes of a column go with it.
        assert_eq!(valid(&catalog).await.len(), all.len() - 5);
        assert_eq!(Catalog::migrate(&place, false).await.unwrap().1, 5);
        assert_eq!(valid(&catalog).await, all);
    }
}
