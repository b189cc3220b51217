//! Several processes on one catalog: jobs are waited for, followed, cancelled and listed through any of them.

use crate::service::{D65, Service, config, problem};
use futures::StreamExt;
use reqwest::StatusCode;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Duration;
use wavelume::store::Digest;

/// Two services without a worker, and one that only works.
async fn nodes(data: &Path) -> [Service; 3] {
    let mut api = config(data);
    api.work.workers = 0;
    let first = Service::start(api.clone()).await;
    let second = Service::start(api).await;
    [first, second, Service::start(config(data)).await]
}

async fn until(service: &Service, path: &str, states: &[&str]) -> Value {
    loop {
        let job: Value = service.get(path).send().await.unwrap().json().await.unwrap();
        if states.contains(&job["state"].as_str().unwrap()) {
            return job;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_waited_for_and_followed_through_nodes_that_do_not_run_it() {
    let data = tempfile::tempdir().unwrap();
    let [first, second, worker] = nodes(data.path()).await;
    let id = first.upload("", D65).await["id"].clone();
    // The node that takes the job waits for it, although another one runs it.
    let job = second.compress(&json!({ "measurement": id, "target": { "er_l2": 0.01 } })).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let content = first.get(&format!("/v1/materials/{}/content", job["material"].as_str().unwrap()));
    let content = content.send().await.unwrap().bytes().await.unwrap();
    assert_eq!(Digest::of(&content).to_string(), job["material"].as_str().unwrap());

    let queued = json!({ "kind": "paper", "tables": [2, 1] });
    let queued: Value = first.post("/v1/jobs").json(&queued).send().await.unwrap().json().await.unwrap();
    let events = second.get(queued["links"]["events"].as_str().unwrap()).send().await.unwrap();
    let mut pieces = events.bytes_stream();
    let mut text = String::new();
    while let Some(piece) = pieces.next().await {
        text.push_str(std::str::from_utf8(&piece.unwrap()).unwrap());
    }
    assert!(text.contains("\"state\":\"succeeded\""), "{text}");
    let last: Value = serde_json::from_str(text.trim().rsplit("data: ").next().unwrap()).unwrap();
    let time = last["updated_ms"].as_i64().unwrap() - last["created_ms"].as_i64().unwrap();
    assert!(text.contains("event: progress") || time < 4000, "no progress in {time} ms: {text}");
    for service in [first, second, worker] {
        service.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_running_job_is_cancelled_and_repeated_through_another_node() {
    let data = tempfile::tempdir().unwrap();
    let [first, second, worker] = nodes(data.path()).await;
    let everything = first.post("/v1/jobs").json(&json!({ "kind": "paper" })).send().await.unwrap();
    let everything: Value = everything.json().await.unwrap();
    let path = everything["links"]["self"].as_str().unwrap();
    until(&first, path, &["running"]).await;
    let cancel = second.post(everything["links"]["cancel"].as_str().unwrap()).send().await.unwrap();
    assert_eq!(cancel.status(), StatusCode::ACCEPTED);
    until(&first, path, &["cancelled"]).await;

    let page: Value = first.get("/v1/jobs?state=cancelled").send().await.unwrap().json().await.unwrap();
    assert_eq!(page["items"][0]["id"], everything["id"]);
    let none: Value = second.get("/v1/jobs?state=dead&limit=5").send().await.unwrap().json().await.unwrap();
    assert_eq!(none, json!({ "items": [], "next": null }));
    let refusal = problem(first.get("/v1/jobs?state=ended"), 400, "bad-query").await;
    assert!(refusal["detail"].as_str().unwrap().contains("expected one of queued, running"), "{refusal}");

    let retry = format!("{path}/retry");
    let again = second.post(&retry).send().await.unwrap();
    assert_eq!(again.status(), StatusCode::ACCEPTED);
    until(&first, path, &["running"]).await;
    problem(second.post(&retry), 409, "job-finished").await;
    second.post(everything["links"]["cancel"].as_str().unwrap()).send().await.unwrap();
    until(&second, path, &["cancelled"]).await;
    let absent = format!("/v1/jobs/{}/retry", uuid_of_nobody());
    problem(first.post(&absent), 404, "not-found").await;
    for service in [first, second, worker] {
        service.stop().await;
    }
}

fn uuid_of_nobody() -> &'static str {
    "019ab000-0000-7000-8000-000000000000"
}

/// Fault 33 of one queue for all: a short job of another client stands behind at most the running job of the worker.
#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_jobs_from_one_address_delays_another_by_one_job() {
    let data = tempfile::tempdir().unwrap();
    let mut waiting = config(data.path());
    waiting.work.workers = 0;
    let service = Service::start(waiting).await;
    let id = service.upload("", D65).await["id"].clone();
    let body = json!({ "measurement": id, "target": { "er_l2": 0.01 } });
    let mut flood = Vec::new();
    for _ in 0..200 {
        let job: Value = service.post("/v1/jobs").json(&body).send().await.unwrap().json().await.unwrap();
        flood.push(job["links"]["self"].as_str().unwrap().to_owned());
    }
    let other = reqwest::Client::builder().no_proxy().local_address(Some([127, 0, 0, 9].into())).build().unwrap();
    let short = other.post(format!("{}/v1/jobs", service.base)).json(&body).send().await.unwrap();
    let short: Value = short.json().await.unwrap();
    service.stop().await;

    let worker = Service::start(config(data.path())).await;
    until(&worker, short["links"]["self"].as_str().unwrap(), &["succeeded"]).await;
    let mut before = 0;
    for path in &flood {
        let job: Value = worker.get(path).send().await.unwrap().json().await.unwrap();
        before += usize::from(job["state"] == "succeeded");
    }
    assert!(before < 20, "{before} of 200 jobs of another client were started first");
    worker.stop().await;
}
