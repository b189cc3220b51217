//! Numbers rounded to significant digits, as messages and provenance state them.

/// Returns `number` rounded to `digits` significant digits, at least 1.
pub(crate) fn with_digits(number: f64, digits: usize) -> f64 {
    format!("{number:.*e}", digits.saturating_sub(1)).parse().unwrap_or(number)
}
