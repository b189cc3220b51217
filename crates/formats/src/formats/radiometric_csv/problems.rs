//! Problems of a file: the first ones with their positions, and the total number.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind, Position};
use std::fmt::Write as _;

/// Upper bound on the problems of a file that a message lists; further ones are only counted.
const LISTED: usize = 20;

/// Problems found so far in a radiometric-csv file.
#[derive(Debug, Default)]
pub(super) struct Problems {
    listed: Vec<(Option<Position>, String)>,
    count: usize,
}

impl Problems {
    /// Adds a problem found in a radiometric-csv file at a line and column, counted from 1. Line 0 means no position.
    pub(super) fn add(&mut self, line: usize, column: usize, message: impl FnOnce() -> String) {
        self.count += 1;
        if self.listed.len() < LISTED {
            self.listed.push(((line > 0).then_some(Position::Text { line, column }), message()));
        }
    }

    /// Adds the problems found in a later part of a radiometric-csv file to those found before. Line 1 of the part is
    /// line `before + 1` of the file.
    pub(super) fn append(&mut self, part: Self, before: usize) {
        self.count += part.count;
        let room = LISTED - self.listed.len();
        self.listed.extend(part.listed.into_iter().take(room).map(|(position, message)| match position {
            Some(Position::Text { line, column }) => (Some(Position::Text { line: line + before, column }), message),
            other => (other, message),
        }));
    }

    /// Combines all problems found in a radiometric-csv file into one error, at the position of the first one in the
    /// file; `None` if there are none.
    pub(super) fn into_error(self) -> Option<FormatError> {
        let mut listed = self.listed.into_iter();
        let (first, mut message) = listed.next()?;
        for (position, further) in listed {
            let _ = match position {
                Some(position) => write!(message, "; {position}: {further}"),
                None => write!(message, "; {further}"),
            };
        }
        match self.count.saturating_sub(LISTED) {
            0 => {}
            more => {
                let _ = write!(message, "; and {more} more problems, {} in all", self.count);
            }
        }
        Some(FormatError { kind: FormatErrorKind::Malformed, format: NAME, position: first, message })
    }
}
