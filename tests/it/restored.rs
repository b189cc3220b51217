//! A dump of PostgreSQL restored beside the running original: the copy is refused, and no byte goes, neither by it nor,
//! after it has taken the store over, by the original.

use crate::service::{CHECKER, D65, LAMP, damage, listed};
use reqwest::Client;
use serde_json::{Value, json};
use sqlx::Connection;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

fn variable(name: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| panic!("{name} is not set: run the tests as `tests/servers cargo test …`"))
}

/// The program with a database and a store.
#[derive(Clone)]
struct Site {
    data: PathBuf,
    database: String,
    store: String,
}

/// A running node or worker, killed at the end of the test.
struct Process {
    child: Child,
    base: String,
    log: PathBuf,
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Site {
    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
        command.args(words).arg("--data").arg(&self.data);
        command.args(["--database", &self.database, "--store", &self.store]).env_remove("RUST_LOG");
        command
    }

    /// Runs a command to its end. Returns true if it succeeded, and its output.
    fn run(&self, words: &[&str]) -> (bool, String) {
        let output = self.command(words).output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
        (output.status.success(), text)
    }

    /// Starts a process that looks for deleted bytes each second and keeps none for a time of grace.
    fn start(&self, name: &str, words: &[&str]) -> Process {
        let log = self.data.join(name);
        let mut child = self
            .command(words)
            .args(["--sweep", "1s", "--grace", "0s"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(File::create(&log).unwrap())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        Process { base: line.trim().trim_start_matches("listening on ").to_owned(), child, log }
    }

    /// Returns the names of all stored bytes.
    async fn objects(&self) -> BTreeSet<String> {
        let (bucket, prefix) = self.store.trim_start_matches("s3://").split_once('/').unwrap();
        listed(bucket, &format!("{prefix}/blobs")).await.into_iter().collect()
    }
}

impl Process {
    async fn upload(&self, query: &str, bytes: &'static [u8]) -> String {
        let url = format!("{}/v1/measurements{query}", self.base);
        let answer = Client::new().post(url).body(bytes).send().await.unwrap().error_for_status().unwrap();
        answer.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned()
    }

    async fn delete(&self, id: &str) {
        let url = format!("{}/v1/measurements/{id}", self.base);
        Client::new().delete(url).send().await.unwrap().error_for_status().unwrap();
    }

    async fn compress(&self, id: &str) -> String {
        let body = json!({ "measurement": id, "target": { "er_l2": 0.01 } });
        let request = Client::new().post(format!("{}/v1/jobs", self.base)).header("prefer", "wait=60").json(&body);
        let job: Value = request.send().await.unwrap().json().await.unwrap();
        job["material"].as_str().unwrap_or_else(|| panic!("{job}")).to_owned()
    }

    async fn content(&self, path: &str) -> Vec<u8> {
        let answer = Client::new().get(format!("{}{path}", self.base)).send().await.unwrap();
        answer.error_for_status().unwrap().bytes().await.unwrap().to_vec()
    }

    fn said(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap()
    }
}

/// Waits until the condition holds.
async fn until(mut condition: impl AsyncFnMut() -> bool) {
    while !condition().await {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// Creates two databases in the server of the tests, and returns their URLs.
async fn databases() -> [String; 2] {
    let url = variable("WAVELUME_TEST_DATABASE");
    let (server, _) = url.rsplit_once('/').unwrap();
    let name = uuid::Uuid::now_v7().simple().to_string();
    sqlx::any::install_default_drivers();
    let mut connection = sqlx::AnyConnection::connect(&url).await.unwrap();
    let names = ["original", "restored"].map(|kind| format!("{kind}_{name}"));
    for name in &names {
        let statement = format!("CREATE DATABASE {name} TEMPLATE template0 ENCODING 'UTF8' LOCALE 'C'");
        sqlx::raw_sql(sqlx::AssertSqlSafe(statement)).execute(&mut connection).await.unwrap();
    }
    connection.close().await.unwrap();
    names.map(|name| format!("{server}/{name}"))
}

fn dump_and_restore(from: &str, to: &str, scratch: &Path) {
    let programs = PathBuf::from(variable("WAVELUME_TEST_POSTGRES"));
    let dump = scratch.join("dump.sql");
    let dumped = Command::new(programs.join("pg_dump")).arg("--file").arg(&dump).arg(from).status().unwrap();
    assert!(dumped.success());
    let mut restore = Command::new(programs.join("psql"));
    let restore = restore.args(["-q", "-v", "ON_ERROR_STOP=1", "--output=/dev/null", "--file"]).arg(&dump).arg(to);
    assert!(restore.status().unwrap().success());
}

async fn instance(database: &str) -> String {
    let mut connection = sqlx::AnyConnection::connect(database).await.unwrap();
    let (id,): (String,) =
        sqlx::query_as("SELECT value FROM facts WHERE name = 'instance'").fetch_one(&mut connection).await.unwrap();
    id
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restored_dump_beside_the_running_original_costs_no_byte() {
    wavelume::store::provide_tls();
    let scratch = tempfile::tempdir().unwrap();
    let [original, restored] = databases().await;
    let store = format!("{}/{}", variable("WAVELUME_TEST_STORE"), uuid::Uuid::now_v7().simple());
    let data = |name: &str| {
        let data = scratch.path().join(name);
        std::fs::create_dir(&data).unwrap();
        data
    };
    let site = Site { data: data("original"), database: original.clone(), store: store.clone() };
    let copy = Site { data: data("copy"), database: restored.clone(), store };
    assert!(site.run(&["migrate"]).0);
    let node = site.start("node.log", &["serve", "--listen", "127.0.0.1:0"]);
    let worker = site.start("worker.log", &["worker"]);
    let lamp = node.upload("", LAMP).await;
    let spectrum = node.upload("?filename=d65.csv", D65).await;
    let material = node.compress(&spectrum).await;
    let checker = node.upload("?quantity=reflectance", CHECKER).await;
    let content = node.content(&format!("/v1/materials/{material}/content")).await;

    dump_and_restore(&original, &restored, scratch.path());
    // The original goes on: its collector takes what the copy still names.
    node.delete(&checker).await;
    until(async || site.objects().await.len() == 3).await;
    let before = site.objects().await;
    let id = instance(&original).await;
    assert_eq!(instance(&restored).await, id, "a dump has the id of its original");

    let wrong = uuid::Uuid::now_v7().to_string();
    let adopting = ["--adopt-store", wrong.as_str()];
    for words in [&["fsck"][..], &["gc", "--now"], &["worker"], &["serve", "--listen", "127.0.0.1:0"]] {
        for extra in [&[][..], &adopting] {
            let (succeeded, said) = copy.run(&[words, extra].concat());
            let parts = ["a restored dump", &format!("copy of the catalog {id}"), &format!("belongs to {id}")];
            assert!(!succeeded && parts.iter().all(|part| said.contains(part)), "{words:?}: {said}");
            assert!(said.contains(&format!("--adopt-store {id}")), "{said}");
        }
    }
    assert_eq!(site.objects().await, before, "a refused copy deletes nothing");
    assert!(site.run(&["fsck"]).0);

    // The copy takes the store over, while the original still runs and has something to delete.
    let (succeeded, said) = copy.run(&["gc", "--adopt-store", &id]);
    assert!(succeeded && said.contains("the store was taken over"), "{said}");
    let new = instance(&restored).await;
    assert!(new != id && instance(&original).await == id);
    let refusal = format!("belongs to the catalog {new}, but the catalog {original} is {id}");
    node.delete(&lamp).await;
    until(async || node.said().contains(&refusal) || worker.said().contains(&refusal)).await;
    let (succeeded, said) = site.run(&["gc", "--now"]);
    assert!(!succeeded && said.contains(&refusal) && said.contains(&format!("--adopt-store {new}")), "{said}");
    assert_eq!(site.objects().await, before, "the original deletes nothing any more");
    drop((node, worker));

    let node = copy.start("node.log", &["serve", "--listen", "127.0.0.1:0"]);
    assert_eq!(node.content(&format!("/v1/measurements/{lamp}/content")).await, LAMP);
    assert_eq!(node.content(&format!("/v1/materials/{material}/content")).await, content);
    // Uploaded again, the bytes that the original has deleted since the dump are back.
    node.upload("?quantity=reflectance", CHECKER).await;
    let (succeeded, said) = copy.run(&["fsck"]);
    assert!(succeeded, "{said}");
    // The test would see a byte that goes.
    damage(before.first().unwrap(), None).await;
    assert!(!copy.run(&["fsck"]).0);
}
