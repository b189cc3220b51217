//! Totals of errors over samples, and the measures of error that are means of them.

use std::ops::{Add, Sub};

/// Totals over samples of their errors and of their squares, for measures of error that are means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Totals {
    /// Number of relative errors.
    pub(crate) scored: f64,
    /// Sum of relative errors.
    pub(crate) relative: f64,
    /// Sum of squared relative errors.
    pub(crate) relative_squared: f64,
    /// Sum of squared absolute errors.
    pub(crate) squared: f64,
    /// Sum of squared original samples.
    pub(crate) signal: f64,
}

impl Totals {
    fn combined(self, other: Self, of: fn(f64, f64) -> f64) -> Self {
        Self {
            scored: of(self.scored, other.scored),
            relative: of(self.relative, other.relative),
            relative_squared: of(self.relative_squared, other.relative_squared),
            squared: of(self.squared, other.squared),
            signal: of(self.signal, other.signal),
        }
    }

    /// Mean relative error, er(L1); 0 without scored samples.
    pub(crate) fn er_l1(&self) -> f64 {
        if self.scored > 0.0 { self.relative / self.scored } else { 0.0 }
    }

    /// Root mean square relative error, er(L2); 0 without scored samples.
    pub(crate) fn er_l2(&self) -> f64 {
        if self.scored > 0.0 { (self.relative_squared.max(0.0) / self.scored).sqrt() } else { 0.0 }
    }

    /// Relative root mean square error.
    pub(crate) fn relative_rmse(&self) -> f64 {
        if self.squared <= 0.0 {
            0.0
        } else if self.signal <= 0.0 {
            f64::MAX
        } else {
            (self.squared / self.signal).sqrt()
        }
    }
}

impl Add for Totals {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.combined(other, |a, b| a + b)
    }
}

impl Sub for Totals {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.combined(other, |a, b| a - b)
    }
}
