//! Header of an array: its position, and its Python dictionary.

use super::about::{MAGIC, NAME};
use super::element::{ELEMENTS, Element, element};
use super::refusal::malformed;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::snippet;

/// Upper bound on the header of an array file, in bytes; `NumPy` writes about 120. Raising it accepts longer headers.
const MAX_HEADER: usize = 1 << 16;

/// Returns the text of an array file's header and the byte offset of the data.
pub(super) fn header_of(bytes: &[u8]) -> Result<(&str, usize), FormatError> {
    let at = MAGIC.len();
    let (length, start) = match bytes.get(at..) {
        Some([1, _, a, b, ..]) => (usize::from(u16::from_le_bytes([*a, *b])), at + 4),
        Some([2 | 3, _, a, b, c, d, ..]) => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, at + 6),
        Some([version, _, _, _, _, _, ..]) => {
            let message = format!("version {version}, expected 1, 2 or 3");
            return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, at, message));
        }
        _ => {
            return Err(malformed(
                bytes.len(),
                "the file ends in its header, expected a version, a length and a dictionary",
            ));
        }
    };
    if length > MAX_HEADER {
        let message = format!("a header of {length} bytes, expected at most {MAX_HEADER}");
        return Err(FormatError::at_byte(FormatErrorKind::OverLimit, NAME, at + 2, message));
    }
    let header = bytes.get(start..start + length).ok_or_else(|| {
        malformed(at + 2, format!("a header of {length} bytes in a file of {} bytes, expected it within", bytes.len()))
    })?;
    let header =
        std::str::from_utf8(header).map_err(|_| malformed(start, "the header is not text, expected a dictionary"))?;
    Ok((header, start + length))
}

/// Contents of the header of an array file.
pub(super) struct Header {
    pub(super) element: Element,
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<usize>,
}

/// Parses the header of an array file, a Python dictionary literal: string keys; strings, booleans and tuples of
/// integers as values.
pub(super) fn parse_header(header: &str, data_at: usize) -> Result<Header, FormatError> {
    let start = data_at - header.len();
    let mut literal = Literal { text: header, at: 0, start };
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    literal.expect('{')?;
    while !literal.accept('}') {
        let key = literal.string("a key in quotes")?;
        literal.expect(':')?;
        let repeated = match key {
            "descr" => {
                if literal.peek() == Some('[') {
                    let message = "records with fields, expected an array of plain numbers";
                    return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, literal.byte(), message));
                }
                let at = literal.byte();
                descr.replace((literal.string("a number type in quotes")?, at)).is_some()
            }
            "fortran_order" => fortran_order.replace(literal.boolean()?).is_some(),
            "shape" => shape.replace(literal.tuple()?).is_some(),
            other => {
                let message = format!("the header key {}, expected descr, fortran_order and shape", snippet(other));
                return Err(literal.malformed(message));
            }
        };
        if repeated {
            return Err(literal.malformed(format!("key {} twice", snippet(key))));
        }
        if !literal.accept(',') && literal.peek() != Some('}') {
            return Err(literal.malformed("expected `,` or `}`"));
        }
    }
    if literal.peek().is_some() {
        return Err(literal.malformed("text after the dictionary, expected the end of the header"));
    }
    let (Some((descr, descr_at)), Some(fortran_order), Some(shape)) = (descr, fortran_order, shape) else {
        return Err(malformed(start, "the header lacks one of descr, fortran_order and shape, expected all of them"));
    };
    let Some(element) = element(descr) else {
        let known: Vec<&str> = ELEMENTS.iter().map(|(name, ..)| *name).collect();
        let message = format!("number type {}, expected < or > and one of {}", snippet(descr), known.join(", "));
        return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, descr_at, message));
    };
    Ok(Header { element, fortran_order, shape })
}

/// Position in the text of a Python literal; blanks are skipped before each item.
struct Literal<'a> {
    text: &'a str,
    at: usize,
    start: usize,
}

impl<'a> Literal<'a> {
    fn byte(&self) -> usize {
        self.start + self.at
    }

    fn malformed(&self, message: impl Into<String>) -> FormatError {
        malformed(self.byte(), message)
    }

    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    fn accept(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.at += wanted.len_utf8();
        }
        found
    }

    fn expect(&mut self, wanted: char) -> Result<(), FormatError> {
        if self.accept(wanted) {
            return Ok(());
        }
        let message = format!("found {}, expected `{wanted}`", snippet(&self.text[self.at..]));
        Err(self.malformed(message))
    }

    fn string(&mut self, expected: &str) -> Result<&'a str, FormatError> {
        let quote = self.peek().filter(|c| matches!(c, '\'' | '"'));
        let rest = &self.text[self.at..];
        let closed = quote.and_then(|quote| rest[1..].split_once(quote)).map(|(string, _)| string);
        let Some(string) = closed else {
            return Err(self.malformed(format!("found {}, expected {expected}", snippet(rest))));
        };
        self.at += string.len() + 2;
        Ok(string)
    }

    fn boolean(&mut self) -> Result<bool, FormatError> {
        self.peek();
        for (name, value) in [("True", true), ("False", false)] {
            if self.text[self.at..].starts_with(name) {
                self.at += name.len();
                return Ok(value);
            }
        }
        Err(self.malformed(format!("found {}, expected True or False", snippet(&self.text[self.at..]))))
    }

    fn tuple(&mut self) -> Result<Vec<usize>, FormatError> {
        self.expect('(')?;
        let mut lengths = Vec::new();
        while !self.accept(')') {
            self.peek();
            let rest = &self.text[self.at..];
            let digits = &rest[..rest.bytes().take_while(u8::is_ascii_digit).count()];
            let Ok(length) = digits.parse() else {
                return Err(self.malformed(format!("found {}, expected the length of an axis", snippet(rest))));
            };
            self.at += digits.len();
            // Python 2 writes long integers with an L.
            if self.text[self.at..].starts_with('L') {
                self.at += 1;
            }
            lengths.push(length);
            if !self.accept(',') && self.peek() != Some(')') {
                return Err(self.malformed("expected `,` or `)`"));
            }
        }
        Ok(lengths)
    }
}
