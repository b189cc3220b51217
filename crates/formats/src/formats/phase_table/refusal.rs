//! Refusals of phase tables about which the user must say more.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind};

pub(super) fn needs(message: String) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
}
