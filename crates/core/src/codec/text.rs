//! Byte form of text: each bit is predicted from the one, two and four bytes before, by models primed with typical
//! metadata.
//!
//! ```text
//! text   varint length in bytes, then the range-coded bytes, high bit first, padded with zeros to at least
//!        length / 1024 bytes, so that a few bytes cannot announce a long text
//! ```
//! Metadata are short, and untrained models would make the first bytes expensive. The models therefore start as if a
//! typical text had been coded before. That text is part of the format.

use super::bytes::{Reader, Writer};
use super::error::CodecError;
use super::model::{INPUTS, Model};
use super::range::{BitCoder, Decoder, Encoder};

/// Typical metadata with which the text model is trained before coding. They are part of the format: any change changes
/// the coded bytes.
pub(crate) const TYPICAL: &str = concat!(
    r#"{"generator":"wavelume 0.1.0","labels":{"0":["1","2","3"]},"request":{"basis":"auto","metadata":true,"policy":"r"#,
    r#"d","target":{"max_relative_error":0.05}},"source":{"content_digest":"b3-6e340b9cffb37a989ca544e6bb780a2c78901d3f"#,
    r#"b33738768511a30617afa01d","dialect":"LM-63-2002, type C, no symmetry","format":"spectral-table","metadata":{"nam"#,
    r#"e":"","description":"","manufacturer":"","date":"","notes":""},"notes":["the header names no quantity, taken as "#,
    r#"spectrum in relative values","no unit stated, taken as 1/sr"],"spectrum_digest":"b3-4bf5122f344554c53bde2ebb8cd2"#,
    r#"b7e3d1600ad631c385a5d7cce23c7785459a"}}{"generator":"wavelume 0.1.0","request":{"basis":"auto","metadata":true,""#,
    r#"policy":"rd","target":{"er_l2":0.01}},"source":{"content_digest":"b3-dbc1b4c900ffe48d575b5da5c638040125f65db0fe3"#,
    r#"e24494b76ea986457d986","dialect":"","format":"npy","metadata":{},"notes":[],"spectrum_digest":null}}"#,
);
/// Largest ratio of text bytes to coded bytes, which bounds the work that a short input can cause. Raising it allows
/// longer texts from fewer bytes.
const MOST_PER_BYTE: usize = 1 << 10;
/// Number of adaptive probabilities for contexts of each length (one, two and four bytes), which are found by a hash; a
/// power of two.
const CONTEXTS: usize = 1 << 16;

/// Context-mixing coder of text: adaptive probabilities, and the bytes coded before.
struct TextCoder {
    model: Model,
    /// Last four bytes of the text coded before, the most recent one lowest.
    before: u32,
}

impl TextCoder {
    fn new(typical: &str) -> Self {
        let mut coder = Self { model: Model::new(INPUTS * CONTEXTS, 8), before: 0 };
        for byte in typical.bytes() {
            coder.code(&mut Listener, byte);
        }
        coder
    }

    fn code<C: BitCoder>(&mut self, coder: &mut C, byte: u8) -> u8 {
        let orders = [self.before & 0xFF, self.before & 0xFFFF, self.before];
        let mut node = 1_u32;
        for shift in (0..8).rev() {
            let slots = std::array::from_fn(|k| k * CONTEXTS + slot(orders[k].wrapping_add(k as u32), node));
            node = node << 1 | u32::from(self.model.code(coder, byte >> shift & 1 == 1, slots, shift));
        }
        self.before = self.before << 8 | (node & 0xFF);
        node as u8
    }
}

/// Returns the number of the adaptive probability for the next bit of a byte; `context` hashes preceding bytes, `node`
/// the bits already coded.
fn slot(context: u32, node: u32) -> usize {
    let mixed = (context.wrapping_mul(0x9E37_79B1) ^ node.wrapping_mul(0x85EB_CA77)).wrapping_mul(0xC2B2_AE3D);
    (mixed >> 16) as usize % CONTEXTS
}

/// Coder that trains the adaptive probabilities and discards the coded decisions.
struct Listener;

impl BitCoder for Listener {
    const DECODES: bool = false;

    fn bit(&mut self, bit: bool, _p1: u32) -> bool {
        bit
    }
}

/// Encodes `text`, by a model trained with the text `typical` first.
pub(crate) fn write_text(typical: &str, text: &str) -> Vec<u8> {
    let mut w = Writer::default();
    w.varint(text.len() as u64);
    let mut models = TextCoder::new(typical);
    let mut encoder = Encoder::default();
    for byte in text.bytes() {
        models.code(&mut encoder, byte);
    }
    let mut coded = encoder.finish();
    coded.resize(coded.len().max(text.len() / MOST_PER_BYTE), 0);
    w.raw(&coded);
    w.into_bytes()
}

