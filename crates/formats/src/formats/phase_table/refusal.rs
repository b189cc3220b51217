//! Refusal of a phase table for which the user must give an option.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind};

pub(super) fn needs(message: String) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
}
