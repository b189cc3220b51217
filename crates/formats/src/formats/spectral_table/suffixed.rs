//! Lists of one wavelength per line with its unit attached (`380nm` and a value), as LI-COR and `UPRtek` instruments
//! save them, with named figures before and after.

use super::holds::{names_wavelength, of_column, says_percent};
use super::table::Table;
use crate::domain::limits::{MAX_SAMPLES, MAX_WAVELENGTHS};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{Source, Token, number, snippet};
use crate::formats::text_table::cells::{Delimiter, is_missing, name_of};
use crate::formats::text_table::lines::{contents, split_comment};
use crate::notes::TextNote;

/// Lower bound on the consecutive lines such as `380nm 0.5` that form a spectrum. Raising it recognises fewer files.
const FEWEST: usize = 3;
/// Upper bound on the named figures (such as CCT) of an instrument's file that are kept as metadata.
const MAX_FIGURES: usize = 1000;

/// Words before the wavelength in each line of a spectrum of Sekonic's meters: `Spectral Data 380[nm]`.
const SEKONIC: &str = "Spectral Data ";

/// Returns the wavelength in nm of a cell such as `380nm` or `Spectral Data 380[nm]`; `None` for any other cell.
fn wavelength(cell: &str) -> Option<f64> {
    if let Some(rest) = cell.strip_prefix(SEKONIC) {
        return number(rest.strip_suffix("[nm]")?.trim());
    }
    let digits = cell.get(..cell.len().checked_sub(2)?)?;
    cell.get(digits.len()..)?.eq_ignore_ascii_case("nm").then_some(())?;
    number(&digits.trim_end().replace(',', ".")).filter(|nm| (1.0..=1e6).contains(nm))
}

/// Returns true for a line that begins with a number and `n`, as `380nm` does. Looks at its first characters only,
/// because it runs on every line of other tables.
fn may_begin(line: &str) -> bool {
    const LONGEST: usize = 24;
    let is_part = |byte: &&u8| byte.is_ascii_digit() || matches!(byte, b'.' | b',' | b' ');
    if line.trim_start().starts_with(SEKONIC) {
        return true;
    }
    let head = line.trim_start().as_bytes();
    head.first().is_some_and(u8::is_ascii_digit)
        && matches!(head.iter().take(LONGEST).find(|byte| !is_part(byte)), Some(b'n' | b'N'))
}

/// Returns the wavelength in nm and the cells of a line such as `380nm 0.5`: a wavelength, then at least one value or
/// missing value.
fn row(delimiter: Delimiter, line: Token<'_>) -> Option<(f64, Vec<Token<'_>>)> {
    may_begin(line.text).then_some(())?;
    let cells = delimiter.cells(line);
    let nm = wavelength(cells.first()?.text)?;
    let is_value = |cell: &Token<'_>| delimiter.number(cell.text).is_some() || is_missing(cell.text);
    (cells.len() > 1 && cells[1..].iter().all(is_value)).then_some((nm, cells))
}