/// Decodes a text of at most `limit` bytes from the remaining bytes of `r`, by a model trained with the text `typical`
/// first.
pub(crate) fn read_text(typical: &str, r: &mut Reader<'_>, limit: usize) -> Result<String, CodecError> {
    let length = r.size(limit, "length of the metadata")?;
    let coded = r.take(r.remaining(), "metadata")?;
    let least = length / MOST_PER_BYTE;
    if coded.len() < least {
        let text =
            format!("{length} bytes of metadata are coded in {} bytes, expected at least {least} bytes", coded.len());
        return Err(r.malformed(text));
    }
    let mut models = TextCoder::new(typical);
    let mut decoder = Decoder::new(coded);
    let mut bytes = Vec::with_capacity(length);
    for _ in 0..length {
        bytes.push(models.code(&mut decoder, 0));
    }
    let unused = coded.get(decoder.position()..).unwrap_or_default();
    if !unused.is_empty() && (coded.len() > least || unused.iter().any(|&byte| byte != 0)) {
        return Err(r.malformed("bytes are left after the end of the metadata"));
    }
    String::from_utf8(bytes).map_err(|_| r.malformed("metadata is no UTF-8 text"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::drawn::{any_list, text};
    use arbtest::arbtest;

    const LIMIT: usize = 1 << 16;

    fn write(text: &str) -> Vec<u8> {
        write_text(TYPICAL, text)
    }

    fn read(bytes: &[u8]) -> Result<String, CodecError> {
        read_text(TYPICAL, &mut Reader::new(bytes, 0), LIMIT)
    }

    #[test]
    fn metadata_is_short() {
        let digest = "4f5b0c7a9d1e2f3a4b5c6d7e8f9a0b1c2d3e4f5a6b7c8d9e0f1a2b3c4d5e6f70";
        let text = format!(
            r#"{{"generator":"wavelume 0.1.0","request":{{"basis":"auto","metadata":true,"policy":"rd","target":{{"er_l2":0.01}}}},"source":{{"content_digest":"b3-{digest}","dialect":"float32","format":"npy","metadata":{{"note":"red plastic"}},"notes":[],"spectrum_digest":null}}}}"#
        );
        let bytes = write(&text);
        assert_eq!(read(&bytes).unwrap(), text);
        // The digest alone is 32 incompressible bytes.
        assert!(bytes.len() < 90, "{} of {}", bytes.len(), text.len());
        assert!(write("{}").len() <= 3);
        let prose = "Goniometric measurement of a painted sample, taken in the dark. ".repeat(20);
        assert!(write(&prose).len() * 10 < prose.len());
    }

    #[test]
    fn lengths_over_the_limit_and_bytes_after_the_end_are_refused() {
        let long = write(&"x".repeat(LIMIT + 1));
        assert!(matches!(read(&long), Err(CodecError::Malformed { .. })));
        let mut huge = Writer::default();
        huge.varint(u64::MAX);
        assert!(matches!(read(&huge.into_bytes()), Err(CodecError::Malformed { .. })));
        let mut longer = write("some text");
        longer.extend([1; 8]);
        assert!(matches!(read(&longer), Err(CodecError::Malformed { .. })));
        assert!(matches!(read(&[]), Err(CodecError::Truncated { .. })));
    }

    #[test]
    fn a_few_bytes_do_not_announce_a_long_text() {
        // A highly repetitive text is padded to the least number of bytes for its length.
        let text = " ".repeat(LIMIT);
        let bytes = write(&text);
        assert_eq!(bytes.len(), 3 + LIMIT / MOST_PER_BYTE);
        assert_eq!(bytes.last(), Some(&0));
        assert_eq!(read(&bytes).unwrap(), text);
        assert!(matches!(read(&bytes[..bytes.len() - 1]), Err(CodecError::Malformed { .. })));
        assert!(read(&[bytes.as_slice(), &[0]].concat()).is_err(), "no more than that");
        let mut other = bytes;
        *other.last_mut().unwrap() = 1;
        assert!(read(&other).is_err(), "the rest are zeros");
        let mut few = Writer::default();
        few.varint(LIMIT as u64);
        few.raw(&[7; 63]);
        assert!(matches!(read(&few.into_bytes()), Err(CodecError::Malformed { .. })));
    }

    #[test]
    fn any_text_round_trips() {
        arbtest(|u| {
            let text = text(u, 200)?;
            assert_eq!(read(&write(&text)).unwrap(), text);
            Ok(())
        });
    }

    #[test]
    fn any_bytes_are_a_text_or_an_error() {
        arbtest(|u| {
            let bytes: Vec<u8> = any_list(u, 0..=199)?;
            let _ = read(&bytes);
            Ok(())
        });
    }
}
