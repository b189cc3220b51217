//! Writes a luminaire as LM-63-2002, type C: absolute intensities; the keywords name a unit other than candela.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::planes::{CPlanes, ascii, plain};
use super::about::NAME;
use super::lines::{LONGEST, list};
use crate::domain::Unit;
use std::fmt::Write as _;

/// Writes the intensities of a luminaire as LM-63 in `unit`. `notes` become `[OTHER]` keywords of any length.
///
/// Photometry is absolute (−1 lumens); `cd/klm` is relative to a lamp of 1000 lm. Units that are not photometric are
/// named in `[_INTENSITYUNITS]`. A program that ignores this keyword takes the numbers for candela.
pub fn write_lm63(planes: &CPlanes, unit: Unit, notes: &[String]) -> Result<Vec<u8>, FormatError> {
    planes.check(NAME)?;
    let (lumens, name) = match unit {
        Unit::CandelaPerKilolumen => (1000, Unit::Candela.name()),
        Unit::Candela
        | Unit::Relative
        | Unit::WattPerSteradian
        | Unit::MilliwattPerSteradian
        | Unit::MicrowattPerSteradian
        | Unit::MicromolePerSecondSteradian => (-1, unit.name()),
        _ => {
            let message = format!("the intensities are in {unit}, expected a unit of intensity without wavelengths");
            return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
        }
    };
    let mut text = String::from("IESNA:LM-63-2002\n");
    for keyword in ["TEST", "TESTLAB", "ISSUEDATE", "MANUFAC"] {
        let _ = writeln!(text, "[{keyword}] not stated");
    }
    let _ = writeln!(text, "[_INTENSITYUNITS] {name}");
    for note in notes {
        keyword(&mut text, "OTHER", note);
    }
    // Scaled to suit fixed decimals; intensities with a peak of 1 to a million are unscaled.
    let peak = planes.peak();
    let multiplier =
        if peak == 0.0 || (1.0..1e6).contains(&peak) { 1.0 } else { libm::exp10(libm::floor(libm::log10(peak)) - 3.0) };
    // The plane of 360° equals that of 0°.
    let closing = (planes.c.len() > 1).then_some(360.0);
    let c: Vec<f64> = planes.c.iter().copied().chain(closing).collect();
    let _ = writeln!(text, "TILT=NONE");
    let _ = writeln!(text, "1 {lumens} {multiplier} {} {} 1 2 0 0 0", planes.gamma.len(), c.len());
    let _ = writeln!(text, "1 1 0");
    list(&mut text, planes.gamma.iter().copied().map(plain));
    list(&mut text, c.iter().copied().map(plain));
    let plane = |i: usize| &planes.values[(i % planes.c.len()) * planes.gamma.len()..][..planes.gamma.len()];
    for i in 0..c.len() {
        list(&mut text, plane(i).iter().map(|value| plain(value / multiplier)));
    }
    Ok(text.replace('\n', "\r\n").into_bytes())
}

/// Writes a keyword with its text, broken at blanks into `[MORE]` lines.
fn keyword(text: &mut String, key: &str, value: &str) {
    let mut line = format!("[{key}]");
    for word in ascii(value, usize::MAX).split_whitespace() {
        // A word longer than a line is truncated.
        let word = &word[..word.len().min(LONGEST - "[OTHER] ".len())];
        if line.len() + 1 + word.len() > LONGEST {
            let _ = writeln!(text, "{line}");
            "[MORE]".clone_into(&mut line);
        }
        let _ = write!(line, " {word}");
    }
    let _ = writeln!(text, "{line}");
}

#[cfg(test)]
mod tests {
    use super::super::super::{Interpretation, Samples, read};
    use super::*;

    fn planes(scale: f64) -> CPlanes {
        let gamma: Vec<f64> = (0..=36).map(|i| 5.0 * f64::from(i)).collect();
        let c: Vec<f64> = (0..24).map(|i| 15.0 * f64::from(i)).collect();
        let value = |c: f64, g: f64| {
            scale * (2.0 + libm::cos(g.to_radians())) * if g > 0.0 && g < 180.0 { 1.0 + c / 720.0 } else { 1.0 }
        };
        let values = c.iter().flat_map(|&c| gamma.iter().map(move |&g| value(c, g))).collect();
        CPlanes { gamma, c, values }
    }

