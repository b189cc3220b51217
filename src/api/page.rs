//! Pages of a list: the cursor at which a page starts, and the number of items on it.

use super::problem::{Kind, Problem};
use crate::catalog::{Cursor, NotACursor};

/// Number of items on a page of a list if the client states none.
pub(super) const USUAL_PAGE: usize = 50;
/// Upper bound on the number of items on a page of a list.
pub(super) const LONGEST_PAGE: usize = 1000;

/// Parses the cursor and the page size of a list request.
pub(super) fn page(cursor: Option<&str>, limit: Option<usize>) -> Result<(Option<Cursor>, usize), Problem> {
    let refused = |error: NotACursor| Problem::new(Kind::BadQuery, format!("cursor: {error}"));
    let cursor = cursor.map(str::parse).transpose().map_err(refused)?;
    match limit.unwrap_or(USUAL_PAGE) {
        limit @ 1..=LONGEST_PAGE => Ok((cursor, limit)),
        limit => Err(Problem::new(Kind::BadQuery, format!("limit: found {limit}, expected 1 to {LONGEST_PAGE}"))),
    }
}
