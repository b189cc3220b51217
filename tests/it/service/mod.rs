//! A real server on a free port, and a client that knows what answers look like.

pub(crate) mod certificates;

use futures::TryStreamExt;
use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt};
use reqwest::{Client, ClientBuilder, Method, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use sqlx::Connection;
use std::path::Path;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use wavelume::api::{ServeConfig, ServeError, Server};
use wavelume::store::Digest;
use wavelume::{Archive, Database};

/// Scheme of the names that tests give to objects in a bucket: `s3://BUCKET/KEY`.
const S3: &str = "s3://";

/// A running service; stop it to see how it ends.
pub(crate) struct Service {
    pub(crate) base: String,
    pub(crate) client: Client,
    stop: oneshot::Sender<()>,
    running: JoinHandle<Result<(), ServeError>>,
}

/// Builds the configuration of a service for tests. All of it is in `data`, or, with `WAVELUME_TEST_SITE=shared`, in a
/// PostgreSQL schema and an S3 prefix that belong to `data`.
pub(crate) fn config(data: &Path) -> ServeConfig {
    let mut config = ServeConfig::new(data, ([127, 0, 0, 1], 0).into());
    config.work.limits.drain = Duration::from_secs(5);
    if is_shared() {
        let name = Digest::of(data.as_os_str().as_encoded_bytes()).to_string();
        let server = |name: &str| {
            std::env::var(name)
                .unwrap_or_else(|_| panic!("{name} is not set: run the tests as `tests/servers cargo test …`"))
        };
        let url = server("WAVELUME_TEST_DATABASE");
        let mark = if url.contains('?') { '&' } else { '?' };
        let site = &mut config.work.site;
        site.database = Some(format!("{url}{mark}options[search_path]=h{}", &name[3..23]).parse().unwrap());
        site.store = Some(format!("{}/h{}", server("WAVELUME_TEST_STORE"), &name[3..23]).parse().unwrap());
    }
    config
}

/// Returns true if the services of this run use PostgreSQL and S3.
pub(crate) fn is_shared() -> bool {
    std::env::var("WAVELUME_TEST_SITE").is_ok_and(|site| site == "shared")
}

/// Makes the schema of a service's database, if it has one of its own, with its tables.
async fn prepare(config: &ServeConfig) {
    if make_schema(config).await {
        Archive::migrate(&config.work.site, false).await.unwrap();
    }
}

/// Makes the schema of a service's database, if it has one of its own, without a table. Returns true if it has.
pub(crate) async fn make_schema(config: &ServeConfig) -> bool {
    let Some(Database::Server(url)) = &config.work.site.database else { return false };
    let schema = url.rsplit_once('=').unwrap().1;
    sqlx::any::install_default_drivers();
    let mut connection = sqlx::AnyConnection::connect(url).await.unwrap();
    let statement = sqlx::AssertSqlSafe(format!("CREATE SCHEMA IF NOT EXISTS {schema}"));
    sqlx::query(statement).execute(&mut connection).await.unwrap();
    connection.close().await.unwrap();
    true
}

/// Returns the places of the stored objects whose digests, or the ids of whose uploads, begin so: paths, or addresses
/// in the S3 server.
pub(crate) async fn objects(data: &Path, digest: &str) -> Vec<String> {
    let mut found = Vec::new();
    if let Some(wavelume::Place::S3 { bucket, prefix }) = config(data).work.site.store {
        let listed = listed(&bucket, &prefix).await.into_iter();
        // The text with the id of the catalog lies beside the folders.
        found.extend(listed.filter(|name| name.contains("/blobs/") || name.contains("/uploads/")));
    } else {
        let mut folders = vec![data.join("blobs"), data.join("uploads")];
        while let Some(folder) = folders.pop() {
            // No upload has begun.
            let Ok(entries) = std::fs::read_dir(folder) else { continue };
            for entry in entries {
                let path = entry.unwrap().path();
                if path.is_dir() { folders.push(path) } else { found.push(path.to_str().unwrap().to_owned()) }
            }
        }
    }
    found.retain(|place| place.rsplit('/').next().unwrap().starts_with(digest));
    found
}

/// Opens a bucket of the S3 server of the tests, which may check signatures.
fn client(bucket: &str) -> AmazonS3 {
    AmazonS3Builder::from_env().with_bucket_name(bucket).with_allow_http(true).build().unwrap()
}

/// Returns the names, `s3://BUCKET/KEY`, of all objects in a bucket whose keys begin with the folder `prefix`.
pub(crate) async fn listed(bucket: &str, prefix: &str) -> Vec<String> {
    let listed: Vec<_> = client(bucket).list(Some(&Key::from(prefix))).try_collect().await.unwrap();
    listed.into_iter().map(|object| format!("{S3}{bucket}/{}", object.location)).collect()
}

/// Overwrites a stored object, or removes it.
pub(crate) async fn damage(place: &str, bytes: Option<&'static [u8]>) {
    if let Some((bucket, key)) = place.strip_prefix(S3).and_then(|place| place.split_once('/')) {
        let (store, key) = (client(bucket), Key::from(key));
        match bytes {
            Some(bytes) => drop(store.put(&key, bytes.into()).await.unwrap()),
            None => store.delete(&key).await.unwrap(),
        }
    } else if let Some(bytes) = bytes {
        std::fs::write(place, bytes).unwrap();
    } else {
        std::fs::remove_file(place).unwrap();
    }
}

/// Removes a stored object of a bucket, and returns its bytes.
pub(crate) async fn take(place: &str) -> Vec<u8> {
    let (bucket, key) = place.strip_prefix(S3).and_then(|place| place.split_once('/')).unwrap();
    let (store, key) = (client(bucket), Key::from(key));
    let bytes = store.get(&key).await.unwrap().bytes().await.unwrap();
    store.delete(&key).await.unwrap();
    bytes.to_vec()
}

/// Writes a stored object of a bucket that was removed before.
pub(crate) async fn put_back(place: &str, bytes: Vec<u8>) {
    let (bucket, key) = place.strip_prefix(S3).and_then(|place| place.split_once('/')).unwrap();
    client(bucket).put(&Key::from(key), bytes.into()).await.unwrap();
}

impl Service {
    pub(crate) async fn start(config: ServeConfig) -> Self {
        Self::start_for(config, Client::builder().no_proxy()).await
    }

    /// Starts a service that is asked by this client.
    pub(crate) async fn start_for(config: ServeConfig, client: ClientBuilder) -> Self {
        wavelume::store::provide_tls();
        prepare(&config).await;
        let server = Server::bind(config).await.unwrap();
        let base = server.url();
        let (stop, stopped) = oneshot::channel();
        let running = tokio::spawn(server.run(async {
            let _ = stopped.await;
        }));
        Self { base, client: client.build().unwrap(), stop, running }
    }

    pub(crate) async fn stop(self) {
        drop(self.client);
        self.stop.send(()).unwrap();
        self.running.await.unwrap().unwrap();
    }

    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{path}", self.base))
    }

    pub(crate) fn get(&self, path: &str) -> RequestBuilder {
        self.request(Method::GET, path)
    }

    pub(crate) fn post(&self, path: &str) -> RequestBuilder {
        self.request(Method::POST, path)
    }

    /// Sends `words` over a connection of their own, and returns the whole answer.
    pub(crate) async fn talk(&self, words: &[u8]) -> String {
        let address = self.base.trim_start_matches("http://");
        let mut stream = tokio::net::TcpStream::connect(address).await.unwrap();
        // A refusal may come before the last word was sent.
        let _ = stream.write_all(words).await;
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer).await;
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// Uploads a file, which must be understood.
    pub(crate) async fn upload(&self, query: &str, bytes: impl Into<reqwest::Body>) -> Value {
        let response = self.post(&format!("/v1/measurements{query}")).body(bytes).send().await.unwrap();
        assert!(response.status().is_success(), "{}", response.text().await.unwrap());
        response.json().await.unwrap()
    }

    /// Compresses a measurement and waits for the end of the job.
    pub(crate) async fn compress(&self, body: &Value) -> Value {
        let response = self.post("/v1/jobs").header("prefer", "wait=60").json(body).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "{}", response.text().await.unwrap());
        response.json().await.unwrap()
    }

    /// A small BRDF of 4 × 64 directions at 400, 500 and 600 nm.
    pub(crate) async fn brdf(&self) -> String {
        let array = self.upload("", npy(&[4, 64, 3])).await;
        let axes = json!({ "axes": ["hemi:0", "hemi:2", "lambda:400:100:3"] });
        let request =
            json!({ "measurement": array["id"], "quantity": "brdf", "axes": axes, "target": { "er_l2": 0.01 } });
        self.compress(&request).await["material"].as_str().unwrap().to_owned()
    }

    /// A small material: the D65 spectrum.
    pub(crate) async fn material(&self) -> String {
        let measurement = self.upload("?filename=d65.csv", D65).await;
        let job = self.compress(&json!({ "measurement": measurement["id"], "target": { "er_l2": 0.01 } })).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        job["material"].as_str().unwrap().to_owned()
    }
}

