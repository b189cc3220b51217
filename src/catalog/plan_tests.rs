//! Plans of the catalog's own statements over many rows, as PostgreSQL reports them (`auto_explain`) while the catalog
//! works: with and without statistics, planned for the values at hand and for any.

use super::testing::{self, measurement, publish};
use super::*;
use crate::domain::Quantity;
use crate::store::{Digest, Object};
use serde_json::Value;
use sqlx::{Executor, Row};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tracing::field::{Field, Visit};
use tracing::{Event, Metadata, Subscriber, span};

const JOBS: u32 = 100_000;
const MATERIALS: u32 = 10_000;
const MINUTE: Duration = Duration::from_mins(1);
const DAY: Duration = Duration::from_hours(24);

/// Tables that grow with the number of stored objects and jobs. No query plan may read one of them as a whole.
const GROWING: [&str; 10] = [
    "blobs",
    "intents",
    "doomed",
    "unnamed",
    "measurements",
    "materials",
    "material_sources",
    "material_tags",
    "jobs",
    "idempotency_keys",
];

/// Upper bounds on the rows that one node of a query plan reads: `FEW` for statements that workers repeat all the time,
/// `SOME` for others. One of those lists the failed jobs (one in twenty), which stand behind those that wait.
const FEW: f64 = 250.0;
const SOME: f64 = 8000.0;

/// Upper bound in place of `SOME` for the largest tested catalog. A list of ended jobs there reads past more than
/// 10,000 that wait or run.
const MANY: f64 = 16_000.0;

/// Number of rows that a sweep takes at a time, below [`FEW`], the bound on the rows that its plans may read.
const BATCH: u32 = 200;

/// Statement that makes PostgreSQL deliver its pending reports. Its own plan reads no table and is ignored.
const FLUSH: &str = "SELECT 1 AS flush";

/// Log subscriber that keeps the messages which PostgreSQL sends to its client, such as query plans.
#[derive(Clone, Debug, Default)]
struct Reports(Arc<Mutex<Vec<String>>>);

struct Message<'a>(&'a Reports);

impl Visit for Message<'_> {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            self.0.0.lock().unwrap_or_else(PoisonError::into_inner).push(format!("{value:?}"));
        }
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        if field.name() == "message" {
            self.0.0.lock().unwrap_or_else(PoisonError::into_inner).push(value.to_owned());
        }
    }
}

impl Subscriber for Reports {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == "sqlx::postgres::notice"
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn event(&self, event: &Event<'_>) {
        event.record(&mut Message(self));
    }

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}

/// Catalog whose statements PostgreSQL explains as it runs them.
struct Explained {
    catalog: Catalog,
    reports: Reports,
    /// Upper bound on the rows that one node of a query plan reads, for statements that are not repeated all the time.
    most: f64,
    /// Text before each reported fault, which names the settings of the check.
    about: String,
    faults: Vec<String>,
}

impl Explained {
    async fn open(place: &Database, mode: &str, most: f64, reports: &Reports) -> Self {
        let Database::Server(url) = place else { panic!("{place}") };
        let settings = [
            "session_preload_libraries]=auto_explain",
            "plan_cache_mode]=MODE",
            "auto_explain.log_min_duration]=0",
            "auto_explain.log_level]=warning",
            "auto_explain.log_format]=json",
            "auto_explain.log_analyze]=on",
            "auto_explain.log_timing]=off",
            "auto_explain.log_nested_statements]=on",
        ];
        let url = settings
            .iter()
            .fold(url.clone(), |url, setting| format!("{url}&options[{}", setting.replace("MODE", mode)));
        let catalog = Catalog::connect(&Database::Server(url), 1).await.unwrap();
        Self { catalog, reports: reports.clone(), most, about: mode.to_owned(), faults: Vec::new() }
    }

