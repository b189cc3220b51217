//! Spectra with one row per sample and one column per wavelength, as instruments export them (`380nm`, `R380`, or the
//! bare number).

use super::holds::{Holds, names_wavelength, says_percent};
use super::table::Table;
use super::wavelength_unit::WavelengthUnit;
use crate::domain::limits::{MAX_ENTRIES, MAX_SAMPLES};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{Source, Token, number, snippet};
use crate::formats::text_table::cells::{Delimiter, has_words, is_missing, name_of};
use crate::formats::text_table::lines::{contents, split_comment};
use crate::formats::turned::turned;
use std::collections::HashMap;

/// Lower bound on the number of wavelengths in a row of column names. Raising it recognises fewer tables with one row
/// per sample.
const FEWEST: usize = 3;
/// Upper bound on the lines that are searched for a row of column names with wavelengths.
const LOOKED_AT: usize = 100;
/// Upper bound on the rows beneath a row of bare numbers that are examined, to tell a row of wavelengths from a first
/// row of values.
const ROWS_LOOKED_AT: usize = 20;
/// Lower bound on the number of neighbouring columns with one text before their numbers, such as `X400`, `X410`, if the
/// text is not known as one before wavelengths. Raising it recognises fewer tables.
const FEWEST_ALIKE: usize = 5;
/// Texts in lower case before or after a wavelength in nm in column names.
const KNOWN: [&str; 12] =
    ["spectral_nm", "spec_", "nm_", "nm", "_nm", "r", "wl_", "wl", "x", "lambda_", "λ", "wavelength_"];
/// Ranges of bare numbers in column names that are taken for wavelengths in nm, wavelengths in µm, and wavenumbers in
/// 1/cm.
const NANOMETRES: std::ops::RangeInclusive<f64> = 150.0..=3000.0;
const MICROMETRES: std::ops::RangeInclusive<f64> = 0.2..=25.0;
const WAVENUMBERS: std::ops::RangeInclusive<f64> = 400.0..=50_000.0;
/// Lower bound on the number of columns that are taken for wavelengths in micrometres: fewer numbers are replicates,
/// depths or angles.
const FEWEST_MICROMETRES: usize = 5;
/// Names in lower case of a first column that identifies samples, whose numbers may look like wavelengths.
const IDENTIFIERS: [&str; 16] = [
    "sample",
    "samples",
    "sampleid",
    "sample_id",
    "sample id",
    "id",
    "name",
    "no",
    "no.",
    "nr",
    "number",
    "spectrum",
    "target",
    "plot",
    "point",
    "scan",
];

/// Column of values: the position of its cell in a row (from 0), its wavelength, and the byte offset of its name.
type NamedColumn = (usize, f64, usize);

/// Number in a column name such as `380nm`, `R380`, `wl_400` or `400.00 nm`, with the text before and after it.
struct Numbered {
    before: String,
    after: String,
    number: f64,
}

/// Splits a column name at its only number; `None` for a name without a number, or with several.
fn numbered(name: &str) -> Option<Numbered> {
    let name = name.to_lowercase();
    let start = name.find(|c: char| c.is_ascii_digit())?;
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',');
    let length = name[start..].find(|c| !is_part(c)).unwrap_or(name.len() - start);
    let (before, rest) = name.split_at(start);
    let (digits, after) = rest.split_at(length);
    let number = number(&digits.replace(',', "."))?;
    let after = after.trim().to_owned();
    let has_words = |text: &str| text.chars().any(|c| c.is_ascii_digit());
    (!has_words(&after) && !before.ends_with('-')).then_some(Numbered { before: before.to_owned(), after, number })
}

