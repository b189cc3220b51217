//! Spread of values that a file states more than once for one direction.

/// Spread of values that are stated more than once for one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repeated {
    /// Sum of squared relative deviations from the mean of each direction.
    pub squares: f64,
    /// Number of values in the sum: those at directions whose mean is not 0.
    pub values: u64,
}

impl Repeated {
    /// Adds the values of one direction; missing ones are skipped. Fewer than two have no effect.
    pub(crate) fn add(&mut self, values: impl Iterator<Item = f64> + Clone) {
        let values = values.filter(|value| !value.is_nan());
        let (sum, count) = values.clone().fold((0.0, 0_u64), |(sum, count), value| (sum + value, count + 1));
        let mean = sum / count as f64;
        if count > 1 && mean != 0.0 {
            let relative = |value: f64| (value - mean) / mean;
            self.squares += values.map(|value| relative(value) * relative(value)).sum::<f64>();
            self.values += count;
        }
    }

    /// Returns the root mean square of the relative deviations; `None` if no direction is stated more than once.
    pub fn rms(&self) -> Option<f64> {
        (self.values > 0).then(|| (self.squares / self.values as f64).sqrt())
    }
}
