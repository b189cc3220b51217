//! Loops of a worker process: claim and run jobs, take back the jobs of dead workers, sweep.

use super::archive::ArchiveError;
use super::attempt::{Failure, Made};
use super::config::WorkConfig;
use super::engine::Engine;
use super::frame::FrameError;
use super::hub::Control;
use super::kinds::Frame;
use super::problem::{Code, JobProblem};
use super::publish::Published;
use super::scrub::scrubbing;
use super::watcher::listening;
use crate::catalog::{Beat, CatalogError, Claimed, Dialect, Ended, Ending, JobState};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::{MissedTickBehavior, interval, interval_at, sleep};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

/// Interval at which workers look for jobs that another process queued, and for dead workers. Raising it finds them
/// later.
const LOOK: Duration = Duration::from_secs(1);

/// Longest interval at which workers look for batch jobs that have waited for long. Raising it starts these later.
const LONGEST_AGEING: Duration = Duration::from_mins(1);

/// Interval at which a worker renews its lease and stores its progress for a job that a client follows; on SQLite for
/// every job. Raising it delays visible progress, and cancellation by another process.
const BEAT: Duration = Duration::from_secs(1);

/// Pause of a worker that finds no space on a disk. Raising it takes up jobs later once there is space again.
const SHORT_OF_SPACE: Duration = Duration::from_secs(2);

/// Interval at which a service makes the reserve of disk space anew, if it was given up and there is space again.
const RESERVE: Duration = Duration::from_secs(2);

/// Opens the catalog and store of a configuration and runs jobs until `stop`. Calls `ready` with the places of the
/// catalog and the store before the first job.
pub(crate) async fn work<E>(
    config: &WorkConfig,
    stop: &CancellationToken,
    ready: impl FnOnce(String) -> Result<(), E>,
) -> Result<(), ArchiveError> {
    let engine = Engine::open(config).await?;
    let (database, store) = engine.archive.places();
    tracing::info!(%database, %store, workers = config.workers, "working");
    // A reader that has closed stdout does not end the work.
    drop(ready(format!("{database} and {store}")));
    run(&engine, config.workers, stop).await;
    engine.archive.catalog.close().await;
    tracing::info!("stopped");
    Ok(())
}

/// Runs at most `workers` jobs at a time until `stop`; then running jobs get a limited time to finish.
pub(crate) async fn run(engine: &Arc<Engine>, workers: usize, stop: &CancellationToken) {
    if workers > 0
        && let Some(isolation) = &engine.isolation
    {
        tracing::info!(memory = isolation.limit(), "each job is computed in a process of its own");
    }
    let tasks = TaskTracker::new();
    tasks.spawn(reaping(Arc::clone(engine), stop.clone()));
    tasks.spawn(sweeping(Arc::clone(engine), stop.clone()));
    tasks.spawn(ageing(Arc::clone(engine), stop.clone()));
    tasks.spawn(reserving(Arc::clone(engine), stop.clone()));
    tasks.spawn(scrubbing(Arc::clone(engine), stop.clone()));
    tasks.spawn(listening(Arc::clone(engine), stop.clone()));
    for _ in 0..workers {
        tasks.spawn(working(Arc::clone(engine), stop.clone()));
    }
    tasks.close();
    tasks.wait().await;
}

async fn working(engine: Arc<Engine>, stop: CancellationToken) {
    let mut pause = Duration::ZERO;
    loop {
        tokio::select! {
            biased;
            () = stop.cancelled() => return,
            () = sleep(pause) => {}
            () = engine.hub.wait_for_job() => {}
        }
        // A job whose result finds no space would fail, and count as an attempt.
        if let Err(error) = engine.archive.has_room().await {
            if pause != SHORT_OF_SPACE {
                tracing::warn!(%error, "no job is taken from the queue until there is space");
            }
            pause = SHORT_OF_SPACE;
            continue;
        }
        match engine.claim().await {
            Ok(Some(job)) => {
                pause = Duration::ZERO;
                match attempt(&engine, &job, &stop).await {
                    Store::Here => {}
                    Store::Away => until_back(&engine, &stop).await,
                    Store::Full => pause = SHORT_OF_SPACE,
                }
            }
            Ok(None) => pause = LOOK,
            Err(error) => {
                tracing::error!(%error, "the worker cannot claim jobs from the queue");
                pause = LOOK;
            }
        }
    }
}

