//! Table of a phase function for renderers (`tabphase` of Mitsuba): values over cos θ, uniform from −1 to 1.
//!
//! +1 is forward. Values are separated by commas on one line. Readers interpolate linearly and normalise the integral
//! over the sphere to 1.

use super::error::{FormatError, FormatErrorKind};
use super::planes::plain;
use super::reader::Format;
use crate::domain::limits::MAX_ENTRIES;
use std::f64::consts::TAU;

const NAME: &str = "tabphase";

pub(super) const ABOUT: Format = Format {
    name: NAME,
    description: "phase function over the cosine as Mitsuba's tabphase takes it, one line of values (.txt)",
    extensions: &["txt"],
    reads: false,
    writes: true,
};

/// Writes a phase function as a line of values in sr⁻¹ at scattering cosines evenly spaced from −1 to 1. There must be
/// at least 2 values, finite, 0 or more.
pub fn write_tabphase(values: &[f64]) -> Result<Vec<u8>, FormatError> {
    let refuse = |kind, message: String| Err(FormatError::new(kind, NAME, message));
    if values.len() > MAX_ENTRIES {
        let message = format!("{} values, expected at most {MAX_ENTRIES}", values.len());
        return refuse(FormatErrorKind::OverLimit, message);
    }
    let usable = values.iter().all(|value| (0.0..=f64::from(f32::MAX)).contains(value));
    if values.len() < 2 || !usable || values.iter().all(|&value| value == 0.0) {
        return refuse(
            FormatErrorKind::NeedsOption,
            "values, expected at least 2, finite, from 0, not all 0".to_owned(),
        );
    }
    let list: Vec<String> = values.iter().map(|&value| plain(value)).collect();
    Ok(format!("{}\n", list.join(", ")).into_bytes())
}

/// Phase function as a renderer reads it from a tabphase line: normalised to integral 1, linear in the cosine.
#[derive(Clone, Debug, PartialEq)]
pub struct TabulatedPhase {
    values: Vec<f64>,
}

impl TabulatedPhase {
    /// Reads a phase function from a line of values at evenly spaced cosines, and normalises it.
    pub fn read(bytes: &[u8]) -> Result<Self, FormatError> {
        let malformed = |message: &str| FormatError::new(FormatErrorKind::Malformed, NAME, message);
        let text = std::str::from_utf8(bytes).map_err(|_| malformed("bytes that are no text, expected numbers"))?;
        let value = |cell: &str| super::text::number(cell.trim()).filter(|value| *value >= 0.0);
        let values: Option<Vec<f64>> = text.trim().split(',').map(value).collect();
        let Some(mut values) = values.filter(|values| values.len() >= 2) else {
            return Err(malformed("expected at least two numbers from 0 with commas between them"));
        };
        let width = 2.0 / (values.len() - 1) as f64;
        let total: f64 = values.array_windows().map(|[a, b]| 0.5 * (a + b) * width).sum::<f64>() * TAU;
        if !(total > 0.0 && total.is_finite()) {
            return Err(malformed("values that integrate to 0, expected a phase function"));
        }
        for value in &mut values {
            *value /= total;
        }
        Ok(Self { values })
    }

    /// Returns the phase function in sr⁻¹ at a cosine of the scattering angle; +1 is forward.
    pub fn at(&self, cosine: f64) -> f64 {
        let last = self.values.len() - 1;
        let x = (0.5 * (cosine.clamp(-1.0, 1.0) + 1.0)) * last as f64;
        let i = (libm::floor(x) as usize).min(last - 1);
        let t = x - i as f64;
        (1.0 - t) * self.values[i] + t * self.values[i + 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_reads_back_normalised() {
        let rayleigh = |mu: f64| 3.0 / (16.0 * std::f64::consts::PI) * (1.0 + mu * mu);
        let values: Vec<f64> = (0..=200).map(|i| 7.0 * rayleigh(f64::from(i) / 100.0 - 1.0)).collect();
        let bytes = write_tabphase(&values).unwrap();
        assert!(bytes.ends_with(b"\n") && bytes.split(|b| *b == b'\n').count() == 2);
        let table = TabulatedPhase::read(&bytes).unwrap();
        for mu in [-1.0, -0.503, 0.0, 0.25, 0.999, 1.0] {
            assert!((table.at(mu) / rayleigh(mu) - 1.0).abs() < 1e-4, "{mu}");
        }
        // Forward is the last.
        let table = TabulatedPhase::read(b"0, 1").unwrap();
        assert_eq!(table.at(-1.0), 0.0);
        assert!((table.at(1.0) - 1.0 / TAU).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_phase_function_is_refused() {
        use FormatErrorKind::{Malformed, NeedsOption, OverLimit};
        for wrong in [&[1.0][..], &[0.0, 0.0], &[1.0, -1.0], &[1.0, f64::NAN]] {
            assert_eq!(write_tabphase(wrong).unwrap_err().kind, NeedsOption);
        }
        assert_eq!(write_tabphase(&vec![1.0; MAX_ENTRIES + 1]).unwrap_err().kind, OverLimit);
        for wrong in [&b""[..], b"1", b"1, x", b"0, 0", b"1 2", b"\xff, 1"] {
            assert_eq!(TabulatedPhase::read(wrong).unwrap_err().kind, Malformed);
        }
    }
}
