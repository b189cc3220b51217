//! Parser of tables with one row per wavelength. Delimiter, decimal mark, header and comments follow from the content.

use super::about::NAME;
use super::cells::{Delimiter, is_missing, missing_end, unquoted};
use super::library::{self, Library};
use super::lines::{contents, split_comment};
use super::table::Table;
use super::wavelength_unit::names_wavelength;
use crate::domain::limits::{MAX_ENTRIES, MAX_SAMPLES};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::number::decimal;
use crate::formats::text::{Source, Token, snippet};
use crate::notes::TextNote;

/// Upper bounds on the lines from which the cell separator is determined, and on the lines before the first row of
/// numbers.
const LOOKED_AT: usize = 20;
pub(super) const MAX_PREAMBLE: usize = 1000;

/// Returns the first cell separator under which the first rows of numbers have an equal number of cells, at least 2,
/// and that number.
pub(super) fn delimiter(lines: &[Token<'_>]) -> Option<(Delimiter, usize)> {
    Delimiter::ALL.into_iter().find_map(|delimiter| {
        let width = |line: &Token<'_>| delimiter.numeric_cells(*line);
        let (start, first) =
            lines.iter().enumerate().find_map(|(i, line)| Some((i, width(line).filter(|&n| n >= 2)?)))?;
        let constant = lines[start..]
            .iter()
            .take(LOOKED_AT)
            .take_while(|line| !line.text.trim_start().starts_with(">>>>>"))
            .all(|line| width(line).is_none_or(|n| n == first));
        (constant && start < MAX_PREAMBLE).then_some((delimiter, first))
    })
}

/// Reads a table of spectra with one row per wavelength.
pub(in crate::formats) fn read(source: &Source, report: &mut ParseReport) -> Result<Table, FormatError> {
    let library = library::read(source);
    let data = library.as_ref().map_or(0, |library| library.data);
    let looked_at: Vec<Token<'_>> =
        contents(source).skip_while(|line| line.offset < data).take(MAX_PREAMBLE + LOOKED_AT).collect();
    let Some((delimiter, width)) = delimiter(&looked_at) else {
        let at = looked_at.first().map_or(0, |line| line.offset);
        let single =
            !looked_at.is_empty() && looked_at.iter().all(|line| Delimiter::Blank.numeric_cells(*line) == Some(1));
        return Err(source.malformed(
            at,
            if single {
                "one column of numbers without wavelengths, expected two or more columns: wavelength and values"
            } else {
                "no rows of numbers with the same number of cells, expected wavelength and values separated by tab, `;`, `,` or blanks"
            },
        ));
    };
    let (preamble, prose, heading) = (Vec::new(), String::new(), String::new());
    let mut parser = Parser { delimiter, width, source, library, preamble, prose, heading, table: None };
    let mut lines = source.lines();
    loop {
        if let Some(table) = &mut parser.table {
            let end = table.push_plain(source.text().as_bytes(), lines.offset(), delimiter);
            lines.skip_to(end);
            parser.check_limit(end)?;
        }
        let Some(line) = lines.next() else { break };
        let (content, comment) = split_comment(line);
        if let Some(comment) = comment {
            parser.comment(content, comment, report);
        }
        if content.text.trim().is_empty() {
            continue;
        }
        if parser.table.is_some() && content.text.trim_start().starts_with(">>>>>") {
            break;
        }
        parser.content(content, report)?;
    }
    let after = lines.filter(|line| !line.text.trim().is_empty()).count();
    if after > 0 {
        report.note(TextNote::LinesAfterEndMark { lines: after });
    }
    parser.finish(report)
}

struct Parser<'a> {
    delimiter: Delimiter,
    /// Number of cells in a row of numbers in a text file of spectra: one wavelength and the values at it.
    width: usize,
    source: &'a Source,
    library: Option<Library>,
    /// Lines before the first row of numbers, each with a flag that is true for a comment.
    preamble: Vec<(Token<'a>, bool)>,
    prose: String,
    heading: String,
    table: Option<Table>,
}

impl<'a> Parser<'a> {
    fn comment(&mut self, content: Token<'a>, comment: &'a str, report: &mut ParseReport) {
        let comment = comment.trim_start_matches('#');
        if comment.trim().is_empty() {
            return;
        }
        // A comment within the data does not describe the columns.
        if self.table.is_none() && self.preamble.len() < MAX_PREAMBLE {
            report.metadata.push(("comment".to_owned(), comment.trim().chars().take(4096).collect()));
            if content.text.trim().is_empty() {
                self.preamble.push((Token { text: comment, offset: content.offset }, true));
            } else {
                self.prose.push_str(&comment.to_lowercase());
                self.prose.push('\n');
            }
        }
    }

    fn content(&mut self, line: Token<'a>, report: &mut ParseReport) -> Result<(), FormatError> {
        let cells = self.delimiter.cells(line);
        if self.table.is_none() {
            // A row begins the data even with a non-numeric cell: that is an error, not a header.
            let is_row = cells.len() == self.width && self.delimiter.number(cells[0].text).is_some();
            if !is_row || self.library.as_ref().is_some_and(|library| line.offset < library.data) {
                if self.preamble.len() < MAX_PREAMBLE {
                    self.preamble.push((line, false));
                }
                return Ok(());
            }
            self.table = Some(self.start(report)?);
        }
        let Some(table) = &mut self.table else { return Ok(()) };
        if cells.iter().all(|cell| cell.text.is_empty()) {
            // Spreadsheets pad a table with rows of delimiters.
            return Ok(());
        }
        let expected = table.names.len() + 1;
        if cells.len() != expected {
            return Err(self.source.malformed(
                line.offset,
                format!("a row of {} cells, expected {expected} as in the rows before", cells.len()),
            ));
        }
        for (i, cell) in cells.iter().enumerate() {
            let refused = |expected: &str| {
                self.source.malformed(cell.offset, format!("found {}, expected {expected}", snippet(cell.text)))
            };
            let value = self.delimiter.number(cell.text);
            if i == 0 {
                table.wavelengths.push((value.ok_or_else(|| refused("a wavelength"))?, cell.offset));
                continue;
            }
            let sample = match value {
                None if is_missing(cell.text) => f32::NAN,
                None => return Err(refused("a number or a missing value (blank, NaN or --)")),
                Some(value) => value as f32,
            };
            if sample.is_infinite() {
                return Err(refused("a number within the range of float32"));
            }
            table.values.push(sample);
        }
        Ok(())
    }

    /// Refuses a table with more values than allowed; `offset` is the byte offset after the last of them.
    fn check_limit(&self, offset: usize) -> Result<(), FormatError> {
        if self.table.as_ref().is_none_or(|table| table.values.len() <= MAX_SAMPLES) {
            return Ok(());
        }
        let message = format!("more than the limit of {MAX_SAMPLES} values");
        Err(self.source.error(FormatErrorKind::OverLimit, offset, message))
    }

    /// Creates the empty table with its column names. The last line before the numbers is the header if its cell count
    /// matches.
    fn start(&mut self, report: &mut ParseReport) -> Result<Table, FormatError> {
        let width = self.width;
        if width - 1 > MAX_ENTRIES {
            let message = format!("{} columns, expected at most {MAX_ENTRIES}", width - 1);
            return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
        }
        let header = if self.library.is_some() { None } else { self.header() };
        if header.is_none() {
            self.refuse_decimal_commas()?;
        }
        if let Some(header) = &header {
            self.heading = header.join("\n").to_lowercase();
            report.metadata.push(("columns".to_owned(), header.join(" | ").chars().take(4096).collect()));
        }
        if let Some(library) = &self.library {
            report.metadata.extend(library.fields.iter().cloned());
        }
        for (line, _) in &self.preamble {
            self.prose.push_str(&line.text.to_lowercase());
            self.prose.push('\n');
        }
        let skipped = self.preamble.iter().filter(|(_, comment)| !comment).count();
        if skipped > 0 && self.library.is_none() {
            report.note(TextNote::LinesBeforeData { lines: skipped });
        }
        let mut names = header.unwrap_or_default().into_iter();
        let wavelength_name = self.library.as_ref().map(|library| library.x_units.clone()).or_else(|| names.next());
        let mut names: Vec<String> = names.collect();
        if names.is_empty() {
            names = (1..width).map(|n| n.to_string()).collect();
        }
        Ok(Table {
            wavelengths: Vec::new(),
            values: Vec::new(),
            names,
            wavelength_name,
            prose: String::new(),
            heading: String::new(),
            library: None,
            dialect: if self.library.is_some() { "spectral library" } else { self.delimiter.dialect() },
        })
    }

    /// Refuses a table of spectra whose decimal commas cannot be told from separators: its row of names has half as
    /// many cells as its rows of numbers.
    fn refuse_decimal_commas(&self) -> Result<(), FormatError> {
        let Some((line, _)) = self.preamble.last().filter(|_| self.delimiter == Delimiter::Comma) else {
            return Ok(());
        };
        let names = self.delimiter.cells(*line);
        let halves = [2 * names.len(), 2 * names.len() - 1].contains(&self.width);
        if names.len() < 2 || !halves || !names_wavelength(&unquoted(names[0].text)) {
            return Ok(());
        }
        let message = format!(
            "{} names over rows of {} cells, expected as many: where commas are decimal marks, cells must be separated by `;`, \
             tabs or blanks",
            names.len(),
            self.width
        );
        Err(self.source.malformed(line.offset, message))
    }

    /// Returns the column names: the cells of the last line before the numbers, or of the last two lines (names, and
    /// units beneath them) joined by column. `None` unless the last line has as many cells as the rows of numbers.
    fn header(&mut self) -> Option<Vec<String>> {
        let cells = |line: Token<'_>| -> Option<Vec<String>> {
            let cells = self.delimiter.cells(line);
            (cells.len() == self.width).then(|| cells.iter().map(|cell| unquoted(cell.text)).collect())
        };
        let mut names = cells(self.preamble.last()?.0)?;
        let above = match self.preamble.as_slice() {
            [.., (line, _), _] if names.iter().all(|name| is_unit(name)) => cells(*line),
            _ => None,
        };
        self.preamble.truncate(self.preamble.len() - 1 - usize::from(above.is_some()));
        if let Some(above) = above {
            names =
                above.into_iter().zip(names).map(|(name, unit)| format!("{name} {unit}").trim().to_owned()).collect();
        }
        Some(names)
    }

    fn finish(self, report: &mut ParseReport) -> Result<Table, FormatError> {
        let end = self.source.text().len();
        let Some(mut table) = self.table else {
            return Err(self.source.malformed(end, "no row of numbers, expected wavelength and values"));
        };
        (table.prose, table.heading, table.library) = (self.prose, self.heading, self.library);
        table.drop_empty_columns(report);
        if table.wavelength_name.is_none() && table.names.len() > 1 {
            let columns = table.names.len();
            report.note(TextNote::ColumnsWithoutHeader { columns });
        }
        Ok(table)
    }
}

