//! Phase functions in columns: scattering angles or their cosines, and the values of one column beside them.

use super::about::NAME;
use super::function::Curve;
use super::normalised::held;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::normalization::Normalization;
use crate::formats::text::{Brief, Source, Token, snippet};
use crate::formats::text_table::header;
use crate::formats::text_table::layout::{self, MAX_PREAMBLE, ROWS_LOOKED_AT};
use crate::formats::text_table::lines::contents;
use crate::formats::text_table::rows::{self, Role};
use crate::notes::{PhaseNote, TextNote};

/// Returns true if lower-case text describes the values as a volume scattering function. A line that only names the
/// option `normalization` does not count.
pub(super) fn says_volume(prose: &str) -> bool {
    let words = |text: &str| text.split(|c: char| !c.is_alphanumeric()).any(|word| word == "vsf");
    prose.contains("volume scattering") || prose.lines().any(|line| !line.contains("normalization") && words(line))
}

/// Column of scattering angles or cosines and the column of values that is read beside it.
struct Table {
    /// Angles or cosines with their byte offsets.
    places: Vec<(f64, usize)>,
    values: Vec<f32>,
    /// True if the header says that angles are in radians.
    radians: bool,
    /// True if the text around the numbers says that they are a volume scattering function.
    is_volume: bool,
    dialect: &'static str,
}

/// Returns true if the name of a column, in lower case, is that of an angle or of its cosine.
fn names_angle(name: &str) -> bool {
    ["angle", "theta", "θ", "cos", "mu", "winkel", "scattering", "deg"].iter().any(|word| name.contains(word))
}

/// Returns true if a text in lower case says radians.
fn says_radians(text: &str) -> bool {
    text.split(|c: char| !c.is_alphabetic()).any(|word| matches!(word, "rad" | "radian" | "radians"))
}

/// Reads the column of angles, which is named so or is the first, and one column of values.
fn table(source: &Source, how: &Interpretation, report: &mut ParseReport) -> Result<Table, FormatError> {
    let lines: Vec<Token<'_>> = contents(source).take(MAX_PREAMBLE + ROWS_LOOKED_AT).collect();
    let Some(layout) = layout::find(&lines) else {
        let at = lines.first().map_or(0, |line| line.offset);
        return Err(source.malformed(
            at,
            "no rows of numbers, expected angles (or their cosines) and values separated by tab, `;`, `,` or blanks, as \
             many cells in each row",
        ));
    };
    // Comments describe the columns, too.
    let before: Vec<Token<'_>> = source
        .lines()
        .take_while(|line| line.offset < layout.start)
        .filter_map(|line| {
            let text = line.text.trim_start().trim_start_matches('#');
            (!text.trim().is_empty()).then_some(Token { text, offset: line.offset })
        })
        .take(MAX_PREAMBLE)
        .collect();
    let header = header::of(&before, &layout);
    let used = header.as_ref().map_or(0, |header| header.lines);
    if before.len() > used {
        report.note(TextNote::LinesBeforeData { lines: before.len() - used });
    }
    let names = header.map_or_else(|| vec![String::new(); layout.width], |header| header.names);
    let lower: Vec<String> = names.iter().map(|name| name.to_lowercase()).collect();
    let numeric: Vec<usize> = (0..layout.width).filter(|&i| !layout.is_text[i]).collect();
    let angle = numeric.iter().copied().find(|&i| names_angle(&lower[i])).unwrap_or(numeric[0]);
    let others: Vec<usize> = numeric.into_iter().filter(|&i| i != angle).collect();
    let titles: Vec<String> = others
        .iter()
        .enumerate()
        .map(|(n, &i)| if names[i].is_empty() { (n + 1).to_string() } else { names[i].clone() })
        .collect();
    let value = if let Some(wanted) = &how.column {
        position(&titles, wanted)?
    } else {
        if titles.len() > 1 {
            report.note(PhaseNote::FirstColumnRead { columns: titles.len(), names: titles.join(", ") });
        }
        0
    };
    let mut roles = vec![Role::Skip; layout.width];
    roles[angle] = Role::Key;
    if let Some(&column) = others.get(value) {
        roles[column] = Role::Value;
    }
    let read = rows::read(source, &layout, &roles, "an angle or a cosine")?;
    if read.after > 0 {
        report.note(TextNote::LinesAfterData { lines: read.after });
    }
    let prose: String = before.iter().map(|line| line.text.to_lowercase() + "\n").collect();
    Ok(Table {
        places: read.keys,
        values: read.values,
        radians: says_radians(&lower[angle]) || lower[angle].is_empty() && says_radians(&prose),
        is_volume: says_volume(&prose),
        dialect: layout.delimiter.dialect(),
    })
}