    /// Awaits an operation of the catalog, and checks the query plans of all its statements and of the foreign keys
    /// behind them. No plan may sort, unless `may_sort` is true.
    async fn check<T>(&mut self, name: &str, most: f64, may_sort: bool, operation: impl Future<Output = T>) -> T {
        self.catalog.pool.execute(FLUSH).await.unwrap();
        self.reports.0.lock().unwrap().clear();
        let done = operation.await;
        // Reports follow the rows: the next statement on the connection takes in those that are still on their way.
        self.catalog.pool.execute(FLUSH).await.unwrap();
        let reports = std::mem::take(&mut *self.reports.0.lock().unwrap());
        let mut plans = 0;
        for report in reports {
            let Some((_, plan)) = report.split_once("plan:\n") else { continue };
            let plan: Value = serde_json::from_str(plan).unwrap();
            if plan["Query Text"] == FLUSH {
                continue;
            }
            plans += 1;
            let mut nodes = vec![&plan["Plan"]];
            while let Some(node) = nodes.pop() {
                nodes.extend(node["Plans"].as_array().into_iter().flatten());
                let kind = node["Node Type"].as_str().unwrap();
                let number = |key: &str| node[key].as_f64().unwrap_or(0.0);
                let rows =
                    (number("Actual Rows") + number("Rows Removed by Filter") + number("Rows Removed by Join Filter"))
                        * number("Actual Loops");
                let table = node["Relation Name"].as_str();
                let grows = table.is_some_and(|table| GROWING.contains(&table));
                let fault = if kind == "Seq Scan" && grows {
                    "reads a whole table"
                } else if kind.contains("Sort") && !may_sort {
                    "sorts"
                } else if rows > most && (grows || table.is_none()) {
                    "reads too many rows"
                } else {
                    continue;
                };
                self.faults.push(format!("{} {name}: {fault}: {rows} rows in {kind} of {plan:#}", self.about));
                break;
            }
        }
        assert!(plans > 0, "{name}: PostgreSQL reported no plan");
        done
    }
}

/// Returns the ids of the newest jobs in a state (at most 100), newest first.
async fn ids(catalog: &Catalog, state: JobState) -> Vec<String> {
    let filter = JobFilter { state: Some(state), measurement: None };
    catalog.jobs(&filter, None, 100).await.unwrap().items.into_iter().map(|row| row.id).collect()
}

async fn number(catalog: &Catalog, query: &'static str) -> i64 {
    sqlx::query(query).fetch_one(&catalog.pool).await.unwrap().try_get(0).unwrap()
}

/// Checks the query plans of operations that workers and uploads repeat all the time.
async fn work(on: &mut Explained) {
    let catalog = on.catalog.clone();
    let lamp = measurement(&format!("lamp {}", on.about));
    let claim = on.check("intend", FEW, false, publish(&catalog, lamp.content, 9)).await;
    let object = Object::fresh(catalog.tenant(), lamp.content);
    catalog.intend(&object, 9, MINUTE).await.unwrap();
    assert!(on.check("prolong", FEW, false, catalog.prolong(&object, MINUTE)).await.unwrap());
    on.check("name", FEW, false, catalog.add_measurement(&lamp, &claim)).await.unwrap();
    for round in 0..7 {
        let job = on.check("claim", FEW, false, catalog.claim("worker", MINUTE, &[])).await.unwrap().unwrap();
        assert_eq!(on.check("beat", FEW, false, catalog.beat(&job, 0.5, MINUTE)).await.unwrap(), Beat::Yours(false));
        let new = NewMaterial {
            id: Digest::of(format!("{} {round}", on.about).as_bytes()),
            payload: Digest::of(b"payload"),
            quantity: Quantity::Edf,
            bytes: 10,
            name: Some("lamp".to_owned()),
            tags: vec!["office".to_owned()],
            measurements: vec![lamp.id],
            document: serde_json::Map::new(),
        };
        let claim = publish(&catalog, new.id, 10).await;
        let ended = Ended::Material(Box::new(new), claim);
        assert_eq!(
            on.check("end", FEW, false, catalog.end(&job, &ended)).await.unwrap(),
            Ending::Now(JobState::Succeeded)
        );
    }
    let gone = if on.about.contains("custom") { "worker 7" } else { "worker 9" }.to_owned();
    let reaped = on.check("reap", on.most, false, catalog.reap(&[gone], true, 9, "{}")).await;
    assert!(!reaped.unwrap().is_empty());
    let share = "10.0.0.1".to_owned();
    for round in 0..7 {
        let (id, key) = (format!("{} {round}", on.about), format!("{} {round}", on.about));
        let idempotency = Some((key, Digest::of(b"request")));
        let new = NewJob {
            id,
            frame: "00".to_owned(),
            measurement: Some(lamp.id),
            share: share.clone(),
            idempotency,
            priority: Priority::Usual,
            level: 1,
        };
        let queued = on.check("enqueue", on.most, false, catalog.enqueue(&new, 10_000)).await.unwrap();
        assert!(matches!(queued, Enqueued::New(_)));
    }
}