/// Makes the reserve of disk space beside the catalog, and makes it anew after it was given up.
async fn reserving(engine: Arc<Engine>, stop: CancellationToken) {
    let Some(reserve) = engine.archive.catalog.reserve().cloned() else { return };
    let mut ticks = interval(RESERVE);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            biased;
            () = stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        let reserve = reserve.clone();
        match tokio::task::spawn_blocking(move || reserve.make()).await {
            Ok(Ok(())) => {}
            Ok(Err(error)) => tracing::warn!(%error, "the reserve of disk space beside the catalog was not made"),
            Err(error) => tracing::warn!(%error, "the reserve of disk space beside the catalog was not made"),
        }
    }
}

/// State of the store after an attempt at a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Store {
    /// Nothing in the attempt speaks against the store.
    Here,
    /// The attempt failed, and afterwards the store did not answer or did not belong to this catalog.
    Away,
    /// The attempt found no space on a disk.
    Full,
}

/// Waits until the store answers and belongs to this catalog, or until `stop`, so that a worker that does not reach the
/// store leaves the queue alone.
async fn until_back(engine: &Engine, stop: &CancellationToken) {
    let start = Instant::now();
    while engine.archive.answers().await.is_err() {
        tokio::select! {
            biased;
            () = stop.cancelled() => return,
            () = sleep(LOOK) => {}
        }
    }
    tracing::info!(waited_ms = start.elapsed().as_millis() as u64, "the store is back; this worker takes jobs again");
}

/// Runs one attempt at a job, from its claim until its end is recorded. An attempt that failed without the store does
/// not count.
async fn attempt(engine: &Arc<Engine>, job: &Claimed, stop: &CancellationToken) -> Store {
    let start = Instant::now();
    let engine = &engine.of(&job.tenant);
    let control = engine.hub.enter(&job.id);
    // A panic outside the maths must not take the worker with it.
    let running = tokio::spawn({
        let (engine, job, control) = (Arc::clone(engine), job.clone(), Arc::clone(&control));
        async move {
            match Frame::decode(&job.frame) {
                Ok(frame) => frame.run(&engine, &control).await,
                Err(error @ FrameError::Newer(_)) => Err(Failure::Newer(error.to_string())),
                Err(error) => Err(Failure::Final(JobProblem::new(Code::Internal, error.to_string()))),
            }
        }
    });
    let (mut published, mut store) = (None, Store::Here);
    let ended = match guard(engine, job, &control, running, stop).await {
        Ok(Ok(made)) => {
            published = Some(made.published);
            made.ended
        }
        Ok(Err(Failure::Final(problem))) => Ended::Failed(problem.to_json()),
        Ok(Err(Failure::NoSpace(detail))) => {
            store = Store::Full;
            tracing::warn!(job = job.id, detail, "a disk is full: the job waits, and the attempt does not count");
            Ended::Released
        }
        Ok(Err(failure @ (Failure::Passing(_) | Failure::Damaged))) => match engine.archive.answers().await {
            Err(reason) => {
                store = Store::Away;
                tracing::warn!(
                    job = job.id,
                    reason,
                    "the store is away: the job waits, and this worker takes no other"
                );
                Ended::Released
            }
            Ok(()) => match failure {
                Failure::Passing(detail) => again(engine, job, Code::Unavailable, detail),
                _ => again(engine, job, Code::Corrupt, DAMAGED),
            },
        },
        Ok(Err(Failure::Newer(detail))) => {
            engine.leave_to_newer(&job.id);
            metrics::counter!("wavelume_jobs_left_to_newer_total").increment(1);
            tracing::warn!(job = job.id, detail, "the job is of a newer version: left to a newer worker");
            Ended::Released
        }
        Ok(Err(Failure::Stopped)) if stop.is_cancelled() => Ended::Released,
        Ok(Err(Failure::Stopped)) => Ended::Cancelled,
        Err(Unfinished::Drained) => Ended::Released,
        Err(Unfinished::Lost) => {
            engine.hub.leave(&job.id);
            metrics::counter!("wavelume_jobs_lost_total").increment(1);
            tracing::warn!(job = job.id, "a running job was given up, because it is another worker's now");
            return store;
        }
    };
    let (ended, state) = end(engine, job, ended, published, stop).await;
    engine.hub.leave(&job.id);
    let duration_ms = start.elapsed().as_millis() as u64;
    metrics::histogram!("wavelume_job_duration_seconds").record(start.elapsed().as_secs_f64());
    match state {
        Ok(Ending::Now(state)) => {
            metrics::counter!("wavelume_job_attempts_total", "state" => state.name()).increment(1);
            let reason = match &ended {
                Ended::Failed(problem) | Ended::Retry { problem, .. } => problem.as_str(),
                _ => "",
            };
            match state {
                JobState::Failed | JobState::Dead => {
                    tracing::warn!(job = job.id, %state, attempts = job.attempts, duration_ms, reason, "job ended");
                }
                _ => tracing::info!(job = job.id, %state, attempts = job.attempts, duration_ms, reason, "job ended"),
            }
        }
        // `end` handles a claim that ran out itself.
        Ok(Ending::Lost | Ending::Unpublished | Ending::Over(_)) => {
            tracing::warn!(job = job.id, duration_ms, "the job became another worker's before it ended in this worker");
        }
        Err(error) => {
            tracing::error!(job = job.id, duration_ms, %error, "the end of a job was not recorded in the catalog");
        }
    }
    store
}

