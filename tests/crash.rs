//! The service is killed twenty times in the middle of uploads, jobs and publications: what it accepted is there
//! afterwards, nothing is there in part, and every accepted job ends exactly once.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

mod service;

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};
use service::npy;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use wavelume::jobs::Archive;
use wavelume::store::Digest;

const KILLS: u64 = 20;
const SEED: u64 = 1;

/// The real program.
struct Program {
    child: Child,
    base: String,
}

impl Program {
    fn start(data: &Path) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_wavelume"))
            .args(["serve", "--listen", "127.0.0.1:0", "--data"])
            .arg(data)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let base = line.trim().strip_prefix("listening on ").unwrap_or_else(|| panic!("found `{line}`")).to_owned();
        Self { child, base }
    }

    /// SIGKILL: no handler runs, nothing is flushed.
    fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

/// What the service has promised so far.
#[derive(Default)]
struct Promises {
    /// Contents by the id that was answered with 2xx.
    measurements: BTreeMap<String, Vec<u8>>,
    /// Jobs answered with 2xx, and their end once it was seen.
    jobs: BTreeMap<String, Option<Value>>,
}

/// One small spectrum that nobody else uploads.
fn spectrum(number: u64) -> Vec<u8> {
    let rows: Vec<String> = (0..40).map(|i| format!("{},{}.5", 400 + 5 * i, (number * 31 + i * 7) % 997 + 1)).collect();
    format!("wavelength,{number}\n{}\n", rows.join("\n")).into_bytes()
}

/// Uploads and compresses one small thing after the other until the service is gone.
async fn small(client: Client, base: String, start: u64, promises: Arc<Mutex<Promises>>) {
    for number in start.. {
        let bytes = spectrum(number);
        let sent = client.post(format!("{base}/v1/measurements")).body(bytes.clone()).send().await;
        let Ok(response) = sent else { return };
        let accepted = response.status().is_success();
        let Ok(measurement) = response.json::<Value>().await else { return };
        assert!(accepted, "{measurement}");
        let id = measurement["id"].as_str().unwrap().to_owned();
        promises.lock().unwrap().measurements.insert(id.clone(), bytes);
        let job = json!({ "measurement": id, "target": { "er_l2": 0.01 }, "quantity": "spectrum" });
        if submit(&client, &base, &job, &promises).await.is_none() {
            return;
        }
    }
}

/// Compresses what takes a while.
async fn long(client: Client, base: String, number: u64, promises: Arc<Mutex<Promises>>) {
    let mut bytes = npy(&[4, 256, 31]);
    let last = bytes.len() - 4;
    bytes[last..].copy_from_slice(&(1.0 + number as f32).to_le_bytes());
    let sent = client.post(format!("{base}/v1/measurements")).body(bytes.clone()).send().await;
    let Ok(response) = sent else { return };
    let Ok(measurement) = response.json::<Value>().await else { return };
    let id = measurement["id"].as_str().unwrap().to_owned();
    promises.lock().unwrap().measurements.insert(id.clone(), bytes);
    let axes = json!({ "axes": ["hemi:0", "hemi:3", "lambda:400:10:31"] });
    let job = json!({ "measurement": id, "quantity": "brdf", "axes": axes, "target": { "er_l2": 0.001 } });
    submit(&client, &base, &job, &promises).await;
}

/// An upload that never ends.
async fn slow(client: Client, base: String) {
    let pieces = futures::stream::unfold(0_u64, |i| async move {
        tokio::time::sleep(Duration::from_millis(5)).await;
        Some((Ok::<_, std::io::Error>(vec![b'#'; 64 * 1024]), i + 1))
    });
    let sent = client.post(format!("{base}/v1/measurements")).body(reqwest::Body::wrap_stream(pieces)).send().await;
    assert!(sent.is_err() || !sent.unwrap().status().is_success());
}

async fn submit(client: &Client, base: &str, job: &Value, promises: &Mutex<Promises>) -> Option<()> {
    let response = client.post(format!("{base}/v1/jobs")).json(job).send().await.ok()?;
    let accepted = response.status().is_success();
    let job = response.json::<Value>().await.ok()?;
    assert!(accepted, "{job}");
    promises.lock().unwrap().jobs.insert(job["id"].as_str().unwrap().to_owned(), None);
    Some(())
}