/// Checks the query plans of the lists and rows that clients and the watcher of an API node read.
async fn look(on: &mut Explained) {
    let catalog = on.catalog.clone();
    for state in JobState::ALL {
        let filter = JobFilter { state: Some(state), measurement: None };
        let page = on.check(state.name(), on.most, true, catalog.jobs(&filter, None, 100)).await.unwrap();
        assert!(!page.items.is_empty(), "{}", state.name());
    }
    let all = on.check("jobs", FEW, false, catalog.jobs(&JobFilter::default(), None, 100)).await.unwrap();
    let next =
        on.check("next jobs", FEW, false, catalog.jobs(&JobFilter::default(), all.next.clone(), 100)).await.unwrap();
    assert!(next.items[0].id < all.items[0].id);
    let made = catalog.materials(&MaterialFilter::default(), None, 100).await.unwrap();
    let lamp = made.items[99].measurements[0];
    let old = Some(lamp);
    let filter = JobFilter { state: None, measurement: old };
    assert!(!on.check("jobs of", FEW, true, catalog.jobs(&filter, None, 100)).await.unwrap().items.is_empty());

    let followed: Vec<String> = all.items.iter().map(|row| row.id.clone()).collect();
    assert_eq!(on.check("seen", FEW, false, catalog.seen(&followed)).await.unwrap().len(), 100);
    on.check("watch", FEW, false, catalog.watch(&followed, MINUTE)).await.unwrap();
    on.check("counts", f64::INFINITY, false, catalog.job_counts()).await.unwrap();
    let (queued, dead) = (ids(&catalog, JobState::Queued).await, ids(&catalog, JobState::Dead).await);
    on.check("cancel", FEW, false, catalog.cancel(&queued[50])).await.unwrap().unwrap();
    assert!(matches!(
        on.check("retry", FEW, false, catalog.retry(&dead[0], 1 << 40)).await.unwrap(),
        Retried::Queued(_)
    ));

    let (tag, q) = (|text: &str| Some(text.to_owned()), |text: &str| Some(text.to_owned()));
    let plain = MaterialFilter::default;
    let filters = [
        ("materials", plain()),
        ("quantity", MaterialFilter { quantity: Some(Quantity::Brdf), ..plain() }),
        ("rare quantity", MaterialFilter { quantity: Some(Quantity::Edf), ..plain() }),
        ("materials of", MaterialFilter { measurement: old, ..plain() }),
        ("tag", MaterialFilter { tag: tag("tag7"), ..plain() }),
        ("rare tag", MaterialFilter { tag: tag("rare"), ..plain() }),
        ("missing tag", MaterialFilter { tag: tag("nowhere"), ..plain() }),
        ("q", MaterialFilter { q: q("sample"), ..plain() }),
        ("rare q", MaterialFilter { q: q("rare"), ..plain() }),
        ("missing q", MaterialFilter { q: q("nowhere"), ..plain() }),
    ];
    for (name, filter) in filters {
        let page = on.check(name, on.most, true, catalog.materials(&filter, None, 100)).await.unwrap();
        assert_eq!(page.items.is_empty(), name.starts_with("missing"), "{name}");
        assert!(page.items.iter().all(|row| row.measurements.len() == 1));
    }
    let plain = MeasurementFilter::default;
    let filters = [
        ("measurements", plain()),
        ("format", MeasurementFilter { format: Some("csv".to_owned()), ..plain() }),
        ("rare format", MeasurementFilter { format: Some("ies".to_owned()), ..plain() }),
        ("rare quantity of measurements", MeasurementFilter { quantity: Some(Quantity::Edf), ..plain() }),
        ("q of measurements", MeasurementFilter { q: q("sample"), ..plain() }),
        ("rare q of measurements", MeasurementFilter { q: q("sample-777.csv"), ..plain() }),
    ];
    for (name, filter) in filters {
        assert!(
            !on.check(name, on.most, true, catalog.measurements(&filter, None, 100)).await.unwrap().items.is_empty()
        );
    }
    on.check("measurement", FEW, false, catalog.measurement(lamp)).await.unwrap().unwrap();
    assert!(matches!(
        on.check("delete", FEW, false, catalog.delete_measurement(lamp)).await.unwrap(),
        Deleted::InUse(_)
    ));
    let page = catalog.materials(&MaterialFilter::default(), None, 1).await.unwrap();
    let made = page.items[0].id;
    on.check("material", FEW, false, catalog.material(made)).await.unwrap().unwrap();
    on.check("namer", FEW, true, catalog.namer(made)).await.unwrap().unwrap();
    let reader = testing::other(&catalog, "reader").await;
    assert_eq!(on.check("hidden", FEW, true, reader.sees(made)).await.unwrap(), None);
    let opening = Opening { is_public: Some(true), readers: Some(vec![reader.tenant().clone()]) };
    let opened = on.check("open", FEW, false, catalog.open_material(made, &opening)).await.unwrap();
    assert_eq!(opened, Opened::Done);
    on.check("sees", FEW, true, reader.sees(made)).await.unwrap().unwrap();
    let all = MaterialFilter::default();
    for sight in [Sight::Shared, Sight::Public] {
        let page = reader.visible_materials(sight, &all, None, 100);
        assert_eq!(on.check("visible", on.most, true, page).await.unwrap().items.len(), 1);
    }
    let blob = on.check("blob", FEW, false, catalog.blob(made)).await.unwrap().unwrap();
    assert!(on.check("knows", FEW, false, catalog.knows(&blob.object)).await.unwrap());
    assert_eq!(on.check("delete", FEW, false, catalog.delete_material(made)).await.unwrap(), Deleted::Done);
    assert!(matches!(on.check("doom", FEW, false, catalog.doom_unnamed(made, MINUTE)).await.unwrap(), Doom::Doomed(_)));
}

