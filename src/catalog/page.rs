//! Pages of a list, newest first. A cursor is the position after the last row seen, so that new rows shift nothing.

use sqlx::{AssertSqlSafe, SqlSafeStr, SqlStr};
use std::fmt;
use std::str::FromStr;

/// Position in a list of rows that is returned in pages: the creation time and id of the last row returned so far.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Cursor {
    pub(super) created_at: i64,
    pub(super) id: String,
}

/// Text that is not a cursor (position in a list that is returned in pages).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found a text that is not a cursor, expected the value of `next` in an earlier answer")]
pub(crate) struct NotACursor;

/// One page of a list of rows, and the cursor of the next page if there are more rows.
#[derive(Clone, Debug)]
pub(crate) struct Page<T> {
    /// Entries of a list (rows of measurements, materials or jobs) that stand on this page of the list.
    pub items: Vec<T>,
    /// Cursor of the next page, if there are more rows.
    pub next: Option<Cursor>,
}

impl Cursor {
    /// Returns the cursor before the newest row, with which a list begins.
    pub(super) fn newest() -> Self {
        Self { created_at: i64::MAX, id: String::new() }
    }
}

impl<T> Page<T> {
    /// Builds a page of at most `limit` rows. One row more was requested from the database, to show if there is a next
    /// page.
    pub(super) fn of(mut rows: Vec<T>, limit: usize, place: impl Fn(&T) -> Cursor) -> Self {
        let more = rows.len() > limit;
        rows.truncate(limit);
        let next = if more { rows.last().map(place) } else { None };
        Self { items: rows, next }
    }
}

impl fmt::Display for Cursor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:x}.{}", self.created_at, self.id)
    }
}

impl FromStr for Cursor {
    type Err = NotACursor;

    fn from_str(text: &str) -> Result<Self, NotACursor> {
        let (time, id) = text.split_once('.').ok_or(NotACursor)?;
        let created_at = i64::from_str_radix(time, 16).map_err(|_| NotACursor)?;
        if id.is_empty() || id.len() > 80 {
            return Err(NotACursor);
        }
        Ok(Self { created_at, id: id.to_owned() })
    }
}

/// Returns the SQL statement that reads a list: `start`, those conditions whose filter is given, and `end`. A filter
/// that is not given leaves no trace in the statement, so that the database can choose an index for the others.
pub(super) fn filtered(start: &'static str, conditions: &[(bool, &'static str)], end: &'static str) -> SqlStr {
    AssertSqlSafe([start, &and(conditions), end].concat()).into_sql_str()
}

/// Returns those SQL conditions whose filter is given, each after an `AND`.
pub(super) fn and(conditions: &[(bool, &'static str)]) -> String {
    conditions.iter().filter(|(given, _)| *given).flat_map(|(_, condition)| [" AND ", condition]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cursors_round_trip_and_nothing_else_is_one() {
        let cursor = Cursor { created_at: 1_790_000_000_000, id: "b3-00".to_owned() };
        assert_eq!(cursor.to_string().parse(), Ok(cursor));
        for bad in ["", "x", ".", "12.", "zz.b3-0", &format!("1.{}", "x".repeat(99))] {
            assert_eq!(bad.parse::<Cursor>(), Err(NotACursor), "{bad}");
        }
    }

    #[test]
    fn a_page_has_a_next_only_if_there_is_more() {
        let place = |n: &i64| Cursor { created_at: *n, id: "x".to_owned() };
        assert_eq!(Page::of(vec![3, 2, 1], 2, place).next, Some(Cursor { created_at: 2, id: "x".to_owned() }));
        assert_eq!(Page::of(vec![3, 2], 2, place).next, None);
    }
}
