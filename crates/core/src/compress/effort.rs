//! The work that a compression took, counted: how often samples were quantised and coded or reconstructed.

use std::sync::atomic::{AtomicU64, Ordering};

/// The trials of a search.
///
/// A trial quantises coefficients with one step or threshold, and codes them, reconstructs the samples from them, or does
/// both. Transforms that are shared by trials, and counts of coefficients, are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// How many trials there were, those on a part of the samples included.
    pub trials: u64,
    /// Samples that all trials together went through.
    pub samples: u64,
}

/// An [`Effort`] in the making, shared by everything that tries.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    trials: AtomicU64,
    samples: AtomicU64,
}

impl Tally {
    /// Counts one trial on so many samples.
    pub(crate) fn add(&self, samples: usize) {
        self.trials.fetch_add(1, Ordering::Relaxed);
        self.samples.fetch_add(samples as u64, Ordering::Relaxed);
    }

    /// Everything counted so far.
    pub(crate) fn effort(&self) -> Effort {
        Effort { trials: self.trials.load(Ordering::Relaxed), samples: self.samples.load(Ordering::Relaxed) }
    }
}
