//! News of jobs that run in other processes: polled for all followers together, and told by notifications.

use super::engine::Engine;
use crate::catalog::{CatalogError, JobState, Notice};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::{MissedTickBehavior, interval, sleep};
use tokio_util::sync::CancellationToken;

/// Interval at which this process polls the catalog for jobs that its clients follow and other processes run. Raising
/// it delays what clients see.
const LOOK: Duration = Duration::from_millis(500);

/// Time for which a worker often stores the progress of a job after a process has asked it to. Raising it lets the
/// worker store progress often for longer after the last client has stopped following.
const WATCH: Duration = Duration::from_secs(30);

/// Pause after a failure of the database before jobs and notifications are read again. Raising it spares a database
/// that is restarting.
const PAUSE: Duration = Duration::from_secs(2);

/// Polls the catalog, until `stop`, for the state of jobs that clients of this process follow and other processes run.
pub(crate) async fn watching(engine: Arc<Engine>, stop: CancellationToken) {
    let mut ticks = interval(LOOK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut known: HashMap<String, (JobState, f64)> = HashMap::new();
    let mut asked: Option<Instant> = None;
    loop {
        tokio::select! {
            () = stop.cancelled() => return,
            _ = ticks.tick() => {}
        }
        let followed = engine.hub.followed_elsewhere();
        if followed.is_empty() {
            known.clear();
            continue;
        }
        let look = async {
            if asked.is_none_or(|asked| asked.elapsed() > WATCH / 3)
                || followed.iter().any(|id| !known.contains_key(id))
            {
                engine.archive.catalog.watch(&followed, WATCH).await?;
                for new in followed.iter().filter(|id| !known.contains_key(*id)) {
                    engine.archive.catalog.tell_watch(new).await?;
                }
                asked = Some(Instant::now());
            }
            let seen = engine.archive.catalog.seen(&followed).await?;
            let mut now = HashMap::with_capacity(seen.len());
            for job in seen {
                if known.get(&job.id) != Some(&(job.state, job.progress)) {
                    engine.hub.changed(&job.id);
                }
                now.insert(job.id, (job.state, job.progress));
            }
            known = now;
            Ok::<_, CatalogError>(())
        };
        if let Err(error) = look.await {
            tracing::warn!(%error, "the state of jobs that clients follow was not read");
            sleep(PAUSE).await;
        }
    }
}

/// Passes notifications from other processes on to this process, until `stop`. Without notifications, polling finds the
/// same changes later.
pub(crate) async fn listening(engine: Arc<Engine>, stop: CancellationToken) {
    let listen = async {
        loop {
            if let Err(error) = listen(&engine).await {
                tracing::warn!(%error, "notifications of other processes are not heard; jobs are found by polling");
                sleep(PAUSE).await;
            } else {
                // The database has none.
                std::future::pending::<()>().await;
            }
        }
    };
    tokio::select! {
        () = stop.cancelled() => {}
        () = listen => {}
    }
}

async fn listen(engine: &Engine) -> Result<(), CatalogError> {
    let Some(mut notices) = engine.archive.catalog.listen().await? else { return Ok(()) };
    loop {
        match notices.next().await? {
            Notice::Queued | Notice::Missed => engine.hub.queued(),
            Notice::Stop(job) => engine.hub.stop(&job),
            Notice::Watch(job) => engine.hub.watch(&job),
        }
    }
}
