//! Words of a Zemax BSDF file, without comments, and the numbers among them.

use crate::domain::limits::MAX_ENTRIES;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{Brief, Source, Token, Tokens, number, snippet};

/// Iterator over the words of a text; lines that begin with `#` are comments.
pub(super) struct Words<'a> {
    source: &'a Source,
    tokens: Tokens<'a>,
}

impl<'a> Words<'a> {
    pub(super) fn new(source: &'a Source) -> Self {
        Self { source, tokens: Tokens::new(source.text(), 0) }
    }

    /// Returns an upper bound on the count of numbers that are left: each takes a byte and a separator.
    fn most(&self) -> usize {
        (self.source.text().len() - self.tokens.offset()).div_ceil(2)
    }

    /// Returns the next word; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Option<Token<'a>> {
        loop {
            let token = self.tokens.next()?;
            if !token.text.starts_with('#') || !self.begins_line(token.offset) {
                return Some(token);
            }
            let rest = &self.source.text()[token.offset..];
            let end = rest.find(['\n', '\r']).unwrap_or(rest.len());
            self.tokens = Tokens::new(self.source.text(), token.offset + end);
        }
    }

    /// Returns true if only blanks stand before byte `offset` in its line.
    fn begins_line(&self, offset: usize) -> bool {
        let before = &self.source.text()[..offset];
        let start = before.rfind(['\n', '\r']).map_or(0, |at| at + 1);
        before[start..].trim().is_empty()
    }

    /// Returns the next word without taking it.
    pub(super) fn peek(&mut self) -> Option<Token<'a>> {
        let before = self.tokens.clone();
        let token = self.next();
        self.tokens = before;
        token
    }

    /// Returns the next word, which must exist.
    pub(super) fn word(&mut self, expected: &str) -> Result<Token<'a>, FormatError> {
        let end = self.source.text().len();
        self.next().ok_or_else(|| self.source.malformed(end, format!("the file ends, expected {expected}")))
    }

    /// Returns the next word, which must be a number, and its byte offset.
    pub(super) fn number(&mut self, expected: &str) -> Result<(f64, usize), FormatError> {
        if let Some(number) = self.tokens.plain_number() {
            return Ok(number);
        }
        let token = self.word(expected)?;
        Ok((self.source.number(token, expected)?, token.offset))
    }

    /// Returns a list of angles in degrees within `range`, which follows its length.
    pub(super) fn angles(&mut self, name: &str, range: (f64, f64)) -> Result<Vec<f64>, FormatError> {
        let expected = format!("the number of angles {name}");
        let token = self.word(&expected)?;
        let most = self.most().clamp(1, MAX_ENTRIES);
        let count = number(token.text).filter(|n| n.fract() == 0.0 && (1.0..=most as f64).contains(n));
        let Some(count) = count else {
            let message =
                format!("found {}, expected {expected}, a whole number from 1 to {most}", snippet(token.text));
            return Err(self.source.malformed(token.offset, message));
        };
        let mut angles = Vec::with_capacity(count as usize);
        let expected = format!("an angle of {name}");
        for _ in 0..count as usize {
            let (angle, offset) = self.number(&expected)?;
            if !(range.0..=range.1).contains(&angle) {
                let message = format!("angle {}° of {name}, expected {}° to {}°", Brief(angle), range.0, range.1);
                return Err(self.source.malformed(offset, message));
            }
            angles.push(angle);
        }
        Ok(angles)
    }

    /// Refuses `count` numbers that the rest of the file cannot hold, or that are more than `limit`.
    pub(super) fn check(&self, count: Option<usize>, limit: usize) -> Result<usize, FormatError> {
        let shown = || count.map_or_else(|| "far more".to_owned(), |count| count.to_string());
        let at = self.tokens.offset();
        match count {
            Some(count) if count <= limit && count <= self.most() => Ok(count),
            Some(count) if count <= limit => Err(self.source.malformed(
                self.source.text().len(),
                format!("the file ends after at most {} numbers, expected {count}", self.most()),
            )),
            _ => {
                let message = format!("{} values, expected at most {limit}", shown());
                Err(self.source.error(FormatErrorKind::OverLimit, at, message))
            }
        }
    }

    /// Returns an error that rejects the file at a word.
    pub(super) fn refused(&self, kind: FormatErrorKind, token: Token<'_>, expected: &str) -> FormatError {
        self.source.error(kind, token.offset, format!("found {}, expected {expected}", snippet(token.text)))
    }

    /// Returns an error that rejects the number at byte `offset` because float32 cannot hold it.
    pub(super) fn too_large(&self, value: f64, offset: usize) -> FormatError {
        let message = format!("value {}, expected a number within the range of float32", Brief(value));
        self.source.malformed(offset, message)
    }
}
