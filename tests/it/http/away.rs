//! A store that is away for a while: no job fails, nothing is marked as damaged, and `/readyz` says so while it lasts.

use crate::service::{D65, LAMP, Service, config, is_shared, listed, problem_of, put_back, take};
use reqwest::{Method, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use sqlx::{Connection, Row};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;
use wavelume::api::ServeConfig;
use wavelume::{Database, Place};

/// A store that a test takes away and brings back.
enum Store {
    /// A directory that is renamed; an empty one, as an unmounted disk leaves it, takes its place.
    Directory(PathBuf),
    /// A prefix of a bucket, and all that was in it while it is away.
    Bucket { bucket: String, prefix: String, taken: Vec<(String, Vec<u8>)> },
}

impl Store {
    fn of(config: &ServeConfig) -> Self {
        match config.work.site.store.clone() {
            Some(Place::S3 { bucket, prefix }) => Self::Bucket { bucket, prefix, taken: Vec::new() },
            Some(Place::Directory(path)) => Self::Directory(path),
            None => panic!("the store of this test has a place of its own"),
        }
    }

    async fn take_away(&mut self) {
        match self {
            Self::Directory(path) => {
                fs::rename(&path, path.with_extension("away")).unwrap();
                fs::create_dir(path).unwrap();
            }
            Self::Bucket { bucket, prefix, taken } => {
                // The id of the catalog first: without it the store is nobody's.
                let mut places = listed(bucket, prefix).await;
                places.sort_by_key(|place| !place.ends_with("/wavelume-instance"));
                for place in places {
                    let bytes = take(&place).await;
                    taken.push((place, bytes));
                }
            }
        }
    }

    /// Brings the store back. Nothing may have been written to its place meanwhile.
    async fn bring_back(&mut self) {
        match self {
            Self::Directory(path) => {
                // Fails if it is not empty.
                fs::remove_dir(&path).unwrap();
                fs::rename(path.with_extension("away"), path).unwrap();
            }
            Self::Bucket { bucket, prefix, taken } => {
                assert_eq!(listed(bucket, prefix).await, Vec::<String>::new());
                for (place, bytes) in taken.drain(..).rev() {
                    put_back(&place, bytes).await;
                }
            }
        }
    }
}

/// Sends a request, which must be answered with 503 and the time after which to repeat it.
async fn unavailable(request: RequestBuilder) {
    let answer = request.send().await.unwrap();
    assert!(answer.headers().contains_key("retry-after"), "{answer:?}");
    problem_of(answer, 503, "unavailable").await;
}

/// Returns the number of stored files that the catalog marks as missing or damaged.
async fn marked(config: &ServeConfig) -> i64 {
    sqlx::any::install_default_drivers();
    let url = match &config.work.site.database {
        Some(Database::Server(url)) => url.clone(),
        _ => format!("sqlite:{}", config.work.site.data.join("catalog.sqlite").display()),
    };
    let mut connection = sqlx::AnyConnection::connect(&url).await.unwrap();
    let query = sqlx::query("SELECT COUNT(*) FROM blobs WHERE suspect <> 0");
    let count = query.fetch_one(&mut connection).await.unwrap().get(0);
    connection.close().await.unwrap();
    count
}

async fn jobs(service: &Service, ids: &[String]) -> Vec<Value> {
    let mut jobs = Vec::new();
    for id in ids {
        jobs.push(service.get(&format!("/v1/jobs/{id}")).send().await.unwrap().json().await.unwrap());
    }
    jobs
}

fn own_store(data: &Path) -> ServeConfig {
    let mut config = config(data);
    if !is_shared() {
        config.work.site.store = Some(Place::Directory(data.join("store")));
    }
    config
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_that_is_away_fails_no_job_and_marks_nothing() {
    let data = tempfile::tempdir().unwrap();
    let config = own_store(data.path());
    let mut store = Store::of(&config);
    let service = Service::start(config.clone()).await;
    let id = service.upload("", D65).await["id"].as_str().unwrap().to_owned();
    let tus = |method: Method, path: &str| service.request(method, path).header("tus-resumable", "1.0.0");
    let begun = tus(Method::POST, "/v1/uploads").header("upload-length", LAMP.len());
    let begun = begun.header("content-type", "application/offset+octet-stream").body(LAMP).send().await.unwrap();
    assert_eq!(begun.status(), StatusCode::CREATED);
    let upload = begun.headers()["location"].to_str().unwrap().rsplit('/').next().unwrap().to_owned();
    let used = || service.post(&format!("/v1/measurements?upload={upload}&filename=lamp.ies"));

    store.take_away().await;
    let mut ids = Vec::new();
    for error in [0.01, 0.02, 0.03] {
        let request = json!({ "measurement": id, "target": { "er_l2": error } });
        let queued = service.post("/v1/jobs").json(&request).send().await.unwrap();
        assert_eq!(queued.status(), StatusCode::ACCEPTED);
        ids.push(queued.json::<Value>().await.unwrap()["id"].as_str().unwrap().to_owned());
    }
    for _ in 0..3 {
        unavailable(service.get("/readyz")).await;
        unavailable(service.get(&format!("/v1/measurements/{id}/content"))).await;
        unavailable(service.get(&format!("/v1/blobs/{id}"))).await;
        for bytes in [D65, LAMP] {
            unavailable(service.post("/v1/measurements").body(bytes)).await;
        }
        unavailable(used()).await;
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    for job in jobs(&service, &ids).await {
        assert!(job["state"] == "queued" || job["state"] == "running", "{job}");
    }
    store.bring_back().await;
    assert_eq!(service.get("/readyz").send().await.unwrap().text().await.unwrap(), "ready\n");
    assert_eq!(service.get(&format!("/v1/blobs/{id}")).send().await.unwrap().bytes().await.unwrap(), D65);
    assert_eq!(used().send().await.unwrap().status(), StatusCode::CREATED);
    for id in &ids {
        loop {
            let job = &jobs(&service, std::slice::from_ref(id)).await[0];
            if job["state"] == "succeeded" {
                assert_eq!(job["attempts"], 1, "an attempt without the store does not count");
                break;
            }
            assert!(job["state"] == "queued" || job["state"] == "running", "{job}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
    assert_eq!(marked(&config).await, 0);
    service.stop().await;
}
