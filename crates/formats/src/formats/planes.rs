//! Intensities on C planes for the writers of luminaire files, and the text form of their numbers.

use super::error::{FormatError, FormatErrorKind};
use super::text::Brief;
use crate::domain::limits::MAX_ENTRIES;

/// Intensities of a luminaire on C planes (vertical half planes through the lamp axis).
#[derive(Clone, Debug, PartialEq)]
pub struct CPlanes {
    /// Angles gamma from nadir in degrees, strictly increasing: 0 to 90, 90 to 180 or 0 to 180.
    pub gamma: Vec<f64>,
    /// Azimuths C of the planes in degrees, strictly increasing from 0 to below 360, covering the full circle. A single
    /// plane represents all azimuths.
    pub c: Vec<f64>,
    /// Intensities, row-major `[c, gamma]`, finite, 0 or more.
    pub values: Vec<f64>,
}

impl CPlanes {
    /// Refuses C planes whose angles or intensities no luminaire format can hold.
    pub(super) fn check(&self, format: &'static str) -> Result<(), FormatError> {
        let refuse = |message: String| Err(FormatError::new(FormatErrorKind::NeedsOption, format, message));
        let increasing = |angles: &[f64]| angles.array_windows().all(|[a, b]| a < b);
        let (gamma, c) = (&self.gamma, &self.c);
        let ends = gamma.first().copied().zip(gamma.last().copied());
        if !matches!(ends, Some((0.0, 90.0 | 180.0) | (90.0, 180.0))) || !increasing(gamma) {
            return refuse("gamma angles, expected them increasing over 0°–90°, 90°–180° or 0°–180°".to_owned());
        }
        if c.first() != Some(&0.0) || !increasing(c) || c.last().is_some_and(|&last| last >= 360.0) {
            return refuse("C angles, expected them increasing from 0° to below 360°".to_owned());
        }
        let (angles, planes) = (gamma.len(), c.len());
        if angles.saturating_mul(planes) > MAX_ENTRIES {
            let message = format!("{planes} planes of {angles} intensities, expected at most {MAX_ENTRIES}");
            return Err(FormatError::new(FormatErrorKind::OverLimit, format, message));
        }
        if self.values.len() != angles * planes {
            return refuse(format!("{} intensities, expected {planes} planes of {angles}", self.values.len()));
        }
        match self.values.iter().find(|value| !(0.0..=f64::from(f32::MAX)).contains(*value)) {
            None => Ok(()),
            Some(&bad) => refuse(format!("intensity {bad}, expected finite numbers, none negative", bad = Brief(bad))),
        }
    }

    /// Returns the largest intensity of the luminaire.
    pub(super) fn peak(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }
}

/// Formats a number with seven significant digits, without an exponent, with at most twelve decimals.
pub(super) fn plain(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (6.0 - libm::floor(libm::log10(value.abs()))).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    if decimals == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_owned() }
}

/// Returns at most `longest` characters of `text` in printable ASCII, which readers of any luminaire file accept; other
/// characters become `?`.
pub(super) fn ascii(text: &str, longest: usize) -> String {
    text.chars().take(longest).map(|c| if c.is_ascii_graphic() || c == ' ' { c } else { '?' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_seven_digits_and_no_exponent() {
        let shown = [0.0, 1.0, 0.1, 1234.5678, 1e7, 123_456_789.0, 0.001_234_567_89, 1e-14].map(plain);
        assert_eq!(shown, ["0", "1", "0.1", "1234.568", "10000000", "123456789", "0.001234568", "0"]);
        assert_eq!(ascii("µW per °\n", 8), "?W per ?");
    }
}