/// Detail of the problem of a job whose stored bytes were missing or damaged in an attempt while the store answered.
const DAMAGED: &str = "the stored bytes of the measurement are missing or damaged; upload the file again";

/// Builds the outcome of an attempt that failed for a transient reason. The delay before the next attempt doubles with
/// each attempt.
fn again(engine: &Engine, job: &Claimed, code: Code, detail: impl Into<String>) -> Ended {
    Ended::Retry {
        problem: JobProblem::new(code, detail).to_json(),
        delay: engine.limits.backoff.saturating_mul(1 << job.attempts.saturating_sub(1).min(10)),
        attempts: engine.limits.attempts,
    }
}

/// Reason why an attempt to run a job was given up before its work ended.
enum Unfinished {
    /// Another worker owns the job now.
    Lost,
    /// The worker process is stopping, and the time for its running jobs to finish is over.
    Drained,
}

/// Waits for the work of a job to end, renews the worker's lease meanwhile, and passes on requests to stop.
async fn guard(
    engine: &Engine,
    job: &Claimed,
    control: &Control,
    mut running: tokio::task::JoinHandle<Result<Made, Failure>>,
    stop: &CancellationToken,
) -> Result<Result<Made, Failure>, Unfinished> {
    // The claim has set the lease: the first beat is due later.
    let period = BEAT.min(engine.limits.lease / 3);
    let mut beats = interval_at(tokio::time::Instant::now() + period, period);
    beats.set_missed_tick_behavior(MissedTickBehavior::Delay);
    // Thousands of workers at one database beat seldom, unless somebody looks.
    let has_one_writer = engine.archive.catalog.dialect() == Dialect::Sqlite;
    let mut often = has_one_writer || job.watched;
    let mut last = Instant::now();
    let drained = async {
        stop.cancelled().await;
        sleep(engine.limits.drain).await;
    };
    tokio::pin!(drained);
    loop {
        tokio::select! {
            done = &mut running => {
                return Ok(done.unwrap_or_else(|panic| {
                    tracing::error!(job = job.id, %panic, "a job panicked");
                    Err(Failure::Final(JobProblem::new(Code::Internal, "the job failed; this is a bug of the service")))
                }));
            }
            _ = beats.tick() => {
                let watched = control.take_watched();
                if !often && !watched && last.elapsed() < engine.limits.lease / 3 {
                    continue;
                }
                last = Instant::now();
                match engine.archive.catalog.beat(job, control.progress(), engine.limits.lease).await {
                    Ok(Beat::Yours(watched)) => often = watched || has_one_writer,
                    Ok(Beat::Cancel) => control.stop(),
                    Ok(Beat::Lost) => {
                        control.stop();
                        return Err(Unfinished::Lost);
                    }
                    // The lease is still valid for a while, so the work goes on.
                    Err(error) => tracing::warn!(job = job.id, %error, "the lease of a job was not renewed"),
                }
            }
            () = &mut drained => {
                control.stop();
                return Err(Unfinished::Drained);
            }
        }
    }
}

