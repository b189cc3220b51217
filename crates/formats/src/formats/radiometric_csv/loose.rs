//! Rows of tables with other separators than commas, decimal commas, quotes or text around them, line by line.

use super::columns::{ANGLE, Cell, Columns, FINITE, NOT_NEGATIVE, VALUE, WAVELENGTH};
use super::problems::Problems;
use super::rows::{Row, Rows};
use super::written::{Count, Marks};
use crate::domain::limits::MAX_SAMPLES;
use crate::formats::text::{Token, snippet};
use crate::formats::text_table::cells::{Delimiter, is_missing};

/// Number of rows from which the decimal mark is judged. Raising it takes longer.
const JUDGED: usize = 5000;

/// Rows of numbers of a table, with the text in which they stand.
pub(super) struct Body<'a> {
    pub(super) text: &'a str,
    /// Number of lines of the file before the text.
    pub(super) before: usize,
    pub(super) delimiter: Delimiter,
    /// Cells of the row of names, to know where it is repeated.
    pub(super) names: &'a [(String, usize)],
}

impl<'a> Body<'a> {
    /// Returns the cells of each line, without those of lines that are blank or comments, with the lines' numbers.
    fn lines(&self) -> impl Iterator<Item = (usize, &'a str, Vec<Token<'a>>)> {
        let delimiter = self.delimiter;
        let lines = self.text.split('\n').enumerate();
        lines.filter(|(_, line)| !line.trim_start().starts_with('#') && !line.trim().is_empty()).filter_map(
            move |(i, line)| {
                let cells = delimiter.cells(Token { text: line, offset: 0 });
                // Spreadsheets pad a table with rows of separators.
                cells.iter().any(|cell| !cell.text.is_empty()).then_some((i + 1, line, cells))
            },
        )
    }

    /// Returns the decimal mark of the numbers, which is that of most of the first rows.
    pub(super) fn marks(&self, columns: &[bool]) -> Marks {
        let mut count = Count::default();
        for (_, _, cells) in self.lines().take(JUDGED) {
            let read = cells.iter().zip(columns).filter(|(cell, is_read)| **is_read && !cell.text.is_empty());
            read.for_each(|(cell, _)| count.add(cell.text));
        }
        count.marks()
    }

    /// Parses the rows. Returns them with the number of lines of text after them.
    pub(super) fn read(&self, marks: Marks, columns: &Columns, cosine: bool, problems: &mut Problems) -> (Rows, usize) {
        let mut parser = Parser {
            columns,
            marks,
            cosine,
            delimiter: self.delimiter,
            rows: Rows::default(),
            problems: std::mem::take(problems),
            line: 0,
            last: None,
        };
        let mut text_after: Option<(usize, usize, String)> = None;
        let mut after = 0;
        for (line, text, mut cells) in self.lines() {
            parser.line = line + self.before;
            while cells.len() > columns.cells.len() && cells.last().is_some_and(|cell| cell.text.is_empty()) {
                cells.pop();
            }
            if !parser.is_row(&cells) {
                let is_header = cells.iter().map(|cell| cell.text).eq(self.names.iter().map(|(name, _)| name.as_str()));
                if !is_header {
                    after += 1;
                    let first = cells.iter().find(|cell| !cell.text.is_empty());
                    let found = first.map_or_else(String::new, |cell| snippet(cell.text));
                    let column = first.map_or(1, |cell| column_of(text, cell.offset));
                    text_after.get_or_insert((parser.line, column, found));
                }
                continue;
            }
            if let Some((line, column, found)) = text_after.take() {
                parser.problems.add(line, column, || {
                    format!(
                        "found {found}, expected a row of numbers: rows go on below (of several tables in one file, send \
                         each by itself)"
                    )
                });
            }
            parser.row(text, &cells);
            if parser.rows.values.len() > MAX_SAMPLES {
                break;
            }
        }
        *problems = parser.problems;
        (parser.rows, after)
    }
}

fn column_of(line: &str, offset: usize) -> usize {
    line.get(..offset).map_or(0, |before| before.chars().count()) + 1
}

/// Parser of the rows of a table.
struct Parser<'a> {
    columns: &'a Columns,
    marks: Marks,
    cosine: bool,
    delimiter: Delimiter,
    rows: Rows,
    problems: Problems,
    line: usize,
    /// Direction of the last row that was read.
    last: Option<[f64; 4]>,
}