/// Sets a last angle that is 180 degrees but for the rounding of its radians (3.14, 3.1416) to 180.
fn close_half_circle(places: &mut [(f64, usize)]) {
    // Two decimals of π are 0.1 degrees off.
    const ROUNDED: f64 = 0.1;
    for (angle, _) in places {
        if (*angle - 180.0).abs() < ROUNDED {
            *angle = 180.0;
        }
    }
}

/// Returns the position of a column of values, chosen by its name or by its number from 1.
fn position(titles: &[String], wanted: &str) -> Result<usize, FormatError> {
    let wanted = wanted.trim();
    let by_name = titles.iter().position(|title| title.eq_ignore_ascii_case(wanted));
    let by_number = || wanted.parse().ok().filter(|n| (1..=titles.len()).contains(n)).map(|n: usize| n - 1);
    by_name.or_else(by_number).ok_or_else(|| {
        let message = format!(
            "no column {}, expected a number from 1 to {} or one of: {}",
            snippet(wanted),
            titles.len(),
            titles.join(", ")
        );
        FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
    })
}

/// Reads a phase function from a table of two columns or more, with a description of its form. Also returns true if the
/// header mentions a volume scattering function.
pub(super) fn read(
    source: &Source,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<(Curve, String, bool), FormatError> {
    let mut table = table(source, how, report)?;
    let vsf = table.is_volume;
    if table.places.len() > MAX_WAVELENGTHS {
        let message = format!("{} scattering angles, expected at most {MAX_WAVELENGTHS}", table.places.len());
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    }
    if table.radians {
        // Rounded, because the degrees of a rounded angle are no better than its digits.
        for (angle, _) in &mut table.places {
            *angle = ((*angle).to_degrees() * 1e4).round() / 1e4;
        }
        close_half_circle(&mut table.places);
        report.note(PhaseNote::AnglesInRadians);
    }
    let (low, high) = table.places.iter().fold((f64::MAX, f64::MIN), |(a, b), &(x, _)| (a.min(x), b.max(x)));
    let cosines = low >= -1.0 && high <= 1.0 && low < 0.0;
    let range = if cosines { (-1.0, 1.0) } else { (0.0, 180.0) };
    let what = if cosines { "a cosine from -1 to 1" } else { "an angle from 0 to 180 degrees" };
    if let Some(&(found, offset)) = table.places.iter().find(|(x, _)| !(range.0..=range.1).contains(x)) {
        return Err(source.malformed(offset, format!("found {}, expected {what}", Brief(found))));
    }
    let falling = table.places.len() > 1 && table.places[1].0 < table.places[0].0;
    for pair in table.places.array_windows() {
        let [(a, _), (b, offset)] = *pair;
        if a == b || (b < a) != falling {
            let expected = if falling { "decreasing" } else { "increasing" };
            return Err(source.malformed(
                offset,
                format!("found {} after {}, expected {expected} angles or cosines, none twice", Brief(b), Brief(a)),
            ));
        }
    }
    let form = format!("{} {}, {}", table.values.len(), if cosines { "cosines" } else { "angles" }, table.dialect);
    if table.values.len() < 2 || table.values.iter().all(|v| v.is_nan()) {
        return Err(source.malformed(0, "fewer than two values, expected a table over the scattering angle"));
    }
    report.note(if cosines { PhaseNote::CosinesInFirstColumn } else { PhaseNote::DegreesInFirstColumn });
    let (mut places, mut values): (Vec<f64>, Vec<f64>) =
        table.places.iter().zip(&table.values).map(|(&(x, _), &value)| (x, f64::from(value))).unzip();
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
