//! Lines of a radiometric-csv file before its numbers: `# key: value`, remarks, and the row of column names.

use super::about::NAME;
use super::columns::Row;
use super::header::Field;
use super::names::{self, Meaning};
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{Source, unmarked, unmarked_utf16};
use crate::formats::text_table::cells::Delimiter;
use crate::notes::TextNote;
use std::borrow::Cow;

/// Upper bounds on the number of header lines and on the characters of each; a longer text is not a header.
const MAX_HEADER_LINES: usize = 1000;
const MAX_HEADER_LINE: usize = 1 << 16;

/// Returns the bytes of a file as ASCII-compatible text with line feeds. UTF-16 is decoded; byte order marks and
/// end-of-file marks are removed.
pub(super) fn plain<'a>(bytes: &'a [u8], report: &mut ParseReport) -> Cow<'a, [u8]> {
    let marked = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff");
    let utf16 = marked || unmarked_utf16(bytes).is_some();
    let text = if utf16 {
        let source = Source::decode(bytes, NAME);
        report.note_encoding(&source);
        Cow::Owned(source.text().as_bytes().to_vec())
    } else {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let marks = bytes.iter().rev().take_while(|&&b| b == 0x1a || b == 0 || b.is_ascii_whitespace()).count();
        Cow::Borrowed(&bytes[..bytes.len() - marks])
    };
    // Old Macintosh files end their lines with a carriage return alone.
    let end = text.iter().position(|&b| b == b'\n' || b == b'\r');
    let alone = end.is_some_and(|end| text[end] == b'\r' && text.get(end + 1) != Some(&b'\n'));
    if alone {
        return Cow::Owned(text.iter().map(|&b| if b == b'\r' { b'\n' } else { b }).collect());
    }
    text
}

/// Contents of the lines of a radiometric-csv file before its numbers.
pub(super) struct Head {
    pub(super) fields: Vec<Field>,
    /// Row of column names of the file.
    pub(super) names: Row,
    /// Separator of the cells in the row of column names.
    pub(super) delimiter: Delimiter,
    /// Number of lines of the file before its rows of numbers, including the row of column names.
    pub(super) lines: usize,
    /// Byte offset of the first line of numbers.
    pub(super) end: usize,
}

impl Head {
    pub(super) fn read(text: &[u8], report: &mut ParseReport) -> Result<Self, FormatError> {
        let mut fields: Vec<Field> = Vec::new();
        let (mut at, mut lines) = (0, 0);
        let mut odd = None;
        let mut decoded = |bytes: &[u8], report: &mut ParseReport| {
            let (text, encoding) = unmarked(bytes);
            if encoding != "UTF-8" && odd.replace(encoding).is_none() {
                report.note(TextNote::DecodedAs { encoding });
            }
            text.into_owned()
        };
        while at < text.len() {
            lines += 1;
            let end = text[at..].iter().position(|&b| b == b'\n').map_or(text.len(), |i| at + i);
            let line = text[at..end].trim_ascii();
            at = (end + 1).min(text.len());
            let Some(comment) = line.strip_prefix(b"#") else {
                if line.is_empty() && lines < MAX_HEADER_LINES {
                    continue;
                }
                let names = decoded(line, report);
                let delimiter = separator(&names);
                let names = Row::of(&names, delimiter, lines);
                complete(&mut fields, &names);
                return Ok(Self { fields, names, delimiter, lines, end: at });
            };
            if lines > MAX_HEADER_LINES || line.len() > MAX_HEADER_LINE {
                let message = format!(
                    "line {lines} of the header, expected at most {MAX_HEADER_LINES} lines of {MAX_HEADER_LINE} bytes"
                );
                return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
            }
            if comment.starts_with(b"#") {
                continue;
            }
            let comment = decoded(comment.trim_ascii_start(), report);
            match comment.split_once(':') {
                // Several words before the colon are prose.
                Some((key, value)) if !key.trim().is_empty() && !key.trim().contains(char::is_whitespace) => {
                    // Spreadsheets pad every line with separators to the length of the longest.
                    let value = value.trim().trim_end_matches([',', ';']).trim_end().chars().take(4096).collect();
                    fields.push(Field { key: key.trim().to_lowercase(), value, line: lines });
                }
                _ if comment.is_empty() => {}
                _ => report.metadata.push(("comment".to_owned(), comment.chars().take(4096).collect())),
            }
        }
        let message = "the file ends in its header, expected a row of column names and rows of numbers";
        Err(FormatError::new(FormatErrorKind::Malformed, NAME, message))
    }
}

/// Returns the separator of a row of column names: the one that occurs most often outside of quotes, or blanks.
pub(super) fn separator(names: &str) -> Delimiter {
    let count = |delimiter: Delimiter| names.bytes().filter(|&byte| byte == delimiter.byte()).count();
    let separators = [Delimiter::Comma, Delimiter::Tab, Delimiter::Semicolon];
    let most = separators.into_iter().max_by_key(|&delimiter| count(delimiter));
    most.filter(|&delimiter| count(delimiter) > 0).unwrap_or(Delimiter::Blank)
}

/// Adds the units that the names of the columns state to the lines of the header, where these do not.
pub(super) fn complete(fields: &mut Vec<Field>, row: &Row) {
    let names: Vec<&String> = row.cells.iter().map(|(name, _)| name).collect();
    let meanings = names::meanings(&names, row.with_source);
    let mut add = |key: &str, value: &str| {
        if !fields.iter().any(|field| field.key == key) {
            fields.push(Field { key: key.to_owned(), value: value.to_owned(), line: row.line });
        }
    };
    let angles: Vec<Option<bool>> = meanings
        .iter()
        .filter_map(|meaning| match meaning {
            Meaning::Angle { radians, .. } => Some(*radians),
            _ => None,
        })
        .collect();
    if !angles.is_empty() && angles.iter().all(Option::is_some) {
        // Each column has its own unit.
        add("angle_unit", "deg");
    }
    if let Some(unit) = meanings.iter().find_map(|meaning| match meaning {
        Meaning::Wavelength(unit) => *unit,
        _ => None,
    }) {
        add("wavelength_unit", unit.name());
    }
    let bands: Vec<bool> = meanings
        .iter()
        .filter_map(|meaning| match meaning {
            Meaning::Value(value) => value.band.map(|band| band.has_unit),
            _ => None,
        })
        .collect();
    if !bands.is_empty() && bands.iter().all(|&has_unit| has_unit) {
        add("wavelength_unit", "nm");
    }
}