impl Parser<'_> {
    /// Returns true for a row of the table, even one with errors: half of its cells or more are numbers or missing
    /// values, and one of those of its angles and wavelength is a number.
    fn is_row(&self, cells: &[Token<'_>]) -> bool {
        let is_number = |cell: &Token<'_>| self.marks.number(cell.text).is_some();
        let filled = cells.iter().filter(|cell| !cell.text.is_empty()).count();
        let numbers =
            cells.iter().filter(|cell| !cell.text.is_empty() && (is_number(cell) || is_absent(cell.text))).count();
        let is_key = |cell: &Cell| matches!(cell, Cell::Angle(_) | Cell::Wavelength);
        let keyed = cells.iter().zip(&self.columns.cells).any(|(cell, of)| is_key(of) && is_number(cell));
        keyed && 2 * numbers >= filled
    }

    fn row(&mut self, text: &str, cells: &[Token<'_>]) {
        let columns = self.columns;
        let expected = columns.cells.len();
        if cells.len() != expected {
            let separator = match self.delimiter {
                Delimiter::Tab => "tabs",
                Delimiter::Semicolon => "`;`",
                Delimiter::Comma => "`,`",
                Delimiter::Blank => "blanks",
            };
            let found = cells.len();
            self.problems.add_alike(self.line, 1, (found, "cells"), || {
                let comma = if self.delimiter == Delimiter::Comma && found > expected {
                    " (a decimal comma separates cells, expected `.`, or `;` between cells)"
                } else {
                    ""
                };
                let s = if found == 1 { "" } else { "s" };
                format!(
                    "found {found} cell{s} between {separator}, expected {expected}, one for each column name{comma}"
                )
            });
            return;
        }
        let (base, width) = (self.rows.values.len(), columns.width());
        self.rows.values.resize(base + width, f32::NAN);
        if columns.has_sigma {
            self.rows.sigma.resize(base + width, f32::NAN);
        }
        let (mut direction, mut lambda, mut good) = ([0.0; 4], None, true);
        for (i, (cell, is)) in cells.iter().zip(&columns.cells).enumerate() {
            let refused = match *is {
                Cell::Ignored => None,
                Cell::Angle(k) => {
                    let number = self.marks.number(cell.text).filter(|(_, sign)| *sign != Some('%'));
                    let degrees = number.and_then(|(written, _)| columns.angles[k]?.degrees(written));
                    direction[k] = degrees.unwrap_or(0.0);
                    degrees.is_none().then_some(ANGLE)
                }
                Cell::Wavelength => {
                    let number =
                        self.marks.number(cell.text).filter(|(written, sign)| *written > 0.0 && sign.is_none());
                    lambda = number.map(|(written, _)| written);
                    lambda.is_none().then_some(WAVELENGTH)
                }
                Cell::Value(rank) => match self.value(cell.text) {
                    Ok(value) => {
                        self.rows.values[base + rank] = value;
                        None
                    }
                    Err(expected) => Some(expected),
                },
                Cell::Sigma(rank) => match self.value(cell.text) {
                    Ok(value) if value < 0.0 => Some(NOT_NEGATIVE),
                    Ok(value) => {
                        self.rows.sigma[base + rank] = value;
                        None
                    }
                    Err(expected) => Some(expected),
                },
            };
            if let Some(kind) = refused {
                good = false;
                let (column, expected) = (column_of(text, cell.offset), self.expected(kind, cell.text));
                self.problems.add_alike(self.line, column, (i, kind), || match expected {
                    Some(other) => format!("found {}, expected {other} ({})", snippet(cell.text), columns.names[i]),
                    None => columns.refusal(i, cell.text, kind),
                });
            }
        }
        if good {
            let same = self.last == Some(direction);
            self.rows.keep(&Row { direction, base, same, lambda }, columns, self.cosine);
            self.last = Some(direction);
        } else {
            self.rows.values.truncate(base);
            self.rows.sigma.truncate(base);
        }
    }

    /// Returns what a refused cell should have, where the decimal marks of the table matter.
    fn expected(&self, kind: &'static str, cell: &str) -> Option<&'static str> {
        let other = Marks { has_commas: !self.marks.has_commas, is_grouped: false, ..self.marks };
        let is_other = self.marks.number(cell).is_none() && cell.contains([',', '.']) && other.number(cell).is_some();
        match (is_other, self.marks.has_commas) {
            (true, true) => Some("a decimal comma, as other numbers of the table have"),
            (true, false) => Some("a decimal point, as other numbers of the table have"),
            _ if kind == PERCENT => Some(PERCENT),
            _ => None,
        }
    }

    /// Parses a cell of a value; NaN for a missing one.
    fn value(&self, cell: &str) -> Result<f32, &'static str> {
        if is_absent(cell) {
            return Ok(f32::NAN);
        }
        let (number, sign) = self.marks.number(cell).ok_or(VALUE)?;
        match sign {
            Some('°') => return Err(VALUE),
            None if self.marks.has_percent && number != 0.0 => return Err(PERCENT),
            _ => {}
        }
        let sample = number as f32;
        if sample.is_infinite() { Err(FINITE) } else { Ok(sample) }
    }
}

const PERCENT: &str = "a percent sign, as other cells have";

/// Returns true for a cell without a value: blank, NaN, or dashes in any number.
fn is_absent(cell: &str) -> bool {
    is_missing(cell) || cell.bytes().all(|byte| byte == b'-')
}
