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

    fn separates(self, c: char) -> bool {
        match self {
            Self::Tab => c == '\t',
            Self::Semicolon => c == ';',
            Self::Comma => c == ',',
            Self::Blank => c.is_whitespace(),
        }
    }

    /// Splits `line` into cells at the separator and trims the blanks around them. A cell in quotes may contain
    /// separators; it is returned without its quotes.
    pub(in crate::formats) fn cells(self, line: Token<'_>) -> Vec<Token<'_>> {
        let (mut cells, mut rest, mut at) = (Vec::new(), line.text, line.offset);
        // One cell more than a row may have, so that longer rows are refused.
        while cells.len() < MAX_ENTRIES + 2 {
            let begin =
                rest.trim_start_matches(|c: char| c.is_whitespace() && (self == Self::Blank || !self.separates(c)));
            at += rest.len() - begin.len();
            if begin.is_empty() && self == Self::Blank {
                break;
            }
            let (text, inner, end) = if let Some((text, end)) = self.quoted(begin) {
                (text, 1, end)
            } else {
                let end = begin.find(|c| self.separates(c)).unwrap_or(begin.len());
                (&begin[..end], 0, end)
            };
            let blank = text.len() - text.trim_start().len();
            cells.push(Token { text: text.trim(), offset: at + inner + blank });
            let Some(separator) = begin[end..].chars().next() else { break };
            let next = end + separator.len_utf8();
            (rest, at) = (&begin[next..], at + next);
        }
        cells
    }

    /// Returns the text within the quotes, double or single, at the start of `text`, and the byte offset of the next
    /// separator; `None` if no whole cell is in quotes. Two quotes within them stand for one.
    fn quoted(self, text: &str) -> Option<(&str, usize)> {
        let quote = text.chars().next().filter(|first| matches!(first, '"' | '\''))?;
        let inner = &text[1..];
        let mut from = 0;
        loop {
            let close = from + inner[from..].find(quote)?;
            if inner[close + 1..].starts_with(quote) {
                from = close + 2;
                continue;
            }
            let after = &inner[close + 1..];
            let blanks =
                after.len() - after.trim_start_matches(|c: char| c.is_whitespace() && !self.separates(c)).len();
            let ends = after[blanks..].chars().next().is_none_or(|c| self.separates(c));
            return ends.then_some((&inner[..close], close + 2 + blanks));
        }
    }

    /// Parses the number in a table cell, behind which a percent sign may stand. A comma is a decimal mark unless it
    /// separates thousands in quotes, where commas separate cells.
    pub(in crate::formats) fn number(self, cell: &str) -> Option<f64> {
        number(cell).or_else(|| {
            let cell = cell.strip_suffix('%').map_or(cell, str::trim_end);
            let Some((whole, part)) = cell.split_once(',') else { return number(cell) };
            let is_thousands = self == Self::Comma && part.len() == 3 && !whole.starts_with('0');
            if part.contains([',', '.']) || is_thousands { None } else { with_point(cell, whole.len()) }
        })
    }

    /// Returns the content of a table cell: a number, a missing value, or text.
    pub(in crate::formats) fn content(self, cell: &str) -> Content {
        // Between blanks a dash may mean "to": `380 - 780`.
        let is_dash = self == Self::Blank && cell == "-";
        match self.number(cell) {
            Some(number) => Content::Number(number),
            None if is_missing(cell) && !is_dash => Content::Missing,
            None => Content::Text,
        }
    }
}

/// Parses a number whose decimal mark at byte `comma` is a comma.
fn with_point(cell: &str, comma: usize) -> Option<f64> {
    /// Upper bound on the bytes of such a number; cells are many, and a buffer needs no allocation.
    const LONGEST: usize = 64;
    let mut digits = [0_u8; LONGEST];
    let digits = digits.get_mut(..cell.len())?;
    digits.copy_from_slice(cell.as_bytes());
    digits[comma] = b'.';
    number(std::str::from_utf8(digits).ok()?)
}

/// Content of a table cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::formats) enum Content {
    Number(f64),
    Missing,
    Text,
}

/// Spellings of a missing value in a table cell, in lower case: those of C libraries, spreadsheets and instruments.
const MISSING: [&str; 25] = [
    "null",
    "n.a.",
    "#div/0!",
    "#value!",
    "#ref!",
    "#num!",
    "#null!",
    "#nv",
    "#wert!",
    "#zahl!",
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

/// Returns the text of a table cell as a name: without quotes, truncated to the maximum length of a name.
pub(in crate::formats) fn name_of(cell: &str) -> String {
    let inner = cell.strip_prefix('"').and_then(|rest| rest.strip_suffix('"')).unwrap_or(cell);
    inner.replace("\"\"", "\"").trim().chars().take(256).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(delimiter: Delimiter, line: &str) -> Vec<(String, usize)> {
        let cells = delimiter.cells(Token { text: line, offset: 100 });
        cells.iter().map(|cell| (name_of(cell.text), cell.offset - 100)).collect()
    }

    #[test]
    fn quotes_keep_separators_and_are_no_part_of_a_cell() {
        let cells = |list: &[(&str, usize)]| list.iter().map(|&(text, at)| (text.to_owned(), at)).collect::<Vec<_>>();
        for (delimiter, line, expected) in [
            (
                Delimiter::Comma,
                r#"A,"filter, orange, 2 mm", 0.5"#,
                cells(&[("A", 0), ("filter, orange, 2 mm", 3), ("0.5", 26)]),
            ),
            (Delimiter::Comma, r#""a ""b""" ,1"#, cells(&[(r#"a "b""#, 1), ("1", 11)])),
            (Delimiter::Comma, r#"",x,"#, cells(&[(r#"""#, 0), ("x", 2), ("", 4)])),
            (Delimiter::Comma, r#"5" disc,1"#, cells(&[(r#"5" disc"#, 0), ("1", 8)])),
            (Delimiter::Semicolon, r#""1,5" ; 2"#, cells(&[("1,5", 1), ("2", 8)])),
            (Delimiter::Blank, "  \"red leaf\"  0.1\t0.2 ", cells(&[("red leaf", 3), ("0.1", 14), ("0.2", 18)])),
            (Delimiter::Tab, "a b\t\t c", cells(&[("a b", 0), ("", 4), ("c", 6)])),
            (Delimiter::Comma, "", cells(&[("", 0)])),
        ] {
            assert_eq!(split(delimiter, line), expected, "{line}");
        }
    }

    #[test]
    fn numbers_have_a_decimal_comma_but_no_thousands() {
        for (delimiter, cell, value) in [
            (Delimiter::Semicolon, "0,5", Some(0.5)),
            (Delimiter::Semicolon, "12,345", Some(12.345)),
            (Delimiter::Comma, "0,345", Some(0.345)),
            (Delimiter::Comma, "12,34", Some(12.34)),
            (Delimiter::Comma, "12,345", None),
            (Delimiter::Tab, "1,2,3", None),
            (Delimiter::Tab, "1,2.3", None),
            (Delimiter::Comma, "8.5%", Some(8.5)),
            (Delimiter::Tab, "8,5 %", Some(8.5)),
            (Delimiter::Tab, "%", None),
        ] {
            assert_eq!(delimiter.number(cell), value, "{cell}");
        }
    }

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
