//! Single-pass parser of rows of numbers, in parallel pieces. Every bad cell becomes a problem with its position.

use super::columns::{ANGLE, Cell, Columns, FINITE, NOT_NEGATIVE, VALUE, WAVELENGTH};
use super::problems::{Kind, Problems};
use crate::domain::limits::MAX_SAMPLES;
use crate::formats::number::decimal;
use crate::formats::text_table::cells::is_missing;
use rayon::prelude::*;
use std::collections::HashMap;

/// Number of bytes of a file that one parallel task parses. Raising it uses more memory and fewer tasks.
const PIECE: usize = 1 << 20;
/// Number of parts of a file that are parsed before they are joined and their memory is reused. It does not depend on
/// the thread count, so that the value count in a message about too many values is reproducible.
const WAITING: usize = 16;
/// Upper bound on the bytes of a table cell in a radiometric-csv file that an error message quotes.
const QUOTED: usize = 60;

/// Parsed rows of a radiometric-csv file.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// Directions `[theta_i, phi_i, theta_o, phi_o]` in degrees, 0 for absent columns. The wide form (one column per
    /// wavelength) has one per row, the long form (one value per row) one per run of rows with equal direction.
    pub(super) directions: Vec<[f64; 4]>,
    /// Number of values of each direction in the long form (one value per row); empty in the wide form, in which every
    /// row has the same number.
    pub(super) lengths: Vec<u32>,
    /// Index in `wavelengths` of each value's wavelength; empty in the wide form (one column per wavelength) and
    /// without wavelengths.
    pub(super) lambdas: Vec<u32>,
    /// Distinct wavelengths of the long form (one value per row) as written, in order of appearance.
    pub(super) wavelengths: Numbered,
    /// Values in a radiometric-csv file, row by row, and within a row in the order of the value columns; NaN = missing.
    pub(super) values: Vec<f32>,
    /// Standard uncertainties of the values; empty if the file has no columns of them.
    pub(super) sigma: Vec<f32>,
    /// Number of values that became missing because the cosine by which they are divided is 0.
    pub(super) grazing: usize,
}

/// Distinct numbers of a file (wavelengths, or values of one angle) in order of appearance, each with an index.
#[derive(Debug, Default)]
pub(super) struct Numbered {
    pub(super) values: Vec<f64>,
    known: HashMap<u64, u32>,
    /// Index, in the list of distinct numbers (wavelengths, or values of one angle) of a file, of the number that was
    /// looked up last. The next look-up starts there, because files list numbers in order.
    guess: usize,
}

impl Numbered {
    /// Returns the index of `value` in the list of distinct numbers (wavelengths, or values of one angle) found so far
    /// in a file. Adds it to the list if it is new.
    pub(super) fn number(&mut self, value: f64) -> u32 {
        for guess in [self.guess, self.guess + 1, 0] {
            if self.values.get(guess) == Some(&value) {
                self.guess = guess;
                return guess as u32;
            }
        }
        let next = self.values.len();
        let number = *self.known.entry(value.to_bits()).or_insert(next as u32);
        if number as usize == next {
            self.values.push(value);
        }
        self.guess = number as usize;
        number
    }
}

/// Parses the rows of `body`, the part of a file after the column names, whose first line is line `before + 1` of the
/// file.
pub(super) fn read(body: &[u8], before: usize, columns: &Columns, cosine: bool, problems: &mut Problems) -> Rows {
    let mut pieces = Vec::with_capacity(body.len() / PIECE + 1);
    let mut start = 0;
    while start < body.len() {
        let wanted = (start + PIECE).min(body.len());
        let end = memchr::memchr(b'\n', &body[wanted..]).map_or(body.len(), |i| wanted + i + 1);
        pieces.push(&body[start..end]);
        start = end;
    }
    let mut all = Rows::default();
    let mut line = before;
    for (done, together) in pieces.chunks(WAITING).enumerate() {
        let read: Vec<Piece> = together.par_iter().map(|text| Piece::read(text, columns, cosine)).collect();
        if done == 0 {
            // Reserves for the other pieces in proportion to their bytes.
            let found: usize = read.iter().map(|piece| piece.rows.values.len()).sum();
            all.values.reserve((found / together.len() * pieces.len()).min(MAX_SAMPLES));
        }
        for piece in read {
            problems.append(piece.problems, line);
            line += piece.lines;
            all.append(&piece.rows);
        }
        if all.values.len() > MAX_SAMPLES {
            // The limit is exceeded whatever follows.
            break;
        }
    }
    all
}

