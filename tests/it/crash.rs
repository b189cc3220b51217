//! The service is killed twenty times in the middle of uploads, jobs, cancels, deletions and publications. Everything
//! it accepted exists afterwards, nothing exists in part, and every accepted job ends exactly once.
//!
//! `WAVELUME_KILLS`, `WAVELUME_SEED` and `WAVELUME_PROGRAM` set the number of rounds, the seed of their times and the
//! program. `tests/nightly kills kills-shared` kills for longer, on both databases.

use crate::service::{npy, objects};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};
use reqwest::{Client, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use wavelume::Archive;
use wavelume::store::Digest;

/// Rounds, each with two kills, and the seed of their times.
const KILLS: u64 = 20;
const SEED: u64 = 1;

/// Rounds whose promises are all checked after each kill; of older ones, this many are drawn. At the end all are
/// checked.
const RECENT: u64 = 2;
const DRAWN: usize = 50;

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name}: found `{text}`")))
}

/// The real program.
pub(crate) struct Program {
    child: Child,
    pub(crate) base: String,
}

impl Program {
    pub(crate) fn start(data: &Path) -> Self {
        let program = std::env::var("WAVELUME_PROGRAM").unwrap_or(env!("CARGO_BIN_EXE_wavelume").to_owned());
        let mut child = Command::new(program)
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
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

/// Promises that the service has made so far.
#[derive(Default)]
struct Promises {
    round: u64,
    /// Measurements by the id that was answered with 2xx.
    measurements: BTreeMap<String, Uploaded>,
    /// Jobs by the id that was answered with 2xx.
    jobs: BTreeMap<String, Queued>,
    /// Materials whose deletion was asked for; true once it was answered with 2xx.
    deleted: BTreeMap<String, bool>,
    cancels: u64,
}

#[derive(Clone)]
struct Uploaded {
    round: u64,
    bytes: Vec<u8>,
    /// The deletion was asked for, and answered with 2xx.
    deleted: Option<bool>,
}

#[derive(Clone)]
struct Queued {
    round: u64,
    /// A cancel was sent.
    cancelled: bool,
    /// The end, once it was seen.
    end: Option<Value>,
}

/// Builds a small spectrum that no other task uploads.
fn spectrum(number: u64) -> Vec<u8> {
    let rows: Vec<String> = (0..40).map(|i| format!("{},{}.5", 400 + 5 * i, (number * 31 + i * 7) % 997 + 1)).collect();
    format!("wavelength,{number}\n{}\n", rows.join("\n")).into_bytes()
}

type Shared = Arc<Mutex<Promises>>;

/// Uploads `bytes` and notes the promise.
async fn upload(client: &Client, base: &str, bytes: Vec<u8>, promises: &Shared) -> Option<String> {
    let response = client.post(format!("{base}/v1/measurements")).body(bytes.clone()).send().await.ok()?;
    let accepted = response.status().is_success();
    let measurement = response.json::<Value>().await.ok()?;
    assert!(accepted, "{measurement}");
    let id = measurement["id"].as_str().unwrap().to_owned();
    let mut promises = promises.lock().unwrap();
    let round = promises.round;
    promises.measurements.insert(id.clone(), Uploaded { round, bytes, deleted: None });
    Some(id)
}

/// Uploads and compresses one small thing after the other until the service is gone; some jobs are cancelled, and some
/// measurements and materials deleted.
async fn small(client: Client, base: String, start: u64, promises: Shared) {
    for number in start.. {
        let Some(id) = upload(&client, &base, spectrum(number), &promises).await else { return };
        if number % 5 == 4 {
            // Nothing depends on the measurement yet: it can be deleted, and may be uploaded again.
            promises.lock().unwrap().measurements.get_mut(&id).unwrap().deleted = Some(false);
            let Ok(gone) = client.delete(format!("{base}/v1/measurements/{id}")).send().await else { return };
            assert_eq!(gone.status(), StatusCode::NO_CONTENT);
            promises.lock().unwrap().measurements.get_mut(&id).unwrap().deleted = Some(true);
            if number % 10 == 4 {
                continue;
            }
            // The upload may have been accepted without an answer.
            promises.lock().unwrap().measurements.get_mut(&id).unwrap().deleted = Some(false);
            if upload(&client, &base, spectrum(number), &promises).await.is_none() {
                return;
            }
        }
        let job = json!({ "measurement": id, "target": { "er_l2": 0.01 }, "quantity": "spectrum" });
        let Some(job) = submit(&client, &base, &job, &promises).await else { return };
        let done = match number % 4 {
            1 => cancel(&client, &base, &job, &promises).await,
            2 => delete_result(&client, &base, &promises).await,
            _ => Some(()),
        };
        if done.is_none() {
            return;
        }
    }
}

async fn cancel(client: &Client, base: &str, job: &str, promises: &Shared) -> Option<()> {
    promises.lock().unwrap().jobs.get_mut(job).unwrap().cancelled = true;
    let response = client.post(format!("{base}/v1/jobs/{job}/cancel")).send().await.ok()?;
    let status = response.status();
    assert!(status.is_success() || status == StatusCode::CONFLICT, "{status}");
    let answer = response.json::<Value>().await.ok()?;
    let mut promises = promises.lock().unwrap();
    promises.cancels += 1;
    if answer["state"] == "cancelled" {
        promises.jobs.get_mut(job).unwrap().end = Some(answer);
    }
    Some(())
}

/// Deletes the material of a job that succeeded in an earlier round, if one is left.
async fn delete_result(client: &Client, base: &str, promises: &Shared) -> Option<()> {
    let material = {
        let mut promises = promises.lock().unwrap();
        let ends = promises.jobs.values().filter_map(|job| job.end.as_ref()?["material"].as_str());
        let mut left = ends.filter(|material| !promises.deleted.contains_key(*material));
        let Some(material) = left.next().map(str::to_owned) else { return Some(()) };
        promises.deleted.insert(material.clone(), false);
        material
    };
    let gone = client.delete(format!("{base}/v1/materials/{material}")).send().await.ok()?;
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    promises.lock().unwrap().deleted.insert(material, true);
    Some(())
}

/// Compresses a measurement that takes a while.
async fn long(client: Client, base: String, number: u64, promises: Shared) {
    let mut bytes = npy(&[4, 256, 31]);
    let last = bytes.len() - 4;
    bytes[last..].copy_from_slice(&(1.0 + number as f32).to_le_bytes());
    let Some(id) = upload(&client, &base, bytes, &promises).await else { return };
    let axes = json!({ "axes": ["hemi:0", "hemi:3", "lambda:400:10:31"] });
    let job = json!({ "measurement": id, "quantity": "brdf", "axes": axes, "target": { "er_l2": 0.001 } });
    let Some(job) = submit(&client, &base, &job, &promises).await else { return };
    if number % 3 == 2 {
        cancel(&client, &base, &job, &promises).await;
    }
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

async fn submit(client: &Client, base: &str, job: &Value, promises: &Shared) -> Option<String> {
    let response = client.post(format!("{base}/v1/jobs")).json(job).send().await.ok()?;
    let accepted = response.status().is_success();
    let job = response.json::<Value>().await.ok()?;
    assert!(accepted, "{job}");
    let id = job["id"].as_str().unwrap().to_owned();
    let mut promises = promises.lock().unwrap();
    let round = promises.round;
    promises.jobs.insert(id.clone(), Queued { round, cancelled: false, end: None });
    Some(id)
}

/// Items of the last rounds, and some older ones drawn at random; all items without `random`.
fn drawn<T>(all: Vec<T>, first: u64, round: impl Fn(&T) -> u64, random: Option<&mut Pcg64Mcg>) -> Vec<T> {
    let Some(random) = random else { return all };
    let (mut old, mut looked): (Vec<T>, Vec<T>) = all.into_iter().partition(|one| round(one) < first);
    for _ in 0..DRAWN.min(old.len()) {
        looked.push(old.swap_remove((random.next_u64() % old.len() as u64) as usize));
    }
    looked
}

/// Checks that everything promised exists, and that no ended job has changed.
async fn kept(client: &Client, base: &str, promises: &Shared, mut random: Option<&mut Pcg64Mcg>) {
    let (first, measurements, jobs) = {
        let promises = promises.lock().unwrap();
        let measurements: Vec<_> = promises.measurements.clone().into_iter().collect();
        let jobs: Vec<_> = promises.jobs.clone().into_iter().collect();
        (promises.round.saturating_sub(RECENT), measurements, jobs)
    };
    let get = async |path: String| client.get(format!("{base}{path}")).send().await.unwrap();
    for (id, uploaded) in drawn(measurements, first, |(_, uploaded)| uploaded.round, random.as_deref_mut()) {
        let content = get(format!("/v1/measurements/{id}/content")).await;
        match (uploaded.deleted, content.status()) {
            (Some(_), StatusCode::NOT_FOUND) => {
                let blob = get(format!("/v1/blobs/{id}")).await;
                assert_eq!(blob.status(), StatusCode::NOT_FOUND, "measurement {id} was deleted and is readable");
                promises.lock().unwrap().measurements.get_mut(&id).unwrap().deleted = Some(true);
            }
            (Some(true), status) => panic!("measurement {id} was deleted and is {status}"),
            (_, StatusCode::OK) => assert_eq!(content.bytes().await.unwrap(), uploaded.bytes),
            (_, status) => panic!("measurement {id} was accepted and is lost: {status}"),
        }
    }
    let looked = |queued: &Queued| if queued.end.is_none() { u64::MAX } else { queued.round };
    for (id, queued) in drawn(jobs, first, |(_, queued)| looked(queued), random) {
        let response = get(format!("/v1/jobs/{id}")).await;
        assert_eq!(response.status(), StatusCode::OK, "job {id} was accepted and is lost");
        let job: Value = response.json().await.unwrap();
        if let Some(end) = &queued.end {
            assert_eq!(&job, end, "a job ended twice");
        }
        match job["state"].as_str().unwrap() {
            "queued" | "running" => continue,
            "succeeded" => {
                let material = job["material"].as_str().unwrap();
                let content = get(format!("/v1/materials/{material}/content")).await;
                let deleted = promises.lock().unwrap().deleted.get(material).copied();
                match (deleted, content.status()) {
                    (Some(_), StatusCode::NOT_FOUND) => {
                        promises.lock().unwrap().deleted.insert(material.to_owned(), true);
                    }
                    (Some(true), status) => panic!("material {material} was deleted and is {status}"),
                    (_, StatusCode::OK) => {
                        assert_eq!(Digest::of(&content.bytes().await.unwrap()).to_string(), material);
                    }
                    (_, status) => panic!("job {id} succeeded and its material is lost: {status}"),
                }
            }
            "cancelled" if queued.cancelled => {}
            // A job whose worker was killed in every attempt is given up: it may be what kills them.
            "dead" if job["problem"]["type"] == "urn:wavelume:problem:worker-lost" => {}
            other => panic!("job {id} is {other}: {job}"),
        }
        promises.lock().unwrap().jobs.get_mut(&id).unwrap().end = Some(job);
    }
}

/// Every file in the store has the bytes of its name.
async fn no_half_blobs(data: &Path) -> usize {
    let objects = objects(data, "").await;
    for path in &objects {
        let name = path.rsplit('/').next().unwrap();
        let digest = name.split('.').next().unwrap();
        assert_eq!(Digest::of(&std::fs::read(path).unwrap()).to_string(), digest, "half a blob is visible");
    }
    objects.len()
}

#[tokio::test(flavor = "multi_thread")]
async fn kills_lose_nothing_that_was_accepted() {
    let (kills, seed) = (setting("WAVELUME_KILLS", KILLS), setting("WAVELUME_SEED", SEED));
    wavelume::store::provide_tls();
    println!("{kills} rounds of two kills, WAVELUME_SEED={seed}");
    let data = tempfile::tempdir().unwrap();
    let promises = Shared::default();
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    for round in 0..kills {
        promises.lock().unwrap().round = round;
        let program = Program::start(data.path());
        let client = Client::builder().no_proxy().build().unwrap();
        let (base, start) = (program.base.clone(), round * 1_000_000);
        let clients = [
            tokio::spawn(small(client.clone(), base.clone(), start, Arc::clone(&promises))),
            tokio::spawn(small(client.clone(), base.clone(), start + 500_000, Arc::clone(&promises))),
            tokio::spawn(long(client.clone(), base.clone(), round, Arc::clone(&promises))),
            tokio::spawn(slow(client.clone(), base.clone())),
        ];
        // On any machine three of four rounds get as far as two jobs; the fourth may be killed before its first.
        let wanted = promises.lock().unwrap().jobs.len() + if round % 4 == 0 { 0 } else { 2 };
        let patience = std::time::Instant::now() + Duration::from_secs(30);
        while promises.lock().unwrap().jobs.len() < wanted && std::time::Instant::now() < patience {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        tokio::time::sleep(Duration::from_millis(20 + random.next_u64() % 500)).await;
        program.kill();
        for client in clients {
            client.await.unwrap();
        }
        if round % 10 == 9 {
            let archive = Archive::open(data.path()).await.unwrap();
            assert_eq!(archive.check().await.unwrap().faults, [], "round {round}");
        }
        let program = Program::start(data.path());
        kept(&Client::builder().no_proxy().build().unwrap(), &program.base, &promises, Some(&mut random)).await;
        // Killed again, this time in the middle of the jobs that were taken back.
        program.kill();
    }

    let program = Program::start(data.path());
    let client = Client::builder().no_proxy().build().unwrap();
    for _ in 0..1200 {
        kept(&client, &program.base, &promises, Some(&mut random)).await;
        if promises.lock().unwrap().jobs.values().all(|job| job.end.is_some()) {
            break;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    kept(&client, &program.base, &promises, None).await;
    program.kill();
    let blobs = no_half_blobs(data.path()).await;
    let (measurements, jobs) = {
        let promises = promises.lock().unwrap();
        assert!(promises.jobs.values().all(|job| job.end.is_some()), "a job never ended");
        let ends = |state: &str| {
            promises.jobs.values().filter_map(|job| job.end.as_ref()).filter(|end| end["state"] == state).count()
        };
        let deleted = promises.measurements.values().filter(|uploaded| uploaded.deleted == Some(true)).count();
        println!(
            "{} kills: {} measurements ({deleted} deleted), {} jobs ({} succeeded, {} cancelled, {} given up; {} cancels \
             answered), {} materials deleted, {blobs} blobs; lost: 0, ended twice: 0",
            2 * kills,
            promises.measurements.len(),
            promises.jobs.len(),
            ends("succeeded"),
            ends("cancelled"),
            ends("dead"),
            promises.cancels,
            promises.deleted.len(),
        );
        (promises.measurements.len(), promises.jobs.len())
    };
    assert!(measurements > kills as usize && jobs > kills as usize, "{measurements} measurements, {jobs} jobs");

    let archive = Archive::open(data.path()).await.unwrap();
    assert_eq!(archive.check().await.unwrap().faults, []);
    archive.sweep().await.unwrap();
    assert_eq!(archive.check().await.unwrap().faults, [], "a sweep took what is named");
    println!("fsck clean before and after a sweep");
}
