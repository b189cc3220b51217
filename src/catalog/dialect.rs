//! The two databases: their URLs, the settings of their connections, and the SQL in which they differ.

use super::result_code::{BUSY, primary};
use sqlx::{AssertSqlSafe, SqlSafeStr, SqlStr};

/// Kind of database behind the catalog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dialect {
    /// SQLite: a file with one writer at a time.
    Sqlite,
    /// PostgreSQL: a server for many processes.
    Postgres,
}

/// SQL statements that set up a SQLite connection: wait for locks, use a write-ahead log (WAL), make commits durable,
/// check foreign keys. None of them changes the file.
pub(super) const PRAGMAS: [&str; 3] =
    ["PRAGMA busy_timeout = 20000", "PRAGMA synchronous = FULL", "PRAGMA foreign_keys = ON"];

/// SQL settings of a SQLite file, which keeps them: readers and the writer do not wait for each other. The wait comes
/// first, because the switch itself needs the lock.
pub(super) const SWITCH: [&str; 2] = ["PRAGMA busy_timeout = 20000", "PRAGMA journal_mode = WAL"];

/// SQL settings of a PostgreSQL connection. Compilation is off, because short statements gain nothing from it. Sorting
/// is discouraged, because a table without statistics would be sorted whole for one row. No statement is shared among
/// processes of the server: for a page of a list each of them would walk as far as one has to. Time limits keep a stuck
/// client from blocking others.
const SETTINGS: [&str; 1] =
    ["SET jit = off; SET random_page_cost = 1.1; SET enable_sort = off; SET max_parallel_workers_per_gather = 0; \
     SET statement_timeout = '30s'; SET lock_timeout = '10s'; SET idle_in_transaction_session_timeout = '30s'; \
     SET client_min_messages = warning"];

