//! Refusals of files: position, what was found, what was expected.

use std::fmt;

/// Reason why a file is rejected: its format, the position, the content found there and the content expected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct FormatError {
    /// Kind of the reason why a file is rejected.
    pub kind: FormatErrorKind,
    /// Name of the format in the table of formats; empty if no format was recognised.
    pub format: &'static str,
    /// Position in the file at which it was rejected, if known.
    pub position: Option<Position>,
    /// Message that says what was found and what was expected: one sentence without a full stop.
    pub message: String,
}

/// Kinds of reasons why a file is rejected. Malformed, unsupported and too large files are distinct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormatErrorKind {
    /// The bytes are in no format of the table of formats.
    Unrecognised,
    /// The bytes break the rules of their file format.
    Malformed,
    /// The file is valid, but the reader does not support it.
    Unsupported,
    /// The content of the file exceeds a limit of the reader, for example the largest number of samples.
    OverLimit,
    /// The file is valid, but an option (unit, quantity, axes) is missing or contradicts it.
    NeedsOption,
}

/// Position in a file. Lines and columns count from 1, byte offsets from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Position {
    /// Position in a text file, by line and column.
    Text {
        /// Line of the text file, counted from 1.
        line: usize,
        /// Column in the line, in characters counted from 1.
        column: usize,
    },
    /// Position in a binary file, as a byte offset counted from 0.
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
    /// Creates the error for a rejected file without a position in it.
    pub(super) fn new(kind: FormatErrorKind, format: &'static str, message: impl Into<String>) -> Self {
        Self { kind, format, position: None, message: message.into() }
    }

    /// Creates the error for a binary file that is rejected at a byte offset.
    pub(super) fn at_byte(
        kind: FormatErrorKind,
        format: &'static str,
        offset: usize,
        message: impl Into<String>,
    ) -> Self {
        Self { kind, format, position: Some(Position::Byte(offset)), message: message.into() }
    }
}
