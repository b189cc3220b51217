//! Layouts of spectral tables: recognition, and choice of the parser.

use super::about::NAME;
use super::pairs::{self, are_pairs};
use super::rows;
use super::table::Table;
use super::wide::{self, is_wide};
use super::{library, suffixed};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::FormatError;
use crate::formats::interpretation::Interpretation;
use crate::formats::reader::HEAD_BYTES;
use crate::formats::text::{Source, Token};
use crate::formats::text_table::cells::Delimiter;
use crate::formats::text_table::layout::{self, MAX_PREAMBLE};
use crate::formats::text_table::lines::contents;

/// Returns the confidence (0 to 100) that a file with this beginning is a table: rows of numbers, or one column of
/// them.
pub(in crate::formats) fn probe(head: &str) -> u8 {
    if is_markdown(head) {
        return 0;
    }
    // The format name is irrelevant, because no message of this source is shown.
    let source = Source::decode(head.as_bytes(), NAME);
    let data = library::data_offset(&source);
    let mut lines: Vec<Token<'_>> =
        contents(&source).skip_while(|line| line.offset < data).take(MAX_PREAMBLE + 1).collect();
    if lines.len() > 1 && head.len() >= HEAD_BYTES / 2 {
        // The head may cut the last line.
        lines.pop();
    }
    // A spectral library's file without rows was cut.
    if data > 0
        || layout::find(&lines).is_some()
        || are_pairs(lines.iter().copied())
        || is_wide(lines.iter().copied())
        || suffixed::is_list(&lines)
    {
        return 30;
    }
    let is_number = |line: &&Token<'_>| Delimiter::Blank.number(line.text.trim()).is_some();
    let single = lines.iter().filter(is_number).count();
    if single >= 3 && 2 * single > lines.len() { 10 } else { 0 }
}

/// Returns true for a page in Markdown, by a fence of code or the ruler of a table.
fn is_markdown(head: &str) -> bool {
    let marks = |line: &str| line.starts_with("```") || line.starts_with('|') && line.contains("--");
    head.lines().any(|line| marks(line.trim_start()))
}

/// Returns true if the beginning of a file has a row of wavelengths with a spectrum in each row beneath.
pub(in crate::formats) fn holds_wide(head: &str) -> bool {
    is_wide(contents(&Source::decode(head.as_bytes(), NAME)))
}

/// Reads the table of spectra in a text, whichever layout it has.
pub(super) fn read(source: &Source, how: &Interpretation, report: &mut ParseReport) -> Result<Table, FormatError> {
    if let Some(table) = pairs::read(source, report) {
        return Ok(table);
    }
    if let Some(table) = suffixed::read(source, report)? {
        return Ok(table);
    }
    match wide::read(source, report)? {
        Some(table) => Ok(table),
        None => rows::read(source, how, report),
    }
}
