//! Counters of the work in a compression: how often samples were quantised and coded or reconstructed.

use std::sync::atomic::{AtomicU64, Ordering};

/// Work of the search for a compressed file that meets its target: number of trial compressions, and of the samples
/// that they process.
///
/// A trial quantises coefficients with one step or threshold, and codes them, reconstructs the samples from them, or
/// both. Transforms shared by trials, and counts of coefficients, are not trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Number of trials (quantisations that were coded or reconstructed), including those on a part of the samples.
    pub trials: u64,
    /// Number of samples processed, summed over all trial quantisations: a sample counts once for each trial.
    pub samples: u64,
}

/// Thread-safe counter of trials and of the samples they process, shared by all searches for a file.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    trials: AtomicU64,
    samples: AtomicU64,
}

impl Tally {
    /// Counts one trial: a quantisation of `samples` samples with one step or threshold whose result is coded or
    /// reconstructed.
    pub(crate) fn add(&self, samples: usize) {
        self.trials.fetch_add(1, Ordering::Relaxed);
        self.samples.fetch_add(samples as u64, Ordering::Relaxed);
    }

    /// Returns the number of trial quantisations counted up to now, and of the samples that they processed.
    pub(crate) fn effort(&self) -> Effort {
        Effort { trials: self.trials.load(Ordering::Relaxed), samples: self.samples.load(Ordering::Relaxed) }
    }
}
