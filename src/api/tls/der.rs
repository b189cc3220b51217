//! Elements of DER, the encoding of certificates: tag, length, content.

/// Reader of a sequence of DER elements. It never reads beyond the bytes that it was given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reader<'a>(&'a [u8]);

/// DER tag of a sequence.
pub(super) const SEQUENCE: u8 = 0x30;

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Takes the next DER element: its tag and its content. Returns `None` at the end, and if the bytes are not DER.
    pub(super) fn element(&mut self) -> Option<(u8, &'a [u8])> {
        let (&[tag, first], rest) = self.0.split_first_chunk()?;
        // Tags of more than one byte occur in no certificate.
        if tag & 0x1f == 0x1f {
            return None;
        }
        let (length, rest) = match first {
            0..=0x7f => (usize::from(first), rest),
            0x81..=0x84 => {
                let (digits, rest) = rest.split_at_checked(usize::from(first & 0x7f))?;
                let length = digits.iter().fold(0_u32, |sum, digit| (sum << 8) | u32::from(*digit));
                (usize::try_from(length).ok()?, rest)
            }
            _ => return None,
        };
        let (content, rest) = rest.split_at_checked(length)?;
        self.0 = rest;
        Some((tag, content))
    }

    /// Takes the next DER element if it has the given tag, and returns its content.
    pub(super) fn of(&mut self, tag: u8) -> Option<&'a [u8]> {
        let mut ahead = *self;
        let (_, content) = ahead.element().filter(|(found, _)| *found == tag)?;
        *self = ahead;
        Some(content)
    }

    /// Takes the next DER element, which must be a sequence, and returns a reader of its content.
    pub(super) fn sequence(&mut self) -> Option<Self> {
        self.of(SEQUENCE).map(Self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_taken_one_after_another() {
        let bytes = [&[SEQUENCE, 3, 2, 1, 7, 4, 0x81, 2][..], &[8, 9]].concat();
        let mut reader = Reader::new(&bytes);
        assert_eq!(reader.of(4), None);
        assert_eq!(reader.sequence().unwrap().of(2), Some(&[7][..]));
        assert_eq!(reader.element(), Some((4, &[8, 9][..])));
        assert!(reader.is_empty() && reader.element().is_none());
    }

    #[test]
    fn lengths_beyond_the_bytes_and_unknown_forms_are_refused() {
        for bytes in [
            &[][..],
            &[4],
            &[4, 1],
            &[4, 0x80, 0],
            &[4, 0x81],
            &[4, 0x82, 1],
            &[4, 0x84, 0xff, 0xff, 0xff, 0xff],
            &[4, 0x85, 0, 0, 0, 0, 1, 7],
            &[0x1f, 1, 0],
        ] {
            assert_eq!(Reader::new(bytes).element(), None, "{bytes:?}");
        }
    }
}
