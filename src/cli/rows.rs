//! Tables of numbers read row by row in constant memory: CSV with a header or a `NumPy` array, from a file or stdin.

use super::failure::Failure;
use super::input::describe;
use crate::formats::ArrayRows;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

/// Upper bound in bytes on a line of a CSV table; longer lines are refused.
const MAX_LINE: u64 = 1 << 16;

/// Reader of some columns of a table, row by row.
pub(crate) struct Rows {
    path: PathBuf,
    names: &'static [&'static str],
    source: Source,
    /// Number of rows of the input table that were read so far.
    read: u64,
}

enum Source {
    /// CSV text, and the positions from 0 of the wanted columns in each line.
    Text { lines: Box<dyn BufRead>, columns: Vec<usize> },
    /// `NumPy` array, and the number of its rows that were not read yet.
    Array { input: Box<dyn Read>, rows: ArrayRows, left: usize },
}

impl Rows {
    /// Opens the table in `path` (`-` is stdin) with the columns of the first list of `choices`, or of another one that
    /// the header of a CSV names; other columns of a CSV are ignored.
    pub(crate) fn open(path: &Path, choices: &[&'static [&'static str]]) -> Result<Self, Failure> {
        let mut names = choices[0];
        let about = |failure: Failure| failure.about(path);
        let unread = |error: std::io::Error| Failure::failed(describe(&error)).about(path);
        let mut input: Box<dyn Read> = match path.to_str() {
            Some("-") => Box::new(std::io::stdin()),
            _ => Box::new(File::open(path).map_err(unread)?),
        };
        let mut head = Vec::new();
        input.by_ref().take(ArrayRows::HEAD as u64).read_to_end(&mut head).map_err(unread)?;
        let source = if ArrayRows::is_array(&head) {
            let rows = ArrayRows::of(&head).map_err(Failure::failed).map_err(about)?;
            if rows.columns() != names.len() {
                let message = format!("{} columns, expected {}: {}", rows.columns(), names.len(), names.join(", "));
                return Err(about(Failure::failed(message)));
            }
            let rest = head.split_off(rows.data_at());
            Source::Array { input: Box::new(Cursor::new(rest).chain(input)), left: rows.rows(), rows }
        } else {
            let mut lines: Box<dyn BufRead> = Box::new(BufReader::new(Cursor::new(head).chain(input)));
            let header = next_line(&mut lines).map_err(about)?;
            let header = header.unwrap_or_default();
            names = choices.iter().copied().find(|names| columns(&header, names).is_ok()).unwrap_or(names);
            let columns = columns(&header, names).map_err(Failure::failed).map_err(about)?;
            Source::Text { lines, columns }
        };
        Ok(Self { path: path.to_owned(), names, source, read: 0 })
    }

    /// Returns the names of the columns that are read.
    pub(crate) fn names(&self) -> &'static [&'static str] {
        self.names
    }

    /// Reads up to `most` rows and appends one number for each wanted column to `numbers`. Returns the number of rows
    /// read, 0 at the end of the table.
    pub(crate) fn read(&mut self, most: usize, numbers: &mut Vec<f64>) -> Result<usize, Failure> {
        let mut count = 0;
        match &mut self.source {
            Source::Text { lines, columns } => {
                while count < most {
                    let row = self.read + count as u64 + 1;
                    let about = |failure: Failure| failure.about(&self.path);
                    let Some(line) = next_line(lines).map_err(about)? else { break };
                    let cells: Vec<&str> = line.split(',').map(str::trim).collect();
                    for (&column, name) in columns.iter().zip(self.names) {
                        let found = cells.get(column).copied().unwrap_or_default();
                        let number = found.trim_matches('"').parse().map_err(|_| {
                            let shown: String = found.chars().take(40).collect();
                            about(Failure::failed(format!(
                                "row {row}, column {name}: found `{shown}`, expected a number"
                            )))
                        })?;
                        numbers.push(number);
                    }
                    count += 1;
                }
            }
            Source::Array { input, rows, left } => {
                count = most.min(*left);
                let mut bytes = Vec::new();
                let wanted = count * rows.columns() * rows.size();
                let found = input.take(wanted as u64).read_to_end(&mut bytes);
                found.map_err(|error| Failure::failed(describe(&error)).about(&self.path))?;
                if bytes.len() < wanted {
                    let whole = self.read as usize + bytes.len() / (rows.columns() * rows.size());
                    let message = format!("the array ends after {whole} of {} rows", rows.rows());
                    return Err(Failure::failed(message).about(&self.path));
                }
                rows.numbers(&bytes, numbers);
                *left -= count;
            }
        }
        self.read += count as u64;
        Ok(count)
    }
}

/// Returns the next line of a CSV table that is neither blank nor a comment; `None` at the end.
fn next_line(lines: &mut Box<dyn BufRead>) -> Result<Option<String>, Failure> {
    let mut bytes = Vec::new();
    loop {
        bytes.clear();
        let count =
            lines.take(MAX_LINE).read_until(b'\n', &mut bytes).map_err(|error| Failure::failed(describe(&error)))?;
        if count == 0 {
            return Ok(None);
        }
        if count as u64 == MAX_LINE && bytes.last() != Some(&b'\n') {
            return Err(Failure::failed(format!("a line of more than {MAX_LINE} bytes")));
        }
        let text = String::from_utf8_lossy(&bytes);
        let text = text.trim().trim_start_matches('\u{feff}');
        if !text.is_empty() && !text.starts_with('#') {
            return Ok(Some(text.to_owned()));
        }
    }
}

/// Returns the positions from 0 of the columns `names` in the header line of a CSV table.
fn columns(header: &str, names: &[&str]) -> Result<Vec<usize>, String> {
    let found: Vec<String> = header.split(',').map(|name| name.trim().trim_matches('"').to_lowercase()).collect();
    let at = |name: &&str| {
        let mut places = found.iter().enumerate().filter(|(_, found)| *found == name);
        match (places.next(), places.next()) {
            (Some((at, _)), None) => Ok(at),
            (Some(_), Some(_)) => Err(format!("the header names {name} twice")),
            _ => {
                let shown: String = header.chars().take(80).collect();
                Err(format!("the header `{shown}` has no column {name}, expected {}", names.join(", ")))
            }
        }
    };
    names.iter().map(at).collect()
}
