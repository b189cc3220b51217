//! Checked reading and writing of little-endian fields and variable-length integers.

use super::error::CodecError;

/// Writer that appends binary fields to a byte vector.
#[derive(Debug, Default)]
pub(crate) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    /// Consumes the writer of binary fields and returns all bytes that it wrote.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Writes one byte.
    pub(crate) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// Writes the given bytes unchanged.
    pub(crate) fn raw(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Writes a LEB128 integer: seven bits per byte, least significant first, the high bit set on all but the last.
    pub(crate) fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }

    /// Writes the `count` low bytes of the integer `value`.
    pub(crate) fn low_bytes(&mut self, value: u32, count: usize) {
        self.bytes.extend(value.to_le_bytes().into_iter().take(count));
    }

    /// Writes an IEEE 754 single-precision number.
    pub(crate) fn f32(&mut self, value: f32) {
        self.raw(&value.to_le_bytes());
    }

    /// Writes an IEEE 754 double-precision number.
    pub(crate) fn f64(&mut self, value: f64) {
        self.raw(&value.to_le_bytes());
    }
}

/// Reader of binary fields from bytes; `base` is the offset of the first byte in the file, used in messages.
#[derive(Clone, Debug)]
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    position: usize,
    base: usize,
}

impl<'a> Reader<'a> {
    /// Starts reading `bytes`, which begin at offset `base` of the file.
    pub(crate) fn new(bytes: &'a [u8], base: usize) -> Self {
        Self { bytes, position: 0, base }
    }

    /// Returns the offset in the file of the next byte.
    pub(crate) fn offset(&self) -> usize {
        self.base + self.position
    }

    /// Returns the number of bytes not yet read.
    pub(crate) fn remaining(&self) -> usize {
        self.bytes.len() - self.position
    }

    /// Returns the bytes of the file from offset `start` to the current position.
    pub(crate) fn since(&self, start: usize) -> &'a [u8] {
        &self.bytes[start - self.base..self.position]
    }

    /// Returns the error that the field read last is invalid, for the given reason.
    pub(crate) fn malformed(&self, reason: impl Into<String>) -> CodecError {
        CodecError::Malformed { at: self.offset(), reason: reason.into() }
    }

    /// Reads the next `count` bytes of the input. `expected` names these bytes in the error if the input is too short.
    pub(crate) fn take(&mut self, count: usize, expected: &'static str) -> Result<&'a [u8], CodecError> {
        let end = self.position.checked_add(count).filter(|&end| end <= self.bytes.len());
        let end = end.ok_or(CodecError::Truncated { at: self.offset(), expected })?;
        let bytes = &self.bytes[self.position..end];
        self.position = end;
        Ok(bytes)
    }

    fn array<const N: usize>(&mut self, expected: &'static str) -> Result<[u8; N], CodecError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, expected)?);
        Ok(array)
    }

    /// Reads one byte.
    pub(crate) fn u8(&mut self, expected: &'static str) -> Result<u8, CodecError> {
        Ok(self.array::<1>(expected)?[0])
    }

    /// Reads an integer of `count` bytes, at most 4.
    pub(crate) fn low_bytes(&mut self, count: usize, expected: &'static str) -> Result<u32, CodecError> {
        let bytes = self.take(count.min(4), expected)?;
        Ok(bytes.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte)))
    }

    /// Reads an IEEE 754 single-precision number, which must be finite.
    pub(crate) fn f32(&mut self, expected: &'static str) -> Result<f32, CodecError> {
        let value = f32::from_le_bytes(self.array(expected)?);
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.malformed(format!("{expected} is {value}, expected a finite number")))
        }
    }

    /// Reads an IEEE 754 double-precision number, which must be finite.
    pub(crate) fn f64(&mut self, expected: &'static str) -> Result<f64, CodecError> {
        let value = f64::from_le_bytes(self.array(expected)?);
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.malformed(format!("{expected} is {value}, expected a finite number")))
        }
    }

    /// Reads a LEB128 integer, which must be in its shortest form.
    pub(crate) fn varint(&mut self, expected: &'static str) -> Result<u64, CodecError> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.u8(expected)?;
            let bits = u64::from(byte & 0x7F);
            if shift == 63 && bits > 1 || (byte == 0 && shift > 0) {
                break;
            }
            value |= bits << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(self.malformed(format!("{expected} is no variable-length integer")))
    }

    /// Reads a LEB128 integer and fails if it exceeds `limit`.
    pub(crate) fn size(&mut self, limit: usize, expected: &'static str) -> Result<usize, CodecError> {
        let value = self.varint(expected)?;
        usize::try_from(value)
            .ok()
            .filter(|&size| size <= limit)
            .ok_or_else(|| self.malformed(format!("{expected} is {value}, expected at most {limit}")))
    }

    /// Fails if bytes are left after the last field.
    pub(crate) fn end(&self, what: &'static str) -> Result<(), CodecError> {
        match self.remaining() {
            0 => Ok(()),
            n => Err(self.malformed(format!("{n} bytes are left after the end of the {what}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_round_trip() {
        let mut w = Writer::default();
        let values = [0, 1, 127, 128, 300, u64::from(u32::MAX), u64::MAX];
        for value in values {
            w.varint(value);
        }
        w.low_bytes(0x0056_3412, 3);
        w.f32(-1.5);
        w.f64(1e300);
        let bytes = w.into_bytes();
        let mut r = Reader::new(&bytes, 10);
        for value in values {
            assert_eq!(r.varint("value"), Ok(value));
        }
        assert_eq!(r.low_bytes(3, "low"), Ok(0x0056_3412));
        assert_eq!((r.f32("f"), r.f64("d")), (Ok(-1.5), Ok(1e300)));
        assert_eq!(r.end("test"), Ok(()));
        assert_eq!(r.u8("more"), Err(CodecError::Truncated { at: 10 + bytes.len(), expected: "more" }));
    }

    #[test]
    fn overlong_and_overlarge_integers_are_refused() {
        for bytes in [&[0x80, 0x00][..], &[0xFF; 10], &[0x80; 20]] {
            assert!(matches!(Reader::new(bytes, 0).varint("x"), Err(CodecError::Malformed { .. })), "{bytes:?}");
        }
        assert!(matches!(Reader::new(&[200, 1], 0).size(10, "x"), Err(CodecError::Malformed { .. })));
        assert!(matches!(Reader::new(&f32::NAN.to_le_bytes(), 0).f32("x"), Err(CodecError::Malformed { .. })));
    }
}