/// Sends a request, which must be answered with a problem of this status and code.
pub(crate) async fn problem(request: RequestBuilder, status: u16, code: &str) -> Value {
    problem_of(request.send().await.unwrap(), status, code).await
}

pub(crate) async fn problem_of(response: Response, status: u16, code: &str) -> Value {
    let found = response.status().as_u16();
    let media_type = response.headers().get("content-type").map(|v| v.to_str().unwrap().to_owned());
    let text = response.text().await.unwrap();
    assert_eq!(found, status, "{text}");
    assert_eq!(media_type.as_deref(), Some("application/problem+json"), "{text}");
    let problem: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(problem["type"], format!("urn:wavelume:problem:{code}"), "{text}");
    assert_eq!(problem["status"], status);
    assert!(!problem["detail"].as_str().unwrap().is_empty() && !problem["title"].as_str().unwrap().is_empty());
    problem
}

pub(crate) const D65: &[u8] = include_bytes!("../../../data/illuminant_D65.csv");
pub(crate) const LAMP: &[u8] = include_bytes!("../../../data/aerolamp.ies");
pub(crate) const LAMP_SPECTRUM: &[u8] = include_bytes!("../../../data/aerolamp.csv");
pub(crate) const CHECKER: &[u8] = include_bytes!("../../../data/colorchecker_n_ohta.csv");

/// Builds an `.npy` of `shape` with smooth positive samples; its axes are stated elsewhere.
pub(crate) fn npy(shape: &[usize]) -> Vec<u8> {
    let samples: Vec<f32> =
        (0..shape.iter().product()).map(|i: usize| 0.2 + 0.1 * ((i % 97) as f32 * 0.1).sin()).collect();
    wavelume::formats::write_npy(shape, &samples)
}

/// A request for a BRDF of 16 × 1024 directions that is busy for a while.
pub(crate) fn long_request(id: &Value) -> Value {
    json!({
        "measurement": id,
        "quantity": "brdf",
        "axes": { "axes": ["hemi:1", "hemi:4", "lambda:380:5:75"] },
        "target": { "er_l2": 0.001 },
    })
}

pub(crate) const LONG_SHAPE: [usize; 3] = [16, 1024, 75];

#[test]
fn a_missing_python_of_the_tests_is_named_with_what_to_install() {
    let servers = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/servers");
    let run = std::process::Command::new(servers).arg("true").env("WAVELUME_PYTHON", "/nowhere/python").output();
    let run = run.unwrap();
    let told = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(1), "{told}");
    assert!(told.contains("no Python /nowhere/python") && told.contains("pip install"), "{told}");
}
