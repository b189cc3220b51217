//! SQL that differs between databases, as SQLite takes it.

/// Now, in ms of the Unix epoch, by the database's own clock: workers on several hosts share it.
pub(super) const CLOCK: &str = "SELECT CAST(ROUND((julianday('now') - 2440587.5) * 86400000.0) AS BIGINT)";

/// Rows that another worker is claiming are skipped; SQLite has one writer at a time and needs nothing.
pub(super) const SKIP_LOCKED: &str = "";

/// Statements that make a connection wait for others, and its commits durable. Waiting comes first: the switch to WAL
/// itself needs the lock.
pub(super) const PRAGMAS: [&str; 3] =
    ["PRAGMA busy_timeout = 20000", "PRAGMA journal_mode = WAL", "PRAGMA synchronous = FULL"];

/// Query of the texts in a parameter that holds a JSON array: `Any` has no arrays of its own.
pub(super) fn each(parameter: &str) -> String {
    format!("SELECT value FROM json_each({parameter})")
}
