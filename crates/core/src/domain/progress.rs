//! How long work tells its caller how far it is, and hears that it should stop.

/// The caller's end of long work: it hears progress and may ask for a stop.
pub trait Progress: Sync {
    /// The work is `fraction` (0..=1) done.
    fn report(&self, fraction: f64);
    /// Whether the caller wants the work to stop; polled between steps.
    fn is_cancelled(&self) -> bool {
        false
    }
    /// `Err(Cancelled)` once the caller wants the work to stop, after reporting `fraction`.
    fn step(&self, fraction: f64) -> Result<(), Cancelled> {
        self.report(fraction);
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// Nobody is listening.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Progress for Silent {
    fn report(&self, _fraction: f64) {}
}

/// The caller asked the work to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;
