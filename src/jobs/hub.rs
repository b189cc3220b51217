//! Progress and cancellation of the running jobs of this process, and the followers of these and other jobs.

use crate::domain::Progress;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Notify, broadcast};
use tokio_util::sync::CancellationToken;

/// Notifies workers of new jobs and clients of changes to jobs, within one process. Jobs of other processes are visible
/// only in the database.
#[derive(Clone, Debug)]
pub(crate) struct Hub {
    running: Arc<Mutex<HashMap<String, Arc<Control>>>>,
    changes: broadcast::Sender<Arc<str>>,
    queued: Arc<Notify>,
    /// Number of requests that follow each job (wait for its changes); jobs without such requests are absent.
    followed: Arc<Mutex<HashMap<String, usize>>>,
}

/// Registration of a request that follows a job (waits for its changes). Dropping this value ends the registration.
#[derive(Debug)]
pub(crate) struct Following {
    hub: Hub,
    job: String,
}

/// Handle of a running job, through which it reports progress and receives requests to stop.
#[derive(Debug)]
pub(crate) struct Control {
    job: Arc<str>,
    progress: AtomicU64,
    stop: CancellationToken,
    /// True once a client of another process has begun to follow the job, until the job's worker has taken note.
    watched: AtomicBool,
    changes: broadcast::Sender<Arc<str>>,
}

impl Hub {
    pub(crate) fn new() -> Self {
        Self {
            running: Arc::default(),
            changes: broadcast::channel(1024).0,
            queued: Arc::default(),
            followed: Arc::default(),
        }
    }

    /// Registers a job that starts to run in this process.
    pub(crate) fn enter(&self, job: &str) -> Arc<Control> {
        let control = Arc::new(Control {
            job: job.into(),
            progress: AtomicU64::new(0),
            stop: CancellationToken::new(),
            watched: AtomicBool::new(false),
            changes: self.changes.clone(),
        });
        self.running().insert(job.to_owned(), Arc::clone(&control));
        self.changed(job);
        control
    }

    /// Removes a job from the list of the jobs that run in this process.
    pub(crate) fn leave(&self, job: &str) {
        self.running().remove(job);
        self.changed(job);
    }

    /// Returns the progress (0 to 1) of a job; `None` if the job does not run in this process.
    pub(crate) fn progress(&self, job: &str) -> Option<f64> {
        self.running().get(job).map(|control| control.progress())
    }

    /// Asks a job to stop, if it runs in this process.
    pub(crate) fn stop(&self, job: &str) {
        if let Some(control) = self.running().get(job) {
            control.stop();
        }
    }

    /// Takes note that a client of another process follows a job, if the job runs in this process.
    pub(crate) fn watch(&self, job: &str) {
        if let Some(control) = self.running().get(job) {
            control.watched.store(true, Ordering::Relaxed);
        }
    }

    /// Notifies listeners that a job has changed.
    pub(crate) fn changed(&self, job: &str) {
        // Nobody may be listening.
        let _ = self.changes.send(job.into());
    }

    /// Subscribes to the ids of jobs that change from now on.
    pub(crate) fn listen(&self) -> broadcast::Receiver<Arc<str>> {
        self.changes.subscribe()
    }

    /// Wakes one waiting worker of this process, because a new job is queued.
    pub(crate) fn queued(&self) {
        self.queued.notify_one();
    }

    /// Waits until a new job may be queued.
    pub(crate) async fn wait_for_job(&self) {
        self.queued.notified().await;
    }

    /// Registers a request that follows a job, that is, waits for its changes.
    pub(crate) fn follow(&self, job: &str) -> Following {
        *self.followed().entry(job.to_owned()).or_default() += 1;
        Following { hub: self.clone(), job: job.to_owned() }
    }

    /// Returns the jobs that some request follows (waits for their changes) and that do not run in this process.
    pub(crate) fn followed_elsewhere(&self) -> Vec<String> {
        let running = self.running();
        self.followed().keys().filter(|job| !running.contains_key(*job)).cloned().collect()
    }

    fn followed(&self) -> MutexGuard<'_, HashMap<String, usize>> {
        self.followed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn running(&self) -> MutexGuard<'_, HashMap<String, Arc<Control>>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Following {
    fn drop(&mut self) {
        let mut followed = self.hub.followed();
        if let Some(count) = followed.get_mut(&self.job) {
            *count -= 1;
            if *count == 0 {
                followed.remove(&self.job);
            }
        }
    }
}

impl Control {
    pub(crate) fn stop(&self) {
        self.stop.cancel();
    }

    /// Waits until the job is asked to stop.
    pub(super) async fn stopped(&self) {
        self.stop.cancelled().await;
    }

    /// Returns true if a client of another process has begun to follow the job since the last call.
    pub(crate) fn take_watched(&self) -> bool {
        self.watched.swap(false, Ordering::Relaxed)
    }

    pub(crate) fn progress(&self) -> f64 {
        f64::from_bits(self.progress.load(Ordering::Relaxed))
    }
}

impl Progress for Control {
    fn report(&self, fraction: f64) {
        let fraction = if fraction.is_finite() { fraction.clamp(0.0, 1.0) } else { return };
        let before = self.progress();
        // Progress only grows, and only a step of one per cent or more is announced.
        if fraction > before {
            self.progress.store(fraction.to_bits(), Ordering::Relaxed);
            if (fraction * 100.0).floor() > (before * 100.0).floor() {
                let _ = self.changes.send(Arc::clone(&self.job));
            }
        }
    }

    fn is_cancelled(&self) -> bool {
        self.stop.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visible_steps_are_told_and_stops_are_heard() {
        let hub = Hub::new();
        let control = hub.enter("job");
        let mut changes = hub.listen();
        for fraction in [0.001, 0.5, 0.5001, 0.2, f64::NAN] {
            control.report(fraction);
        }
        assert_eq!(&*changes.try_recv().unwrap(), "job");
        assert!(changes.try_recv().is_err());
        assert_eq!(hub.progress("job"), Some(0.5001));
        assert!(control.step(0.6).is_ok());
        hub.stop("job");
        assert!(control.step(0.7).is_err());
        let following = [hub.follow("job"), hub.follow("job"), hub.follow("other")];
        assert_eq!(hub.followed_elsewhere(), ["other"]);
        hub.leave("job");
        assert_eq!(hub.progress("job"), None);
        assert_eq!(hub.followed_elsewhere().len(), 2);
        drop(following);
        assert!(hub.followed_elsewhere().is_empty());
    }
}
