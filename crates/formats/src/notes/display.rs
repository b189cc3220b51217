//! Numbers, quotations and plurals as sentences show them.

use crate::domain::{NoteValue, ToNoteValue};
use std::fmt;

/// Returns the ending of a regular plural: nothing for one thing, else `s`.
pub(super) fn s(count: impl Copy + PartialEq + From<u8>) -> &'static str {
    either(count, "", "s")
}

/// Returns the verb for a number of things: `is` for one, else `are`.
pub(super) fn are(count: impl Copy + PartialEq + From<u8>) -> &'static str {
    either(count, "is", "are")
}

/// Returns `one` for a single thing, else `many`.
pub(super) fn either<N: Copy + PartialEq + From<u8>, T>(count: N, one: T, many: T) -> T {
    if count == N::from(1) { one } else { many }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Note;
    use crate::notes::{TextNote, ValueNote};

    #[test]
    fn one_thing_is_said_in_the_singular() {
        assert_eq!((s(1_usize), s(0_u64), s(2_usize)), ("", "s", "s"));
        for (note, sentence) in [
            (Note::from(TextNote::LinesBeforeData { lines: 1 }), "1 line of text before the data"),
            (TextNote::LinesBeforeData { lines: 2 }.into(), "2 lines of text before the data"),
            (
                TextNote::UnknownColumns { columns: 1, first_names: "`x`".to_owned() }.into(),
                "1 column that is not known: `x`",
            ),
            (
                ValueNote::Negative { values: 1, lowest: -0.5 }.into(),
                "1 value is negative, down to -0.5; kept as it is",
            ),
        ] {
            assert_eq!(note.message, sentence);
        }
    }
}
