//! Refusal of a malformed array at a byte offset.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind};

pub(super) fn malformed(offset: usize, message: impl Into<String>) -> FormatError {
    FormatError::at_byte(FormatErrorKind::Malformed, NAME, offset, message)
}
