//! A luminaire as EULUMDAT: absolute photometry, every C plane, one value a line.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::planes::{CPlanes, ascii, plain};
use super::about::NAME;
use crate::domain::Unit;

/// Upper bound on the characters of a text in an EULUMDAT file that is written, because old readers accept no more.
const LONGEST: usize = 78;
/// Largest difference in degrees between steps of angles that count as equidistant.
const STEP: f64 = 1e-9;

/// Writes the intensities of a luminaire as EULUMDAT. `unit` is cd for a luminaire of `flux` lumens, or cd/klm, for
/// which `flux` is ignored.
///
/// Absolute photometry is a lamp count of −1 with the flux of the luminaire. Required fields without a measured value
/// (lamps, sizes, room ratios) are 0 or empty.
pub fn write_eulumdat(planes: &CPlanes, unit: Unit, flux: f64, name: &str) -> Result<Vec<u8>, FormatError> {
    planes.check(NAME)?;
    let refuse = |message: String| Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    let (lamps, lumens) = match unit {
        Unit::Candela if flux > 0.0 && flux.is_finite() => (-1, flux),
        Unit::Candela => return refuse(format!("the flux of the luminaire is {flux} lm, expected more than 0")),
        Unit::CandelaPerKilolumen => (1, 1000.0),
        _ => return refuse(format!("the intensities are in {unit}, expected cd or cd/klm")),
    };
    // The rounded lumens as written, so that the reader recovers the intensities.
    let lumens = plain(lumens);
    let written: f64 = lumens.parse().unwrap_or_default();
    if written <= 0.0 {
        return refuse(format!(
            "the flux of the luminaire is {flux:e} lm, which the file would state as 0 lm; use lm63"
        ));
    }
    let per_kilolumen = 1000.0 / written;
    let (gamma, c) = (&planes.gamma, &planes.c);
    let mut lines: Vec<String> = Vec::new();
    let mut add = |line: String| lines.push(line);
    add("wavelume".to_owned());
    let axial = c.len() == 1;
    // Point source with or without symmetry about the vertical axis.
    add(if axial { "1" } else { "3" }.to_owned());
    add(if axial { "1" } else { "0" }.to_owned());
    add(c.len().to_string());
    add(plain(step(c, 360.0)));
    add(gamma.len().to_string());
    add(plain(step(gamma, *gamma.last().unwrap_or(&0.0))));
    for text in ["not stated", name, "", "", "not stated"] {
        add(ascii(text, LONGEST));
    }
    // Luminaire and luminous area: sizes in mm.
    (0..9).for_each(|_| add("0".to_owned()));
    add(plain(100.0 * downward(planes)));
    for value in ["100", "1", "0", "1"] {
        add(value.to_owned());
    }
    for value in [lamps.to_string(), "not stated".to_owned(), lumens, String::new(), String::new(), "0".to_owned()] {
        add(value);
    }
    (0..10).for_each(|_| add("0".to_owned()));
    c.iter().chain(gamma).for_each(|&angle| add(plain(angle)));
    planes
        .values
        .iter()
        .for_each(|&value| add(plain(if unit == Unit::Candela { value * per_kilolumen } else { value })));
    let mut text = lines.join("\r\n");
    text.push_str("\r\n");
    Ok(text.into_bytes())
}

/// Returns the step in degrees between equidistant angles up to `end`; 0 if they are not equidistant.
fn step(angles: &[f64], end: f64) -> f64 {
    let closed: Vec<f64> = if angles.last() == Some(&end) { angles.to_vec() } else { [angles, &[end]].concat() };
    let first = closed.get(1).map_or(0.0, |second| second - closed[0]);
    if closed.array_windows().all(|[a, b]| ((b - a) - first).abs() <= STEP) { first } else { 0.0 }
}

/// Returns the fraction of a luminaire's flux below the horizon. Each cell between neighbouring angles has the mean
/// intensity of its corners.
fn downward(planes: &CPlanes) -> f64 {
    let n = planes.gamma.len();
    let (mut below, mut all) = (0.0, 0.0);
    for (i, [a, b]) in planes.gamma.array_windows().enumerate() {
        let zone = libm::cos(a.to_radians()) - libm::cos(b.to_radians());
        let column = |gamma: usize| planes.values.iter().skip(gamma).step_by(n).sum::<f64>();
        let flux = zone * (column(i) + column(i + 1));
        all += flux;
        if *b <= 90.0 {
            below += flux;
        }
    }
    if all > 0.0 { below / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::super::{Interpretation, Samples, read};
    use super::*;

    fn planes() -> CPlanes {
        let gamma: Vec<f64> = (0..=18).map(|i| 5.0 * f64::from(i)).collect();
        let c: Vec<f64> = (0..8).map(|i| 45.0 * f64::from(i)).collect();
        let value = |c: f64, g: f64| 300.0 * libm::cos(0.9 * g.to_radians()) + if g > 0.0 { c } else { 0.0 };
        let values = c.iter().flat_map(|&c| gamma.iter().map(move |&g| value(c, g))).collect();
        CPlanes { gamma, c, values }
    }

    #[test]
    fn what_is_written_reads_back() {
        for (unit, flux) in [(Unit::Candela, 1_234.567_89), (Unit::CandelaPerKilolumen, f64::NAN)] {
            let planes = planes();
            let bytes = write_eulumdat(&planes, unit, flux, "Lämp").unwrap();
            let found = read(&bytes, &Interpretation::default()).unwrap();
            assert_eq!((found.format, found.unit), ("eulumdat", Unit::Candela));
            let Samples::Grid(grid) = found.samples else { panic!("a grid") };
            for (t, row) in grid.values.chunks_exact(8).enumerate() {
                for (h, &value) in row.iter().enumerate() {
                    let wanted = planes.values[h * 19 + 18 - t];
                    assert!((f64::from(value) / wanted - 1.0).abs() < 1e-6, "{unit} {t} {h}: {value} {wanted}");
                }
            }
        }
    }

    #[test]
    fn what_the_format_cannot_say_is_refused() {
        let faint = write_eulumdat(&planes(), Unit::Candela, 1e-30, "").unwrap_err();
        assert!(
            faint
                .to_string()
                .ends_with("the flux of the luminaire is 1e-30 lm, which the file would state as 0 lm; use lm63")
        );
        let kind = |unit, flux| write_eulumdat(&planes(), unit, flux, "").unwrap_err().kind;
        assert_eq!(kind(Unit::MilliwattPerSteradian, 1.0), FormatErrorKind::NeedsOption);
        assert_eq!(kind(Unit::Candela, 0.0), FormatErrorKind::NeedsOption);
        let wrong = CPlanes { values: Vec::new(), ..planes() };
        assert_eq!(write_eulumdat(&wrong, Unit::Candela, 1.0, "").unwrap_err().kind, FormatErrorKind::NeedsOption);
    }
}