/// Returns true for a cell that is empty or says that its value is missing.
fn states_none(cell: &[u8]) -> bool {
    let cell = cell.trim_ascii_end();
    cell.is_empty() || std::str::from_utf8(cell).is_ok_and(is_missing)
}

/// Direction and wavelength of a row whose values were appended to those of the rows before.
pub(super) struct Row {
    pub(super) direction: [f64; 4],
    /// Index of the row's first value among all values.
    pub(super) base: usize,
    /// True if the row before has the same direction.
    pub(super) same: bool,
    pub(super) lambda: Option<f64>,
}

impl Rows {
    /// Completes a data row of the file: stores its direction and wavelength, and divides its values by |cos θo| if the
    /// file has multiplied them by it.
    #[inline]
    pub(super) fn keep(&mut self, row: &Row, columns: &Columns, cosine: bool) {
        let &Row { direction, base, same, lambda } = row;
        if cosine {
            self.divide_by_cosine(direction[2], base);
        }
        if let Some(lambda) = lambda {
            let number = self.wavelengths.number(lambda);
            self.lambdas.push(number);
        }
        if columns.is_wide() {
            self.directions.push(direction);
        } else if let (true, Some(length)) = (same, self.lengths.last_mut()) {
            *length += 1;
        } else {
            self.directions.push(direction);
            self.lengths.push(1);
        }
    }

    fn divide_by_cosine(&mut self, theta_o: f64, base: usize) {
        let cosine = libm::cos(theta_o.to_radians()).abs();
        for value in self.values[base..].iter_mut().filter(|value| !value.is_nan()) {
            let quotient = (f64::from(*value) / cosine) as f32;
            if cosine > 1e-9 && quotient.is_finite() {
                *value = quotient;
            } else {
                self.grazing += 1;
                *value = f32::NAN;
            }
        }
        for sigma in self.sigma.iter_mut().skip(base) {
            let quotient = (f64::from(*sigma) / cosine) as f32;
            *sigma = if quotient.is_finite() { quotient } else { f32::NAN };
        }
    }

    fn append(&mut self, part: &Self) {
        self.directions.extend_from_slice(&part.directions);
        self.lengths.extend_from_slice(&part.lengths);
        let numbers: Vec<u32> = part.wavelengths.values.iter().map(|&value| self.wavelengths.number(value)).collect();
        self.lambdas.extend(part.lambdas.iter().map(|&local| numbers[local as usize]));
        self.values.extend_from_slice(&part.values);
        self.sigma.extend_from_slice(&part.sigma);
        self.grazing += part.grazing;
    }
}

/// Result of parsing one of the parts into which the rows of a file are divided, to be parsed in parallel.
struct Piece {
    rows: Rows,
    lines: usize,
    problems: Problems,
}

/// Position in the text of an angle cell of the previous row, and its value in degrees.
#[derive(Clone, Copy, Default)]
struct Known {
    start: usize,
    end: usize,
    degrees: f64,
}

/// Parser of one part of the rows of a radiometric-csv file; parts are parsed in parallel.
struct Parser<'a> {
    text: &'a [u8],
    columns: &'a Columns,
    cosine: bool,
    rows: Rows,
    problems: Problems,
    /// Number of the current line and byte offset of its start, both within the piece of the file that one parallel
    /// task parses; lines are counted from 1.
    line: usize,
    line_start: usize,
    /// Text positions and values of the four angles in the previous row. Often the next row has the same angles, which
    /// then need not be parsed again.
    last: [Known; 4],
}

