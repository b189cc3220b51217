//! Checksums made right again, so that mutations get behind them.

use wavelume::compress::{DecodeError, inspect};

/// Bytes of a checksum.
const CHECKSUM: usize = 4;

/// `bytes` with the checksum of every chunk that the decoder reaches made that of its content.
///
/// The decoder says itself which checksum is wrong, so nothing of the container is known here but that of one chunk.
pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut last = None;
    while let Err(DecodeError::Checksum { at, .. }) = inspect(&bytes) {
        assert!(last < Some(at), "the checksum at {at} is not made as it is here");
        last = Some(at);
        seal_chunk(&mut bytes, at);
    }
    bytes
}

/// The chunk at `at`: kind, varint length, payload, then the checksum of all these.
fn seal_chunk(bytes: &mut [u8], at: usize) {
    let mut length = 0_usize;
    let mut end = at + 1;
    for shift in (0..).step_by(7) {
        let byte = bytes[end];
        end += 1;
        length |= usize::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            break;
        }
    }
    end += length;
    let hash = blake3::hash(&bytes[at..end]);
    bytes[end..end + CHECKSUM].copy_from_slice(&hash.as_bytes()[..CHECKSUM]);
}
