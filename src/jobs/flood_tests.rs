//! A tenant that fills the queue of all, and another that sends one job after the other, at real workers.

use super::publish::tests::{SPECTRUM, upload};
use super::request::CompressRequest;
use super::site::tests::sites;
use super::worker::run;
use super::{Engine, JobRequest, WorkConfig};
use crate::catalog::{Enqueued, JobState, testing};
use crate::compress::Target;
use futures::future::join_all;
use serde_json::json;
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Number of workers that run the jobs of the test.
const WORKERS: usize = 2;

/// Number of jobs that the tenant with few jobs sends, one after the other.
const SENT: usize = 5;

/// Returns a request for a short job on a new measurement of the engine's tenant.
async fn request(engine: &Arc<Engine>) -> JobRequest {
    let staged = engine.archive.staging.stage(SPECTRUM).unwrap();
    let (row, _) = engine.ingest(staged, upload()).await.unwrap();
    let request = json!({ "measurement": row.id, "target": Target::ErL2(0.01) });
    JobRequest::Compress(Box::new(serde_json::from_value::<CompressRequest>(request).unwrap()))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tenant_beside_one_that_fills_the_queue_waits_for_one_job_of_each_worker_at_most() {
    // PostgreSQL: SQLite takes a minute to write so many jobs to the disk.
    let (site, _guard) = sites().await.pop().unwrap();
    let config = WorkConfig { site, workers: WORKERS, by_tenant: true, ..WorkConfig::new("") };
    let engine = Engine::open(&config).await.unwrap();
    testing::record_starts(&engine.archive.catalog).await;
    let mut tenants = Vec::new();
    for id in ["flood", "few"] {
        let catalog = testing::other(&engine.archive.catalog, id).await;
        let engine = engine.of(catalog.tenant());
        tenants.push((request(&engine).await, engine));
    }
    let (few_request, few) = tenants.pop().unwrap();
    let (flood_request, flood) = tenants.pop().unwrap();

    let queued = join_all((0..8).map(|_| async {
        let mut queued = 0;
        loop {
            match flood.enqueue(&flood_request, None).await.unwrap() {
                Enqueued::New(_) => queued += 1,
                Enqueued::Full => return queued,
                other => panic!("{other:?}"),
            }
        }
    }));
    let queued: u64 = queued.await.into_iter().sum();
    assert!((10_000..10_100).contains(&queued), "{queued} jobs until the queue is full");

    let stop = CancellationToken::new();
    let working = tokio::spawn({
        let (engine, stop) = (Arc::clone(&engine), stop.clone());
        async move { run(&engine, WORKERS, &stop).await }
    });
    for sent in 0..SENT {
        let queued = few.enqueue(&few_request, None).await.unwrap();
        let Enqueued::New(job) = queued else { panic!("{queued:?}: refused for the jobs of another tenant") };
        testing::record_answer(&engine.archive.catalog, &job.id).await;
        let ended = async {
            loop {
                let state = few.job(&job.id).await.unwrap().unwrap().state;
                if state.is_final() {
                    return state;
                }
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        };
        let ended = tokio::time::timeout(Duration::from_mins(1), ended).await;
        assert_eq!(ended.ok(), Some(JobState::Succeeded));
        let before = testing::started_before(&engine.archive.catalog, &job.id).await;
        assert!(before <= WORKERS as i64, "{before} jobs were started before number {sent}");
    }
    stop.cancel();
    working.await.unwrap();
    let counts = engine.archive.catalog.job_counts().await.unwrap();
    assert!(counts.queued > 9_000, "the flood was waiting all the time: {counts:?}");
}