/// Returns the cell separator of lines such as `380nm 0.5`, and the number of cells per line; `None` if too few lines
/// follow each other.
fn form(lines: &[Token<'_>]) -> Option<(Delimiter, usize)> {
    Delimiter::ALL.into_iter().find_map(|delimiter| {
        let (mut width, mut count) = (0, 0);
        for line in lines {
            let found = row(delimiter, *line).map_or(0, |(_, cells)| cells.len());
            (width, count) =
                if found > 0 && found == width { (width, count + 1) } else { (found, usize::from(found > 0)) };
            if count >= FEWEST {
                return Some((delimiter, width));
            }
        }
        None
    })
}

/// Returns true if the lines contain a spectrum in the form `380nm 0.5`.
pub(super) fn is_list(lines: &[Token<'_>]) -> bool {
    form(lines).is_some()
}

/// Returns the spectrum of lines such as `380nm 0.5` as a table; `None` if the text has none.
pub(super) fn read(source: &Source, report: &mut ParseReport) -> Result<Option<Table>, FormatError> {
    const LOOKED_AT: usize = 1000;
    let looked_at: Vec<Token<'_>> = contents(source).take(LOOKED_AT).collect();
    let Some((delimiter, width)) = form(&looked_at) else { return Ok(None) };
    let (mut wavelengths, mut values, mut prose) = (Vec::new(), Vec::new(), String::new());
    let (mut heading, mut figures, mut ended) = (Vec::new(), 0_usize, false);
    let mut in_percent = vec![false; width - 1];
    for line in contents(source) {
        let Some((nm, cells)) = row(delimiter, line) else {
            let cells = delimiter.cells(line);
            if let (Some(first), None) = (cells.first(), cells.first().and_then(|cell| wavelength(cell.text))) {
                ended = !wavelengths.is_empty();
                if !ended && cells.len() == width {
                    heading = cells.iter().map(|cell| name_of(cell.text)).collect();
                }
                figures += 1;
                if figures <= MAX_FIGURES {
                    let key = name_of(first.text);
                    let rest = cells[1..].iter().map(|cell| name_of(cell.text)).collect::<Vec<_>>().join(" ");
                    report.metadata.push((key, rest.chars().take(4096).collect()));
                    prose.push_str(&line.text.to_lowercase());
                    prose.push('\n');
                }
                continue;
            }
            let bad = cells.iter().skip(1).find(|cell| delimiter.number(cell.text).is_none() && !is_missing(cell.text));
            let (found, offset) = bad.map_or((line.text, line.offset), |cell| (cell.text, cell.offset));
            return Err(
                source.malformed(offset, format!("found {}, expected a number for the wavelength", snippet(found)))
            );
        };
        if ended {
            return Err(
                source.malformed(line.offset, format!("{nm} nm in a second list, expected one list of wavelengths"))
            );
        }
        if cells.len() != width {
            let message = format!("a row of {} cells, expected {width} as in the rows before", cells.len());
            return Err(source.malformed(line.offset, message));
        }
        wavelengths.push((nm, line.offset));
        for (cell, in_percent) in cells[1..].iter().zip(&mut in_percent) {
            *in_percent |= cell.text.ends_with('%');
            let value = delimiter.number(cell.text).map_or(f32::NAN, |value| value as f32);
            if value.is_infinite() {
                let message = format!("found {}, expected a number within the range of float32", snippet(cell.text));
                return Err(source.malformed(cell.offset, message));
            }
            values.push(value);
        }
        if wavelengths.len() > MAX_WAVELENGTHS || values.len() > MAX_SAMPLES {
            let message = format!("expected at most {MAX_WAVELENGTHS} wavelengths and {MAX_SAMPLES} values");
            return Err(source.error(FormatErrorKind::OverLimit, line.offset, message));
        }
    }
    if figures > 0 {
        report.note(TextNote::FiguresAroundData { lines: figures });
    }
    for comment in source.lines().filter_map(|line| split_comment(line).1).take(MAX_FIGURES) {
        prose.push_str(&comment.to_lowercase());
        prose.push('\n');
    }
    // A figure such as `CCT 5000` has two cells, too.
    let is_named = heading.first().is_some_and(|first: &String| width > 2 || names_wavelength(first));
    let names = if is_named { heading.split_off(1) } else { (1..width).map(|n| n.to_string()).collect() };
    let heading = String::new();
    let (wavelength_name, dialect) = (Some("nm".to_owned()), "a wavelength with its unit a line");
    let holds = names.iter().zip(&in_percent).map(|(name, in_percent)| of_column(name, *in_percent)).collect();
    let says = |(name, in_percent): (&String, bool)| in_percent || says_percent(&name.to_lowercase());
    let percent = names.iter().zip(in_percent).map(says).collect();
    let library = None;
    Ok(Some(Table { wavelengths, values, names, holds, percent, wavelength_name, prose, heading, library, dialect }))
}
