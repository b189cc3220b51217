//! Catalog of measurements, materials, jobs and stored bytes: SQL and its migrations.
//!
//! One text of each statement serves SQLite and PostgreSQL: `$n` placeholders, three column types, and a few marks that
//! each database writes in its own way ([`dialect`]). What must stay true while many processes write is said by foreign
//! keys and by updates that name the state in which they find a row. Writes on SQLite begin with `BEGIN IMMEDIATE`, so
//! that a transaction never has to give up because it read before it wrote.

mod ageing;
mod audit;
mod blobs;
mod checks;
#[cfg(test)]
mod cost_tests;
mod database;
mod dialect;
mod error;
mod examine;
mod facts;
mod file;
mod filling;
mod hold;
mod indexes;
mod job;
#[cfg(test)]
mod job_tests;
mod jobs;
mod keys;
mod lists;
mod lock;
mod materials;
mod measurements;
mod migrate;
mod page;
mod partial;
#[cfg(test)]
mod partial_tests;
mod place;
#[cfg(test)]
mod plan_tests;
mod priority;
mod queue;
#[cfg(test)]
mod race_tests;
mod ranks;
mod reading;
mod ready;
mod reserve;
mod result_code;
mod retention;
mod schema;
mod search;
mod sight;
mod snapshot;
#[cfg(test)]
mod step_tests;
#[cfg(test)]
mod tenant_tests;
mod tenants;
mod texts;
mod trusted;
mod uploaded;
mod usage;
mod watch;

pub use error::CatalogError;
pub use place::Database;
pub(crate) use place::without_password;

pub(crate) use audit::{Act, ActRow};
pub(crate) use blobs::{Blob, Claim, Doom, Namer};
pub(crate) use database::Catalog;
pub(crate) use dialect::Dialect;
pub(crate) use examine::{Engine as EngineFacts, Examined, OLDEST_SERVER, Server as ServerFacts};
pub(crate) use filling::Filling;
pub(crate) use job::{Beat, Claimed, Ended, Ending, Enqueued, JobRow, JobState, NewJob};
pub(crate) use jobs::{Cancelling, JobFilter, Retried};
pub(crate) use keys::{AddedKey, Credential, KeyRow, NewKey, Revoked};
pub(crate) use lists::Sight;
pub(crate) use materials::{MaterialFilter, MaterialRow, NewMaterial};
pub(crate) use measurements::{Added, Deleted, MeasurementFilter, MeasurementRow, NewMeasurement};
pub(crate) use page::{Cursor, NotACursor};
pub(crate) use partial::{Begun, Bound, Held, NewPartial, Partial, PartialLimits};
pub(crate) use priority::Priority;
pub(crate) use reserve::Reserve;
pub(crate) use retention::Retention;
pub(crate) use schema::VERSION as SCHEMA;
pub(crate) use schema::{EDITION, OTHER_TENANTS};
#[cfg(test)]
pub(crate) use schema::{Edition, PROGRAM};
pub(crate) use sight::{Opened, Opening, Visible};
pub(crate) use snapshot::TABLES;
pub(crate) use tenants::{Limit, MOST_WEIGHT, Quotas, Settled, TenantChange, TenantRow, TenantState};
pub(crate) use trusted::{Counted, Doubt};
pub(crate) use uploaded::Uploaded;
pub(crate) use usage::{Limited, OverQuota};
pub(crate) use watch::Notice;

#[cfg(test)]
pub(crate) mod testing {
    //! Catalogs for tests, on both databases, and rows to fill them with.

    use super::*;
    use crate::domain::Quantity;
    use crate::store::{Digest, Object};
    use crate::trust::{Key, Tenant};
    use sqlx::{AnyConnection, Connection, Executor, Row};
    use std::time::Duration;

    /// Temporary directory of a test, kept for as long as the test runs; `None` if the test has no files.
    pub(crate) type Guard = Option<tempfile::TempDir>;

