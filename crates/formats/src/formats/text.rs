//! Decoding of bytes in any encoding to text with lines, tokens and positions, and safe quotation of a file in
//! messages.

use super::error::{FormatError, FormatErrorKind, Position};
use super::number::decimal;
pub(super) use crate::notes::Brief;
use crate::notes::Quoted;
use std::borrow::Cow;
use std::fmt::Write as _;

/// Name of the encoding of text that is not UTF-8 and has no byte order mark.
pub(super) const WINDOWS: &str = "Windows-1252";

/// Decoded text of a file, with the name of the format that its error messages give.
pub(super) struct Source {
    format: &'static str,
    text: String,
    encoding: &'static str,
}

/// Piece of a line between separators, with its position in the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Token<'a> {
    /// Characters of the piece between separators; empty between two commas without content.
    pub(super) text: &'a str,
    /// Byte offset, in the decoded text of the file, at which the piece between separators starts.
    pub(super) offset: usize,
}

impl Source {
    /// Decodes the bytes of a file as text. A byte order mark selects UTF-8 or UTF-16; UTF-16 is also detected without
    /// one. Other bytes are UTF-8 if valid, else Windows-1252. NUL, with which instruments pad fields, becomes a blank;
    /// a DOS end-of-file mark is removed.
    pub(super) fn decode(bytes: &[u8], format: &'static str) -> Self {
        let (text, encoding) = decode(bytes);
        let mut text =
            if memchr::memchr(0, text.as_bytes()).is_some() { text.replace('\0', " ") } else { text.into_owned() };
        let kept = text.trim_end_matches(|c: char| c == '\u{1a}' || c == '\0' || c.is_whitespace()).len();
        if let Some(mark) = text[kept..].find('\u{1a}') {
            text.truncate(kept + mark);
        }
        Self { format, text, encoding }
    }

    /// Replaces the decoded text by one of the same length, in which positions stay what they are.
    pub(super) fn with_text(self, text: String) -> Self {
        Self { text, ..self }
    }

    /// Returns the decoded text of the file.
    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// Returns the name of the text's encoding, for a note; `None` for plain UTF-8.
    pub(super) fn odd_encoding(&self) -> Option<&'static str> {
        (self.encoding != "UTF-8").then_some(self.encoding)
    }

    /// Returns the lines of the text with their byte offsets; lines end with CR LF, LF or a lone CR.
    pub(super) fn lines(&self) -> Lines<'_> {
        Lines { text: &self.text, at: 0 }
    }

    /// Returns the line and column of a byte offset in the text.
    pub(super) fn position(&self, offset: usize) -> Position {
        let before = self.text.get(..offset).unwrap_or(&self.text).as_bytes();
        let mut line = 1;
        let mut start = 0;
        for (i, &byte) in before.iter().enumerate() {
            // The CR of a CR LF pair counts with its LF.
            let ends = byte == b'\n' || (byte == b'\r' && self.text.as_bytes().get(i + 1) != Some(&b'\n'));
            if ends {
                line += 1;
                start = i + 1;
            }
        }
        let column = 1 + self.text[start..before.len()].chars().count();
        Position::Text { line, column }
    }

    /// Returns an error that rejects the file at byte `offset` of the text.
    pub(super) fn error(&self, kind: FormatErrorKind, offset: usize, message: impl Into<String>) -> FormatError {
        FormatError { kind, format: self.format, position: Some(self.position(offset)), message: message.into() }
    }

    /// Returns an error that rejects the file as malformed at byte `offset` of the text.
    pub(super) fn malformed(&self, offset: usize, message: impl Into<String>) -> FormatError {
        self.error(FormatErrorKind::Malformed, offset, message)
    }

    /// Parses `token` as a number; the error names what was expected.
    pub(super) fn number(&self, token: Token<'_>, expected: &str) -> Result<f64, FormatError> {
        number(token.text)
            .ok_or_else(|| self.malformed(token.offset, format!("found {}, expected {expected}", snippet(token.text))))
    }
}

/// Iterator over the lines of a text with their byte offsets.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    text: &'a str,
    at: usize,
}

