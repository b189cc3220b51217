//! Jobs in processes of their own: the same bytes, limited memory, and an end with the job or the worker.

use crate::service::{CHECKER, D65, LAMP, LAMP_SPECTRUM, Service, config, npy};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use wavelume::api::ServeConfig;

const PROGRAM: &str = env!("CARGO_BIN_EXE_wavelume");

fn isolated(data: &Path) -> ServeConfig {
    let mut config = config(data);
    config.work.isolate = Some(PROGRAM.into());
    config.work.threads = 2;
    config
}

/// Returns the processes of the jobs of a service: those that work in its directory of staged files.
fn processes(data: &Path) -> Vec<String> {
    let staging = data.canonicalize().unwrap().join("staging");
    let all = fs::read_dir("/proc").unwrap().filter_map(|entry| entry.unwrap().file_name().into_string().ok());
    all.filter(|id| fs::read_link(format!("/proc/{id}/cwd")).is_ok_and(|cwd| cwd == staging)).collect()
}

async fn until<T>(what: &str, mut look: impl AsyncFnMut() -> Option<T>) -> T {
    for _ in 0..3000 {
        if let Some(found) = look().await {
            return found;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("{what}: never");
}

async fn get(base: &str, path: &str) -> Value {
    let client = reqwest::Client::builder().no_proxy().build().unwrap();
    client.get(format!("{base}{path}")).send().await.unwrap().json().await.unwrap()
}

/// Waits until the process of a job runs that reports progress beyond `fraction`.
async fn running(data: &Path, base: &str, job: &str, fraction: f64) -> String {
    until("a process that makes progress", async || {
        let progress = get(base, job).await["progress"].as_f64().unwrap();
        processes(data).pop().filter(|_| progress > fraction)
    })
    .await
}

#[tokio::test(flavor = "multi_thread")]
async fn materials_and_reports_are_the_same_in_a_process_of_their_own() {
    let (here, apart) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let services = [Service::start(config(here.path())).await, Service::start(isolated(apart.path())).await];
    let mut made = [const { Vec::new() }; 2];
    for (service, made) in services.iter().zip(&mut made) {
        let spectrum = service.upload("", LAMP_SPECTRUM).await["id"].as_str().unwrap().to_owned();
        for (query, bytes, quantity) in [
            (String::new(), D65, "spectrum"),
            (String::new(), LAMP, "edf"),
            (format!("?spectrum={spectrum}"), LAMP, "edf"),
            ("?quantity=reflectance".to_owned(), CHECKER, "reflectance"),
        ] {
            let id = service.upload(&query, bytes).await["id"].clone();
            let mut request = json!({ "measurement": id, "quantity": quantity, "target": { "er_l2": 0.02 } });
            if !query.is_empty() && quantity == "edf" {
                request["wavelengths"] = json!("400:700:50");
            }
            let job = service.compress(&request).await;
            let path = format!("/v1/materials/{}", job["material"].as_str().unwrap_or_else(|| panic!("{job}")));
            let mut material = get(&service.base, &path).await;
            material["created_ms"] = Value::Null;
            made.push(material);
        }
        made.push(service.compress(&json!({ "kind": "paper", "tables": [2] })).await["report"].clone());
        let request = json!({ "measurement": spectrum, "quantity": "brdf", "target": { "er_l2": 0.01 } });
        let job = service.compress(&request).await;
        assert_eq!(job["state"], "failed", "{job}");
        made.push(job["problem"].clone());
    }
    assert_eq!(made[0], made[1]);
    assert_eq!(fs::read_dir(apart.path().join("staging")).unwrap().count(), 0, "no file of a job is left");
    for service in services {
        service.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_needs_more_memory_than_it_may_use_fails_alone() {
    let data = tempfile::tempdir().unwrap();
    let mut config = isolated(data.path());
    config.work.workers = 2;
    config.work.limits.job_memory = 48 << 20;
    let service = Service::start(config).await;
    let large = service.upload("", npy(&[16, 4096, 75])).await["id"].clone();
    let axes = json!({ "axes": ["hemi:1", "hemi:5", "lambda:380:5:75"] });
    let large = json!({ "measurement": large, "quantity": "brdf", "axes": axes, "target": { "er_l2": 0.01 } });
    let small = json!({ "measurement": service.upload("", D65).await["id"], "target": { "er_l2": 0.01 } });
    let (large, beside) = tokio::join!(service.compress(&large), service.compress(&small));
    assert_eq!((&large["state"], &large["attempts"]), (&json!("failed"), &json!(1)), "{large}");
    assert_eq!(large["problem"]["type"], "urn:wavelume:problem:out-of-memory", "{large}");
    let detail = large["problem"]["detail"].as_str().unwrap();
    assert!(detail.contains("more than 48MiB") && detail.contains("--job-memory"), "{detail}");
    assert_eq!(beside["state"], "succeeded", "{beside}");
    assert_eq!(service.compress(&small).await["state"], "succeeded");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_process_of_a_cancelled_job_is_killed() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(isolated(data.path())).await;
    let job: Value =
        service.post("/v1/jobs").json(&json!({ "kind": "paper" })).send().await.unwrap().json().await.unwrap();
    let path = job["links"]["self"].as_str().unwrap();
    let first = running(data.path(), &service.base, path, 0.0).await;
    // A supervisor asks all processes of the service to stop; jobs go on meanwhile.
    assert!(Command::new("kill").args(["-TERM", &first]).status().unwrap().success());
    let progress = get(&service.base, path).await["progress"].as_f64().unwrap();
    assert_eq!(running(data.path(), &service.base, path, progress).await, first);
    service.post(job["links"]["cancel"].as_str().unwrap()).send().await.unwrap();
    until("a cancelled job", async || (get(&service.base, path).await["state"] == "cancelled").then_some(())).await;
    assert_eq!(processes(data.path()), Vec::<String>::new());
    assert_eq!(fs::read_dir(data.path().join("staging")).unwrap().count(), 0);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_process_of_a_job_knows_no_secrets_and_ends_with_its_worker() {
    let data = tempfile::tempdir().unwrap();
    let mut program = Command::new(PROGRAM)
        .args(["serve", "--listen", "127.0.0.1:0", "--job-memory", "1GiB", "--data"])
        .arg(data.path())
        .env("AWS_SECRET_ACCESS_KEY", "a secret")
        .env("PGPASSWORD", "a secret")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(program.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let base = line.trim().strip_prefix("listening on ").unwrap().to_owned();
    let client = reqwest::Client::builder().no_proxy().build().unwrap();
    let job = client.post(format!("{base}/v1/jobs")).json(&json!({ "kind": "paper" })).send().await.unwrap();
    let job: Value = job.json().await.unwrap();
    let id = running(data.path(), &base, job["links"]["self"].as_str().unwrap(), 0.0).await;
    let of = |name: &str| String::from_utf8_lossy(&fs::read(format!("/proc/{id}/{name}")).unwrap()).into_owned();
    assert!(!of("environ").contains("a secret"), "{}", of("environ"));
    assert_eq!((of("comm").trim(), of("oom_score_adj").trim()), ("wavelume-job", "1000"));
    let limits = of("limits");
    let data_size = limits.lines().find(|line| line.starts_with("Max data size")).unwrap();
    let size: u64 = data_size.split_whitespace().nth(3).unwrap().parse().unwrap();
    // The stacks of the threads are beside the memory of the job.
    assert!(size > 1 << 30 && size < (1 << 30) + (1 << 29), "{data_size}");
    program.kill().unwrap();
    program.wait().unwrap();
    until("the end of the job's process", async || processes(data.path()).is_empty().then_some(())).await;
}
