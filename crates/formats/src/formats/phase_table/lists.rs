//! Phase functions as bare lists: values at evenly spaced cosines on one line, or Legendre moments, one per line.

use super::about::NAME;
use super::function::Curve;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::spectral_table::pairs::are_pairs;
use crate::formats::text::{Brief, Source, Token, Tokens, number};
use crate::formats::text_table::lines::contents as table_lines;
use crate::notes::PhaseNote;
use std::f64::consts::PI;

/// Smallest number of values, or of Legendre moments, that a phase function given as a bare list of numbers must have.
const FEWEST: usize = 3;
/// Upper bound on the number of Legendre moments of a phase function, whose polynomials are summed at every angle.
/// Raising it allows longer computations.
const MAX_MOMENTS: usize = 1 << 12;
/// Number of scattering angles for each Legendre moment in the table that is computed from the moments. Raising it
/// makes finer tables.
const ANGLES_PER_MOMENT: usize = 8;

/// Returns the non-empty lines of a text without their comments after `#`.
fn contents(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map(|line| line.split('#').next().unwrap_or_default().trim()).filter(|line| !line.is_empty())
}

fn numbers(line: &str) -> Option<Vec<f64>> {
    Tokens::new(line, 0).map(|token| number(token.text)).collect()
}

/// Returns true if the beginning of a file is a single line of at least three numbers, which may continue.
pub(super) fn is_line(head: &str) -> bool {
    let mut lines = contents(head);
    let (first, more) = (lines.next().unwrap_or_default(), lines.next().is_some());
    let words: Vec<Token<'_>> = Tokens::new(first, 0).collect();
    // The head may cut the last word.
    let whole = &words[..words.len().saturating_sub(1)];
    !more && words.len() >= FEWEST && whole.iter().all(|word| number(word.text).is_some())
}

/// Returns true if one line of numbers is a spectrum, not a phase function: it consists of pairs of wavelength and
/// value, or the lower-case text around it says so.
pub(super) fn is_spectral(head: &str, prose: &str) -> bool {
    let source = Source::decode(head.as_bytes(), NAME);
    are_pairs(table_lines(&source)) || ["wavelength", "lambda", "nm"].iter().any(|word| prose.contains(word))
}

/// Returns true if the text is a list of Legendre moments: one number per line, the first equal to 1, and number m
/// (from 0) at most 2m + 1 in magnitude.
pub(super) fn is_moments(head: &str) -> bool {
    let mut count = 0_usize;
    for line in contents(head) {
        let Some(value) = number(line) else { return false };
        let fits = if count == 0 { (value - 1.0).abs() < 1e-6 } else { value.abs() <= (2 * count + 1) as f64 };
        if !fits {
            return false;
        }
        count += 1;
    }
    count >= FEWEST
}

/// Returns true if the first numbers of the rows are cosines, or angles from 0 to 180 degrees. Wavelengths do not have
/// such a range.
pub(super) fn is_angular(head: &str) -> bool {
    let firsts: Vec<f64> = contents(head)
        .filter_map(|line| number(line.split([',', ';', '\t', ' ']).find(|cell| !cell.is_empty())?))
        .collect();
    let (low, high) = firsts.iter().fold((f64::MAX, f64::MIN), |(low, high), &x| (low.min(x), high.max(x)));
    firsts.len() >= FEWEST && (((-1.0..0.0).contains(&low) && high <= 1.0) || (low == 0.0 && high == 180.0))
}

