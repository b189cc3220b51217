//! Phase functions in columns: scattering angles or their cosines, and the values of one column beside them.

use super::about::NAME;
use super::function::Curve;
use super::normalised::held;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::normalization::Normalization;
use crate::formats::spectral_table::rows;
use crate::formats::text::{Brief, Source};
use crate::notes::PhaseNote;

/// Returns true if lower-case text describes the values as a volume scattering function. A line that only names the
/// option `normalization` does not count.
pub(super) fn says_volume(prose: &str) -> bool {
    let words = |text: &str| text.split(|c: char| !c.is_alphanumeric()).any(|word| word == "vsf");
    prose.contains("volume scattering") || prose.lines().any(|line| !line.contains("normalization") && words(line))
}

/// Reads a phase function from a table of two columns or more, with a description of its form. Also returns true if the
/// header mentions a volume scattering function.
pub(super) fn read(
    source: &Source,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(Curve, String, bool), FormatError> {
    let renamed = |error: FormatError| FormatError { format: NAME, ..error };
    let mut table = rows::read(source, report).map_err(renamed)?;
    match &how.column {
        Some(column) => table.pick(column).map_err(renamed)?,
        None if table.names.len() > 1 => {
            let list = table.column_list();
            report.note(PhaseNote::FirstColumnRead { columns: table.names.len(), names: list });
            table.pick("1").map_err(renamed)?;
        }
        None => {}
    }
    let vsf = table.says(says_volume);
    if table.wavelengths.len() > MAX_WAVELENGTHS {
        let message = format!("{} scattering angles, expected at most {MAX_WAVELENGTHS}", table.wavelengths.len());
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    let (low, high) = table.wavelengths.iter().fold((f64::MAX, f64::MIN), |(a, b), &(x, _)| (a.min(x), b.max(x)));
    let cosines = low >= -1.0 && high <= 1.0 && low < 0.0;
    let range = if cosines { (-1.0, 1.0) } else { (0.0, 180.0) };
    let what = if cosines { "a cosine from -1 to 1" } else { "an angle from 0 to 180 degrees" };
    if let Some(&(found, offset)) = table.wavelengths.iter().find(|(x, _)| !(range.0..=range.1).contains(x)) {
        return Err(source.malformed(offset, format!("found {}, expected {what}", Brief(found))));
    }
    let falling = table.wavelengths.len() > 1 && table.wavelengths[1].0 < table.wavelengths[0].0;
    for pair in table.wavelengths.array_windows() {
        let [(a, _), (b, offset)] = *pair;
        if a == b || (b < a) != falling {
            let expected = if falling { "decreasing" } else { "increasing" };
            return Err(source.malformed(
                offset,
                format!(
                    "found wavelength {} after {}, expected {expected} wavelengths, none twice",
                    Brief(b),
                    Brief(a)
                ),
            ));
        }
    }
    let form = format!("{} {}, {}", table.values.len(), if cosines { "cosines" } else { "angles" }, table.dialect);
    if table.values.len() < 2 || table.values.iter().all(|v| v.is_nan()) {
        return Err(source.malformed(0, "fewer than two values, expected a table over the scattering angle"));
    }
    report.note(if cosines { PhaseNote::CosinesInFirstColumn } else { PhaseNote::DegreesInFirstColumn });
    let (mut places, mut values): (Vec<f64>, Vec<f64>) =
        table.wavelengths.iter().zip(&table.values).map(|(&(x, _), &value)| (x, f64::from(value))).unzip();
    // Sorted by increasing angle or decreasing cosine.
    if cosines != falling {
        places.reverse();
        values.reverse();
    }
    let curve = if cosines {
        Curve::over_cosines(places, values)
    } else {
        Curve::over_angles(places, values, vsf || how.normalization == Some(Normalization::Vsf))
    };
    Ok((held(curve, report), form, vsf))
}
