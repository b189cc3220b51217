//! Progress reporting and cancellation of long-running work.

/// Callback with which the caller of long-running work receives progress and can cancel.
pub trait Progress: Sync {
    /// Receives the fraction (0..=1) of the work that is done.
    fn report(&self, fraction: f64);
    /// Returns true if the long-running work should stop; called between steps.
    fn is_cancelled(&self) -> bool {
        false
    }
    /// Reports the finished `fraction` (0..=1) of the work, then returns `Err(Cancelled)` if the work should stop.
    fn step(&self, fraction: f64) -> Result<(), Cancelled> {
        self.report(fraction);
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// Progress callback that discards reports and never cancels.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Progress for Silent {
    fn report(&self, _fraction: f64) {}
}

/// Error that long-running work returns when its caller cancels it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the computation was cancelled by its caller")]
pub struct Cancelled;
