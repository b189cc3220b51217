//! Expected squared errors of predictions with few known neighbours: running means, overall and by brightness.

/// Rate at which the running mean of squared prediction errors follows new ones. Raising it adapts faster, with more
/// noise.
const RATE: f64 = 0.02;
/// Initial value of the running mean of squared prediction errors, in squared units of values (natural logarithms).
const START: f64 = 0.02;
/// Weight of the mean of all recent squared prediction errors in an expected error; one earlier error at about the same
/// local mean (brightness) of the values has the weight 1. Raising it trusts brightness less.
const WEIGHT: f64 = 4.0;
/// Factor on the sum of squared prediction errors at about the same local mean (brightness) whenever another value with
/// this mean is coded. Raising it lengthens the memory.
const DECAY: f64 = 0.98;
/// Number of bins of the local mean (brightness) of values, each half a natural logarithm wide, in which squared
/// prediction errors are averaged separately.
const BINS: usize = 64;

/// Statistics of the squared prediction errors so far: a running mean overall, and sums by brightness.
#[derive(Clone, Debug)]
pub(super) struct Expectation {
    running: f64,
    bins: [(f64, f64); BINS],
    /// Number of bins of the local mean (brightness) that one quantiser step spans, mostly a fraction of a bin.
    per_step: f64,
}

impl Expectation {
    /// Builds the initial statistics of prediction errors. `unit` is the number of quantiser steps in a change of 1 in
    /// the natural logarithm, or a fixed number if samples are coded instead of logarithms.
    pub(super) fn new(unit: f64) -> Self {
        Self { running: START * unit * unit, bins: [(0.0, 0.0); BINS], per_step: 2.0 / unit }
    }

    /// Index of the bin of brightness into which a local mean of values, given in quantiser steps, falls. Prediction
    /// errors are averaged by bin.
    #[inline]
    pub(super) fn bin_of(&self, mean: f64) -> usize {
        ((mean * self.per_step).floor() + 32.0).clamp(0.0, (BINS - 1) as f64) as usize
    }

    /// Expected squared prediction error, in squared quantiser steps, of the difference of two neighbours whose mean
    /// falls into brightness bin number `bin`.
    #[inline]
    pub(super) fn of(&self, bin: usize) -> f64 {
        let (sum, weight) = self.bins[bin];
        (self.running * WEIGHT + sum) / (WEIGHT + weight)
    }

    /// Adds the squared error of a prediction to the running mean and to the sums of the bin of brightness (local mean)
    /// `bin`.
    #[inline]
    pub(super) fn learn(&mut self, bin: usize, error: f64) {
        self.running += (error - self.running) * RATE;
        let (sum, weight) = &mut self.bins[bin];
        *sum = *sum * DECAY + error;
        *weight = *weight * DECAY + 1.0;
    }
}
