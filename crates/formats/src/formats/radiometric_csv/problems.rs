//! What is wrong with a file: the first problems with their places, and how many there are in all.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind, Position};
use std::fmt::Write as _;

/// Problems that are listed; of the others only the number is told.
const LISTED: usize = 20;

/// The problems found so far.
#[derive(Debug, Default)]
pub(super) struct Problems {
    listed: Vec<(Option<Position>, String)>,
    count: usize,
}

impl Problems {
    /// Adds a problem at a line and column, both from 1; line 0 is no place in a text.
    pub(super) fn add(&mut self, line: usize, column: usize, message: impl FnOnce() -> String) {
        self.count += 1;
        if self.listed.len() < LISTED {
            self.listed.push(((line > 0).then_some(Position::Text { line, column }), message()));
        }
    }

    /// Adds the problems of a later part, whose line 1 is line `before + 1` of the whole.
    pub(super) fn append(&mut self, part: Self, before: usize) {
        self.count += part.count;
        let room = LISTED - self.listed.len();
        self.listed.extend(part.listed.into_iter().take(room).map(|(position, message)| match position {
            Some(Position::Text { line, column }) => (Some(Position::Text { line: line + before, column }), message),
            other => (other, message),
        }));
    }

    /// One refusal of them all, if there are any: where the first is, then each.
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
