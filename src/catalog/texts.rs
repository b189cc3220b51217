//! Search index of SQLite: the texts of a list in its order, and FTS5 over their runs of three characters.
//!
//! `TABLE_texts` has a row for each row of a table, `TABLE_words` is the index. Triggers keep both, so that programs
//! that know nothing of them may write. PostgreSQL has `pg_trgm` for this, see [`super::indexes`].

use super::database::{Catalog, Write};
use super::error::CatalogError;
use sqlx::{AssertSqlSafe, Executor};

/// Tables with a column `search`, each with the further columns that a search may filter by.
const TABLES: [(&str, &[&str]); 2] =
    [("materials", &["quantity", "visibility"]), ("measurements", &["quantity", "format"])];

/// Number of places for rows of the same ms. A row has its place by its time, so that the index is read in the order of
/// the list: the ms of the Unix epoch times this, plus the number of earlier rows of that ms. Raising it by a factor of
/// two brings the end of [`LAST`] one half closer.
const EACH: i64 = 1 << 20;

/// Last time in ms of the Unix epoch that has places of its own, in the year 2248.
const LAST: i64 = i64::MAX / EACH - 1;

/// Returns the first place after those of rows that are as old as `created_at`, in ms of the Unix epoch, or older.
pub(super) fn after(created_at: i64) -> i64 {
    (created_at.clamp(0, LAST) + 1) * EACH
}

/// Returns the SQL subquery for the ids of one page of a list, as columns `tenant` and `id`. `table` is the name of the
/// list's table. With `is_indexed` the index is asked for parameter 11; without, all texts are read along the list.
/// `conditions` are further SQL conditions on the texts, whose alias is `m`, each after an `AND`.
pub(super) fn page(table: &str, is_indexed: bool, conditions: &str) -> String {
    let (from, place) = if is_indexed {
        let from = format!(
            "{table}_words w CROSS JOIN {table}_texts m ON m.place = w.rowid WHERE w.{table}_words MATCH $11 AND"
        );
        (from, "w.rowid")
    } else {
        // The index of ids would have all texts of a tenant sorted.
        (format!("{table}_texts AS m NOT INDEXED WHERE"), "m.place")
    };
    let found = |range: &str| {
        format!(
            "SELECT m.place, m.tenant, m.id, m.created_at FROM {from} {range} AND (m.created_at, m.id) < ($1, $2)\
             {conditions} ORDER BY {place} DESC"
        )
    };
    // Rows of one ms are not in the order of the list: if the page ends among them, all of them are read.
    let first = found(&format!("{place} < $12"));
    let rest = found(&format!(
        "{place} < (SELECT COALESCE(MIN(place), 0) FROM first) \
         AND {place} >= (SELECT COALESCE(MIN(place) / {EACH} * {EACH}, 0) FROM first)"
    ));
    format!(
        "WITH first AS MATERIALIZED ({first} LIMIT $7) SELECT tenant, id FROM (SELECT * FROM first \
         UNION ALL SELECT * FROM ({rest})) ORDER BY created_at DESC, id DESC LIMIT $7"
    )
}

/// Builds the index of each table, unless it is there.
pub(super) async fn build(catalog: &Catalog) -> Result<(), CatalogError> {
    if catalog.has_table("materials_words").await? {
        return Ok(());
    }
    let mut write = catalog.write().await?;
    let built = "SELECT 1 FROM sqlite_master WHERE name = 'materials_words'";
    if sqlx::query(built).fetch_optional(&mut *write.transaction).await?.is_some() {
        // Another process was first.
        return Ok(());
    }
    make(&mut write).await?;
    write.commit().await
}

/// Makes the index of each table and fills it.
pub(super) async fn make(write: &mut Write) -> Result<(), CatalogError> {
    for (table, filters) in TABLES {
        for statement in statements(table, filters) {
            write.transaction.execute(AssertSqlSafe(statement)).await?;
        }
    }
    Ok(())
}