    #[test]
    fn what_is_written_reads_back_in_its_unit() {
        let note = "a note of many words ".repeat(20);
        for (unit, scale) in [
            (Unit::Candela, 700.0),
            (Unit::CandelaPerKilolumen, 30.0),
            (Unit::MilliwattPerSteradian, 1e-9),
            (Unit::MicromolePerSecondSteradian, 1e12),
            (Unit::Relative, 1.0),
        ] {
            let planes = planes(scale);
            let notes = [note.clone(), format!("once in mW/sr, µ; now {unit}")];
            let bytes = write_lm63(&planes, unit, &notes).unwrap();
            let text = String::from_utf8(bytes.clone()).unwrap();
            assert!(text.lines().all(|line| line.len() <= LONGEST), "{text}");
            let found = read(&bytes, &Interpretation::default()).unwrap();
            let wanted = if unit == Unit::CandelaPerKilolumen { Unit::Candela } else { unit };
            assert_eq!((found.unit, found.dialect.as_str()), (wanted, "LM-63-2002, type C, no symmetry"));
            let other = found.report.metadata.iter().find(|(key, _)| key == "OTHER").unwrap();
            assert_eq!(other.1.replace('\n', " "), note.trim());
            let Samples::Grid(grid) = found.samples else { panic!("a grid") };
            assert_eq!(grid.outgoing.as_ref().unwrap().phi.as_ref().unwrap().phi, planes.c);
            // theta rises as gamma falls; azimuth is the inner axis.
            for (t, row) in grid.values.chunks_exact(24).enumerate() {
                for (h, &value) in row.iter().enumerate() {
                    let wanted = planes.values[h * 37 + 36 - t];
                    assert!((f64::from(value) / wanted - 1.0).abs() < 1e-6, "{unit} {t} {h}: {value} {wanted}");
                }
            }
        }
    }

    #[test]
    fn an_axial_luminaire_is_one_plane() {
        let planes = CPlanes { gamma: vec![0.0, 45.0, 90.0], c: vec![0.0], values: vec![3.0, 2.0, 1.0] };
        let found = read(&write_lm63(&planes, Unit::Candela, &[]).unwrap(), &Interpretation::default()).unwrap();
        assert_eq!(found.dialect, "LM-63-2002, type C, axially symmetric");
    }

    #[test]
    fn what_is_no_luminaire_is_refused() {
        use FormatErrorKind::{NeedsOption, OverLimit};
        let good = CPlanes { gamma: vec![0.0, 45.0, 90.0], c: vec![0.0], values: vec![3.0, 2.0, 1.0] };
        let kind = |planes: &CPlanes, unit| write_lm63(planes, unit, &[]).unwrap_err().kind;
        assert_eq!(kind(&good, Unit::WattPerSteradianNanometre), NeedsOption);
        for wrong in [
            CPlanes { gamma: vec![0.0, 45.0, 80.0], ..good.clone() },
            CPlanes { gamma: vec![0.0, 95.0, 90.0], ..good.clone() },
            CPlanes { c: vec![15.0], ..good.clone() },
            CPlanes { c: Vec::new(), ..good.clone() },
            CPlanes { values: vec![1.0; 2], ..good.clone() },
            CPlanes { values: vec![1.0, -1.0, 0.0], ..good.clone() },
            CPlanes { values: vec![1.0, f64::NAN, 0.0], ..good.clone() },
        ] {
            assert_eq!(kind(&wrong, Unit::Candela), NeedsOption, "{wrong:?}");
        }
        let list = |n: u32, end: f64| (0..=n).map(|i| end * f64::from(i) / f64::from(n)).collect::<Vec<f64>>();
        let huge = CPlanes { gamma: list(4000, 180.0), c: list(4000, 359.0), values: Vec::new() };
        assert_eq!(kind(&huge, Unit::Candela), OverLimit);
    }
}
