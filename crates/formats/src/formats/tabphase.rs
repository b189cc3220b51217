//! Table of a phase function for renderers (`tabphase` of Mitsuba): values over cos θ, uniform from −1 to 1.
//!
//! +1 is forward. Values are separated by commas on one line. Readers interpolate linearly and normalise the integral
//! over the sphere to 1.

use super::error::{FormatError, FormatErrorKind};
use super::planes::plain;
use super::reader::Format;
use crate::domain::limits::MAX_ENTRIES;
use crate::notes::Quoted;
use std::f64::consts::TAU;

const NAME: &str = "tabphase";
/// Line of values that a reader accepts, for its messages.
const EXPECTED: &str =
    "expected the values of a phase function: at least 2 numbers, none negative, with commas between them";

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
        let message = format!("a phase function of {} values, expected at most {MAX_ENTRIES}", values.len());
        return refuse(FormatErrorKind::OverLimit, message);
    }
    let usable = values.iter().all(|value| (0.0..=f64::from(f32::MAX)).contains(value));
    if values.len() < 2 || !usable || values.iter().all(|&value| value == 0.0) {
        let message = format!(
            "found {} values of a phase function, expected at least 2, all finite, none negative and not all 0",
            values.len()
        );
        return refuse(FormatErrorKind::NeedsOption, message);
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
        let malformed = |message: String| FormatError::new(FormatErrorKind::Malformed, NAME, message);
        let found = |what: &str| malformed(format!("found {what}, {EXPECTED}"));
        let text = std::str::from_utf8(bytes).map_err(|_| found("bytes that are no text"))?;
        let value = |cell: &str| {
            let value = super::text::number(cell.trim()).filter(|value| *value >= 0.0);
            value.ok_or_else(|| found(&Quoted::of(cell.trim()).to_string()))
        };
        let mut values = text.trim().split(',').map(value).collect::<Result<Vec<f64>, FormatError>>()?;
        if values.len() < 2 {
            return Err(found("one number"));
        }
        let width = 2.0 / (values.len() - 1) as f64;
        let total: f64 = values.array_windows().map(|[a, b]| 0.5 * (a + b) * width).sum::<f64>() * TAU;
        if !(total > 0.0 && total.is_finite()) {
            let message =
                format!("the values integrate to {total} over the sphere, expected a finite integral above 0");
            return Err(malformed(message));
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
        for (wrong, found) in [
            (&b""[..], "found nothing, expected the values of a phase function: at least 2 numbers, none negative"),
            (b"1", "found one number,"),
            (b"1, x", "found `x`,"),
            (b"1, -2", "found `-2`,"),
            (b"1 2", "found `1 2`,"),
            (b"\xff, 1", "found bytes that are no text,"),
            (b"0, 0", "the values integrate to 0 over the sphere,"),
        ] {
            let error = TabulatedPhase::read(wrong).unwrap_err();
            assert_eq!(error.kind, Malformed);
            assert!(error.message.starts_with(found), "{error}");
        }
    }
}
