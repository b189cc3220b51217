//! Wavelength axis: nanometres, strictly increasing, even or uneven.

use super::limits::MAX_WAVELENGTHS;
use crate::numeric::bracket::Bracket;

/// Wavelengths in nm, strictly increasing, finite and positive; even grids are stored as start and step.
#[derive(Clone, Debug, PartialEq)]
pub enum WavelengthGrid {
    /// Evenly spaced wavelengths, `start + i * step`.
    Even {
        /// First and shortest of the evenly spaced wavelengths, in nm.
        start: f64,
        /// Distance between neighbouring wavelengths, in nm; positive.
        step: f64,
        /// Number of evenly spaced wavelengths; at least 1.
        count: usize,
    },
    /// List of all wavelengths, in nm.
    Uneven(Vec<f64>),
}

/// Reasons why numbers do not form an axis of wavelengths.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WavelengthError {
    /// The list of wavelengths is empty.
    #[error("a wavelength axis needs at least one wavelength")]
    Empty,
    /// The number of wavelengths exceeds the limit.
    #[error("{found} wavelengths are more than the limit of {MAX_WAVELENGTHS}")]
    TooMany {
        /// Number of wavelengths in the list that is too long.
        found: usize,
    },
    /// A wavelength is not positive or not finite.
    #[error("wavelength {index} is {value}, expected a positive finite number of nm")]
    NotPositive {
        /// Position of the invalid wavelength in its list, from 0.
        index: usize,
        /// Invalid wavelength in nm: not positive or not finite.
        value: f64,
    },
    /// A wavelength is not larger than its predecessor.
    #[error("wavelength {index} is {value} nm after {previous} nm, expected a strictly increasing axis")]
    NotIncreasing {
        /// Position in its list of the wavelength that does not increase, from 0.
        index: usize,
        /// Wavelength that breaks the increasing order of the list, since it is not larger than the one before it; in
        /// nm.
        value: f64,
        /// Wavelength just before the one that breaks the increasing order of the list, in nm.
        previous: f64,
    },
    /// The text of a range of wavelengths is not of the form START:STOP:STEP.
    #[error("`{found}` is no wavelength range, expected START:STOP:STEP in nm with START <= STOP and STEP > 0")]
    NotARange {
        /// Text that should give a range of wavelengths.
        found: String,
    },
}

impl WavelengthGrid {
    /// Creates `count` wavelengths from `start` in even steps of `step`, in nm.
    pub fn even(start: f64, step: f64, count: usize) -> Result<Self, WavelengthError> {
        check_count(count)?;
        if !(start.is_finite() && start > 0.0) {
            return Err(WavelengthError::NotPositive { index: 0, value: start });
        }
        let second = start + step;
        if count > 1 && !(second.is_finite() && second > start) {
            return Err(WavelengthError::NotIncreasing { index: 1, value: second, previous: start });
        }
        let step = if count == 1 { 1.0 } else { step };
        Ok(Self::Even { start, step, count })
    }

    /// Creates an axis of wavelengths from a list in nm. A list is recognised as even if every wavelength is exactly
    /// `start + i * step`.
    pub fn listed(values: Vec<f64>) -> Result<Self, WavelengthError> {
        check_count(values.len())?;
        for (index, &value) in values.iter().enumerate() {
            if !(value.is_finite() && value > 0.0) {
                return Err(WavelengthError::NotPositive { index, value });
            }
            if index > 0 && value <= values[index - 1] {
                return Err(WavelengthError::NotIncreasing { index, value, previous: values[index - 1] });
            }
        }
        let start = values[0];
        let step = if values.len() > 1 { values[1] - start } else { 1.0 };
        let even = values.iter().enumerate().all(|(i, &value)| start + i as f64 * step == value);
        Ok(if even { Self::Even { start, step, count: values.len() } } else { Self::Uneven(values) })
    }

    /// Parses a range of wavelengths `START:STOP:STEP` in nm, both ends included (`380:750:5` has 75 wavelengths).
    pub fn parse_range(text: &str) -> Result<Self, WavelengthError> {
        let refused = || WavelengthError::NotARange { found: text.to_owned() };
        let parts: Vec<f64> =
            text.split(':').map(|part| part.trim().parse().map_err(|_| refused())).collect::<Result<_, _>>()?;
        let &[start, stop, step] = parts.as_slice() else { return Err(refused()) };
        let ordered = start.is_finite() && stop.is_finite() && step.is_finite() && step > 0.0 && stop >= start;
        if !ordered {
            return Err(refused());
        }
        let steps = ((stop - start) / step + 1e-9).floor();
        if steps >= MAX_WAVELENGTHS as f64 {
            return Err(WavelengthError::TooMany { found: (steps as usize).saturating_add(1) });
        }
        Self::even(start, step, steps as usize + 1)
    }

    /// Returns the number of wavelengths; never 0.
    #[allow(clippy::len_without_is_empty, reason = "a grid is never empty")]
    pub fn len(&self) -> usize {
        match self {
            Self::Even { count, .. } => *count,
            Self::Uneven(values) => values.len(),
        }
    }

    /// Returns wavelength number `index` in nm.
    ///
    /// # Panics
    /// If `index` is out of range on an uneven grid.
    pub fn at(&self, index: usize) -> f64 {
        match self {
            Self::Even { start, step, .. } => start + index as f64 * step,
            Self::Uneven(values) => values[index],
        }
    }