/// Returns the columns with names of wavelengths, such as `380nm`, `R380`, `X400` or `wl_400`, and their unit: for each
/// its position, wavelength and byte offset. All have the same text before and after their numbers.
fn with_text(cells: &[Token<'_>]) -> (Vec<NamedColumn>, WavelengthUnit) {
    let mut alike: HashMap<(String, String), Vec<NamedColumn>> = HashMap::new();
    for (i, cell) in cells.iter().enumerate() {
        let Some(Numbered { before, after, number }) = numbered(&name_of(cell.text)) else { continue };
        let range = if unit_of(&after) == WavelengthUnit::Micrometre { MICROMETRES } else { NANOMETRES };
        if range.contains(&number) && (!before.is_empty() || !after.is_empty()) {
            alike.entry((before, after)).or_default().push((i, number, cell.offset));
        }
    }
    let are_wavelengths = |(before, after): &(String, String), columns: &[NamedColumn]| {
        let is_known = WavelengthUnit::of_name(after).is_some()
            || KNOWN.contains(&before.as_str())
            || KNOWN.contains(&after.as_str());
        let identifies = IDENTIFIERS.contains(&before.trim_end_matches(['_', ' ', '-', '.']));
        let numbers: Vec<f64> = columns.iter().map(|&(_, number, _)| number).collect();
        columns.len() >= if is_known { FEWEST } else { FEWEST_ALIKE }
            && (is_known || !identifies && is_monotone(&numbers))
    };
    let found = alike.into_iter().filter(|(text, columns)| are_wavelengths(text, columns));
    // The first of equally many.
    let most = found.max_by_key(|(_, columns)| (columns.len(), std::cmp::Reverse(columns[0].0)));
    most.map_or((Vec::new(), WavelengthUnit::Nanometre), |((_, after), columns)| (columns, unit_of(&after)))
}

/// Returns the unit that follows a wavelength in a column name; nm without one.
fn unit_of(after: &str) -> WavelengthUnit {
    WavelengthUnit::of_name(after).unwrap_or(WavelengthUnit::Nanometre)
}

/// Row of column names that contains wavelengths, with its cell separator.
struct Names {
    delimiter: Delimiter,
    cells: usize,
    /// Columns of values, in the order of the file.
    columns: Vec<NamedColumn>,
    /// Name of the wavelength axis, which may contain its unit.
    axis: Option<String>,
    offset: usize,
}

fn names<'a>(lines: impl Iterator<Item = Token<'a>>) -> Option<Names> {
    let lines: Vec<Token<'_>> = lines.take(LOOKED_AT + ROWS_LOOKED_AT).collect();
    lines.iter().take(LOOKED_AT).enumerate().find_map(|(i, line)| {
        // Bare numbers must follow a name or be on the first line.
        let begins = line.text.trim_start().starts_with(|c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.'));
        if begins && i > 0 && !has_words(line.text) {
            return None;
        }
        let below = &lines[i + 1..(i + 1 + ROWS_LOOKED_AT).min(lines.len())];
        Delimiter::ALL.into_iter().find_map(|delimiter| {
            let suffixed = if has_words(line.text) { with_unit(delimiter, *line) } else { None };
            suffixed.or_else(|| bare(delimiter, *line, below, i == 0))
        })
    })
}

/// Parses a row of column names in which wavelengths have a unit or other text, such as `380nm`, `R380` or `wl_400`.
fn with_unit(delimiter: Delimiter, line: Token<'_>) -> Option<Names> {
    let cells = delimiter.cells(line);
    let (columns, unit) = with_text(&cells);
    let is_of_column = |i: &usize| columns.iter().any(|(column, ..)| column == i);
    // Beside a column of wavelengths, such names are excitations or samples.
    let has_axis = (0..cells.len()).filter(|i| !is_of_column(i)).any(|i| names_wavelength(&name_of(cells[i].text)));
    let (cells, axis) = (cells.len(), Some(unit.name().to_owned()));
    (columns.len() >= FEWEST && !has_axis).then_some(Names { delimiter, cells, columns, axis, offset: line.offset })
}

/// Parses a row of column names in a text table of spectra, in which wavelengths are bare numbers, increasing or
/// decreasing. `None` unless the rows `below` have equally many cells.
fn bare(delimiter: Delimiter, line: Token<'_>, below: &[Token<'_>], is_first: bool) -> Option<Names> {
    let cells = delimiter.cells(line);
    if cells.len() < FEWEST {
        return None;
    }
    let numbers: Vec<Option<f64>> = cells.iter().map(|cell| delimiter.number(&name_of(cell.text))).collect();
    let from = numbers.iter().position(Option::is_some)?;
    let columns: Vec<NamedColumn> =
        (from..cells.len()).map_while(|i| Some((i, numbers[i]?, cells[i].offset))).collect();
    let after = numbers[from + columns.len()..].iter().all(Option::is_none);
    let values: Vec<f64> = columns.iter().map(|&(_, value, _)| value).collect();
    let first = name_of(cells[0].text);
    let is_stated = WavelengthUnit::of_header(&first).is_some() && values.iter().all(|&value| value > 0.0);
    let fits_a_unit = if is_stated { is_monotone(&values) } else { are_wavelengths(&values) };
    if columns.len() < FEWEST || 2 * columns.len() < cells.len() || !after || !fits_a_unit {
        return None;
    }
    let fits = |row: &Token<'_>| -> Option<String> {
        let row = delimiter.cells(*row);
        let same = row.len() == cells.len() || row.len() == cells.len() + 1 && row.last()?.text.is_empty();
        let is_value = |i: usize| delimiter.number(row[i].text).is_some() || is_missing(row[i].text);
        (same && columns.iter().all(|&(i, ..)| is_value(i))).then(|| name_of(row[0].text))
    };
    let firsts: Vec<String> = below.iter().map_while(fits).collect();
    // Wavelengths continue down the first column; sample numbers do not.
    let down: Option<Vec<f64>> = firsts.iter().map(|cell| delimiter.number(cell)).collect();
    let goes_on = |head: Option<f64>| {
        down.as_ref().is_some_and(|down| {
            let all: Vec<f64> = head.into_iter().chain(down.iter().copied()).collect();
            all.len() > 1 && is_monotone(&all) && all.iter().all(|value| NANOMETRES.contains(value))
        })
    };
    let is_table_of_rows = if from == 0 {
        !is_first || goes_on(Some(values[0]))
    } else {
        !IDENTIFIERS.contains(&first.to_lowercase().as_str()) && goes_on(None)
    };
    // A malformed first row under a name such as `sample` is left to the reader's error message.
    let is_identified = from > 0 && !below.is_empty() && IDENTIFIERS.contains(&first.to_lowercase().as_str());
    if firsts.is_empty() && !is_identified || is_table_of_rows {
        return None;
    }
    let axis = Some(first).filter(|first| WavelengthUnit::of_header(first).is_some());
    Some(Names { delimiter, cells: cells.len(), columns, axis, offset: line.offset })
}