/// Checks the query plans of a sweep, the removal of unused stored objects.
async fn sweep(on: &mut Explained) {
    let catalog = on.catalog.clone();
    assert!(on.check("expired intents", FEW, false, catalog.doom_expired(BATCH, DAY)).await.unwrap() > 9);
    let unnamed = on.check("unnamed", FEW, false, catalog.unnamed(BATCH)).await.unwrap();
    assert!(unnamed.len() > 9);
    let (_, unnamed) = unnamed[0];
    assert_eq!(on.check("named", FEW, false, catalog.doom_unnamed(unnamed, DAY)).await.unwrap(), Doom::Named);
    let due: Vec<Object> = on
        .check("doomed", FEW, false, catalog.take_doomed(BATCH, MINUTE))
        .await
        .unwrap()
        .into_iter()
        .map(|due| due.0)
        .collect();
    assert!(due.len() > 99);
    on.check("deleted", FEW, false, catalog.deleted(&due)).await.unwrap();
    let undated = "UPDATE material_tags SET created_at = NULL WHERE material IN (SELECT id FROM materials \
                   ORDER BY created_at DESC LIMIT 100)";
    catalog.pool.execute(undated).await.unwrap();
    let tag = MaterialFilter { tag: Some("tag7".to_owned()), ..MaterialFilter::default() };
    let page = on.check("tag of an older program", on.most, true, catalog.materials(&tag, None, 100)).await.unwrap();
    assert_eq!(page.items.len(), 100);
    assert!(on.check("date tags", FEW, false, catalog.date_tags(BATCH)).await.unwrap() > 99);
    on.check("blobs for a check", FEW, false, catalog.blobs_beginning(Some(7), None, 200)).await.unwrap();
    let jobs = number(&catalog, "SELECT COUNT(*) FROM jobs").await;
    let succeeded = number(
        &catalog,
        "SELECT CAST(EXTRACT(EPOCH FROM now()) * 1000 AS BIGINT) - updated_at FROM jobs WHERE state = 'succeeded' \
         AND state NOT IN ('queued', 'running') ORDER BY updated_at OFFSET 1100 LIMIT 1",
    );
    let succeeded = Duration::from_millis(succeeded.await as u64);
    let keys = number(
        &catalog,
        "SELECT CAST(EXTRACT(EPOCH FROM now()) * 1000 AS BIGINT) - created_at FROM idempotency_keys \
         ORDER BY created_at OFFSET 1100 LIMIT 1",
    );
    let keys = Duration::from_millis(keys.await as u64);
    let ages = Retention { succeeded, failed: succeeded, keys, acts: succeeded };
    let forgotten = on.check("retention", on.most, false, catalog.forget(&ages)).await.unwrap();
    assert!(forgotten > 999);
    assert_eq!(number(&catalog, "SELECT COUNT(*) FROM jobs").await, jobs - forgotten as i64);
}