/// Longest pause between two tries to record the end of an attempt. Raising it spares a database that is restarting.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// Records the end of a job attempt in the catalog, and returns what was recorded. While the database is away,
/// recording is tried again until the worker must stop. Bytes of the result that the catalog may no longer refer to are
/// stored again.
async fn end(
    engine: &Engine,
    job: &Claimed,
    mut ended: Ended,
    mut published: Option<Published>,
    stop: &CancellationToken,
) -> (Ended, Result<Ending, CatalogError>) {
    let mut pause = Duration::from_millis(100);
    loop {
        match engine.archive.catalog.end(job, &ended).await {
            Ok(Ending::Unpublished) => {
                let detail = match published.take() {
                    Some(before) => match before.again(&engine.archive).await {
                        Ok(again) => {
                            ended.reclaim(again.claim().clone());
                            published = Some(again);
                            continue;
                        }
                        Err(error) => error.to_string(),
                    },
                    None => "the result of the job was not stored".to_owned(),
                };
                ended = again(engine, job, Code::Unavailable, detail);
            }
            Ok(Ending::Over(over)) => {
                ended = Ended::Failed(JobProblem::new(Code::QuotaExceeded, over.to_string()).to_json());
                if let Some(refused) = published.take() {
                    refused.withdraw(&engine.archive).await;
                }
            }
            Err(CatalogError::Sql(error)) if !stop.is_cancelled() || pause < Duration::from_secs(1) => {
                tracing::warn!(job = job.id, %error, "the end of a job was not recorded; recording is tried again");
                sleep(pause).await;
                pause = LONGEST_PAUSE.min(2 * pause);
            }
            other => return (ended, other),
        }
    }
}

