//! Steps that SQLite takes for pages of lists over many rows, counted by its virtual machine.

use super::lists::Filters;
use super::search::Sought;
use super::*;
use crate::domain::Quantity;
use sqlx::sqlite::SqliteConnection;
use sqlx::{AssertSqlSafe, Connection, Executor, Row};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Upper bound on the steps for a page of 100. Raising it lets a page read more rows: each takes 5 steps and more.
const STEPS: u64 = 20_000;

/// Number of materials. To read all of them takes 60,000 steps and more.
const MATERIALS: u32 = 12_000;

/// Returns a statement of a list with its parameters written out, for a connection that counts steps.
fn written(filters: &Filters, statement: &str, tenant: &str, sight: Sight) -> String {
    let text = |text: Option<String>| text.map_or("NULL".to_owned(), |text| format!("'{}'", text.replace('\'', "''")));
    let patterns = filters.text.as_ref().map(Sought::patterns);
    let values = [
        i64::MAX.to_string(),
        "''".to_owned(),
        text(filters.quantity.map(|quantity| quantity.name().to_owned())),
        text(filters.measurement.clone()),
        text(filters.tag.as_ref().map(|tag| tag.composed.clone())),
        text(filters.tag.as_ref().and_then(|tag| tag.decomposed.clone())),
        "101".to_owned(),
        text(Some(tenant.to_owned())),
        text(patterns.clone().map(|patterns| patterns.0)),
        text(patterns.and_then(|patterns| patterns.1)),
        text(Some(filters.matching(tenant, sight))),
        i64::MAX.to_string(),
    ];
    let numbered = (1..).zip(&values).collect::<Vec<_>>();
    numbered.iter().rev().fold(statement.to_owned(), |text, (number, value)| text.replace(&format!("${number}"), value))
}

#[tokio::test]
async fn no_page_reads_a_list_from_one_end_to_the_other() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("catalog.sqlite");
    let catalog = Catalog::migrate(&Database::File(file.clone()), false).await.unwrap().0;
    let mut connection = SqliteConnection::connect(&format!("sqlite:{}", file.display())).await.unwrap();
    connection.execute("PRAGMA foreign_keys = OFF").await.unwrap();
    let fill = include_str!("../../tests/benches/fill-sqlite.sql");
    let fill = fill.replace(":materials", &MATERIALS.to_string()).replace(":document", "printf('%03000d', i)");
    connection.execute(AssertSqlSafe(fill)).await.unwrap();
    let steps = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&steps);
    connection.lock_handle().await.unwrap().set_progress_handler(10, move || {
        counted.fetch_add(10, Ordering::Relaxed);
        true
    });
    let text = |text: &str| Some(text.to_owned());
    let plain = MaterialFilter::default;
    let edf = Some(Quantity::Edf);
    let first = format!("b3-{}", "0".repeat(64)).parse().unwrap();
    let own = [
        (101, plain()),
        (101, MaterialFilter { quantity: Some(Quantity::Brdf), ..plain() }),
        (2, MaterialFilter { quantity: edf, ..plain() }),
        (1, MaterialFilter { measurement: Some(first), ..plain() }),
        (101, MaterialFilter { tag: text("common"), ..plain() }),
        (3, MaterialFilter { tag: text("rare"), ..plain() }),
        (0, MaterialFilter { tag: text("nowhere"), ..plain() }),
        (0, MaterialFilter { tag: text("Dämmerung"), ..plain() }),
        (101, MaterialFilter { q: text("sample"), ..plain() }),
        (101, MaterialFilter { q: text("sample 1"), ..plain() }),
        (3, MaterialFilter { q: text("rare"), ..plain() }),
        (0, MaterialFilter { q: text("nowhere"), ..plain() }),
        (0, MaterialFilter { q: text("Dämmerung"), ..plain() }),
        (101, MaterialFilter { q: text("e"), ..plain() }),
        (2, MaterialFilter { q: text("sample"), quantity: edf, ..plain() }),
        (3, MaterialFilter { q: text("sample"), tag: text("rare"), ..plain() }),
        (3, MaterialFilter { q: text("e"), tag: text("rare"), ..plain() }),
        (2, MaterialFilter { q: text("e"), quantity: edf, ..plain() }),
    ];
    let others = [(3, plain()), (3, MaterialFilter { q: text("sample"), ..plain() })];
    let mut lists: Vec<_> = own.into_iter().map(|(rows, filter)| (rows, filter, Sight::Own)).collect();
    for sight in [Sight::Shared, Sight::Public] {
        lists.extend(others.iter().map(|(rows, filter)| (*rows, filter.clone(), sight)));
    }
    for (expected, filter, sight) in lists {
        let filters = filter.sought();
        let tenant = if sight == Sight::Own { "default" } else { "reader" };
        let statement = filters.materials(catalog.dialect, sight);
        let statement = written(&filters, statement.as_str(), tenant, sight);
        steps.store(0, Ordering::Relaxed);
        let rows = sqlx::query(AssertSqlSafe(statement.clone())).fetch_all(&mut connection).await.unwrap();
        let taken = steps.load(Ordering::Relaxed);
        println!("{taken:6} steps: {sight:?} {filter:?}");
        let plan = sqlx::query(AssertSqlSafe(format!("EXPLAIN QUERY PLAN {statement}")));
        let plan = plan.fetch_all(&mut connection).await.unwrap();
        let plan: Vec<String> = plan.iter().map(|row| row.try_get("detail").unwrap()).collect();
        assert_eq!(rows.len(), expected, "{filter:?}");
        assert!(taken < STEPS, "{sight:?} {filter:?}: {taken} steps\n{statement}\n{}", plan.join("\n"));
    }
}