#[tokio::test]
async fn no_statement_reads_a_table_from_one_end_to_the_other() {
    let mut faults = Vec::new();
    for analysed in [true, false] {
        let place = testing::server().await;
        let catalog = Catalog::migrate(&place, false).await.unwrap().0;
        let off = GROWING.map(|table| format!("ALTER TABLE {table} SET (autovacuum_enabled = off)")).join("; ");
        testing::fill(&place, JOBS, MATERIALS, if analysed { "" } else { &off }).await;
        if analysed {
            catalog.pool.execute("ANALYZE").await.unwrap();
        }
        let reports = Reports::default();
        let _guard = tracing::subscriber::set_default(reports.clone());
        for mode in ["force_custom_plan", "force_generic_plan"] {
            let mut on = Explained::open(&place, mode, SOME, &reports).await;
            on.about = format!("{mode}, {}", if analysed { "with statistics" } else { "without statistics" });
            work(&mut on).await;
            // Without statistics a list may sort all that its filter leaves.
            on.most = if analysed { SOME } else { f64::INFINITY };
            look(&mut on).await;
            on.most = SOME;
            if mode == "force_custom_plan" {
                sweep(&mut on).await;
            }
            faults.append(&mut on.faults);
        }
    }
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}

/// Prints the median and the 99th percentile of the durations of an operation.
fn tell(name: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let at = |part: usize| times[(times.len() * part / 100).min(times.len() - 1)].as_secs_f64() * 1e3;
    println!("  {name}: median {:.2} ms, 99 % within {:.2} ms, of {}", at(50), at(99), times.len());
}

async fn timed<T>(times: &mut Vec<Duration>, operation: impl Future<Output = T>) -> T {
    let start = Instant::now();
    let done = operation.await;
    times.push(start.elapsed());
    done
}

#[tokio::test]
#[ignore = "needs the large catalog that tests/nights/sizes makes"]
async fn plans_and_times_at_size() {
    let url =
        std::env::var("WAVELUME_SIZES_DATABASE").expect("WAVELUME_SIZES_DATABASE is not set: run tests/nights/sizes");
    let place = Database::Server(url);
    let catalog = Catalog::open_few(&place).await.unwrap();
    let (mut claims, mut beats, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..2000 {
        let job = timed(&mut claims, catalog.claim("worker", MINUTE, &[])).await.unwrap().unwrap();
        timed(&mut beats, catalog.beat(&job, 0.5, MINUTE)).await.unwrap();
        timed(&mut ends, catalog.end(&job, &Ended::Failed("{}".to_owned()))).await.unwrap();
    }
    tell("claim", claims);
    tell("beat", beats);
    tell("end", ends);
    let lamp = measurement("lamp at size");
    testing::add(&catalog, &lamp).await;
    let mut queued = Vec::new();
    for round in 0..1000 {
        let id = format!("enqueued {round}");
        let share = format!("10.0.0.{}", round % 50);
        let new = NewJob {
            id,
            frame: "00".to_owned(),
            measurement: Some(lamp.id),
            share,
            idempotency: None,
            priority: Priority::Usual,
            level: 1,
        };
        timed(&mut queued, catalog.enqueue(&new, 1_000_000)).await.unwrap();
    }
    tell("enqueue", queued);
    // The service has swept what was due.
    for statement in [
        "UPDATE intents SET expires_at = 0 WHERE object IN (SELECT object FROM intents LIMIT 100)",
        "UPDATE doomed SET not_before = 0 WHERE object IN (SELECT object FROM doomed LIMIT 200)",
        "UPDATE unnamed SET not_before = 0 WHERE digest IN (SELECT digest FROM unnamed LIMIT 100)",
    ] {
        catalog.pool.execute(statement).await.unwrap();
    }
    let reports = Reports::default();
    let _guard = tracing::subscriber::set_default(reports.clone());
    let mut faults = Vec::new();
    for mode in ["force_custom_plan", "force_generic_plan"] {
        let mut on = Explained::open(&place, mode, MANY, &reports).await;
        work(&mut on).await;
        look(&mut on).await;
        if mode == "force_custom_plan" {
            sweep(&mut on).await;
        }
        faults.append(&mut on.faults);
    }
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));
}
