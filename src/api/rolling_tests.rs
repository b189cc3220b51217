//! A rolling update and its rollback, under load: this program beside the next one, which has one more migration in two
//! files and one more version of jobs.

use super::{ServeConfig, ServeError, Server, Stop};
use crate::catalog::{Catalog, EDITION, Edition, Enqueued, NewJob, PROGRAM, Priority, testing};
use crate::jobs::{Archive, Site};
use crate::store::contract;
use reqwest::Client;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// Edition of a newer program for the test. Two more migrations add a column that may be null and, while others write,
/// an index. The newer program also runs one higher version of job arguments.
const NEXT: Edition = Edition {
    migrations: &[
        EDITION.migrations[0],
        EDITION.migrations[1],
        EDITION.migrations[2],
        EDITION.migrations[3],
        EDITION.migrations[4],
        EDITION.migrations[5],
        EDITION.migrations[6],
        ("0008_note", "ALTER TABLE jobs ADD COLUMN note TEXT;"),
        ("0009_jobs_by_note", "CREATE INDEX IF NOT EXISTS jobs_by_note ON jobs (note) WHERE note IS NOT NULL;"),
    ],
    level: EDITION.level + 1,
};

/// Encoded arguments of a job of kind `paper` that makes table 2.
const FRAME: &str = "01000000010000000000000002";

/// Number of looks at a state, 20 ms apart, after which a test gives up.
const LOOKS: usize = 6000;

/// Number of jobs of the load that wait or run at the same time.
const WAITING: usize = 3;

/// Running service of the test, which stands for a process of this program or of the newer one.
struct Node {
    base: String,
    stop: oneshot::Sender<()>,
    running: JoinHandle<Result<(), ServeError>>,
}

impl Node {
    async fn start(edition: Edition, site: &Site, workers: usize) -> Self {
        let mut config = ServeConfig::new(&site.data, ([127, 0, 0, 1], 0).into());
        config.work.site = site.clone();
        config.work.workers = workers;
        let server = PROGRAM.scope(edition, Server::bind(config)).await.unwrap();
        let (stop, stopped) = oneshot::channel();
        let base = format!("http://{}", server.address());
        // Requests that a balancer has sent meanwhile are still answered.
        let stopped = async {
            let _ = stopped.await;
            Stop::Announced
        };
        Self { base, stop, running: tokio::spawn(server.run(stopped)) }
    }

    async fn stop(self) {
        self.stop.send(()).unwrap();
        self.running.await.unwrap().unwrap();
    }
}

/// Continuous load of a test: the jobs that it has queued, and the nodes that it asks in turn, as a load balancer does.
#[derive(Default)]
struct Load {
    nodes: Mutex<Vec<String>>,
    jobs: Mutex<Vec<String>>,
    ended: Mutex<bool>,
}

impl Load {
    fn node(&self, turn: usize) -> String {
        let nodes = self.nodes.lock().unwrap();
        nodes[turn % nodes.len()].clone()
    }

    fn add(&self, node: &Node) {
        self.nodes.lock().unwrap().push(node.base.clone());
    }

    /// Sends no further request to a node that will be stopped.
    async fn remove(&self, node: Node) {
        self.nodes.lock().unwrap().retain(|base| *base != node.base);
        node.stop().await;
    }

    /// Queues jobs and looks them up, each through another node, until the test ends. No answer may be an error.
    async fn run(self: Arc<Self>, client: Client) {
        let body = json!({ "measurement": upload(&client, &self.node(0)).await, "target": { "er_l2": 0.01 } });
        for turn in 0_usize.. {
            if *self.ended.lock().unwrap() {
                return;
            }
            // A few wait or run at any time.
            if let Some(earlier) = turn.checked_sub(WAITING) {
                self.end_of(&client, earlier).await;
            }
            let posted = client.post(format!("{}/v1/jobs", self.node(turn)));
            let posted = posted.json(&body).send().await.unwrap();
            assert_eq!(posted.status(), 202);
            let job: Value = posted.json().await.unwrap();
            let path = job["links"]["self"].as_str().unwrap().to_owned();
            let found = client.get(format!("{}{path}", self.node(turn + 1))).send().await.unwrap();
            assert_eq!(found.status(), 200);
            self.jobs.lock().unwrap().push(path);
        }
    }

    /// Waits until job `number` of the load, counted from 0, has ended, and returns the description of the job.
    async fn end_of(&self, client: &Client, number: usize) -> Value {
        for _ in 0..LOOKS {
            tokio::time::sleep(Duration::from_millis(20)).await;
            let Some(path) = self.jobs.lock().unwrap().get(number).cloned() else { continue };
            let found = client.get(format!("{}{path}", self.node(number))).send().await.unwrap();
            assert_eq!(found.status(), 200);
            let job: Value = found.json().await.unwrap();
            if !["queued", "running"].contains(&job["state"].as_str().unwrap()) {
                return job;
            }
        }
        panic!("job {number} never ends");
    }