/// Removes the index, before many rows are written in another order than that of their times: each would cost a write
/// of the index, which is made in one go afterwards.
pub(super) async fn remove(write: &mut Write) -> Result<(), CatalogError> {
    for (table, _) in TABLES {
        let triggers =
            ["added", "removed", "changed"].map(|name| format!("DROP TRIGGER IF EXISTS {table}_texts_{name}"));
        let tables = ["texts", "words"].map(|name| format!("DROP TABLE IF EXISTS {table}_{name}"));
        for statement in triggers.into_iter().chain(tables) {
            write.transaction.execute(AssertSqlSafe(statement)).await?;
        }
    }
    Ok(())
}

/// Returns the SQL statements that make the index of a table and fill it.
fn statements(table: &str, filters: &[&str]) -> Vec<String> {
    let (texts, words) = (format!("{table}_texts"), format!("{table}_words"));
    let kept = filters.iter().flat_map(|name| [*name, " TEXT, "]).collect::<String>();
    let columns = |prefix: &str, names: &[&str]| {
        let names = names.iter().chain(filters).chain(&["search"]).map(|name| format!("{prefix}{name}"));
        names.collect::<Vec<_>>().join(", ")
    };
    let all = |prefix: &str| columns(prefix, &["tenant", "id", "created_at"]);
    let indexed = columns("", &["tenant"]);
    let first = |time: &str| format!("MIN(MAX({time}, 0), {LAST}) * {EACH}");
    let free = format!(
        "(SELECT COALESCE(MAX(place) + 1, {0}) FROM {texts} WHERE place >= {0} AND place < {0} + {EACH})",
        first("NEW.created_at")
    );
    let of = |row: &str| format!("FROM {texts} WHERE tenant = {row}.tenant AND id = {row}.id");
    let add = format!(
        "INSERT INTO {texts} (place, {}) VALUES ({free}, {}); \
         INSERT INTO {words} (rowid, {indexed}) SELECT place, {indexed} {};",
        all(""),
        all("NEW."),
        of("NEW")
    );
    let remove = format!(
        "INSERT INTO {words} ({words}, rowid, {indexed}) SELECT 'delete', place, {indexed} {0}; DELETE {0};",
        of("OLD")
    );
    let trigger = |name: &str, when: &str, work: &str| {
        format!("CREATE TRIGGER {texts}_{name} AFTER {when} ON {table} BEGIN {work} END")
    };
    vec![
        format!(
            "CREATE TABLE {texts} (place INTEGER NOT NULL PRIMARY KEY, tenant TEXT NOT NULL, \
             id TEXT NOT NULL, created_at BIGINT NOT NULL, {kept}search TEXT NOT NULL, UNIQUE (tenant, id))"
        ),
        format!(
            "CREATE VIRTUAL TABLE {words} USING fts5({indexed}, content = '{texts}', \
             content_rowid = 'place', tokenize = 'trigram case_sensitive 1')"
        ),
        format!(
            "INSERT INTO {texts} (place, {0}) SELECT {1} + ROW_NUMBER() OVER (PARTITION BY {1} ORDER BY id) - 1, {0} \
             FROM {table} ORDER BY created_at",
            all(""),
            first("created_at")
        ),
        format!("INSERT INTO {words} ({words}) VALUES ('rebuild')"),
        trigger("added", "INSERT", &add),
        trigger("removed", "DELETE", &remove),
        trigger("changed", &format!("UPDATE OF {}", all("")), &format!("{remove} {add}")),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::testing::{self, measurement};
    use crate::catalog::{Database, Deleted, MeasurementFilter};
    use std::collections::BTreeSet;

    async fn on_a_file() -> (Catalog, tempfile::TempDir) {
        let directory = tempfile::tempdir().unwrap();
        let place = Database::File(directory.path().join("catalog.sqlite"));
        (Catalog::migrate(&place, false).await.unwrap().0, directory)
    }

    /// Returns the names of all measurements that a search finds, read in pages of `limit`.
    async fn found(catalog: &Catalog, q: &str, limit: usize) -> Vec<String> {
        let filter = MeasurementFilter { q: Some(q.to_owned()), ..MeasurementFilter::default() };
        let (mut names, mut next) = (Vec::new(), None);
        loop {
            let page = catalog.measurements(&filter, next, limit).await.unwrap();
            names.extend(page.items.into_iter().map(|row| row.name.unwrap()));
            next = page.next;
            if next.is_none() {
                return names;
            }
        }
    }

    async fn run(catalog: &Catalog, statement: &'static str) {
        catalog.pool.execute(statement).await.unwrap();
    }

    #[tokio::test]
    async fn the_index_finds_what_stands_in_the_texts_and_nothing_else() {
        let (catalog, _directory) = on_a_file().await;
        let alphabet = ['a', 'b', 'A', '"', '*', '%', '_', '\'', ' ', 'ä', '灯', '\u{1f4a1}', '-', ':', '('];
        let mut state = 7_u64;
        let mut random = move |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let mut text = |most: usize| (0..=random(most)).map(|_| alphabet[random(alphabet.len())]).collect::<String>();
        let names: BTreeSet<String> = (0..60).map(|_| text(9)).collect();
        for name in &names {
            testing::add(&catalog, &measurement(name)).await;
        }
        for _ in 0..150 {
            let q = text(4);
            let there = |name: &&String| format!("{name}\nies").to_lowercase().contains(&q.to_lowercase());
            let expected: BTreeSet<String> = names.iter().filter(there).cloned().collect();
            let pages = found(&catalog, &q, 7).await;
            assert_eq!(pages.len(), expected.len(), "{q}");
            assert_eq!(pages.into_iter().collect::<BTreeSet<_>>(), expected, "{q}");
        }
    }

    #[tokio::test]
    async fn rows_of_one_time_are_found_once_each_and_in_the_order_of_the_list() {
        let (catalog, _directory) = on_a_file().await;
        for number in 0..23 {
            testing::add(&catalog, &measurement(&format!("lamp {number}"))).await;
        }
        // Times before 1970 and after the last place have places, too.
        for (time, condition) in [("5", "1 = 1"), ("-9", "bytes = 6"), ("9223372036854775806", "name LIKE '% 2%'")] {
            let text = format!("UPDATE measurements SET created_at = {time} WHERE {condition}");
            catalog.pool.execute(AssertSqlSafe(text)).await.unwrap();
        }
        let all = catalog.measurements(&MeasurementFilter::default(), None, 99).await.unwrap();
        let expected: Vec<String> = all.items.into_iter().map(|row| row.name.unwrap()).collect();
        for limit in [1, 2, 5, 22, 23] {
            assert_eq!(found(&catalog, "lamp", limit).await, expected, "{limit}");
            assert_eq!(found(&catalog, "p", limit).await, expected, "{limit}");
        }
    }

    #[tokio::test]
    async fn the_index_follows_writers_that_do_not_know_it() {
        let (catalog, _directory) = on_a_file().await;
        let (lamp, _) = testing::add(&catalog, &measurement("floor lamp")).await;
        testing::add(&catalog, &measurement("desk lamp")).await;
        assert_eq!(found(&catalog, "lamp", 9).await.len(), 2);
        run(&catalog, "UPDATE measurements SET search = 'torch' WHERE name = 'floor lamp'").await;
        assert_eq!(found(&catalog, "lamp", 9).await, ["desk lamp"]);
        assert_eq!(found(&catalog, "torch", 9).await, ["floor lamp"]);
        assert_eq!(catalog.delete_measurement(lamp.id).await.unwrap(), Deleted::Done);
        assert!(found(&catalog, "torch", 9).await.is_empty());
        // A catalog of the program before has no index.
        let mut write = catalog.write().await.unwrap();
        remove(&mut write).await.unwrap();
        write.commit().await.unwrap();
        testing::add(&catalog, &measurement("street lamp")).await;
        let again = Catalog::migrate(&catalog.place, false).await.unwrap().0;
        assert_eq!(found(&again, "lamp", 9).await.len(), 2);
        testing::add(&catalog, &measurement("table lamp")).await;
        assert_eq!(found(&again, "lamp", 9).await.len(), 3);
        for table in ["measurements_words", "materials_words"] {
            let check = format!("INSERT INTO {table} ({table}, rank) VALUES ('integrity-check', 1)");
            catalog.pool.execute(AssertSqlSafe(check)).await.unwrap();
        }
    }
}
