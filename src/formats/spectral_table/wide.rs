//! Spectra with one row for each sample and one column for each wavelength, as instruments export them (`380nm`, `R380`).

use super::rows::{Delimiter, Table, contents, split_comment, unquoted};
use crate::domain::limits::{MAX_ENTRIES, MAX_SAMPLES};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{Source, Token, number, snippet};
use crate::formats::turned::turned;

/// Columns of wavelengths that make a row of names one of spectra.
const FEWEST: usize = 3;
/// Lines before the data in which names are looked for.
const LOOKED_AT: usize = 100;
/// What stands before a wavelength in nm.
const PREFIXES: [&str; 5] = ["spectral_nm", "spec_", "nm_", "nm", "r"];

/// The wavelength of a column such as `380nm`, `R380`, `SPEC_380` or `nm380`.
fn wavelength(name: &str) -> Option<f64> {
    let name = name.to_lowercase();
    let before = PREFIXES.iter().find_map(|prefix| name.strip_prefix(prefix));
    let rest = before.unwrap_or(&name);
    let digits = rest.strip_suffix("nm").map(str::trim_end);
    (before.is_some() || digits.is_some()).then_some(())?;
    number(digits.unwrap_or(rest)).filter(|nm| (150.0..=3000.0).contains(nm))
}

/// The row of names, what separates its cells, and where their wavelengths are.
struct Names {
    delimiter: Delimiter,
    cells: usize,
    /// The number of the cell, the wavelength, and its place.
    columns: Vec<(usize, f64, usize)>,
    offset: usize,
}

fn names<'a>(lines: impl Iterator<Item = Token<'a>>) -> Option<Names> {
    // Rows of numbers have no letter but that of an exponent.
    let named = |line: &Token<'_>| line.text.bytes().any(|b| b.is_ascii_alphabetic() && !matches!(b, b'e' | b'E'));
    lines.take(LOOKED_AT).filter(named).find_map(|line| {
        Delimiter::ALL.into_iter().find_map(|delimiter| {
            let cells = delimiter.cells(line);
            let columns: Vec<(usize, f64, usize)> = cells
                .iter()
                .enumerate()
                .filter_map(|(i, cell)| Some((i, wavelength(&unquoted(cell.text))?, cell.offset)))
                .collect();
            let first = cells.first().map(|cell| cell.text.to_lowercase()).unwrap_or_default();
            let is_axis = first.contains("wavelength") || first.contains("lambda") || first.trim() == "nm";
            let found = columns.len() >= FEWEST && !is_axis;
            found.then_some(Names { delimiter, cells: cells.len(), columns, offset: line.offset })
        })
    })
}

/// Whether a row of names has columns of wavelengths.
pub(super) fn is_wide<'a>(lines: impl Iterator<Item = Token<'a>>) -> bool {
    names(lines).is_some()
}

/// The table of such a text, turned: a column for each sample; `None` where the text is another.
pub(super) fn read(source: &Source, report: &mut ParseReport) -> Result<Option<Table>, FormatError> {
    let Some(Names { delimiter, cells: width, columns, offset }) = names(contents(source)) else { return Ok(None) };
    let (mut names, mut values, mut prose) = (Vec::new(), Vec::new(), String::new());
    for line in source.lines() {
        let (content, comment) = split_comment(line);
        if line.offset <= offset {
            prose.push_str(&line.text.to_lowercase());
            prose.push('\n');
            let comment = comment.map(str::trim).filter(|comment| !comment.is_empty());
            report.metadata.extend(comment.map(|text| ("comment".to_owned(), text.chars().take(4096).collect())));
            continue;
        }
        if content.text.trim().is_empty() {
            continue;
        }
        let cells = delimiter.cells(content);
        if cells.len() != width {
            let message = format!("a row of {} cells, expected {width} as there are names", cells.len());
            return Err(source.malformed(line.offset, message));
        }
        for &(i, ..) in &columns {
            let cell = cells[i];
            let value = delimiter.number(cell.text).map(|value| value as f32).filter(|value| value.is_finite());
            if value.is_none() && !cell.text.is_empty() {
                let message = format!("found {}, expected a number or a blank cell", snippet(cell.text));
                return Err(source.malformed(cell.offset, message));
            }
            values.push(value.unwrap_or(f32::NAN));
        }
        let is_label = |i: &usize| columns.iter().all(|(column, ..)| column != i) && !cells[*i].text.is_empty();
        let label = (0..width).find(is_label).map(|i| unquoted(cells[i].text));
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
    let (wavelength_name, dialect) = (Some("nm".to_owned()), "one spectrum a row");
    Ok(Some(Table { wavelengths, values, names, wavelength_name, prose, dialect }))
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
        assert!(found.dialect.ends_with("3 column(s)"), "{}", found.dialect);
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
        let error = read("sample,380nm,400nm,390nm\nleaf,1,2,3\n").unwrap_err();
        assert!(error.to_string().contains("wavelength 390 after 400"), "{error}");
    }
}