    /// Waits until `more` jobs have succeeded that were queued from now on.
    async fn goes_on(&self, client: &Client, more: usize) {
        let before = self.jobs.lock().unwrap().len();
        for number in before..before + more {
            let ended = self.end_of(client, number).await;
            assert_eq!((&ended["state"], &ended["attempts"]), (&json!("succeeded"), &json!(1)), "{ended}");
        }
    }
}

async fn upload(client: &Client, base: &str) -> Value {
    let spectrum = "wavelength,a\n400,1\n410,2\n420,3\n430,2\n440,1\n";
    let sent = client.post(format!("{base}/v1/measurements?quantity=spectrum")).body(spectrum).send().await.unwrap();
    sent.json::<Value>().await.unwrap()["id"].clone()
}

async fn until<T>(mut look: impl AsyncFnMut() -> Option<T>) -> T {
    for _ in 0..LOOKS {
        if let Some(found) = look().await {
            return found;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("never");
}

/// Queues a job that only the next program understands.
async fn queue_newer(catalog: &Catalog) -> String {
    let id = uuid::Uuid::now_v7().to_string();
    let new = NewJob {
        id: id.clone(),
        frame: FRAME.to_owned(),
        level: NEXT.level,
        measurement: None,
        priority: Priority::Urgent,
        share: String::new(),
        idempotency: None,
    };
    assert!(matches!(catalog.enqueue(&new, 99).await.unwrap(), Enqueued::New(_)));
    id
}

async fn state(client: &Client, base: &str, id: &str) -> (String, i64) {
    let job: Value = client.get(format!("{base}/v1/jobs/{id}")).send().await.unwrap().json().await.unwrap();
    (job["state"].as_str().unwrap().to_owned(), job["attempts"].as_i64().unwrap())
}

async fn rolls(site: &Site) {
    let client = Client::builder().no_proxy().build().unwrap();
    let load = Arc::new(Load::default());
    let (old, old_worker) = (Node::start(EDITION, site, 0).await, Node::start(EDITION, site, 1).await);
    load.add(&old);
    let running = tokio::spawn(Arc::clone(&load).run(client.clone()));
    load.goes_on(&client, 2).await;

    // The schema first; the programs that run go on with it.
    assert_eq!(PROGRAM.scope(NEXT, Archive::migrate(site, false)).await.unwrap(), 2);
    let next_archive = PROGRAM.scope(NEXT, Archive::serve(site)).await.unwrap();
    let rows = testing::count(&next_archive.catalog, "jobs WHERE note IS NULL").await;
    assert!(rows >= 2, "{rows} rows have the new column");
    load.goes_on(&client, 3).await;

    // Nodes next; an old worker leaves a newer job alone, however urgent it is.
    let next = Node::start(NEXT, site, 0).await;
    load.add(&next);
    let newer = queue_newer(&next_archive.catalog).await;
    load.goes_on(&client, 3).await;
    assert_eq!(state(&client, &old.base, &newer).await, ("queued".to_owned(), 0));
    let next_worker = Node::start(NEXT, site, 1).await;
    until(async || (state(&client, &old.base, &newer).await.0 == "succeeded").then_some(())).await;
    load.goes_on(&client, 3).await;

    // Back again: the old program goes on with the newer schema, and starts with it.
    load.remove(next).await;
    next_worker.stop().await;
    let left = queue_newer(&next_archive.catalog).await;
    load.goes_on(&client, 3).await;
    let again = Node::start(EDITION, site, 0).await;
    load.add(&again);
    load.remove(old).await;
    assert_eq!(Archive::migrate(site, false).await.unwrap(), 0);
    load.goes_on(&client, 3).await;
    assert_eq!(state(&client, &again.base, &left).await, ("queued".to_owned(), 0));
    let cancelled = client.post(format!("{}/v1/jobs/{left}/cancel", again.base)).send().await.unwrap();
    assert_eq!(cancelled.status(), 200);

    *load.ended.lock().unwrap() = true;
    running.await.unwrap();
    // No job has failed, and none was tried twice.
    let all = load.jobs.lock().unwrap().len();
    for number in 0..all {
        let ended = load.end_of(&client, number).await;
        assert_eq!((&ended["state"], &ended["attempts"]), (&json!("succeeded"), &json!(1)), "{ended}");
    }
    for node in [again, old_worker] {
        node.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rolling_update_and_its_rollback_fail_no_job_on_one_machine() {
    crate::store::provide_tls();
    let data = tempfile::tempdir().unwrap();
    let site = Site::new(data.path());
    Archive::migrate(&site, false).await.unwrap();
    rolls(&site).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rolling_update_and_its_rollback_fail_no_job_on_postgresql_and_s3() {
    crate::store::provide_tls();
    let data = tempfile::tempdir().unwrap();
    let (database, store) = (Some(testing::server().await), Some(contract::bucket()));
    let site = Site { database, store, ..Site::new(data.path()) };
    Archive::migrate(&site, false).await.unwrap();
    rolls(&site).await;
}
