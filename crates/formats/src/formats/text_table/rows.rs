//! Parser of the rows of a table in one pass: keys (wavelengths or angles) and values, each from its columns.

use super::cells::{Content, Delimiter, is_missing, missing_end};
use super::layout::Layout;
use super::lines::split_comment;
use crate::domain::limits::MAX_SAMPLES;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::number::decimal;
use crate::formats::text::{Source, Token, snippet};

/// Role of a column of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::formats) enum Role {
    /// Column of what the values are a function of: wavelengths, or angles.
    Key,
    /// Column of values.
    Value,
    /// Column that is not read.
    Skip,
}

/// Rows of a table.
#[derive(Debug, Default)]
pub(in crate::formats) struct Rows {
    /// Keys with their byte offsets, `[row, column of keys]`. NaN where the row has none of this column.
    pub(in crate::formats) keys: Vec<(f64, usize)>,
    /// Values, `[row, column of values]`; NaN = missing.
    pub(in crate::formats) values: Vec<f32>,
    /// Number of lines of text after the last row.
    pub(in crate::formats) after: usize,
    /// True if a mark of instruments (`>>>>>`) ends the rows.
    pub(in crate::formats) has_end_mark: bool,
}

/// Reads the rows of a table. `key` names what the keys are, for messages: `a wavelength`.
pub(in crate::formats) fn read(
    source: &Source,
    layout: &Layout,
    roles: &[Role],
    key: &str,
) -> Result<Rows, FormatError> {
    let of_role = |role: Role| roles.iter().filter(|&&found| found == role).count();
    let mut parser = Parser {
        source,
        layout,
        roles,
        key,
        columns: (of_role(Role::Key), of_role(Role::Value)),
        rows: Rows::default(),
        text_after: None,
    };
    let mut lines = source.lines();
    lines.skip_to(layout.start);
    loop {
        if parser.text_after.is_none() {
            let end = parser.plain_rows(lines.offset());
            lines.skip_to(end);
            parser.check_limit(end)?;
        }
        let Some(line) = lines.next() else { break };
        let (content, _) = split_comment(line);
        if content.text.trim().is_empty() {
            continue;
        }
        if content.text.trim_start().starts_with(">>>>>") {
            parser.rows.has_end_mark = true;
            break;
        }
        parser.line(content)?;
    }
    parser.rows.after += lines.filter(|line| !line.text.trim().is_empty()).count();
    Ok(parser.rows)
}

struct Parser<'a> {
    source: &'a Source,
    layout: &'a Layout,
    roles: &'a [Role],
    key: &'a str,
    /// Numbers of columns of keys and of values.
    columns: (usize, usize),
    rows: Rows,
    /// First line of text after a row of numbers.
    text_after: Option<Token<'a>>,
}

impl<'a> Parser<'a> {
    /// Refuses a table with more values than allowed; `offset` is the byte offset after the last of them.
    fn check_limit(&self, offset: usize) -> Result<(), FormatError> {
        if self.rows.values.len() <= MAX_SAMPLES {
            return Ok(());
        }
        let message = format!("more than the limit of {MAX_SAMPLES} values");
        Err(self.source.error(FormatErrorKind::OverLimit, offset, message))
    }

    /// Parses a line that is no row of plain numbers: one with missing values, quotes or decimal commas, or text after
    /// the rows.
    fn line(&mut self, line: Token<'a>) -> Result<(), FormatError> {
        let Layout { delimiter, width, .. } = *self.layout;
        let mut cells = delimiter.cells(line);
        // Spreadsheets pad a table with rows of separators.
        if cells.iter().all(|cell| cell.text.is_empty()) {
            return Ok(());
        }
        while cells.len() > width && cells.last().is_some_and(|cell| cell.text.is_empty()) {
            cells.pop();
        }
        let contents: Vec<Content> = cells.iter().map(|cell| delimiter.content(cell.text)).collect();
        let is_number = |content: &Content| matches!(content, Content::Number(_));
        let keyed = cells.len() == width
            && contents.iter().zip(self.roles).any(|(content, role)| *role == Role::Key && is_number(content));
        let all_numbers = contents.iter().all(|content| *content != Content::Text) && contents.iter().any(is_number);
        if !keyed && !all_numbers {
            self.rows.after += 1;
            self.text_after.get_or_insert(line);
            return Ok(());
        }
        if let Some(text) = self.text_after {
            let found = delimiter.cells(text).first().map_or(text, |cell| *cell);
            let message = format!(
                "found {}, expected {}: rows of numbers go on below (of several tables in one file, send each by itself)",
                snippet(found.text),
                self.key
            );
            return Err(self.source.malformed(found.offset, message));
        }
        if cells.len() != width {
            let message = format!("a row of {} cells, expected {width} as in the rows before", cells.len());
            return Err(self.source.malformed(line.offset, message));
        }
        self.row(&cells, &contents)
    }

