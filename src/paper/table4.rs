//! Table 4.
use super::PaperError;
use super::report::Table;
use crate::domain::Progress;
pub(super) fn make(_progress: &dyn Progress) -> Result<Table, PaperError> {
    Err(PaperError::NoSuchTable { found: 4 })
}