impl Piece {
    fn read(text: &[u8], columns: &Columns, cosine: bool) -> Self {
        let mut parser = Parser {
            text,
            columns,
            cosine,
            rows: Rows::default(),
            problems: Problems::default(),
            line: 0,
            line_start: 0,
            last: [Known::default(); 4],
        };
        while parser.line_start < text.len() {
            parser.line += 1;
            let first = parser.blanks(parser.line_start);
            let end = match text.get(first) {
                None | Some(b'#' | b'\n' | b'\r') => parser.line_end(first),
                Some(_) => parser.row(),
            };
            parser.line_start = (end + 1).min(text.len());
        }
        Self { rows: parser.rows, lines: parser.line, problems: parser.problems }
    }
}

/// Returns true if a byte can follow a number: a separator, a blank, or the end of the text.
fn ends_number(next: Option<&u8>) -> bool {
    matches!(next, None | Some(b',' | b'\n' | b'\r' | b' ' | b'\t'))
}

fn too_many(columns: usize) -> String {
    format!(
        "more cells than the {columns} columns, expected one for each (a decimal comma separates cells, expected `.`)"
    )
}

impl Parser<'_> {
    /// Returns the first byte offset from `at` on that is not a blank.
    #[inline]
    fn blanks(&self, mut at: usize) -> usize {
        while matches!(self.text.get(at), Some(b' ' | b'\t')) {
            at += 1;
        }
        at
    }

    /// Returns the byte offset of the next line feed from `at` on, or the end of the text.
    fn line_end(&self, at: usize) -> usize {
        memchr::memchr(b'\n', &self.text[at..]).map_or(self.text.len(), |i| at + i)
    }

    /// Returns the byte offset at which the table cell that starts at byte `at` of a radiometric-csv file ends: that of
    /// the next comma or line end, or of the end of the text.
    #[inline]
    fn cell_end(&self, mut at: usize) -> usize {
        while !matches!(self.text.get(at), None | Some(b',' | b'\n' | b'\r')) {
            at += 1;
        }
        at
    }

    fn problem(&mut self, at: usize, kind: Kind, message: impl FnOnce() -> String) {
        let before = String::from_utf8_lossy(&self.text[self.line_start..at]);
        self.problems.add_alike(self.line, before.chars().count() + 1, kind, message);
    }

    /// Adds a table cell with unexpected content to the problems found in a radiometric-csv file. Returns the byte
    /// offset of the cell's end.
    fn refuse(&mut self, start: usize, column: usize, expected: &'static str) -> usize {
        let end = self.cell_end(start);
        let found = String::from_utf8_lossy(&self.text[start..end.min(start + QUOTED)]).trim_end().to_owned();
        let columns = self.columns;
        self.problem(start, (column, expected), || columns.refusal(column, &found, expected));
        end
    }

    /// Parses the row of a radiometric-csv file that starts at byte `self.line_start`, and returns the byte offset of
    /// its line end.
    fn row(&mut self) -> usize {
        let (columns, text, base) = (self.columns, self.text, self.rows.values.len());
        self.rows.values.resize(base + columns.width(), f32::NAN);
        if columns.has_sigma {
            self.rows.sigma.resize(base + columns.width(), f32::NAN);
        }
        let (mut good, mut same, mut lambda) = (true, true, None);
        let mut at = self.line_start;
        let last = columns.cells.len() - 1;
        for (column, cell) in columns.cells.iter().enumerate() {
            if let Some(next) = self.plain_cell(*cell, at, base, column == last) {
                at = next;
                continue;
            }
            let start = self.blanks(at);
            at = match *cell {
                Cell::Value(value) | Cell::Sigma(value) => match decimal(text, start) {
                    Some((number, end)) if ends_number(text.get(end)) => {
                        let sample = number as f32;
                        if sample.is_infinite() {
                            good = false;
                            self.refuse(start, column, FINITE)
                        } else if matches!(cell, Cell::Value(_)) {
                            self.rows.values[base + value] = sample;
                            end
                        } else if sample < 0.0 {
                            good = false;
                            self.refuse(start, column, NOT_NEGATIVE)
                        } else {
                            self.rows.sigma[base + value] = sample;
                            end
                        }
                    }
                    _ => {
                        let end = self.cell_end(start);
                        if !states_none(&text[start..end]) {
                            good = false;
                            self.refuse(start, column, VALUE);
                        }
                        end
                    }
                },
                Cell::Angle(k) => {
                    let end = self.cell_end(start);
                    let known = self.last[k];
                    if text[start..end] != text[known.start..known.end] || end == start {
                        same = false;
                        if let Some(degrees) = self.angle(start, k) {
                            self.last[k] = Known { start, end, degrees };
                        } else {
                            good = false;
                            self.refuse(start, column, ANGLE);
                        }
                    }
                    end
                }
                Cell::Wavelength => match decimal(text, start) {
                    Some((number, end)) if ends_number(text.get(end)) && number > 0.0 => {
                        lambda = Some(number);
                        end
                    }
                    _ => {
                        good = false;
                        self.refuse(start, column, WAVELENGTH)
                    }
                },
                Cell::Ignored => self.cell_end(start),
            };
            at = self.blanks(at);
            match text.get(at) {
                Some(b',') if column < last => at += 1,
                Some(b',') => {
                    good = false;
                    self.problem(at, (0, "fewer cells"), || too_many(last + 1));
                    break;
                }
                None | Some(b'\n' | b'\r') if column == last => {}
                None | Some(b'\n' | b'\r') => {
                    good = false;
                    let found = column + 1;
                    self.problem(at, (found, "more cells"), || {
                        format!("a row of {found} cells, expected {}, one a column", last + 1)
                    });
                    break;
                }
                Some(_) => {
                    good = false;
                    at = self.refuse(start, column, "one number");
                    at += usize::from(text.get(at) == Some(&b','));
                }
            }
        }
        if good {
            let direction = self.last.map(|known| known.degrees);
            self.rows.keep(&Row { direction, base, same, lambda }, columns, self.cosine);
        } else {
            self.rows.values.truncate(base);
            self.rows.sigma.truncate(base);
        }
        self.line_end(at)
    }

    /// Parses the table cell at byte `at` of a radiometric-csv file if it is a plain finite value, which is stored in
    /// the row's values, or an angle written exactly as in the previous row. Returns the offset of the next cell or row
    /// end; `None` for any other cell.
    #[inline]
    fn plain_cell(&mut self, cell: Cell, at: usize, base: usize, is_last: bool) -> Option<usize> {
        let end = match cell {
            Cell::Value(value) => {
                let (number, end) = decimal(self.text, at)?;
                let sample = number as f32;
                self.rows.values[base + value] = sample;
                sample.is_finite().then_some(end)?
            }
            Cell::Angle(k) => {
                let Known { start, end, .. } = self.last[k];
                let after = at + (end - start);
                let same = end > start && self.text.get(at..after) == Some(&self.text[start..end]);
                same.then_some(after)?
            }
            _ => return None,
        };
        match (self.text.get(end), is_last) {
            (Some(b','), false) => Some(end + 1),
            (Some(b'\n'), true) => Some(end),
            _ => None,
        }
    }

    /// Returns the angle in degrees that starts at byte `start` if it fills the whole cell and is in range.
    fn angle(&self, start: usize, k: usize) -> Option<f64> {
        let (written, end) = decimal(self.text, start)?;
        let whole = matches!(self.text.get(self.blanks(end)), None | Some(b',' | b'\n' | b'\r'));
        self.columns.angles[k].filter(|_| whole)?.degrees(written)
    }
}
