//! Counters of the work in a compression: how often samples were quantised and coded or reconstructed.

use std::sync::atomic::{AtomicU64, Ordering};

/// Number of trials of a search.
///
/// A trial quantises coefficients with one step or threshold, and codes them, reconstructs the samples from them, or
/// both. Transforms shared by trials, and counts of coefficients, are not trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Number of trials, including those on a part of the samples.
    pub trials: u64,
    /// Samples processed by all trials together.
    pub samples: u64,
}

/// Thread-safe counter of an [`Effort`], shared by all searches.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    trials: AtomicU64,
    samples: AtomicU64,
}

impl Tally {
    /// Counts one trial on `samples` samples.
    pub(crate) fn add(&self, samples: usize) {
        self.trials.fetch_add(1, Ordering::Relaxed);
        self.samples.fetch_add(samples as u64, Ordering::Relaxed);
    }

    /// Returns the counts accumulated up to now.
    pub(crate) fn effort(&self) -> Effort {
        Effort { trials: self.trials.load(Ordering::Relaxed), samples: self.samples.load(Ordering::Relaxed) }
    }
}
