//! Result codes of SQLite, by which its faults are told apart.

pub(super) const BUSY: u32 = 5;
pub(super) const READ_ONLY: u32 = 8;
pub(super) const CORRUPT: u32 = 11;
pub(super) const CANNOT_OPEN: u32 = 14;
pub(super) const NOT_A_DATABASE: u32 = 26;

/// Returns the primary result code of an error of SQLite: the low byte of the extended result code.
pub(super) fn primary(error: &sqlx::Error) -> Option<u32> {
    let code = error.as_database_error()?.code()?;
    code.parse::<u32>().ok().map(|code| code & 0xff)
}
