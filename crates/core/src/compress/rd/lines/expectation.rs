//! Expected squared errors of predictions with few known neighbours: running means, overall and by brightness.

/// Rate of the running mean. Raising it adapts faster, with more noise.
const RATE: f64 = 0.02;
/// Initial value of the running mean, in squared units of values.
const START: f64 = 0.02;
/// Weight of the running mean relative to one detail of the same brightness. Raising it trusts brightness less.
const WEIGHT: f64 = 4.0;
/// Factor on the running sums of a brightness bin whenever another detail of that bin is coded. Raising it lengthens
/// the memory.
const DECAY: f64 = 0.98;
/// Number of brightness bins, each half a unit wide.
const BINS: usize = 64;

/// Squared errors of the predictions so far.
#[derive(Clone, Debug)]
pub(super) struct Expectation {
    running: f64,
    bins: [(f64, f64); BINS],
    /// Bins to a step.
    per_step: f64,
}

impl Expectation {
    /// Initial state. `unit` is the unit of values in steps: one natural logarithm if values are logarithms.
    pub(super) fn new(unit: f64) -> Self {
        Self { running: START * unit * unit, bins: [(0.0, 0.0); BINS], per_step: 2.0 / unit }
    }

    /// Bin of a mean given in steps.
    #[inline]
    pub(super) fn bin_of(&self, mean: f64) -> usize {
        ((mean * self.per_step).floor() + 32.0).clamp(0.0, (BINS - 1) as f64) as usize
    }

    /// Expected squared error at means of a bin.
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
