//! Lines of a table, split into content and comment.

use crate::formats::text::{Source, Token};

/// Splits a line of a text table at the first `#` into content and comment. A line that begins with a letter is a
/// header, in which `#` may be part of a name; it is not split.
pub(super) fn split_comment(line: Token<'_>) -> (Token<'_>, Option<&str>) {
    let header =
        line.text.trim_start().starts_with(|c: char| !c.is_ascii_digit() && !matches!(c, '#' | '+' | '-' | '.'));
    match line.text.split_once('#').filter(|_| !header) {
        None => (line, None),
        Some((content, comment)) => (Token { text: content, ..line }, Some(comment)),
    }
}

/// Returns the lines of a text table that have content besides comments.
pub(in crate::formats) fn contents(source: &Source) -> impl Iterator<Item = Token<'_>> {
    source.lines().map(|line| split_comment(line).0).filter(|line| !line.text.trim().is_empty())
}
