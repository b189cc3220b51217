//! Refusals of files: position, what was found, what was expected.

use std::fmt;

/// Refusal of a file: format, position, what was found and what was expected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct FormatError {
    /// The kind of refusal.
    pub kind: FormatErrorKind,
    /// The format's name in the table of formats; empty if no format was recognised.
    pub format: &'static str,
    /// Position in the file, if known.
    pub position: Option<Position>,
    /// Message with what was found and what was expected: one sentence without a full stop.
    pub message: String,
}

/// Kinds of refusal. Malformed, unsupported and over a limit are distinct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormatErrorKind {
    /// No format of the table recognises the bytes.
    Unrecognised,
    /// The bytes break the rules of their format.
    Malformed,
    /// Valid, but not supported by the reader.
    Unsupported,
    /// A size in the file is over a limit.
    OverLimit,
    /// The file is valid, but an option (unit, quantity, axes) is missing or contradicts it.
    NeedsOption,
}

/// Position in a file. Lines and columns count from 1, bytes from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// In a text file.
    Text {
        /// The line.
        line: usize,
        /// The column, in characters.
        column: usize,
    },
    /// In a binary file.
    Byte(usize),
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text { line, column } => write!(f, "line {line}, column {column}"),
            Self::Byte(offset) => write!(f, "byte {offset}"),
        }
    }
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.format.is_empty() {
            write!(f, "{}: ", self.format)?;
        }
        if let Some(position) = self.position {
            write!(f, "{position}: ")?;
        }
        f.write_str(&self.message)
    }
}

impl FormatError {
    /// A refusal without a place in the file.
    pub(super) fn new(kind: FormatErrorKind, format: &'static str, message: impl Into<String>) -> Self {
        Self { kind, format, position: None, message: message.into() }
    }

    /// A refusal at a byte of a binary file.
    pub(super) fn at_byte(
        kind: FormatErrorKind,
        format: &'static str,
        offset: usize,
        message: impl Into<String>,
    ) -> Self {
        Self { kind, format, position: Some(Position::Byte(offset)), message: message.into() }
    }
}
