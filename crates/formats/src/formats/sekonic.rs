//! Exports of Sekonic's light meters (C-700, C-800, C-7000; `.csv`): named figures, then a line
//! `Spectral Data 380[nm],value` for each wavelength, in steps of 5 nm and again of 1 nm.

use super::acquisition::{Acquisition, ParseReport};
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::reader::{Format, Reader, Sample};
use super::spectra::{Spectra, of_light};
use super::spectral_table::table::Table;
use super::text::{Source, Token, is_text, number, snippet};
use super::text_table::cells::{Content, Delimiter, name_of};
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::notes::{SpectrumNote, TextNote};

const NAME: &str = "sekonic";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "spectrum of a Sekonic light meter: C-700, C-800, C-7000 (.csv)",
        extensions: &["csv"],
        reads: true,
        writes: false,
    },
    options: &[],
    probe: |sample: &Sample<'_>| if is_text(&sample.head) && is_export(&sample.head) { 90 } else { 0 },
    read,
};

/// Words before the wavelength in each line of a spectrum.
const MARK: &str = "Spectral Data ";
/// Separators between the cells of an export; spreadsheets change the comma.
const DELIMITERS: [Delimiter; 3] = [Delimiter::Comma, Delimiter::Semicolon, Delimiter::Tab];
/// Lower bound on the lines of a spectrum in an export. Raising it recognises fewer files.
const FEWEST: usize = 3;
/// Upper bounds on the named figures that are kept as metadata, and on the spectra side by side. Raising them keeps
/// more.
const MAX_FIGURES: usize = 1000;
const MAX_COLUMNS: usize = 1000;
/// Largest number of lists of wavelengths in an export: in steps of 5 nm and of 1 nm.
const MOST_LISTS: usize = 2;

/// Returns the wavelength in nm of a cell such as `Spectral Data 380[nm]`.
fn wavelength(cell: &str) -> Option<f64> {
    let written = cell.strip_prefix(MARK)?.trim_end().strip_suffix("[nm]")?;
    number(written.trim()).filter(|nm| *nm > 0.0)
}

/// Returns the separator of a line such as `Spectral Data 380[nm],0.5`.
fn delimiter(line: &str) -> Option<Delimiter> {
    let line = line.trim_start_matches(['"', ' ']);
    line.starts_with(MARK).then_some(())?;
    let after = line[line.find("[nm]")? + "[nm]".len()..].trim_start_matches(['"', ' ']);
    DELIMITERS.into_iter().find(|delimiter| after.starts_with(char::from(delimiter.byte())))
}

fn is_export(head: &str) -> bool {
    head.lines().filter(|line| delimiter(line).is_some()).take(FEWEST).count() == FEWEST
}

/// Lines of one list of wavelengths: wavelengths in nm with their byte offsets, and values row by row.
#[derive(Default)]
struct List {
    wavelengths: Vec<(f64, usize)>,
    values: Vec<f32>,
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let source = Source::decode(bytes, NAME);
    let mut report = ParseReport::default();
    report.note_encoding(&source);
    let quantity = of_light(how, NAME, &mut report)?;
    let delimiter = source.lines().find_map(|line| delimiter(line.text)).unwrap_or(Delimiter::Comma);
    let (mut lists, mut columns, mut figures, mut titles): (Vec<List>, _, _, _) = (Vec::new(), 0, 0, Vec::new());
    for line in source.lines().filter(|line| !line.text.trim().is_empty()) {
        let cells = delimiter.cells(line);
        let Some(nm) = cells.first().and_then(|cell| wavelength(cell.text)) else {
            let rest: Vec<String> = cells.iter().skip(1).map(|cell| name_of(cell.text)).collect();
            let key = cells.first().map_or_else(String::new, |cell| name_of(cell.text));
            if key.starts_with(MARK.trim_end()) {
                let message = format!("found {}, expected a line such as {MARK}380[nm]", snippet(line.text));
                return Err(source.malformed(line.offset, message));
            }
            figures += 1;
            if figures <= MAX_FIGURES {
                report.metadata.push((key.clone(), rest.join(" ").chars().take(4096).collect()));
            }
            if key == "Title" {
                titles = rest;
            }
            continue;
        };
        row(&source, delimiter, nm, &cells, &mut lists, &mut columns)?;
    }
    if figures > 0 {
        report.note(TextNote::FiguresAroundData { lines: figures });
    }
    let list = finest(lists, &source, &mut report)?;
    let is_flash =
        report.metadata.iter().any(|(key, value)| key == "Measuring Mode" && value.to_lowercase().contains("flash"));
    report.note(SpectrumNote::LightKept {
        what: if is_flash {
            "light of a flash, in a unit that the file does not state"
        } else {
            "spectral irradiance in W/m²/nm"
        },
    });
    let is_named = columns > 1 && titles.len() == columns;
    let names = if is_named { titles } else { (1..=columns).map(|column| column.to_string()).collect() };
    let table = Table::of_columns(names, list.wavelengths, list.values, NAME);
    let of_several = if columns > 1 { format!(", {columns} spectra") } else { String::new() };
    let dialect = format!("{} wavelengths{of_several}", table.wavelengths.len());
    Spectra::of_table(table, &source, NAME, dialect, quantity)?.acquisition(how, report)
}