impl Lines<'_> {
    /// Returns the byte offset in the text at which the line starts that the iterator yields next.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    /// Makes the line that starts at byte `offset` of the text the next one that the iterator yields.
    pub(super) fn skip_to(&mut self, offset: usize) {
        self.at = offset;
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Token<'a>;

    fn next(&mut self) -> Option<Token<'a>> {
        let rest = &self.text[self.at..];
        if rest.is_empty() {
            return None;
        }
        let offset = self.at;
        let bytes = rest.as_bytes();
        let end = memchr::memchr2(b'\n', b'\r', bytes).unwrap_or(rest.len());
        let mark = match bytes.get(end..) {
            Some([b'\r', b'\n', ..]) => 2,
            Some([_, ..]) => 1,
            _ => 0,
        };
        self.at += end + mark;
        Some(Token { text: &rest[..end], offset })
    }
}

/// Iterator over the words and numbers of a text, which blanks, line ends and single commas separate; a comma with
/// blanks around it is one separator.
#[derive(Clone)]
pub(super) struct Tokens<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Tokens<'a> {
    /// Creates an iterator over the words and numbers of `text` from byte `at` on; blanks and commas separate them.
    pub(super) fn new(text: &'a str, at: usize) -> Self {
        Self { text, at }
    }

    /// Returns the byte offset in the text behind the last word or number read, where the next one is looked for.
    pub(super) fn offset(&self) -> usize {
        self.at
    }

    /// Returns the next number of the text and its byte offset, if a plain number follows after at most one comma; else
    /// consumes nothing.
    #[inline]
    pub(super) fn plain_number(&mut self) -> Option<(f64, usize)> {
        let bytes = self.text.as_bytes();
        let (mut at, mut commas) = (self.at, 0);
        loop {
            match KINDS[usize::from(*bytes.get(at)?)] {
                Kind::Blank => {}
                Kind::Comma if commas == 0 => commas = 1,
                Kind::Part => break,
                _ => return None,
            }
            at += 1;
        }
        let (value, end) = decimal(bytes, at)?;
        if let Some(&next) = bytes.get(end)
            && !matches!(KINDS[usize::from(next)], Kind::Blank | Kind::Comma)
        {
            return None;
        }
        self.at = end;
        Some((value, at))
    }

    /// Returns the length in bytes of the blank character at byte `at`, 0 if there is none.
    #[inline]
    fn blank(&self, at: usize) -> usize {
        match KINDS[usize::from(self.text.as_bytes()[at])] {
            Kind::Blank => 1,
            // Rare: blanks outside ASCII.
            Kind::Unknown => self.text[at..].chars().next().filter(|c| c.is_whitespace()).map_or(0, char::len_utf8),
            _ => 0,
        }
    }

    /// Returns the byte offset at which the word that contains byte `at` ends: at a blank, a comma or the end of the
    /// text.
    #[inline]
    fn end(&self, mut at: usize) -> usize {
        let bytes = self.text.as_bytes();
        while let Some(&byte) = bytes.get(at) {
            match KINDS[usize::from(byte)] {
                Kind::Part => at += 1,
                Kind::Unknown if self.blank(at) == 0 => at += self.text[at..].chars().next().map_or(1, char::len_utf8),
                _ => break,
            }
        }
        at
    }
}

/// Role of a byte of text: part of a word, blank or comma.
#[derive(Clone, Copy)]
enum Kind {
    Part,
    Blank,
    Comma,
    /// First byte of a character outside ASCII, which can be a blank or part of a word: only the decoded character
    /// tells.
    Unknown,
}

const KINDS: [Kind; 256] = {
    let mut kinds = [Kind::Part; 256];
    let mut byte = 0;
    while byte < 256 {
        kinds[byte] = match byte as u8 {
            b' ' | b'\t'..=b'\r' | 0 => Kind::Blank,
            b',' => Kind::Comma,
            0x80.. => Kind::Unknown,
            _ => Kind::Part,
        };
        byte += 1;
    }
    kinds
};

impl<'a> Iterator for Tokens<'a> {
    type Item = Token<'a>;