    /// Returns two places for a test's catalog: a SQLite file in a directory with an awkward name, and a schema of its
    /// own in PostgreSQL.
    pub(crate) async fn places() -> Vec<(Database, Guard)> {
        let directory = tempfile::Builder::new().prefix("odd name %?#").tempdir().unwrap();
        let file = Database::File(directory.path().join("catalog.sqlite"));
        vec![(file, Some(directory)), (server().await, None)]
    }

    /// Creates a new schema in the PostgreSQL server of the tests, and returns its URL.
    pub(crate) async fn server() -> Database {
        let url = std::env::var("WAVELUME_TEST_DATABASE").expect(
            "WAVELUME_TEST_DATABASE is not set: run the tests as `tests/servers cargo test …`, which starts PostgreSQL",
        );
        sqlx::any::install_default_drivers();
        let schema = format!("t{}", uuid::Uuid::now_v7().simple());
        let mut connection = AnyConnection::connect(&url).await.unwrap();
        connection.execute(sqlx::AssertSqlSafe(format!("CREATE SCHEMA {schema}"))).await.unwrap();
        connection.close().await.unwrap();
        let mark = if url.contains('?') { '&' } else { '?' };
        Database::Server(format!("{url}{mark}options[search_path]={schema}"))
    }

    /// Opens an empty catalog with the current schema on each kind of database (SQLite and PostgreSQL), for a test.
    pub(crate) async fn catalogs() -> Vec<(Catalog, Guard)> {
        let mut catalogs = Vec::new();
        for (place, guard) in places().await {
            catalogs.push((Catalog::migrate(&place, false).await.unwrap().0, guard));
        }
        catalogs
    }

    /// Builds the measurement of a lamp with the content `text`, for a test.
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

    /// Builds a material of 10 bytes with the content `text`, without name, tags and measurements, for a test.
    pub(crate) fn material(text: &str) -> NewMaterial {
        NewMaterial {
            id: Digest::of(text.as_bytes()),
            payload: Digest::of(b"payload"),
            quantity: Quantity::Edf,
            bytes: 10,
            name: None,
            tags: Vec::new(),
            measurements: Vec::new(),
            document: serde_json::Map::new(),
        }
    }

    /// Stores an access key of the usual tenant with the scope `read`, which ends after the time `life`, for a test.
    pub(crate) async fn key(catalog: &Catalog, life: Duration) -> Key {
        let key = Key::generate().unwrap();
        let new = NewKey {
            id: key.id(),
            tenant: Tenant::default(),
            name: "test".to_owned(),
            hash: key.secret().hash(),
            verifier: None,
            scopes: "read".parse().unwrap(),
            life,
            created_by: "test".to_owned(),
        };
        assert!(matches!(catalog.add_key(&new, 1000, &Act::default()).await.unwrap(), AddedKey::Row(_)));
        key
    }

    /// Announces to the catalog, for a test, that an object with this digest and size in bytes is about to be written.
    pub(crate) async fn publish(catalog: &Catalog, digest: Digest, bytes: u64) -> Claim {
        let object = Object::fresh(catalog.tenant(), digest);
        catalog.intend(&object, bytes, Duration::from_mins(1)).await.unwrap();
        Claim::Written(object, bytes)
    }

    /// Adds a tenant to a test's catalog, and returns the catalog as the tenant sees it.
    pub(crate) async fn other(catalog: &Catalog, id: &str) -> Catalog {
        let insert = "INSERT INTO tenants (id, name, created_at) VALUES ($1, $1, 0) ON CONFLICT DO NOTHING";
        sqlx::query(insert).bind(id).execute(&catalog.pool).await.unwrap();
        catalog.of(&id.parse().unwrap())
    }

    /// Stores a measurement in a test's catalog, as an upload does.
    pub(crate) async fn add(catalog: &Catalog, new: &NewMeasurement) -> (MeasurementRow, bool) {
        let claim = publish(catalog, new.content, new.bytes).await;
        match catalog.add_measurement(new, &claim).await.unwrap() {
            Added::Row(row, fresh) => (row, fresh),
            other => panic!("{other:?}"),
        }
    }

