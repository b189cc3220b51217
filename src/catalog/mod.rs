//! Catalog of measurements, materials and jobs by digest: SQL and its migrations.
//!
//! The same queries serve SQLite and PostgreSQL: `$n` placeholders, three column types, and two fragments that differ
//! (the clock, and the row locks while a job is claimed). Writes on SQLite begin with `BEGIN IMMEDIATE`, so that a
//! transaction never has to give up because it read before it wrote.

mod database;
mod dialect;
mod error;
mod file;
mod job;
#[cfg(test)]
mod job_tests;
mod jobs;
mod lock;
mod materials;
mod measurements;
mod page;
mod pins;
mod ready;
mod result_code;
mod schema;

pub(crate) use database::Catalog;
pub use error::CatalogError;
pub(crate) use job::{Beat, Claimed, Ended, Ending, Enqueued, JobRow, JobState, NewJob};
pub(crate) use materials::{MaterialFilter, MaterialRow, NewMaterial};
pub(crate) use measurements::{Added, Deleted, MeasurementFilter, MeasurementRow, NewMeasurement};
pub(crate) use page::{Cursor, NotACursor};
pub(crate) use pins::Namer;

#[cfg(test)]
pub(crate) mod testing {
    use super::*;
    use crate::domain::Quantity;
    use crate::store::Digest;
    use sqlx::Row;
    use std::time::Duration;

    /// A catalog in a directory with an awkward name.
    pub(crate) async fn catalog() -> (Catalog, tempfile::TempDir) {
        let directory = tempfile::Builder::new().prefix("odd name %?#").tempdir().unwrap();
        let catalog = Catalog::open(&directory.path().join("catalog.sqlite")).await.unwrap();
        (catalog, directory)
    }

    /// A lamp whose content is `text`.
    pub(crate) fn measurement(text: &str) -> NewMeasurement {
        NewMeasurement {
            id: Digest::of(text.as_bytes()),
            content: Digest::of(text.as_bytes()),
            spectrum: None,
            name: Some(text.to_owned()),
            file_name: None,
            bytes: text.len() as u64,
            format: "ies".to_owned(),
            quantity: Some(Quantity::Edf),
            document: "{}".to_owned(),
        }
    }

    /// Pins and adds a measurement, as an upload does.
    pub(crate) async fn add(catalog: &Catalog, new: &NewMeasurement) -> (MeasurementRow, bool) {
        catalog.pin(new.content, "test", Duration::from_mins(1)).await.unwrap();
        match catalog.add_measurement(new, "test").await.unwrap() {
            Added::Row(row, fresh) => (row, fresh),
            other => panic!("{other:?}"),
        }
    }

    /// Expires every pin now.
    pub(crate) async fn expire_pins(catalog: &Catalog) {
        sqlx::query("UPDATE pins SET expires_at = 0").execute(&catalog.pool).await.unwrap();
    }

    /// Number of rows of a table.
    pub(crate) async fn count(catalog: &Catalog, table: &str) -> i64 {
        let query = sqlx::AssertSqlSafe(format!("SELECT COUNT(*) FROM {table}"));
        sqlx::query(query).fetch_one(&catalog.pool).await.unwrap().try_get(0).unwrap()
    }
}