    fn row(&mut self, cells: &[Token<'a>], contents: &[Content]) -> Result<(), FormatError> {
        for ((cell, content), role) in cells.iter().zip(contents).zip(self.roles) {
            let refused = |expected: &str| {
                self.source.malformed(cell.offset, format!("found {}, expected {expected}", snippet(cell.text)))
            };
            if *role == Role::Skip {
                continue;
            }
            if let Content::Number(_) = content
                && self.layout.has_points
                && cell.text.contains(',')
            {
                return Err(refused("one decimal mark: other numbers of the table have a point"));
            }
            match (role, content) {
                (Role::Key, Content::Number(number)) => self.rows.keys.push((*number, cell.offset)),
                // One of several tables side by side may end before the others.
                (Role::Key, Content::Missing) if self.columns.0 > 1 => self.rows.keys.push((f64::NAN, cell.offset)),
                (Role::Key, _) => return Err(refused(self.key)),
                (_, Content::Number(number)) => {
                    let sample = *number as f32;
                    if sample.is_infinite() && number.abs() < f64::MAX {
                        return Err(refused("a number within the range of float32"));
                    }
                    self.rows.values.push(if sample.is_infinite() { f32::NAN } else { sample });
                }
                (_, Content::Missing) => self.rows.values.push(f32::NAN),
                (_, Content::Text) if is_missing(cell.text) => self.rows.values.push(f32::NAN),
                (_, Content::Text) => return Err(refused("a number or a missing value (blank, NaN or --)")),
            }
        }
        Ok(())
    }

    /// Parses rows of plain finite numbers from byte `at` on. Returns the offset of the first line that is not such a
    /// row, or at which the number of values exceeds its limit.
    fn plain_rows(&mut self, mut at: usize) -> usize {
        let text = self.source.text().as_bytes();
        while self.rows.values.len() <= MAX_SAMPLES {
            let (keys, values) = (self.rows.keys.len(), self.rows.values.len());
            let Some(end) = self.plain_row(text, at) else {
                self.rows.keys.truncate(keys);
                self.rows.values.truncate(values);
                break;
            };
            at = end;
        }
        at
    }

    /// Parses the row of numbers at byte `at` and appends its keys and values. Returns the offset of the next line.
    #[inline]
    fn plain_row(&mut self, text: &[u8], at: usize) -> Option<usize> {
        let delimiter = self.layout.delimiter;
        let separator = delimiter.byte();
        let blanks = |mut at: usize| {
            while let Some(&byte @ (b' ' | b'\t')) = text.get(at)
                && (byte != separator || delimiter == Delimiter::Blank)
            {
                at += 1;
            }
            at
        };
        let mut end = at;
        for (column, role) in self.roles.iter().enumerate() {
            let mut at = blanks(end);
            if column > 0 && delimiter == Delimiter::Blank {
                (at > end).then_some(())?;
            } else if column > 0 {
                (text.get(at) == Some(&separator)).then_some(())?;
                at = blanks(at + 1);
            }
            end = match role {
                Role::Key => {
                    let (key, next) = decimal(text, at)?;
                    self.rows.keys.push((key, at));
                    next
                }
                Role::Value => {
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
                    self.rows.values.push(sample);
                    next
                }
                Role::Skip => skip_cell(text, at, separator, delimiter)?,
            };
        }
        let end = blanks(end);
        let mark = match text.get(end..)? {
            [b'\r', b'\n', ..] => 2,
            [b'\r' | b'\n', ..] => 1,
            [] => 0,
            _ => return None,
        };
        // A row has a cell at least.
        (end + mark > at).then_some(end + mark)
    }
}

/// Returns the offset at which the cell at byte `at` ends; `None` if it may be in quotes.
fn skip_cell(text: &[u8], at: usize, separator: u8, delimiter: Delimiter) -> Option<usize> {
    let ends =
        |byte: u8| byte == separator || matches!(byte, b'\r' | b'\n') || delimiter == Delimiter::Blank && byte == b'\t';
    let length = text[at..].iter().position(|&byte| ends(byte) || matches!(byte, b'"' | b'#'));
    match length {
        Some(length) if matches!(text[at + length], b'"' | b'#') => None,
        Some(length) => Some(at + length),
        None => Some(text.len()),
    }
}