    /// Returns all wavelengths in nm, in order.
    pub fn values(&self) -> Vec<f64> {
        (0..self.len()).map(|i| self.at(i)).collect()
    }

    /// Returns the range of the wavelengths in words, such as `400 to 700 nm`, rounded as [`readable`] does.
    pub fn in_words(&self) -> String {
        let (first, last) = self.range();
        format!("{} to {} nm", readable(first), readable(last))
    }

    /// Returns the shortest and the longest wavelength in nm.
    pub fn range(&self) -> (f64, f64) {
        (self.at(0), self.at(self.len() - 1))
    }

    /// Returns the position `(i, t)` of `lambda` (nm) for linear interpolation: the value is `(1 − t)·sample[i] +
    /// t·sample[i + 1]`, with `t = 0` at the last sample. `None` outside the axis.
    #[inline]
    pub fn locate(&self, lambda: f64) -> Option<(usize, f64)> {
        let (first, last) = self.range();
        if !(lambda >= first && lambda <= last) {
            return None;
        }
        let position = self.position(lambda);
        let below = position as usize;
        Some((below, position - below as f64))
    }

    /// Returns the fractional sample index of `lambda` (nm) on the axis, clamped to the ends; 0 for NaN.
    #[inline]
    pub(crate) fn position(&self, lambda: f64) -> f64 {
        let last = self.len() - 1;
        match self {
            Self::Even { start, step, .. } => ((lambda - start) / step).max(0.0).min(last as f64),
            Self::Uneven(values) => {
                let Bracket { below, t, .. } = Bracket::held(values, lambda);
                // Rounding must not move it to the next sample.
                below as f64 + t.min(1.0 - f64::EPSILON)
            }
        }
    }

    /// Returns the weights, in nm, of the trapezoidal rule: `Σ weight[i]·sample[i]` is the integral over all
    /// wavelengths of the axis. A single wavelength has weight 1.
    pub fn weights(&self) -> Vec<f64> {
        let n = self.len();
        if n == 1 {
            return vec![1.0];
        }
        (0..n).map(|i| 0.5 * (self.at((i + 1).min(n - 1)) - self.at(i.saturating_sub(1)))).collect()
    }
}

fn check_count(count: usize) -> Result<(), WavelengthError> {
    match count {
        0 => Err(WavelengthError::Empty),
        n if n > MAX_WAVELENGTHS => Err(WavelengthError::TooMany { found: n }),
        _ => Ok(()),
    }
}

/// Rounds a wavelength in nm to 0.001 nm for people: instruments list wavelengths with all digits of a float32.
pub fn readable(nm: f64) -> f64 {
    libm::round(nm * 1000.0) / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_include_both_ends() {
        let grid = WavelengthGrid::parse_range("380:750:5").unwrap();
        assert_eq!((grid.len(), grid.at(0), grid.at(74)), (75, 380.0, 750.0));
        assert_eq!(WavelengthGrid::parse_range("400:400:5").unwrap().len(), 1);
        assert_eq!(WavelengthGrid::parse_range("380:399:5").unwrap().at(3), 395.0);
        for bad in ["", "380:750", "750:380:5", "380:750:0", "380:750:-5", "a:b:c", "nan:750:5", "-5:10:1"] {
            assert!(WavelengthGrid::parse_range(bad).is_err(), "{bad}");
        }
        for many in ["1:1e12:1", "1:1e300:1e-300", "1:1e308:1"] {
            assert!(matches!(WavelengthGrid::parse_range(many), Err(WavelengthError::TooMany { .. })), "{many}");
        }
    }

    #[test]
    fn listed_grids_are_checked_and_recognised() {
        assert!(matches!(WavelengthGrid::listed(vec![400.0, 410.0, 420.0]), Ok(WavelengthGrid::Even { count: 3, .. })));
        assert!(matches!(WavelengthGrid::listed(vec![400.0, 410.0, 421.0]), Ok(WavelengthGrid::Uneven(_))));
        assert_eq!(
            WavelengthGrid::listed(vec![400.0, 400.0]),
            Err(WavelengthError::NotIncreasing { index: 1, value: 400.0, previous: 400.0 })
        );
        assert_eq!(WavelengthGrid::listed(vec![]), Err(WavelengthError::Empty));
        assert!(WavelengthGrid::listed(vec![f64::NAN]).is_err());
    }

    #[test]
    fn location_interpolates_and_ends_at_the_ends() {
        for grid in [
            WavelengthGrid::even(380.0, 5.0, 75).unwrap(),
            WavelengthGrid::listed(vec![200.0, 203.0, 211.5, 300.0]).unwrap(),
        ] {
            let (first, last) = grid.range();
            assert_eq!(grid.locate(first), Some((0, 0.0)));
            assert_eq!(grid.locate(last), Some((grid.len() - 1, 0.0)));
            assert_eq!(grid.locate(first - 1e-9), None);
            assert_eq!(grid.locate(f64::NAN), None);
            let middle = 0.5 * (grid.at(1) + grid.at(2));
            assert_eq!(grid.locate(middle), Some((1, 0.5)));
            let total: f64 = grid.weights().iter().sum();
            assert!((total - (last - first)).abs() < 1e-9);
        }
    }
}
