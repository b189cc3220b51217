//! Cells of a line of text: separators, numbers, and the spellings of a missing value.

use crate::domain::limits::MAX_ENTRIES;
use crate::formats::text::{Token, number};

/// Separator between the cells of a row in a text table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::formats) enum Delimiter {
    Tab,
    Semicolon,
    Comma,
    Blank,
}

impl Delimiter {
    /// All cell separators in the order in which they are tried.
    pub(in crate::formats) const ALL: [Self; 4] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Blank];

    pub(in crate::formats) fn dialect(self) -> &'static str {
        match self {
            Self::Tab => "tab separated",
            Self::Semicolon => "semicolon separated",
            Self::Comma => "comma separated",
            Self::Blank => "blank separated",
        }
    }

    /// Returns the byte that separates cells; a blank may be repeated.
    pub(in crate::formats) fn byte(self) -> u8 {
        match self {
            Self::Tab => b'\t',
            Self::Semicolon => b';',
            Self::Comma => b',',
            Self::Blank => b' ',
        }
    }

    /// Splits `line` into cells at the separator and trims the blanks around them.
    pub(in crate::formats) fn cells(self, line: Token<'_>) -> Vec<Token<'_>> {
        let separates = |c: char| match self {
            Self::Tab => c == '\t',
            Self::Semicolon => c == ';',
            Self::Comma => c == ',',
            Self::Blank => c.is_whitespace(),
        };
        let mut at = line.offset;
        line.text
            .split_inclusive(separates)
            .map(|cell| {
                let start = at;
                at += cell.len();
                let cell = cell.strip_suffix(separates).unwrap_or(cell);
                let offset = start + cell.len() - cell.trim_start().len();
                Token { text: cell.trim(), offset }
            })
            // A trailing delimiter adds an empty cell.
            .chain(
                (self != Self::Blank && line.text.ends_with(separates))
                    .then(|| Token { text: "", offset: line.offset + line.text.len() }),
            )
            .filter(|cell| self != Self::Blank || !cell.text.is_empty())
            // One cell more than a row may have, so that longer rows are refused.
            .take(MAX_ENTRIES + 2)
            .collect()
    }

    /// Parses the number in a table cell. A comma is a decimal mark unless it separates cells.
    pub(in crate::formats) fn number(self, cell: &str) -> Option<f64> {
        number(cell).or_else(|| {
            let decimal_comma = self != Self::Comma && !cell.contains('.') && cell.matches(',').count() == 1;
            if decimal_comma { number(&cell.replace(',', ".")) } else { None }
        })
    }

    /// Returns the number of cells if `line` is a row of numbers, else `None`. Missing values are allowed after the
    /// first cell.
    pub(in crate::formats) fn numeric_cells(self, line: Token<'_>) -> Option<usize> {
        let cells = self.cells(line);
        let numeric = self.number(cells.first()?.text).is_some()
            && cells.iter().all(|cell| {
                // Between blanks a dash may mean "to": `380 - 780`.
                let is_dash = self == Self::Blank && cell.text == "-";
                self.number(cell.text).is_some() || (is_missing(cell.text) && !is_dash)
            });
        numeric.then_some(cells.len())
    }
}

/// Spellings of a missing value in a table cell, in lower case: those of C libraries, spreadsheets and instruments.
const MISSING: [&str; 15] = [
    "nan",
    "-nan",
    "+nan",
    "nan(ind)",
    "-nan(ind)",
    "1.#ind",
    "-1.#ind",
    "1.#qnan",
    "-1.#qnan",
    "-",
    "--",
    "---",
    "na",
    "n/a",
    "#n/a",
];

/// Returns true for a table cell without a value: blank, NaN or dashes.
pub(in crate::formats) fn is_missing(cell: &str) -> bool {
    cell.is_empty() || MISSING.iter().any(|spelling| cell.eq_ignore_ascii_case(spelling))
}

/// Returns the byte offset of the end of a missing value (`nan` or dashes) that starts at `at`, or `at` itself for a
/// blank cell; `None` for any other cell. Covers only the spellings that fill whole columns; [`is_missing`] covers the
/// others.
#[inline]
pub(in crate::formats) fn missing_end(text: &[u8], at: usize) -> Option<usize> {
    match text.get(at..)? {
        [b'n' | b'N', b'a' | b'A', b'n' | b'N', ..] => Some(at + 3),
        [b'-', b'-', ..] => Some(at + 2),
        [b',' | b';' | b'\t' | b'\r' | b'\n', ..] | [] => Some(at),
        _ => None,
    }
}

/// Returns true if a line has letters other than the `e` of an exponent.
pub(in crate::formats) fn has_words(line: &str) -> bool {
    line.bytes().any(|byte| byte.is_ascii_alphabetic() && !matches!(byte, b'e' | b'E'))
}

/// Returns the text of a table cell without its quotes, truncated to the maximum length of a name.
pub(in crate::formats) fn unquoted(cell: &str) -> String {
    cell.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(cell).trim().chars().take(256).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_values_have_many_spellings_and_numbers_have_none_of_them() {
        for cell in ["", "NaN", "nan", "NAN", "--", "-", "N/A", "#N/A", "-1.#IND", "-nan(ind)"] {
            assert!(is_missing(cell) && Delimiter::Tab.number(cell).is_none(), "{cell}");
        }
        for cell in ["inf", "-inf", "0", "-1", "none", "nano", "1e", "----"] {
            assert!(!is_missing(cell), "{cell}");
        }
        assert_eq!(
            [b"NaN,1".as_slice(), b"--\n", b",1", b"-1", b"x"].map(|t| missing_end(t, 0)),
            [Some(3), Some(2), Some(0), None, None]
        );
    }
}
