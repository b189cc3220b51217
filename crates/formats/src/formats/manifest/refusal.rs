//! Refusals of a manifest, in the name of the array that it belongs to.

use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::npy::about::NAME;

pub(super) fn unfit(message: impl std::fmt::Display) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, NAME, format!("manifest: {message}"))
}

pub(super) fn over_limit(message: impl std::fmt::Display) -> FormatError {
    FormatError::new(FormatErrorKind::OverLimit, NAME, format!("manifest: {message}"))
}
