//! Shared code of the writers that restate a file with its original angles, keywords and multipliers.

use super::error::{FormatError, FormatErrorKind};
use crate::domain::{DirectionGrid, Unit};

/// Rule for the number of digits with which values are written to a text file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Digits {
    /// Each value has the shortest text that reads back as an equal float32.
    Shortest,
    /// Each value has the shortest text whose number differs from it by at most this fraction (0.01 is 1 %).
    Within(f64),
}

/// Samples to write at the angles of their source file, with the metadata that its reader kept.
#[derive(Clone, Copy, Debug)]
pub struct Restatement<'a> {
    /// Directions of the samples: the outgoing axis of the measurement.
    pub directions: &'a DirectionGrid,
    /// Samples in `unit`, row-major `[polar, azimuth]`; NaN = masked, written as 0.
    pub values: &'a [f32],
    /// Numbers as listed in the source file, with their factor: sample = factor · number. `None` if unknown.
    pub numbers: Option<(&'a [f32], f64)>,
    /// Unit of the samples.
    pub unit: Unit,
    /// Revision and flavour of the source file, as named by its reader.
    pub dialect: &'a str,
    /// Keywords and header fields of the source file, as kept by its reader, in order.
    pub metadata: &'a [(String, String)],
    /// Rule for the number of significant digits with which the samples are written.
    pub digits: Digits,
}

/// Range of magnitudes in which a number is written to a text file without an exponent.
const PLAIN: std::ops::Range<f64> = 1e-6..1e15;
/// Number of significant decimal digits that suffice to identify any float32.
const MOST_DIGITS: usize = 9;

impl Restatement<'_> {
    /// Returns the text of the header field `key`, as the reader of the source file kept it.
    pub(super) fn kept(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(found, _)| found == key).map(|(_, text)| text.as_str())
    }

    /// Returns the number at the start of the text of the header field `key`.
    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.kept(key)?.split_whitespace().next()?.parse().ok()
    }

    /// Returns the text of the number to write for sample number `entry`: the sample divided by `factor`.
    pub(super) fn spelled(&self, entry: usize, factor: f64) -> String {
        if let Some((numbers, own)) = self.numbers
            && own == factor
            && self.digits == Digits::Shortest
        {
            let number = numbers[entry];
            return if number.is_nan() { "0".to_owned() } else { plain_f32(number) };
        }
        let value = self.values[entry];
        if value.is_nan() { "0".to_owned() } else { self.digits.spelled(value, factor) }
    }
}

impl Digits {
    /// Returns the text of the number to write for a sample: `value` divided by `factor`.
    fn spelled(self, value: f32, factor: f64) -> String {
        let quotient = f64::from(value) / factor;
        let number = if factor != 0.0 && quotient.is_finite() { quotient } else { 0.0 };
        match self {
            Self::Shortest => shortest(number as f32, |number| (f64::from(number) * factor) as f32 == value),
            Self::Within(part) => fewest(number, part),
        }
    }
}

/// Returns the shortest text among `number` and the float32 numbers next to it for which `is_right` is true; the text
/// of `number` if there is none.
fn shortest(number: f32, is_right: impl Fn(f32) -> bool) -> String {
    let near = [number, number.next_down(), number.next_up()];
    let right = near.into_iter().filter(|&number| number.is_finite() && is_right(number)).map(plain_f32);
    right.min_by_key(String::len).unwrap_or_else(|| plain_f32(number))
}

fn plain_f32(number: f32) -> String {
    let size = f64::from(number.abs());
    if size == 0.0 {
        // Zero is written without a sign.
        "0".to_owned()
    } else if PLAIN.contains(&size) {
        number.to_string()
    } else {
        format!("{number:e}")
    }
}

fn fewest(number: f64, part: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let rounded = (0..MOST_DIGITS).find_map(|decimals| {
        let rounded: f64 = format!("{number:.decimals$e}").parse().ok()?;
        ((rounded - number).abs() <= part * number.abs()).then_some(rounded)
    });
    let number = rounded.unwrap_or(number);
    if PLAIN.contains(&number.abs()) { number.to_string() } else { format!("{number:e}") }
}

/// Returns the error for data that a file format cannot hold.
pub(super) fn unfit<T>(format: &'static str, message: impl Into<String>) -> Result<T, FormatError> {
    Err(FormatError::new(FormatErrorKind::NeedsOption, format, message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_a_file_come_back_through_their_factor() {
        for factor in [1.0, 1.5, 0.1 * 0.7, 0.95 * 1.03, 1e-3] {
            for text in ["1328.4", "0.0001", "94.51997", "7", "123456", "0.33", "16777216", "2.5e-9"] {
                let number: f32 = text.parse().unwrap();
                let value = (f64::from(number) * factor) as f32;
                let spelled = Digits::Shortest.spelled(value, factor);
                let back = (f64::from(spelled.parse::<f32>().unwrap()) * factor) as f32;
                assert_eq!(back, value, "{text} {factor}");
                assert!(spelled.len() <= text.len(), "{spelled} {text} {factor}");
            }
        }
        assert_eq!([Digits::Shortest.spelled(-0.0, 2.0), Digits::Shortest.spelled(3.0, 0.0)], ["0", "0"]);
    }

    #[test]
    fn lossy_numbers_have_the_fewest_digits_within_their_part() {
        for (number, part, text) in
            [(123.456, 1e-3, "123.5"), (123.456, 0.05, "120"), (-0.009_96, 0.01, "-0.01"), (2e-9, 0.1, "2e-9")]
        {
            assert_eq!(fewest(number, part), text);
        }
    }
}
