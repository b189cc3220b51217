//! Model and blocks coded as separate streams, so that one block can be decoded without the others.
//!
//! ```text
//! streams   varint length of each stream: that of the model, if there is one; one for each representative, in order,
//!           if there is a pyramid behind the model; then the streams in the same order, to the end of the chunk
//! ```
//! Each stream is range-coded independently: its adaptive models start afresh, and its contexts lie within its own
//! block.

use crate::codec::{CodecError, Decoder, Reader, Writer};

/// Byte streams of a pyramid chunk whose blocks (incoming directions) can be decoded one by one: that of the scattering
/// model, and one for each block.
pub(super) struct Streams<'a> {
    model: &'a [u8],
    blocks: Vec<&'a [u8]>,
}

impl<'a> Streams<'a> {
    pub(super) fn write(model: Option<&[u8]>, blocks: &[Vec<u8>]) -> Vec<u8> {
        let mut w = Writer::default();
        let streams = || model.into_iter().chain(blocks.iter().map(Vec::as_slice));
        streams().for_each(|stream| w.varint(stream.len() as u64));
        streams().for_each(|stream| w.raw(stream));
        w.into_bytes()
    }

    /// Reads the byte streams of `blocks` blocks (incoming directions), after that of the scattering model if
    /// `has_model`.
    pub(super) fn read(r: &mut Reader<'a>, has_model: bool, blocks: usize) -> Result<Self, CodecError> {
        let mut lengths = Vec::new();
        for _ in 0..usize::from(has_model) + blocks {
            lengths.push(r.size(usize::MAX >> 1, "length of a stream")?);
        }
        let mut streams = lengths.into_iter().map(|length| r.take(length, "stream of a block"));
        let model = if has_model { streams.next().transpose()?.unwrap_or_default() } else { &[] };
        let blocks = streams.collect::<Result<_, _>>()?;
        r.end("streams of the blocks")?;
        Ok(Self { model, blocks })
    }

    pub(super) fn model(&self) -> &'a [u8] {
        self.model
    }

    /// Decoder of the byte stream of coded block (incoming direction) `k`.
    pub(super) fn block(&self, k: usize) -> Decoder<'a> {
        Decoder::new(self.blocks.get(k).copied().unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_read_as_they_were_written_and_any_other_length_is_an_error() {
        let blocks = [vec![1_u8; 3], Vec::new(), vec![2; 200]];
        for model in [None, Some(&[7_u8, 8][..])] {
            let bytes = Streams::write(model, &blocks);
            let lengths = if model.is_some() { 5 } else { 4 };
            assert_eq!(bytes.len(), lengths + model.map_or(0, <[u8]>::len) + 203);
            let read = |bytes: &[u8]| {
                let streams = Streams::read(&mut Reader::new(bytes, 0), model.is_some(), 3)?;
                Ok::<_, CodecError>((streams.model.to_vec(), streams.blocks.concat()))
            };
            assert_eq!(read(&bytes).unwrap(), (model.unwrap_or_default().to_vec(), blocks.concat()));
            for end in 0..bytes.len() {
                assert!(matches!(read(&bytes[..end]), Err(CodecError::Truncated { .. })), "{end}");
            }
            assert!(matches!(read(&[bytes, vec![0]].concat()), Err(CodecError::Malformed { .. })));
        }
        let huge = [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F, 0];
        assert!(Streams::read(&mut Reader::new(&huge, 0), false, 2).is_err());
    }
}
