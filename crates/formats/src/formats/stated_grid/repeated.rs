//! Spread of values that a file states more than once for one direction.

/// Deviations between values that a file lists more than once for one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repeated {
    /// Sum of the squared relative deviations of repeated values from the mean for their direction.
    pub squares: f64,
    /// Number of values in the sum of squared deviations: all values that a file lists more than once for one
    /// direction, except where the mean for the direction is 0.
    pub values: u64,
}

impl Repeated {
    /// Adds the deviations between the values that a file lists for one direction to the sum of squares. Missing values
    /// are skipped. A direction with a single value has no deviation.
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

    /// Returns the root mean square of the relative deviations of repeated values from the mean for their direction
    /// (0.01 is 1 %); `None` if no direction is listed more than once.
    pub fn rms(&self) -> Option<f64> {
        (self.values > 0).then(|| (self.squares / self.values as f64).sqrt())
    }
}