    /// Fills an empty catalog on PostgreSQL with this many jobs and materials, after running the SQL statements
    /// `before`.
    pub(crate) async fn fill(place: &Database, jobs: u32, materials: u32, before: &str) {
        let Database::Server(url) = place else { panic!("{place}") };
        let mut connection = AnyConnection::connect(url).await.unwrap();
        connection.execute(sqlx::AssertSqlSafe(before.to_owned())).await.unwrap();
        let text = include_str!("../../tests/benches/fill.sql");
        let text = text
            .replace(":jobs", &jobs.to_string())
            .replace(":materials", &materials.to_string())
            .replace(":measurement_document", "repeat(md5(CAST(i AS TEXT)), 20)")
            .replace(":material_document", "repeat(md5(CAST(i AS TEXT)), 75)");
        connection.execute(sqlx::AssertSqlSafe(text)).await.unwrap();
        connection.close().await.unwrap();
    }

    /// Lets all announcements of objects that are being written expire now.
    pub(crate) async fn expire_intents(catalog: &Catalog) {
        sqlx::query("UPDATE intents SET expires_at = 0").execute(&catalog.pool).await.unwrap();
    }

    /// Shortens waiting times of hours to seconds, for a test. An announcement lasts for 1 s. An object is deleted 2 s
    /// after its announcement expired, or 1 s after another object took its place or its removal failed.
    pub(crate) async fn hurry(catalog: &Catalog) {
        for statement in [
            "UPDATE intents SET expires_at = {now} + 1000 WHERE expires_at > {now} + 60000",
            "UPDATE doomed SET not_before = {now} + CASE WHEN not_before > {now} + 43200000 THEN 2000 ELSE 1000 END \
             WHERE not_before > {now} + 60000",
        ] {
            let _turn = catalog.turn().await;
            sqlx::query(catalog.sql(statement)).execute(&catalog.pool).await.unwrap();
        }
    }

    /// Makes a test's catalog on PostgreSQL record each start of a job, in the order in which they happen.
    pub(crate) async fn record_starts(catalog: &Catalog) {
        let text = "CREATE TABLE starts (number BIGSERIAL, job TEXT, is_mark BOOLEAN); \
             CREATE FUNCTION record_start() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN \
             INSERT INTO starts (job, is_mark) VALUES (NEW.id, FALSE); RETURN NULL; END $$; \
             CREATE TRIGGER started AFTER UPDATE ON jobs FOR EACH ROW \
             WHEN (OLD.state = 'queued' AND NEW.state = 'running') EXECUTE FUNCTION record_start()";
        catalog.pool.execute(text).await.unwrap();
    }

    /// Records, in the order of the recorded starts, that the client that queued a job has its answer. Workers see the
    /// job a little earlier: when its transaction has ended, which no statement of that transaction can tell.
    pub(crate) async fn record_answer(catalog: &Catalog, job: &str) {
        let mark = sqlx::query("INSERT INTO starts (job, is_mark) VALUES ($1, TRUE)").bind(job.to_owned());
        mark.execute(&catalog.pool).await.unwrap();
    }

    /// Returns the number of jobs that were started after [`record_answer`] for a job and before that job was started.
    pub(crate) async fn started_before(catalog: &Catalog, job: &str) -> i64 {
        let count = "SELECT COUNT(*) FROM starts WHERE NOT is_mark \
             AND number > (SELECT number FROM starts WHERE job = $1 AND is_mark) \
             AND number < (SELECT number FROM starts WHERE job = $1 AND NOT is_mark)";
        sqlx::query(count).bind(job.to_owned()).fetch_one(&catalog.pool).await.unwrap().try_get(0).unwrap()
    }

    /// Drops a table of the catalog, so that statements about it fail.
    pub(crate) async fn drop_table(catalog: &Catalog, table: &str) {
        catalog.pool.execute(sqlx::AssertSqlSafe(format!("DROP TABLE {table}"))).await.unwrap();
    }

    /// Returns the number of rows of a table of the catalog.
    pub(crate) async fn count(catalog: &Catalog, table: &str) -> i64 {
        let query = sqlx::AssertSqlSafe(format!("SELECT COUNT(*) FROM {table}"));
        sqlx::query(query).fetch_one(&catalog.pool).await.unwrap().try_get(0).unwrap()
    }
}
