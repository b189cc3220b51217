//! Binary range coder (Martin 1979, in the carry-propagating form of LZMA). Models are written once, for encoding and
//! decoding.

/// Range coder of binary decisions: an encoder writes `bit`; a decoder ignores it and returns the bit that it read.
pub(crate) trait BitCoder {
    /// Encodes or decodes one binary decision whose probability of being 1 is `p1 / 65536`, `0 < p1 < 65536`.
    fn bit(&mut self, bit: bool, p1: u32) -> bool;

    /// True for decoders, false for encoders.
    const DECODES: bool;

    /// Encodes or decodes one binary decision of probability one half.
    fn even(&mut self, bit: bool) -> bool {
        self.bit(bit, 1 << 15)
    }

    /// Encodes or decodes the `count` low bits of `value`, each with probability one half, most significant first.
    fn bits(&mut self, value: u32, count: u32) -> u32 {
        (0..count).rev().fold(0, |read, shift| read << 1 | u32::from(self.even(value >> shift & 1 == 1)))
    }
}

/// Range encoder: writes binary decisions to bytes.
#[derive(Clone, Debug)]
pub(crate) struct Encoder {
    low: u64,
    range: u32,
    /// Last byte of output, held back because a carry may still change it; `pending_ones` bytes of 0xFF follow it.
    pending: u8,
    pending_ones: u64,
    started: bool,
    bytes: Vec<u8>,
}

impl Default for Encoder {
    fn default() -> Self {
        Self { low: 0, range: u32::MAX, pending: 0, pending_ones: 0, started: false, bytes: Vec::new() }
    }
}

impl Encoder {
    fn shift(&mut self) {
        let carry = (self.low >> 32) as u8;
        if self.low < 0xFF00_0000 || carry == 1 {
            if self.started {
                self.bytes.push(self.pending.wrapping_add(carry));
            }
            for _ in 0..self.pending_ones {
                self.bytes.push(0xFF_u8.wrapping_add(carry));
            }
            self.pending_ones = 0;
            self.pending = (self.low >> 24) as u8;
            self.started = true;
        } else {
            self.pending_ones += 1;
        }
        self.low = (self.low & 0x00FF_FFFF) << 8;
    }

    /// Returns the encoded bytes without trailing zeros, since a decoder reads zeros past the end.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        // Any value in [low, low + range) decodes correctly; the one with the most trailing zero bits is the shortest.
        let high = self.low + u64::from(self.range) - 1;
        let shared = (0..33).rev().find(|&k| (high >> k) << k >= self.low).unwrap_or(0);
        self.low = (high >> shared) << shared;
        for _ in 0..5 {
            self.shift();
        }
        while self.bytes.last() == Some(&0) {
            self.bytes.pop();
        }
        self.bytes
    }
}

impl BitCoder for Encoder {
    const DECODES: bool = false;

    #[inline]
    fn bit(&mut self, bit: bool, p1: u32) -> bool {
        let bound = (self.range >> 16) * p1;
        if bit {
            self.range = bound;
        } else {
            self.low += u64::from(bound);
            self.range -= bound;
        }
        while self.range < 1 << 24 {
            self.range <<= 8;
            self.shift();
        }
        bit
    }
}

/// Range decoder: reads binary decisions from bytes, and zeros past their end.
#[derive(Clone, Debug)]
pub(crate) struct Decoder<'a> {
    bytes: &'a [u8],
    position: usize,
    range: u32,
    code: u32,
}

impl<'a> Decoder<'a> {
    /// Starts range decoding of `bytes`.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { bytes, position: 0, range: u32::MAX, code: 0 };
        for _ in 0..4 {
            decoder.code = decoder.code << 8 | decoder.next();
        }
        decoder
    }

    fn next(&mut self) -> u32 {
        let byte = self.bytes.get(self.position).copied().unwrap_or(0);
        self.position += 1;
        u32::from(byte)
    }

    /// Returns the number of bytes on which the decisions decoded so far depend, including zeros past the end.
    pub(crate) fn position(&self) -> usize {
        self.position
    }

    /// Returns true if the decoder has read all bytes.
    #[cfg(test)]
    pub(crate) fn is_exhausted(&self) -> bool {
        self.position >= self.bytes.len()
    }
}

impl BitCoder for Decoder<'_> {
    const DECODES: bool = true;

    #[inline]
    fn bit(&mut self, _bit: bool, p1: u32) -> bool {
        let bound = (self.range >> 16) * p1;
        let bit = self.code < bound;
        if bit {
            self.range = bound;
        } else {
            self.code -= bound;
            self.range -= bound;
        }
        while self.range < 1 << 24 {
            self.range <<= 8;
            self.code = self.code << 8 | self.next();
        }
        bit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::drawn::list;
    use arbtest::arbtest;

    fn round_trip(decisions: &[(bool, u32)]) -> usize {
        let mut encoder = Encoder::default();
        for &(bit, p1) in decisions {
            encoder.bit(bit, p1);
        }
        let bytes = encoder.finish();
        let mut decoder = Decoder::new(&bytes);
        for (i, &(bit, p1)) in decisions.iter().enumerate() {
            assert_eq!(decoder.bit(false, p1), bit, "decision {i}");
        }
        assert!(decoder.is_exhausted());
        bytes.len()
    }

    #[test]
    fn decisions_round_trip() {
        arbtest(|u| {
            round_trip(&list(u, 0..=1999, |u| Ok((u.arbitrary()?, u.int_in_range(1..=65_535)?)))?);
            Ok(())
        });
    }

    #[test]
    fn decisions_depend_on_the_bytes_up_to_the_position_only() {
        let decisions: Vec<_> =
            (0..3000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 28 == 0, 4096 + i * 7)).collect();
        let mut encoder = Encoder::default();
        for &(bit, p1) in &decisions {
            encoder.bit(bit, p1);
        }
        let bytes = encoder.finish();
        let mut decoder = Decoder::new(&bytes);
        for count in 0..decisions.len() {
            if count % 100 == 0 {
                let end = decoder.position().min(bytes.len());
                for beyond in [0, 0xFF] {
                    let mut cut = bytes[..end].to_vec();
                    cut.extend([beyond; 8]);
                    let mut again = Decoder::new(&cut);
                    for &(bit, p1) in &decisions[..count] {
                        assert_eq!(again.bit(false, p1), bit);
                    }
                }
            }
            decoder.bit(false, decisions[count].1);
        }
    }

    #[test]
    fn carries_reach_through_runs_of_ones() {
        for p1 in [1, 2, 32768, 65534, 65535] {
            for period in [1, 2, 3, 7, 1000] {
                let decisions: Vec<_> = (0..5000).map(|i| (i % period == 0, p1)).collect();
                round_trip(&decisions);
            }
        }
    }

    #[test]
    fn the_cost_is_the_entropy() {
        assert_eq!(round_trip(&[]), 0);
        let sure: Vec<_> = (0..100_000).map(|_| (true, 65535)).collect();
        assert!(round_trip(&sure) <= 2);
        let even: Vec<_> = (0..8000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 31 == 1, 32768)).collect();
        assert!(round_trip(&even) <= 1001);
    }

    #[test]
    fn raw_bits_round_trip() {
        let mut encoder = Encoder::default();
        encoder.bits(0xDEAD_BEEF, 32);
        encoder.bits(5, 3);
        let bytes = encoder.finish();
        let mut decoder = Decoder::new(&bytes);
        assert_eq!((decoder.bits(0, 32), decoder.bits(0, 3)), (0xDEAD_BEEF, 5));
    }
}
