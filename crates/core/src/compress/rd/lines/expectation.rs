//! Expected squared errors of predictions where few are known nearby: running means, as a whole and by brightness.

/// Rate of the running mean.
const RATE: f64 = 0.02;
/// Start of the running mean, in squared units of values.
const START: f64 = 0.02;
/// Weight of the running mean beside the sum over details of the same brightness.
const WEIGHT: f64 = 4.0;
/// Factor of the sums of a brightness for each detail of it.
const DECAY: f64 = 0.98;
/// Bins of brightness, half a unit wide.
const BINS: usize = 64;

/// Squared errors of the predictions so far.
#[derive(Clone, Debug)]
pub(super) struct Expectation {
    running: f64,
    bins: [(f64, f64); BINS],
    /// Bins in a step.
    per_step: f64,
}

impl Expectation {
    /// Before any prediction; `unit` is that of values in steps, one natural logarithm where values are logarithms.
    pub(super) fn new(unit: f64) -> Self {
        Self { running: START * unit * unit, bins: [(0.0, 0.0); BINS], per_step: 2.0 / unit }
    }

    /// The bin of a mean in steps.
    #[inline]
    pub(super) fn bin_of(&self, mean: f64) -> usize {
        ((mean * self.per_step).floor() + 32.0).clamp(0.0, (BINS - 1) as f64) as usize
    }

    /// The squared error to expect at means of a bin.
    #[inline]
    pub(super) fn of(&self, bin: usize) -> f64 {
        let (sum, weight) = self.bins[bin];
        (self.running * WEIGHT + sum) / (WEIGHT + weight)
    }

    /// Adds the squared error of a prediction.
    #[inline]
    pub(super) fn learn(&mut self, bin: usize, error: f64) {
        self.running += (error - self.running) * RATE;
        let (sum, weight) = &mut self.bins[bin];
        *sum = *sum * DECAY + error;
        *weight = *weight * DECAY + 1.0;
    }
}