/// Returns the phase function that a file gives as a single list of numbers, and a description of the list in words,
/// such as `64 Legendre moments`. Returns `None` if the file is a table of several columns.
pub(super) fn read(
    source: &Source,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<Option<(Curve, String)>, FormatError> {
    let text = source.text();
    let mut lines = contents(text);
    let (line, more) = (lines.next().unwrap_or_default(), lines.next().is_some());
    let is_list = !more && Tokens::new(line, 0).nth(FEWEST - 1).is_some();
    if !is_list && !contents(text).all(|line| number(line).is_some()) {
        return Ok(None);
    }
    if how.column.is_some() {
        let message = "a list of numbers has no columns to choose from";
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    }
    let at = |piece: &str| piece.as_ptr() as usize - text.as_ptr() as usize;
    if is_list {
        let values = numbers(line).ok_or_else(|| {
            let bad = Tokens::new(line, 0).find(|token| number(token.text).is_none());
            let (found, offset) = bad.map_or(("", 0), |token| (token.text, token.offset));
            source.malformed(
                at(line) + offset,
                format!("found {}, expected a number", crate::formats::text::snippet(found)),
            )
        })?;
        return Ok(Some((list(&values, report)?, format!("{} values over the cosine", values.len()))));
    }
    let moments: Vec<f64> = contents(text).filter_map(number).collect();
    if moments.len() < FEWEST {
        return Err(source.malformed(0, format!("{} numbers, expected a table or at least {FEWEST}", moments.len())));
    }
    let first = moments[0];
    if (first - 1.0).abs() > 1e-6 {
        let message = format!(
            "one number a line, the first of them {}: expected 1, the first Legendre moment (values over the cosine go on \
             one line, angles and values into two columns)",
            Brief(first)
        );
        return Err(source.malformed(0, message));
    }
    let form = format!("{} Legendre moments", moments.len());
    Ok(Some((expanded(moments, report)?, form)))
}

fn over_limit(found: usize, what: &str, most: usize) -> FormatError {
    FormatError::new(FormatErrorKind::OverLimit, NAME, format!("{found} {what}, expected at most {most}"))
}

/// Returns the phase function with the values `values` at evenly spaced cosines of the scattering angle from -1 to 1.
fn list(values: &[f64], report: &mut ParseReport) -> Result<Curve, FormatError> {
    let n = values.len();
    if n > MAX_WAVELENGTHS {
        return Err(over_limit(n, "values", MAX_WAVELENGTHS));
    }
    report.note(PhaseNote::EvenCosines);
    let cosine = |i: usize| 2.0 * i as f64 / (n - 1) as f64 - 1.0;
    let cosines = (0..n).rev().map(|i| cosine(i).clamp(-1.0, 1.0)).collect();
    Ok(Curve::over_cosines(cosines, values.iter().rev().copied().collect()))
}

/// Returns the phase function with these Legendre moments, as a table fine enough for the highest order.
fn expanded(mut moments: Vec<f64>, report: &mut ParseReport) -> Result<Curve, FormatError> {
    let n = moments.len();
    if n > MAX_MOMENTS {
        return Err(over_limit(n, "moments", MAX_MOMENTS));
    }
    // A non-negative function has |k_m| <= 1.
    let factored = moments.iter().any(|k| k.abs() > 1.0 + 1e-9);
    report.note(if factored { PhaseNote::MomentsFactored } else { PhaseNote::MomentsNotFactored });
    if !factored {
        moments.iter_mut().enumerate().for_each(|(m, k)| *k *= (2 * m + 1) as f64);
    }
    let count = (ANGLES_PER_MOMENT * n).clamp(360, MAX_WAVELENGTHS - 1);
    report.note(PhaseNote::MomentsExpanded { angles: count + 1 });
    let angles: Vec<f64> = (0..=count).map(|i| 180.0 * i as f64 / count as f64).collect();
    let values = angles.iter().map(|angle| series(&moments, libm::cos(angle.to_radians())) / (4.0 * PI)).collect();
    let mut curve = Curve::over_angles(angles, values, false);
    curve.is_listed = false;
    Ok(curve)
}

/// Returns the Legendre series `Σ c_m P_m(x)` (Bonnet's recurrence).
fn series(coefficients: &[f64], x: f64) -> f64 {
    let (mut before, mut polynomial, mut sum) = (0.0, 1.0, 0.0);
    for (m, c) in coefficients.iter().enumerate() {
        sum += c * polynomial;
        let m = m as f64;
        let next = ((2.0 * m + 1.0) * x * polynomial - m * before) / (m + 1.0);
        (before, polynomial) = (polynomial, next);
    }
    sum
}