async fn reaping(engine: Arc<Engine>, stop: CancellationToken) {
    let lost = JobProblem::new(Code::WorkerLost, "its worker vanished in every attempt").to_json();
    let mut ticks = interval(LOOK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    // Leases run out while the database is away. Their workers get a whole lease to renew them afterwards.
    let mut answers_since = Instant::now();
    loop {
        tokio::select! {
            biased;
            () = stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        let expired = answers_since.elapsed() >= engine.limits.lease;
        if let Err(error) = reap(&engine, expired, &lost).await {
            tracing::error!(%error, "jobs of lost workers were not taken back");
            answers_since = Instant::now();
        }
    }
}

/// Takes jobs back from the workers of this host whose processes have ended, and, if `expired`, from all workers whose
/// lease has run out.
async fn reap(engine: &Arc<Engine>, expired: bool, lost: &str) -> Result<(), CatalogError> {
    let seeker = Arc::clone(engine);
    let gone = tokio::task::spawn_blocking(move || seeker.presence.gone()).await;
    let gone = gone.map_err(std::io::Error::other).flatten().unwrap_or_else(|error| {
        tracing::warn!(%error, "lost workers of this host cannot be listed; their jobs wait until the leases expire");
        Vec::new()
    });
    let reaped = engine.archive.catalog.reap(&gone, expired, engine.limits.lost, lost).await?;
    if !gone.is_empty()
        && let Err(error) = engine.archive.sweep_staging(engine.limits.stale).await
    {
        tracing::warn!(%error, "temporary files of lost workers were not removed");
    }
    engine.presence.forget(&gone);
    for job in &reaped {
        tracing::warn!(job, "job taken back from a lost worker");
        engine.hub.changed(job);
        engine.hub.queued();
    }
    Ok(())
}

/// Lets batch jobs that have waited for long count as usual ones, until `stop`.
async fn ageing(engine: Arc<Engine>, stop: CancellationToken) {
    let age = engine.limits.batch_age;
    let mut ticks = interval((age / 60).clamp(LOOK, LONGEST_AGEING));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            biased;
            () = stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        match engine.archive.catalog.age(age).await {
            Ok(0) => {}
            Ok(jobs) => tracing::info!(jobs, "batch jobs that have waited for long now count as usual jobs"),
            Err(error) => tracing::error!(%error, "the waiting times of batch jobs were not checked"),
        }
    }
}

async fn sweeping(engine: Arc<Engine>, stop: CancellationToken) {
    let mut ticks = interval(engine.limits.sweep);
    loop {
        tokio::select! {
            biased;
            () = stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        let start = Instant::now();
        let checked = engine.archive.check_clock().await;
        let is_doubted = matches!(checked, Err(ArchiveError::Clock(_)));
        metrics::gauge!("wavelume_clock_doubted").set(f64::from(u8::from(is_doubted)));
        let swept = match checked {
            Ok(()) => engine.archive.sweep_within(&engine.limits, &|| stop.is_cancelled()).await,
            Err(error) => Err(error),
        };
        let duration_ms = start.elapsed().as_millis() as u64;
        match swept {
            Ok(report) if report.removed_blobs + report.removed_staging + report.forgotten_jobs > 0 => tracing::info!(
                removed_blobs = report.removed_blobs,
                removed_bytes = report.removed_bytes,
                removed_staging = report.removed_staging,
                forgotten_jobs = report.forgotten_jobs,
                duration_ms,
                "swept"
            ),
            Ok(_) => {}
            Err(error) => tracing::error!(%error, duration_ms, "the sweep failed"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::publish::tests::{Late, SPECTRUM, upload};
    use super::*;
    use crate::catalog::{Enqueued, NewJob, Priority};
    use crate::compress::Target;
    use crate::jobs::JobRequest;
    use crate::jobs::request::CompressRequest;
    use serde_json::json;

    /// Takes the only waiting job from the queue of a test service and tries once to run it; returns the job.
    async fn attempted(engine: &Arc<Engine>) -> Claimed {
        let job = engine.claim().await.unwrap().expect("a job waits");
        attempt(engine, &job, &CancellationToken::new()).await;
        job
    }

    async fn queue(engine: &Engine, frame: &str) -> String {
        let id = uuid::Uuid::now_v7().to_string();
        let new = NewJob {
            id: id.clone(),
            frame: frame.to_owned(),
            level: 1,
            measurement: None,
            priority: Priority::Usual,
            share: String::new(),
            idempotency: None,
        };
        assert!(matches!(engine.archive.catalog.enqueue(&new, 99).await.unwrap(), Enqueued::New(_)));
        id
    }

    #[tokio::test]
    async fn a_job_of_a_newer_version_waits_for_a_newer_worker() {
        let (engine, _, _data) = Late::engine(0).await;
        let measurement = crate::store::Digest::of(b"lamp");
        let unknown = json!({ "measurement": measurement, "target": { "er_l2": 0.01 }, "denoise": true }).to_string();
        let frames = [
            // A third kind of job, a request with another field, and an eighth table.
            "020000000100000000000000ff".to_owned(),
            Frame::Compress { request: unknown }.encode().unwrap(),
            Frame::Paper { tables: vec![8] }.encode().unwrap(),
        ];
        for frame in frames {
            let id = queue(&engine, &frame).await;
            attempted(&engine).await;
            let row = engine.archive.catalog.job(&id).await.unwrap().unwrap();
            assert_eq!((row.state, row.attempts, row.problem), (JobState::Queued, 0, None), "{frame}");
            assert!(engine.claim().await.unwrap().is_none(), "this process does not take it again");
            let newer = engine.archive.catalog.claim("newer", LOOK, &[]).await.unwrap().unwrap();
            assert_eq!((newer.id, newer.attempts), (id.clone(), 1), "a newer worker takes it at once");
            engine.archive.catalog.cancel(&id).await.unwrap();
        }
        let id = queue(&engine, "not hexadecimal").await;
        attempted(&engine).await;
        assert_eq!(engine.archive.catalog.job(&id).await.unwrap().unwrap().state, JobState::Failed);
    }

    #[tokio::test]
    async fn a_result_whose_claim_ran_out_is_published_again_before_the_job_succeeds() {
        let (engine, times, _data) = Late::engine(0).await;
        let staged = engine.archive.staging.stage(SPECTRUM).unwrap();
        let (row, _) = engine.ingest(staged, upload()).await.unwrap();
        let request = json!({ "measurement": row.id, "target": Target::ErL2(0.01) });
        let request: CompressRequest = serde_json::from_value(request).unwrap();
        for (late, expected) in [(2, JobState::Succeeded), (99, JobState::Queued)] {
            times.store(late, std::sync::atomic::Ordering::Relaxed);
            let request = JobRequest::Compress(Box::new(request.clone()));
            let Enqueued::New(job) = engine.enqueue(&request, None).await.unwrap() else { panic!() };
            attempted(&engine).await;
            let job = engine.job(&job.id).await.unwrap().unwrap();
            assert_eq!(job.state, expected, "{job:?}");
            assert_eq!(engine.archive.check().await.unwrap().faults, []);
            if let Some(material) = job.material {
                engine.archive.get(material).await.unwrap();
                engine.archive.catalog.delete_material(material).await.unwrap();
                engine.archive.sweep_now().await.unwrap();
            }
        }
    }
}
