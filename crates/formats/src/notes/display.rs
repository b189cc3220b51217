//! Numbers and quotations as sentences show them.

use crate::domain::{NoteValue, ToNoteValue};
use std::fmt;

/// Wrapper that displays a number in a message, in scientific notation if it would be long otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Brief(pub(crate) f64);

impl fmt::Display for Brief {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || (1e-4..1e15).contains(&size) { self.0.fmt(f) } else { write!(f, "{:e}", self.0) }
    }
}

impl ToNoteValue for Brief {
    fn to_value(&self) -> Option<NoteValue> {
        self.0.to_value()
    }
}

/// Short quotation of a file in a message: at most 40 characters, without control characters that could affect a
/// terminal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Quoted(String);

impl Quoted {
    /// Quotes `text` for a message; a long text ends with an ellipsis after 40 characters.
    pub(crate) fn of(text: &str) -> Self {
        const LONGEST: usize = 40;
        let mut characters = text.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c });
        let mut quoted: String = characters.by_ref().take(LONGEST).collect();
        quoted.extend(characters.next().map(|_| '…'));
        Self(quoted)
    }
}

impl fmt::Display for Quoted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { f.write_str("nothing") } else { write!(f, "`{}`", self.0) }
    }
}

impl ToNoteValue for Quoted {
    fn to_value(&self) -> Option<NoteValue> {
        self.0.to_value()
    }
}