    fn next(&mut self) -> Option<Token<'a>> {
        let bytes = self.text.as_bytes();
        let mut commas = 0;
        let mut at = self.at;
        while let Some(&byte) = bytes.get(at) {
            if byte == b',' {
                commas += 1;
                if commas == 2 {
                    // The second comma is left, so that it separates the empty token from the next.
                    self.at = at;
                    return Some(Token { text: "", offset: at });
                }
                at += 1;
                continue;
            }
            let blank = self.blank(at);
            if blank > 0 {
                at += blank;
                continue;
            }
            let offset = at;
            at = self.end(at);
            self.at = at;
            return Some(Token { text: &self.text[offset..at], offset });
        }
        self.at = self.text.len();
        None
    }
}

/// Parses the whole of `text` as a finite decimal number; rejects `nan`, `inf` and hexadecimal.
pub(super) fn number(text: &str) -> Option<f64> {
    decimal(text.as_bytes(), 0).filter(|&(_, end)| end == text.len()).map(|(value, _)| value)
}

/// Returns a short quotation of a file for a message: at most 40 characters, without control characters that could
/// affect a terminal.
pub(super) fn snippet(text: &str) -> String {
    Quoted::of(text).to_string()
}

/// Formats a list of numbers for metadata; a long list is shortened.
pub(super) fn listed(values: &[f64]) -> String {
    const LONGEST: usize = 4096;
    let mut list = String::new();
    for (i, &value) in values.iter().enumerate() {
        if i == LONGEST {
            let _ = write!(list, " … ({} in all)", values.len());
            break;
        }
        let _ = write!(list, "{}{}", if i == 0 { "" } else { " " }, Brief(value));
    }
    list
}

/// Returns the beginning of a file as text of at most `longest` bytes, from which its format is recognised.
pub(super) fn head(bytes: &[u8], longest: usize) -> String {
    let cut = &bytes[..bytes.len().min(longest)];
    let whole_characters = match std::str::from_utf8(cut) {
        Err(error) if error.error_len().is_none() => &cut[..error.valid_up_to()],
        _ => cut,
    };
    decode(whole_characters).0.into_owned()
}

/// Returns true if the beginning of a file is text, with or without NUL padding: it has no control characters other
/// than line and page breaks.
pub(super) fn is_text(head: &str) -> bool {
    head.bytes().all(|byte| byte >= b' ' || matches!(byte, 0 | b'\t'..=b'\r' | 0x1a))
}

/// Returns the encoding of UTF-16 text without a byte order mark, recognised as printable ASCII in which every other
/// byte is NUL.
pub(super) fn unmarked_utf16(bytes: &[u8]) -> Option<&'static encoding_rs::Encoding> {
    const LOOKED_AT: usize = 512;
    const FEWEST: usize = 8;
    let (pairs, _) = bytes[..bytes.len().min(2 * LOOKED_AT)].as_chunks::<2>();
    let is_plain = |byte: u8| matches!(byte, b' '..=b'~' | b'\t' | b'\n' | b'\r');
    let plain = |side: usize| pairs.iter().filter(|pair| is_plain(pair[side]) && pair[1 - side] == 0).count();
    let enough = |count: usize| pairs.len() >= FEWEST && 10 * count >= 9 * pairs.len();
    if enough(plain(0)) {
        Some(encoding_rs::UTF_16LE)
    } else if enough(plain(1)) {
        Some(encoding_rs::UTF_16BE)
    } else {
        None
    }
}

fn decode(bytes: &[u8]) -> (Cow<'_, str>, &'static str) {
    if let Some((encoding, mark)) = encoding_rs::Encoding::for_bom(bytes) {
        let (text, _) = encoding.decode_without_bom_handling(&bytes[mark..]);
        let name = if encoding == encoding_rs::UTF_8 { "UTF-8" } else { encoding.name() };
        return (text, name);
    }
    if let Some(encoding) = unmarked_utf16(bytes) {
        return (encoding.decode_without_bom_handling(bytes).0, encoding.name());
    }
    unmarked(bytes)
}