/// Adds a line of the spectrum to the last list of wavelengths, or to a new one where wavelengths begin anew.
fn row(
    source: &Source,
    delimiter: Delimiter,
    nm: f64,
    cells: &[Token<'_>],
    lists: &mut Vec<List>,
    columns: &mut usize,
) -> Result<(), FormatError> {
    let offset = cells[0].offset;
    if *columns == 0 {
        *columns = cells.len() - 1;
    }
    if cells.len() - 1 != *columns || *columns == 0 {
        let expected = (*columns).max(1);
        let message = format!("{} values, expected {expected} for each wavelength", cells.len() - 1);
        return Err(source.malformed(offset, message));
    }
    if *columns > MAX_COLUMNS {
        let message = format!("{columns} spectra side by side, expected at most {MAX_COLUMNS}");
        return Err(source.error(FormatErrorKind::OverLimit, offset, message));
    }
    let begins = |list: &List| list.wavelengths.last().is_none_or(|&(last, _)| nm <= last);
    if lists.last().is_none_or(begins) {
        if lists.len() == MOST_LISTS {
            let message = format!("a further list of wavelengths from {nm} nm, expected at most {MOST_LISTS}");
            return Err(source.malformed(offset, message));
        }
        lists.push(List::default());
    }
    let Some(list) = lists.last_mut() else { return Ok(()) };
    if list.wavelengths.len() >= MAX_WAVELENGTHS {
        let message = format!("more than {MAX_WAVELENGTHS} wavelengths");
        return Err(source.error(FormatErrorKind::OverLimit, offset, message));
    }
    list.wavelengths.push((nm, offset));
    for cell in &cells[1..] {
        let value = match delimiter.content(cell.text) {
            Content::Number(value) => Some(value as f32).filter(|value| value.is_finite()),
            Content::Missing => Some(f32::NAN),
            Content::Text => None,
        };
        let value = value.ok_or_else(|| {
            source.malformed(cell.offset, format!("found {}, expected the value at {nm} nm", snippet(cell.text)))
        })?;
        list.values.push(value);
    }
    Ok(())
}

/// Returns the list with the most wavelengths, and refuses another one of equal length: the meter writes each spectrum
/// in two steps.
fn finest(mut lists: Vec<List>, source: &Source, report: &mut ParseReport) -> Result<List, FormatError> {
    lists.sort_by_key(|list| list.wavelengths.len());
    let Some(finest) = lists.pop() else {
        let message = format!("no line such as {MARK}380[nm], expected one for each wavelength");
        return Err(source.malformed(source.text().len(), message));
    };
    let of = finest.wavelengths.len();
    for list in &lists {
        let wavelengths = list.wavelengths.len();
        if wavelengths == of {
            let message = format!("a second list of {of} wavelengths, expected one that is finer than the others");
            return Err(source.malformed(finest.wavelengths[0].1.max(list.wavelengths[0].1), message));
        }
        report.note(SpectrumNote::CoarserList { wavelengths, of });
    }
    Ok(finest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Axis, Quantity, Unit};
    use crate::formats::{Samples, StatedQuantity, read as read_any};

    fn plain(text: &str) -> Result<Acquisition, FormatError> {
        read_any(text.as_bytes(), &Interpretation::default())
    }

    fn parts(found: &Acquisition) -> (Vec<Axis>, Vec<f32>) {
        let Samples::OnAxes { tensor, .. } = &found.samples else { panic!("on axes") };
        (tensor.axes().to_vec(), tensor.samples().to_vec())
    }

    fn lines(from: u32, step: u32, count: u32) -> String {
        let line = |i| format!("Spectral Data {}[nm],0.{:03}\n", from + i * step, i + 1);
        (0..count).map(line).collect::<Vec<_>>().concat()
    }

    #[test]
    fn the_finer_of_two_lists_is_read() {
        let text = format!("\u{feff}Title,x\nTcp [K],3000\n\n{}\n{}\nSSI1,---\n", lines(380, 5, 3), lines(380, 1, 11));
        let found = plain(&text).unwrap();
        assert_eq!((found.format, found.quantity, found.unit), (NAME, Quantity::Spectrum, Unit::Relative));
        let (axes, values) = parts(&found);
        assert_eq!((axes[0].len(), values[0], values[10]), (11, 0.001, 0.011));
        let notes: Vec<String> = found.report.notes.iter().map(|note| note.message.clone()).collect();
        assert!(notes.iter().any(|note| note.contains("3 wavelengths beside a finer one of 11")), "{notes:?}");
        assert!(notes.iter().any(|note| note.contains("irradiance in W/m²/nm")), "{notes:?}");
        let flash = plain(&text.replace("Title,x", "Measuring Mode,Cordless Flash")).unwrap();
        assert!(flash.report.notes.iter().any(|note| note.message.contains("light of a flash")));
    }

    #[test]
    fn spreadsheets_change_separators_and_columns() {
        let text = "Title;a;b\nSpectral Data 380[nm];0,5;1\nSpectral Data 381[nm];;2\nSpectral Data 382[nm];0,7;3\n";
        let (axes, values) = parts(&plain(text).unwrap());
        assert!(matches!(&axes[0], Axis::Index { labels, .. } if labels == &["a", "b"]));
        assert!(values[1].is_nan());
        assert_eq!((values[0], values[2], values[3], values[5]), (0.5, 0.7, 1.0, 3.0));
    }

    #[test]
    fn refusals_say_where_and_what() {
        use FormatErrorKind::{Malformed, NeedsOption, OverLimit};
        let good = lines(380, 5, 4);
        for (text, kind, words) in [
            (good.replace("0.002", "Over"), Malformed, "line 2, column 23: found `Over`, expected the value at 385 nm"),
            (good.replace("0.002", "0.002,0.1"), Malformed, "2 values, expected 1"),
            (good.replace(",0.002", ""), Malformed, "0 values, expected 1"),
            (good.replace("385[nm]", "385"), Malformed, "line 2, column 1"),
            (good.replace("385[nm]", "-385[nm]"), Malformed, "line 2, column 1"),
            (good.replace("0.002", "1e39"), Malformed, "expected the value at 385 nm"),
            (format!("{good}{}{good}", lines(380, 1, 9)), Malformed, "a further list of wavelengths from 380 nm"),
            (format!("{good}{good}"), Malformed, "a second list of 4 wavelengths"),
            (lines(1, 1, 65_537), OverLimit, "more than 65536"),
        ] {
            let error = plain(&text).unwrap_err();
            assert_eq!((error.kind, error.format), (kind, NAME), "{error}");
            assert!(error.to_string().contains(words), "{words}: {error}");
        }
        let how = Interpretation { quantity: Some(StatedQuantity::Edf), ..Interpretation::default() };
        assert_eq!(read_any(good.as_bytes(), &how).unwrap_err().kind, NeedsOption);
    }
}
