//! SQL that differs between databases, as SQLite takes it.

/// Query for the current time in ms of the Unix epoch by the database's own clock, which workers on several hosts
/// share.
pub(super) const CLOCK: &str = "SELECT CAST(ROUND((julianday('now') - 2440587.5) * 86400000.0) AS BIGINT)";

/// Clause that skips rows which another worker is claiming; empty for SQLite, which has one writer at a time.
pub(super) const SKIP_LOCKED: &str = "";

/// Statements that make a connection wait for locks, and its commits durable. The wait comes first, because the switch
/// to WAL itself needs the lock.
pub(super) const PRAGMAS: [&str; 3] =
    ["PRAGMA busy_timeout = 20000", "PRAGMA journal_mode = WAL", "PRAGMA synchronous = FULL"];

/// Returns a query for the texts in a parameter that holds a JSON array: `Any` has no array type.
pub(super) fn each(parameter: &str) -> String {
    format!("SELECT value FROM json_each({parameter})")
}
