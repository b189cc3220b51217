//! Result codes of SQLite, by which its faults are told apart.

use sqlx::error::DatabaseError;

pub(super) const BUSY: u32 = 5;
pub(super) const READ_ONLY: u32 = 8;
pub(super) const IO: u32 = 10;
pub(super) const CORRUPT: u32 = 11;
pub(super) const FULL: u32 = 13;
pub(super) const CANNOT_OPEN: u32 = 14;
pub(super) const NOT_A_DATABASE: u32 = 26;

/// Extended result code of SQLite for an index of the log (the `-shm` file) that cannot grow.
const NO_ROOM_FOR_INDEX: u32 = 4874;

/// Error code (SQLSTATE) of PostgreSQL for a full disk.
const DISK_FULL: &str = "53100";

/// Returns true if the database found no space on its disk.
pub(super) fn is_full(error: &sqlx::Error) -> bool {
    let code = error.as_database_error().and_then(DatabaseError::code);
    let code = code.as_deref().unwrap_or_default();
    code == DISK_FULL || code.parse() == Ok(NO_ROOM_FOR_INDEX) || primary(error) == Some(FULL)
}

/// Returns true if the disk of a SQLite file has failed, or has no space.
pub(super) fn is_of_disk(error: &sqlx::Error) -> bool {
    matches!(primary(error), Some(IO | READ_ONLY | CORRUPT | FULL | CANNOT_OPEN | NOT_A_DATABASE))
}

/// Returns the primary result code of an error of SQLite: the low byte of the extended result code.
pub(super) fn primary(error: &sqlx::Error) -> Option<u32> {
    let code = error.as_database_error()?.code()?;
    code.parse::<u32>().ok().map(|code| code & 0xff)
}
