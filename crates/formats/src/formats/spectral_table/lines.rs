//! Lines of a table: their content and the comments behind it.

use crate::formats::text::{Source, Token};

/// The part of a line before a `#` comment, and the comment. In a header `#` may be part of a name.
pub(super) fn split_comment(line: Token<'_>) -> (Token<'_>, Option<&str>) {
    let header =
        line.text.trim_start().starts_with(|c: char| !c.is_ascii_digit() && !matches!(c, '#' | '+' | '-' | '.'));
    match line.text.split_once('#').filter(|_| !header) {
        None => (line, None),
        Some((content, comment)) => (Token { text: content, ..line }, Some(comment)),
    }
}

/// Lines with content besides comments.
pub(in crate::formats) fn contents(source: &Source) -> impl Iterator<Item = Token<'_>> {
    source.lines().map(|line| split_comment(line).0).filter(|line| !line.text.trim().is_empty())
}
