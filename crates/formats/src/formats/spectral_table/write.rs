//! Writes spectra as text: two columns separated by a blank, or CSV with one column per spectrum.

use super::super::error::{FormatError, FormatErrorKind};
use super::about::NAME;
use crate::domain::WavelengthGrid;
use std::fmt::Write as _;

/// Writes one spectrum as `wavelength value` per line, as pbrt and Mitsuba read it (`.spd`): single blanks, at least
/// two rows, comments after `#`. Masked samples are left out, so that readers interpolate across them.
pub fn write_spd(grid: &WavelengthGrid, samples: &[f32], comment: &str) -> Result<Vec<u8>, FormatError> {
    check(grid, samples, 1)?;
    let measured = samples.iter().filter(|sample| !sample.is_nan()).count();
    if measured < 2 {
        let message = format!("{measured} samples that are not masked, expected at least 2");
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    }
    let mut text = String::new();
    comment.lines().for_each(|line| {
        let _ = writeln!(text, "# {line}");
    });
    for (lambda, sample) in grid.values().into_iter().zip(samples).filter(|(_, sample)| !sample.is_nan()) {
        let _ = writeln!(text, "{lambda} {sample}");
    }
    Ok(text.into_bytes())
}

/// Writes spectra `[column, lambda]` as CSV: a column of wavelengths in nm, then one named column per spectrum. Masked
/// samples are blank cells.
pub fn write_spectra(grid: &WavelengthGrid, samples: &[f32], names: &[String]) -> Result<Vec<u8>, FormatError> {
    check(grid, samples, names.len())?;
    let mut text = String::from("wavelength_nm");
    for name in names {
        let _ = write!(text, ",{}", bare(name));
    }
    text.push('\n');
    for (row, lambda) in grid.values().into_iter().enumerate() {
        let _ = write!(text, "{lambda}");
        for column in samples.chunks_exact(grid.len()) {
            text.push(',');
            if !column[row].is_nan() {
                let _ = write!(text, "{}", column[row]);
            }
        }
        text.push('\n');
    }
    Ok(text.into_bytes())
}

fn check(grid: &WavelengthGrid, samples: &[f32], columns: usize) -> Result<(), FormatError> {
    if columns > 0 && grid.len().checked_mul(columns) == Some(samples.len()) {
        return Ok(());
    }
    let message = format!("{} samples, expected {columns} spectra of {} wavelengths", samples.len(), grid.len());
    Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message))
}

/// Returns the name of a spectrum without separators and quotes, so that it is a single cell for every reader.
fn bare(name: &str) -> String {
    name.chars().map(|c| if c.is_control() || matches!(c, ',' | ';' | '"') { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::super::super::{Interpretation, Samples, read};
    use super::*;
    use crate::domain::Axis;

    fn grid() -> WavelengthGrid {
        WavelengthGrid::listed(vec![380.0, 402.5, 500.125, 700.0]).unwrap()
    }

    #[test]
    fn a_spectrum_reads_back_to_the_bit() {
        let samples = [0.1, 3.0e-7, f32::NAN, 123_456.79];
        let bytes = write_spd(&grid(), &samples, "a lamp\nof two lines").unwrap();
        let text = String::from_utf8(bytes.clone()).unwrap();
        assert_eq!(text, "# a lamp\n# of two lines\n380 0.1\n402.5 0.0000003\n700 123456.79\n");
        let Samples::OnAxes { tensor, .. } = read(&bytes, &Interpretation::default()).unwrap().samples else {
            panic!("on axes")
        };
        assert_eq!(tensor.samples(), [0.1, 3.0e-7, 123_456.79]);
    }

    #[test]
    fn spectra_read_back_to_the_bit_under_their_names() {
        let samples = [0.1, 0.2, f32::NAN, 0.4, 1.0 / 3.0, 0.6, 0.7, -0.8];
        let bytes = write_spectra(&grid(), &samples, &["dark,red".to_owned(), "2".to_owned()]).unwrap();
        let Samples::OnAxes { tensor, .. } = read(&bytes, &Interpretation::default()).unwrap().samples else {
            panic!("on axes")
        };
        let [Axis::Index { labels, .. }, Axis::Wavelength(found)] = tensor.axes() else { panic!("two axes") };
        assert_eq!((labels[0].as_str(), labels[1].as_str()), ("dark red", "2"));
        assert_eq!(found.values(), grid().values());
        assert_eq!(tensor.samples().iter().map(|s| s.to_bits()).collect::<Vec<_>>().len(), 8);
        assert!(tensor.samples().iter().zip(samples).all(|(a, b)| *a == b || (a.is_nan() && b.is_nan())));
    }

    #[test]
    fn too_little_is_refused() {
        let kind = |result: Result<Vec<u8>, FormatError>| result.unwrap_err().kind;
        let nan = f32::NAN;
        assert_eq!(kind(write_spd(&grid(), &[1.0, nan, nan, nan], "")), FormatErrorKind::NeedsOption);
        assert_eq!(kind(write_spd(&grid(), &[1.0; 3], "")), FormatErrorKind::NeedsOption);
        assert_eq!(kind(write_spectra(&grid(), &[1.0; 4], &[])), FormatErrorKind::NeedsOption);
    }
}
