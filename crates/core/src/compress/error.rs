//! Reasons why a measurement cannot be compressed.

use super::setting_error::SettingError;
use super::unreachable_error::UnreachableError;
use crate::domain::Cancelled;

/// Reasons why a measurement is not compressed: wrong settings, a target that no file can meet, or a cancellation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompressError {
    /// A setting is out of its range, contradicts another one, or does not fit the measurement.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Failure of a compression, because no file of the measurement can meet the target that was asked for.
    #[error(transparent)]
    Unreachable(#[from] UnreachableError),
    /// The caller cancelled the compression before it was finished.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
