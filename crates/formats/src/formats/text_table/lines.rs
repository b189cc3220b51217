//! Lines of a table, split into content and comment.

use super::cells::is_missing;
use crate::formats::text::{Source, Token};

/// Splits a line of a text table at the first `#` into content and comment. A line that begins with a letter is a
/// header, in which `#` may be part of a name; it is not split.
pub(in crate::formats) fn split_comment(line: Token<'_>) -> (Token<'_>, Option<&str>) {
    let header =
        line.text.trim_start().starts_with(|c: char| !c.is_ascii_digit() && !matches!(c, '#' | '+' | '-' | '.'));
    let begins = |&at: &usize| !line.text[..at].ends_with('.') && !is_missing_value(&line.text[at..]);
    let start = if header { None } else { memchr::memchr_iter(b'#', line.text.as_bytes()).find(begins) };
    match start {
        None => (line, None),
        Some(at) => (Token { text: &line.text[..at], ..line }, Some(&line.text[at + 1..])),
    }
}

/// Returns true if a spelling of a missing value begins with the `#` at the start of a text: spreadsheets write `#N/A`.
fn is_missing_value(text: &str) -> bool {
    let end = text.find(|c: char| c.is_whitespace() || matches!(c, ',' | ';' | '"')).unwrap_or(text.len());
    is_missing(&text[..end])
}

/// Returns the lines of a text table that have content besides comments.
pub(in crate::formats) fn contents(source: &Source) -> impl Iterator<Item = Token<'_>> {
    source.lines().map(|line| split_comment(line).0).filter(|line| !line.text.trim().is_empty())
}