/// Everything promised is there, and no job that ended has changed.
async fn kept(client: &Client, base: &str, promises: &Mutex<Promises>) {
    let (measurements, jobs) = {
        let promises = promises.lock().unwrap();
        (promises.measurements.clone(), promises.jobs.clone())
    };
    for (id, bytes) in measurements {
        let content = client.get(format!("{base}/v1/measurements/{id}/content")).send().await.unwrap();
        assert_eq!(content.status(), StatusCode::OK, "measurement {id} was accepted and is lost");
        assert_eq!(content.bytes().await.unwrap(), bytes);
    }
    for (id, ended) in jobs {
        let response = client.get(format!("{base}/v1/jobs/{id}")).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "job {id} was accepted and is lost");
        let job: Value = response.json().await.unwrap();
        match (ended, job["state"].as_str().unwrap()) {
            (Some(ended), _) => assert_eq!(job, ended, "a job ended twice"),
            (None, "queued" | "running") => {}
            (None, "succeeded") => {
                let material = job["material"].as_str().unwrap();
                let content = client.get(format!("{base}/v1/materials/{material}/content")).send().await.unwrap();
                assert_eq!(content.status(), StatusCode::OK, "job {id} succeeded and its material is lost");
                assert_eq!(Digest::of(&content.bytes().await.unwrap()).to_string(), material);
                promises.lock().unwrap().jobs.insert(id, Some(job));
            }
            // A job whose worker was killed in every attempt is given up: it may be what kills them.
            (None, "dead") if job["attempts"] == 5 => {
                promises.lock().unwrap().jobs.insert(id, Some(job));
            }
            (None, other) => panic!("job {id} is {other}: {job}"),
        }
    }
}

/// Every file in the store has the bytes of its name.
fn no_half_blobs(data: &Path) -> usize {
    let mut blobs = 0;
    for directory in std::fs::read_dir(data.join("blobs")).unwrap() {
        for blob in std::fs::read_dir(directory.unwrap().path()).unwrap() {
            let path = blob.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            assert_eq!(Digest::of(&std::fs::read(&path).unwrap()).to_string(), name, "half a blob is visible");
            blobs += 1;
        }
    }
    blobs
}

#[tokio::test(flavor = "multi_thread")]
async fn twenty_kills_lose_nothing_that_was_accepted() {
    let data = tempfile::tempdir().unwrap();
    let promises = Arc::new(Mutex::new(Promises::default()));
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    for round in 0..KILLS {
        let program = Program::start(data.path());
        let client = Client::builder().no_proxy().build().unwrap();
        let (base, start) = (program.base.clone(), round * 1_000_000);
        let clients = [
            tokio::spawn(small(client.clone(), base.clone(), start, Arc::clone(&promises))),
            tokio::spawn(small(client.clone(), base.clone(), start + 500_000, Arc::clone(&promises))),
            tokio::spawn(long(client.clone(), base.clone(), round, Arc::clone(&promises))),
            tokio::spawn(slow(client.clone(), base.clone())),
        ];
        tokio::time::sleep(Duration::from_millis(20 + random.next_u64() % 500)).await;
        program.kill();
        for client in clients {
            client.await.unwrap();
        }
        no_half_blobs(data.path());
        let program = Program::start(data.path());
        kept(&Client::builder().no_proxy().build().unwrap(), &program.base, &promises).await;
        // Killed again, this time in the middle of the jobs that were taken back.
        program.kill();
    }

    let program = Program::start(data.path());
    let client = Client::builder().no_proxy().build().unwrap();
    for _ in 0..1200 {
        kept(&client, &program.base, &promises).await;
        if promises.lock().unwrap().jobs.values().all(Option::is_some) {
            break;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    kept(&client, &program.base, &promises).await;
    program.kill();
    let blobs = no_half_blobs(data.path());
    let (measurements, jobs, dead) = {
        let promises = promises.lock().unwrap();
        let dead = promises.jobs.values().flatten().filter(|job| job["state"] == "dead").count();
        assert!(promises.jobs.values().all(Option::is_some), "a job never ended");
        (promises.measurements.len(), promises.jobs.len(), dead)
    };
    println!("{KILLS} kills: {measurements} measurements, {jobs} jobs ({dead} given up), {blobs} blobs");
    assert!(measurements > KILLS as usize && jobs > KILLS as usize, "{measurements} measurements, {jobs} jobs");

    let archive = Archive::open(data.path()).await.unwrap();
    assert_eq!(archive.check().await.unwrap().faults, []);
    archive.sweep().await.unwrap();
    assert_eq!(archive.check().await.unwrap().faults, [], "a sweep took what is named");
}
