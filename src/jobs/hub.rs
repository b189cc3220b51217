//! What the running jobs of this process are doing right now, and who wants to know.

use crate::domain::Progress;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Notify, broadcast};

/// Tells workers of new jobs and clients of changes. Other processes are heard through the catalog only.
#[derive(Clone, Debug)]
pub(crate) struct Hub {
    running: Arc<Mutex<HashMap<String, Arc<Control>>>>,
    changes: broadcast::Sender<Arc<str>>,
    queued: Arc<Notify>,
}

/// One running job: its progress goes out, a wish to stop goes in.
#[derive(Debug)]
pub(crate) struct Control {
    job: Arc<str>,
    progress: AtomicU64,
    stop: AtomicBool,
    changes: broadcast::Sender<Arc<str>>,
}

impl Hub {
    pub(crate) fn new() -> Self {
        Self { running: Arc::default(), changes: broadcast::channel(1024).0, queued: Arc::default() }
    }

    /// Enters a job that begins to run here.
    pub(crate) fn enter(&self, job: &str) -> Arc<Control> {
        let control = Arc::new(Control {
            job: job.into(),
            progress: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            changes: self.changes.clone(),
        });
        self.running().insert(job.to_owned(), Arc::clone(&control));
        self.changed(job);
        control
    }

    /// Removes a job that runs here no more.
    pub(crate) fn leave(&self, job: &str) {
        self.running().remove(job);
        self.changed(job);
    }

    /// The progress of a job that runs here.
    pub(crate) fn progress(&self, job: &str) -> Option<f64> {
        self.running().get(job).map(|control| control.progress())
    }

    /// Asks a job to stop, if it runs here.
    pub(crate) fn stop(&self, job: &str) {
        if let Some(control) = self.running().get(job) {
            control.stop();
        }
    }

    /// Says that something about a job is new.
    pub(crate) fn changed(&self, job: &str) {
        // Nobody may be listening.
        let _ = self.changes.send(job.into());
    }

    /// The ids of jobs about which something is new, from now on.
    pub(crate) fn listen(&self) -> broadcast::Receiver<Arc<str>> {
        self.changes.subscribe()
    }

    /// Says that there is a new job.
    pub(crate) fn queued(&self) {
        self.queued.notify_one();
    }

    /// Waits for a new job.
    pub(crate) async fn wait_for_job(&self) {
        self.queued.notified().await;
    }

    fn running(&self) -> MutexGuard<'_, HashMap<String, Arc<Control>>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Control {
    pub(crate) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    pub(crate) fn progress(&self) -> f64 {
        f64::from_bits(self.progress.load(Ordering::Relaxed))
    }
}

impl Progress for Control {
    fn report(&self, fraction: f64) {
        let fraction = if fraction.is_finite() { fraction.clamp(0.0, 1.0) } else { return };
        let before = self.progress();
        // Progress only grows, and only a visible step is told.
        if fraction > before {
            self.progress.store(fraction.to_bits(), Ordering::Relaxed);
            if (fraction * 100.0).floor() > (before * 100.0).floor() {
                let _ = self.changes.send(Arc::clone(&self.job));
            }
        }
    }

    fn is_cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
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
        hub.leave("job");
        assert_eq!(hub.progress("job"), None);
    }
}
