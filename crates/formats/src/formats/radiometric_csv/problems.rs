//! Problems of a file: the first of each kind with its position, how often it occurs, and the total number.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind, Position};
use std::fmt::Write as _;

/// Upper bound on the problems of a file that a message lists; further ones are only counted.
const LISTED: usize = 20;

/// Kind of a problem: the column, counted from 0, and what was expected there. Problems of one kind are listed once.
pub(super) type Kind = (usize, &'static str);

/// Problem of a file, with the further ones of its kind.
#[derive(Debug)]
struct Problem {
    position: Option<Position>,
    message: String,
    kind: Option<Kind>,
    /// Number of further problems of this kind, and the line of the last one.
    further: usize,
    last_line: usize,
}

/// Problems found so far in a radiometric-csv file.
#[derive(Debug, Default)]
pub(super) struct Problems {
    listed: Vec<Problem>,
    count: usize,
}

impl Problems {
    /// Adds a problem found in a radiometric-csv file at a line and column, counted from 1. Line 0 means no position.
    pub(super) fn add(&mut self, line: usize, column: usize, message: impl FnOnce() -> String) {
        self.count += 1;
        self.list(line, column, None, message);
    }

    /// Adds a problem that may occur in many rows. Only the first one of a kind is listed, with the number of all.
    pub(super) fn add_alike(&mut self, line: usize, column: usize, kind: Kind, message: impl FnOnce() -> String) {
        self.count += 1;
        match self.listed.iter_mut().find(|problem| problem.kind == Some(kind)) {
            Some(problem) => {
                problem.further += 1;
                problem.last_line = line;
            }
            None => self.list(line, column, Some(kind), message),
        }
    }

    fn list(&mut self, line: usize, column: usize, kind: Option<Kind>, message: impl FnOnce() -> String) {
        if self.listed.len() < LISTED {
            let position = (line > 0).then_some(Position::Text { line, column });
            self.listed.push(Problem { position, message: message(), kind, further: 0, last_line: line });
        }
    }

    /// Adds the problems found in a later part of a radiometric-csv file to those found before. Line 1 of the part is
    /// line `before + 1` of the file.
    pub(super) fn append(&mut self, part: Self, before: usize) {
        self.count += part.count;
        for mut problem in part.listed {
            problem.last_line += before;
            if let Some(Position::Text { line, .. }) = &mut problem.position {
                *line += before;
            }
            let same = |known: &&mut Problem| known.kind.is_some() && known.kind == problem.kind;
            if let Some(known) = self.listed.iter_mut().find(same) {
                known.further += 1 + problem.further;
                known.last_line = problem.last_line;
            } else if self.listed.len() < LISTED {
                self.listed.push(problem);
            }
        }
    }

    /// Combines all problems found in a radiometric-csv file into one error, at the position of the first one in the
    /// file; `None` if there are none.
    pub(super) fn into_error(self) -> Option<FormatError> {
        let told: usize = self.listed.iter().map(|problem| 1 + problem.further).sum();
        let mut listed = self.listed.into_iter();
        let first = listed.next()?;
        let mut message = first.told();
        for further in listed {
            let _ = match further.position {
                Some(position) => write!(message, "; {position}: {}", further.told()),
                None => write!(message, "; {}", further.told()),
            };
        }
        match self.count - told {
            0 => {}
            more => {
                let _ = write!(message, "; and {more} more problems, {} in all", self.count);
            }
        }
        Some(FormatError { kind: FormatErrorKind::Malformed, format: NAME, position: first.position, message })
    }
}

impl Problem {
    fn told(&self) -> String {
        match (self.further, self.last_line) {
            (0, _) => self.message.clone(),
            (further, 0) => format!("{} ({} times)", self.message, further + 1),
            (further, last) => format!("{} ({} times, the last in line {last})", self.message, further + 1),
        }
    }
}