/// Decodes text without a byte order mark and names its encoding: UTF-8 if valid, else Windows-1252.
pub(super) fn unmarked(bytes: &[u8]) -> (Cow<'_, str>, &'static str) {
    match std::str::from_utf8(bytes) {
        Ok(text) => (Cow::Borrowed(text), "UTF-8"),
        Err(_) => (encoding_rs::WINDOWS_1252.decode_without_bom_handling(bytes).0, WINDOWS),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, little: bool) -> Vec<u8> {
        let unit = |u: u16| if little { u.to_le_bytes() } else { u.to_be_bytes() };
        std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(unit).collect()
    }

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "Straße 5 µm\n";
        let windows: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            windows,
            utf16(text, true),
            utf16(text, false),
        ] {
            assert_eq!(Source::decode(&bytes, "t").text(), text);
        }
    }

    #[test]
    fn padding_is_blank_and_text_in_two_bytes_needs_no_mark() {
        assert_eq!(Source::decode(b"ab\0\0c\n1\t2\0\n", "t").text(), "ab  c\n1\t2 \n");
        let text = "Wavelength\tirradiance\n350\t0.1\n";
        for little in [true, false] {
            let source = Source::decode(&utf16(text, little)[2..], "t");
            assert_eq!((source.text(), source.odd_encoding().is_some()), (text, true));
        }
        for binary in
            [&[0; 64][..], &[90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0, 1, 2, 3, 4], b"350\t0.1\0\0\0\0\0\0\0\0\0\0"]
        {
            assert!(unmarked_utf16(binary).is_none(), "{binary:?}");
        }
        assert!(is_text("350\t0.1\0\0\r\n") && !is_text("350\u{1}"));
    }

    #[test]
    fn the_dos_end_mark_is_cut_and_nothing_else() {
        assert_eq!(Source::decode(b"400\t\x1a\r\n", "t").text(), "400\t");
        assert_eq!(Source::decode(b"400\t\n", "t").text(), "400\t\n");
        assert_eq!(Source::decode(b"4\x1a5\n", "t").text(), "4\u{1a}5\n");
    }

    #[test]
    fn lines_and_positions_know_three_line_ends() {
        let source = Source::decode("a\r\nbé c\rd\n\ne".as_bytes(), "t");
        let lines: Vec<&str> = source.lines().map(|l| l.text).collect();
        assert_eq!(lines, ["a", "bé c", "d", "", "e"]);
        let at = |needle: &str| source.position(source.text().find(needle).unwrap());
        assert_eq!(at("c"), Position::Text { line: 2, column: 4 });
        assert_eq!(at("d"), Position::Text { line: 3, column: 1 });
        assert_eq!(at("e"), Position::Text { line: 5, column: 1 });
    }

    #[test]
    fn a_comma_with_blanks_is_one_separator_and_two_commas_enclose_nothing() {
        let tokens = |text| Tokens::new(text, 0).map(|t| t.text).collect::<Vec<_>>();
        assert_eq!(tokens("1,1000 , 3\n,4,\n5  6,"), ["1", "1000", "3", "4", "5", "6"]);
        assert_eq!(tokens("1,,2"), ["1", "", "2"]);
        assert_eq!(tokens("1, ,,2"), ["1", "", "", "2"]);
        assert!(tokens(" \n\t").is_empty());
    }

    #[test]
    fn numbers_are_decimal_and_finite() {
        for (text, value) in [("1", 1.0), (".292", 0.292), ("5.", 5.0), ("+1e3", 1000.0), ("-0", 0.0)] {
            assert_eq!(number(text), Some(value));
        }
        for text in ["", "nan", "NaN", "inf", "-inf", "1e999", "0x10", "1,5", "1O", "e", "-", "."] {
            assert_eq!(number(text), None, "{text}");
        }
    }

    #[test]
    fn quotations_are_short_and_harmless() {
        assert_eq!(snippet("ab\u{1b}[31m"), "`ab\u{fffd}[31m`");
        assert!(snippet(&"x".repeat(1000)).chars().count() <= 43);
        assert_eq!(snippet(""), "nothing");
        assert_eq!(
            [90.0, -0.5, 0.0, 1e300, 1e-300].map(|x| Brief(x).to_string()),
            ["90", "-0.5", "0", "1e300", "1e-300"]
        );
    }
}