impl Table {
    /// Parses rows of plain finite numbers in one pass from byte `at` on. Returns the offset of the first line that is
    /// not such a row, or at which the number of values exceeds its limit.
    fn push_plain(&mut self, text: &[u8], mut at: usize, delimiter: Delimiter) -> usize {
        while self.values.len() <= MAX_SAMPLES {
            let first = self.values.len();
            let Some((wavelength, end)) = self.plain_row(text, at, delimiter) else {
                self.values.truncate(first);
                break;
            };
            self.wavelengths.push(wavelength);
            at = end;
        }
        at
    }

    /// Parses the row of numbers at byte `at` and appends its values. Returns its wavelength with the byte offset, and
    /// the offset of the next line.
    #[inline]
    fn plain_row(&mut self, text: &[u8], at: usize, delimiter: Delimiter) -> Option<((f64, usize), usize)> {
        let separator = delimiter.byte();
        let blanks = |mut at: usize| {
            while let Some(&byte @ (b' ' | b'\t')) = text.get(at)
                && (byte != separator || delimiter == Delimiter::Blank)
            {
                at += 1;
            }
            at
        };
        let mut at = blanks(at);
        let place = at;
        let (wavelength, mut end) = decimal(text, at)?;
        for _ in 0..self.names.len() {
            at = blanks(end);
            if delimiter == Delimiter::Blank {
                (at > end).then_some(())?;
            } else {
                (text.get(at) == Some(&separator)).then_some(())?;
                at = blanks(at + 1);
            }
            let (value, next) = if let Some(found) = decimal(text, at) {
                found
            } else {
                // Between blanks a cell cannot be empty.
                let end = missing_end(text, at).filter(|&end| end > at || delimiter != Delimiter::Blank)?;
                (f64::NAN, end)
            };
            let sample = value as f32;
            if sample.is_infinite() {
                return None;
            }
            self.values.push(sample);
            end = next;
        }
        let end = blanks(end);
        let mark = match text.get(end..)? {
            [b'\r', b'\n', ..] => 2,
            [b'\r' | b'\n', ..] => 1,
            [] => 0,
            _ => return None,
        };
        Some(((wavelength, place), end + mark))
    }

    /// Removes the nameless empty column that a separator at the end of every row creates.
    fn drop_empty_columns(&mut self, report: &mut ParseReport) {
        let columns = self.names.len();
        let nameless = self.names[columns - 1].is_empty() || self.wavelength_name.is_none();
        if columns < 2 || !nameless || !self.values.chunks_exact(columns).all(|row| row[columns - 1].is_nan()) {
            return;
        }
        self.values = self.values.chunks_exact(columns).flat_map(|row| &row[..columns - 1]).copied().collect();
        self.names.pop();
        report.note(TextNote::BlankLastColumn);
    }
}

/// Returns true for a cell that belongs to a row of units such as `[nm]`, `(%)` or `counts`, or is blank.
fn is_unit(cell: &str) -> bool {
    const BARE: [&str; 12] = ["nm", "um", "µm", "cm-1", "%", "a.u.", "counts", "w", "w/nm", "mw/nm", "sr-1", "1/sr"];
    let bracketed = |open, close| cell.starts_with(open) && cell.ends_with(close);
    let cell_is_bare = BARE.contains(&cell.to_lowercase().as_str());
    cell.is_empty() || bracketed('[', ']') || bracketed('(', ')') || cell_is_bare
}