impl Dialect {
    /// SQL statements that set up each new connection to the database.
    pub(super) fn prepare(self) -> &'static [&'static str] {
        match self {
            Self::Sqlite => &PRAGMAS,
            Self::Postgres => &SETTINGS,
        }
    }

    /// SQL statement that begins a write transaction on this kind of database.
    pub(super) fn begin(self) -> &'static str {
        match self {
            Self::Sqlite => "BEGIN IMMEDIATE",
            Self::Postgres => "BEGIN",
        }
    }

    /// SQL statement that begins a transaction for reading a page of a list. PostgreSQL may then sort, and plans the
    /// queries for the given filters: a rare value is looked up in an index of its own, a common one is met soon on the
    /// way along the list.
    pub(super) fn begin_list(self) -> &'static str {
        match self {
            Self::Sqlite => "BEGIN",
            Self::Postgres => {
                "BEGIN READ ONLY; SET LOCAL enable_sort = on; SET LOCAL plan_cache_mode = force_custom_plan"
            }
        }
    }

    /// Returns `text` with its marks replaced by the SQL of this kind of database. `{now}` is the database's clock in
    /// ms of the Unix epoch, which workers on several hosts share. `{lock}` locks the rows of a query until the
    /// transaction ends; `{skip}` does so but leaves out rows that another transaction has locked. `{greater}` and
    /// `{lesser}` are the functions that return the greater and the lesser of two numbers. `{each $n}` is a query for
    /// the texts in parameter n, a JSON array. `{among $n}` and `{among SELECT …}` are the condition that a column is
    /// one of such texts or of the texts of a query; on PostgreSQL they are looked up in an index of the column, also
    /// without statistics.
    pub(super) fn sql(self, text: &'static str) -> SqlStr {
        if !text.contains('{') {
            return text.into_sql_str();
        }
        let mut out = String::with_capacity(text.len() + 128);
        let mut rest = text;
        while let Some((before, after)) = rest.split_once('{') {
            let (mark, after) = after.split_once('}').unwrap_or((after, ""));
            out.push_str(before);
            match (self, mark) {
                (Self::Sqlite, "now") => {
                    out.push_str("CAST(ROUND((julianday('now') - 2440587.5) * 86400000.0) AS BIGINT)");
                }
                (Self::Postgres, "now") => {
                    out.push_str("CAST(EXTRACT(EPOCH FROM statement_timestamp()) * 1000 AS BIGINT)");
                }
                (Self::Postgres, "lock") => out.push_str(" FOR UPDATE"),
                (Self::Postgres, "skip") => out.push_str(" FOR UPDATE SKIP LOCKED"),
                (Self::Sqlite, "greater") => out.push_str("MAX"),
                (Self::Postgres, "greater") => out.push_str("GREATEST"),
                (Self::Sqlite, "lesser") => out.push_str("MIN"),
                (Self::Postgres, "lesser") => out.push_str("LEAST"),
                (_, mark) => {
                    if let Some(parameter) = mark.strip_prefix("each ") {
                        self.each(&mut out, parameter);
                    } else if let Some(query) = mark.strip_prefix("among ") {
                        let (before, after) = match self {
                            Self::Sqlite => ("IN (", ")"),
                            Self::Postgres => ("= ANY (ARRAY(", "))"),
                        };
                        out.push_str(before);
                        if query.starts_with('$') {
                            self.each(&mut out, query);
                        } else {
                            out.push_str(query);
                        }
                        out.push_str(after);
                    }
                }
            }
            rest = after;
        }
        out.push_str(rest);
        AssertSqlSafe(out).into_sql_str()
    }

    /// Appends an SQL query for the texts in a parameter, a JSON array.
    fn each(self, out: &mut String, parameter: &str) {
        let (before, after) = match self {
            Self::Sqlite => ("SELECT value FROM json_each(", ")"),
            Self::Postgres => ("SELECT value FROM json_array_elements_text(CAST(", " AS json))"),
        };
        out.extend([before, parameter, after]);
    }

    /// Returns true if a failed database operation may succeed when it is tried again at once: another transaction was
    /// in the way, or the connection broke.
    pub(super) fn is_passing(self, error: &sqlx::Error) -> bool {
        match error {
            sqlx::Error::Io(_) | sqlx::Error::WorkerCrashed => true,
            sqlx::Error::Database(database) => match self {
                Self::Sqlite => primary(error) == Some(BUSY),
                // Serialisation failures, deadlocks, connections lost or refused, a server that stops or starts.
                Self::Postgres => database.code().is_some_and(|code| {
                    matches!(&*code, "40001" | "40P01" | "57P01" | "57P02" | "57P03" | "55P03")
                        || code.starts_with("08")
                }),
            },
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_written_for_each_database() {
        let text = "SELECT {greater}(a, {now}) FROM t WHERE id IN ({each $2}){skip}";
        assert_eq!(
            Dialect::Postgres.sql(text).as_str(),
            "SELECT GREATEST(a, CAST(EXTRACT(EPOCH FROM statement_timestamp()) * 1000 AS BIGINT)) FROM t WHERE id IN \
             (SELECT value FROM json_array_elements_text(CAST($2 AS json))) FOR UPDATE SKIP LOCKED"
        );
        let sqlite = Dialect::Sqlite.sql(text);
        let sqlite = sqlite.as_str();
        assert!(sqlite.ends_with("id IN (SELECT value FROM json_each($2))") && sqlite.contains("MAX(a, CAST(ROUND("));
        assert_eq!(Dialect::Sqlite.sql("SELECT 1").as_str(), "SELECT 1");
        let text = "DELETE FROM t WHERE a {among $1} AND b {among SELECT b FROM old}";
        assert_eq!(
            Dialect::Postgres.sql(text).as_str(),
            "DELETE FROM t WHERE a = ANY (ARRAY(SELECT value FROM json_array_elements_text(CAST($1 AS json)))) AND b = \
             ANY (ARRAY(SELECT b FROM old))"
        );
        assert_eq!(
            Dialect::Sqlite.sql(text).as_str(),
            "DELETE FROM t WHERE a IN (SELECT value FROM json_each($1)) AND b IN (SELECT b FROM old)"
        );
    }
}
