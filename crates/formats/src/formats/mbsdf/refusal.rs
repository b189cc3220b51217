//! Refusals of malformed measured BSDFs, at a byte.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind};

pub(super) fn malformed(offset: usize, message: impl Into<String>) -> FormatError {
    FormatError::at_byte(FormatErrorKind::Malformed, NAME, offset, message)
}