fn is_monotone(values: &[f64]) -> bool {
    values.array_windows().all(|[a, b]| a < b) || values.array_windows().all(|[a, b]| a > b)
}

/// Returns true for ordered numbers that can be wavelengths in nm or µm, or decreasing wavenumbers.
fn are_wavelengths(values: &[f64]) -> bool {
    let within = |range: &std::ops::RangeInclusive<f64>| values.iter().all(|value| range.contains(value));
    let are_micrometres = || {
        values.len() >= FEWEST_MICROMETRES && values.iter().any(|value| value.fract() != 0.0) && within(&MICROMETRES)
    };
    let falls = values[values.len() - 1] < values[0];
    is_monotone(values) && (within(&NANOMETRES) || are_micrometres() || falls && within(&WAVENUMBERS))
}

/// Returns true if a row of column names has wavelengths, with a spectrum in each row beneath.
pub(super) fn is_wide<'a>(lines: impl Iterator<Item = Token<'a>>) -> bool {
    names(lines).is_some()
}

/// Returns the spectra of a table with one spectrum in each row, transposed so that each spectrum is a column; `None`
/// for any other text.
pub(super) fn read(source: &Source, report: &mut ParseReport) -> Result<Option<Table>, FormatError> {
    let Some(found) = names(contents(source)) else { return Ok(None) };
    let Names { delimiter, cells: width, columns, axis, offset } = found;
    let (mut names, mut values) = (Vec::new(), Vec::new());
    let (mut prose, mut heading) = (String::new(), String::new());
    for line in source.lines() {
        let (content, comment) = split_comment(line);
        if line.offset <= offset {
            let text = if line.offset == offset { &mut heading } else { &mut prose };
            text.push_str(&line.text.to_lowercase());
            text.push('\n');
            let comment = comment.map(str::trim).filter(|comment| !comment.is_empty());
            report.metadata.extend(comment.map(|text| ("comment".to_owned(), text.chars().take(4096).collect())));
            continue;
        }
        let mut cells = delimiter.cells(content);
        if cells.iter().all(|cell| cell.text.is_empty()) {
            continue;
        }
        // Either the names or the rows may have an additional trailing delimiter.
        if cells.len() == width + 1 && cells.last().is_some_and(|cell| cell.text.is_empty()) {
            cells.pop();
        } else if cells.len() + 1 == width && columns.last().is_some_and(|&(last, ..)| last + 1 < width) {
            cells.push(Token { text: "", offset: content.offset + content.text.len() });
        }
        if cells.len() != width {
            let message = format!("a row of {} cells, expected {width}: the row of names has as many", cells.len());
            return Err(source.malformed(line.offset, message));
        }
        for &(i, ..) in &columns {
            let cell = cells[i];
            let value = delimiter.number(cell.text).map(|value| value as f32).filter(|value| value.is_finite());
            if value.is_none() && !is_missing(cell.text) {
                let message =
                    format!("found {}, expected a number or a missing value (blank, NaN or --)", snippet(cell.text));
                return Err(source.malformed(cell.offset, message));
            }
            values.push(value.unwrap_or(f32::NAN));
        }
        let is_label = |i: &usize| columns.iter().all(|(column, ..)| column != i) && !cells[*i].text.is_empty();
        let label = (0..width).find(is_label).map(|i| name_of(cells[i].text));
        names.push(label.unwrap_or_else(|| (names.len() + 1).to_string()));
        if names.len() > MAX_ENTRIES || values.len() > MAX_SAMPLES {
            let message = format!("expected at most {MAX_ENTRIES} rows and {MAX_SAMPLES} values");
            return Err(source.error(FormatErrorKind::OverLimit, line.offset, message));
        }
    }
    if names.is_empty() {
        return Err(source.malformed(offset, "names of wavelengths without a row of values, expected one at least"));
    }
    let values = turned(&values, columns.len(), names.len());
    let wavelengths = columns.into_iter().map(|(_, nm, offset)| (nm, offset)).collect();
    let (wavelength_name, dialect) = (axis, "one spectrum a row");
    let (holds, percent) = (vec![Holds::Unstated; names.len()], vec![says_percent(&heading); names.len()]);
    let library = None;
    Ok(Some(Table { wavelengths, values, names, holds, percent, wavelength_name, prose, heading, library, dialect }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Axis, Quantity};
    use crate::formats::{Acquisition, Interpretation, Samples, read as read_any};

    fn read(text: &str) -> Result<Acquisition, FormatError> {
        read_any(text.as_bytes(), &Interpretation::default())
    }

    #[test]
    fn every_name_of_a_wavelength_is_one() {
        for text in [
            "sample,380nm,390 nm,400nm\nleaf,0.1,0.2,0.3\n\"red leaf\",0.4,,0.6\n",
            "# reflectance\nid;type;R380;R390;R400\nleaf;a;0,1;0,2;0,3\nred leaf;b;0,4;;0,6\n",
            "SAMPLE\tSPEC_380\tSPEC_390\tSPEC_400\nleaf\t.1\t.2\t.3\nred leaf\t.4\t\t.6\n",
            "nm380,nm390,nm400,name\n0.1,0.2,0.3,leaf\n0.4,,0.6,red leaf\n",
        ] {
            let found = read(text).unwrap_or_else(|error| panic!("{text}{error}"));
            assert_eq!(found.quantity, if text.contains('#') { Quantity::Reflectance } else { Quantity::Spectrum });
            let Samples::OnAxes { tensor, .. } = found.samples else { panic!("on axes") };
            let [Axis::Index { labels, .. }, Axis::Wavelength(grid)] = tensor.axes() else { panic!("two axes") };
            assert_eq!(
                (labels.as_slice(), grid.values()),
                (&["leaf", "red leaf"].map(str::to_owned)[..], vec![380.0, 390.0, 400.0])
            );
            let samples = tensor.samples();
            assert!(samples[..4] == [0.1, 0.2, 0.3, 0.4] && samples[4].is_nan() && samples[5] == 0.6, "{samples:?}");
        }
    }

    #[test]
    fn other_tables_stay_what_they_are() {
        // Excitations of a fluorescent sample.
        let found = read("wavelength (nm),380nm,390nm,400nm\n500,1,2,3\n510,2,3,4\n").unwrap();
        assert!(found.dialect.ends_with("3 columns"), "{}", found.dialect);
    }

    #[test]
    fn refusals_say_where_and_what() {
        let names = "sample,380nm,390nm,400nm\n";
        for (rows, word) in [
            ("leaf,0.1,0.2\n", "line 2, column 1: a row of 3 cells, expected 4"),
            ("leaf,0.1,x,0.3\n", "line 2, column 10: found `x`, expected a number"),
            ("", "without a row of values"),
        ] {
            let error = read(&format!("{names}{rows}")).unwrap_err();
            assert!(error.kind == FormatErrorKind::Malformed && error.to_string().contains(word), "{error}");
        }
        let error = read("sample,380nm,390nm,390nm\nleaf,1,2,3\n").unwrap_err();
        assert!(error.to_string().contains("wavelength 390 twice"), "{error}");
        let Samples::OnAxes { tensor, .. } = read("sample,380nm,400nm,390nm\nleaf,1,2,3\n").unwrap().samples else {
            panic!("on axes")
        };
        assert_eq!(tensor.samples(), [1.0, 3.0, 2.0], "sorted");
    }
}
