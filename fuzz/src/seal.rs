//! Corrects checksums, so that mutations pass them.

use wavelume_core::compress::{DecodeError, inspect};

/// Length of a checksum in bytes.
const CHECKSUM: usize = 4;

/// Returns `bytes` with corrected checksums for all chunks that the decoder reaches.
///
/// The decoder reports which checksum is wrong, so only the layout of a single chunk is known here.
pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut last = None;
    while let Err(DecodeError::Checksum { at, chunk }) = inspect(&bytes) {
        assert!(last < Some(at), "the checksum of the {chunk} at {at} is not made as it is here");
        last = Some(at);
        seal_chunk(&mut bytes, at, letter(chunk));
    }
    bytes
}

/// Letter that a checksum covers in front of its chunk.
fn letter(chunk: &str) -> u8 {
    match chunk {
        "header chunk" => b'H',
        "interpolation chunk" => b'V',
        "lobe chunk" => b'A',
        "classes chunk" => b'C',
        "wide classes chunk" => b'D',
        "basis chunk" => b'B',
        "pyramid chunk" => b'P',
        "grid chunk" => b'G',
        "coefficients chunk" => b'Q',
        "light chunk" => b'L',
        "corrections chunk" => b'R',
        "exact chunk" => b'X',
        "metadata chunk" => b'M',
        "provenance chunk" => b'N',
        other => panic!("the {other} is unknown here"),
    }
}

/// Corrects the chunk at `at`: varint length, payload, then the checksum of the letter and both.
fn seal_chunk(bytes: &mut [u8], at: usize, letter: u8) {
    let mut length = 0_usize;
    let mut end = at;
    for shift in (0..).step_by(7) {
        let byte = bytes[end];
        end += 1;
        length |= usize::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            break;
        }
    }
    end += length;
    let mut hasher = blake3::Hasher::new();
    hasher.update(&[letter]).update(&bytes[at..end]);
    bytes[end..end + CHECKSUM].copy_from_slice(&hasher.finalize().as_bytes()[..CHECKSUM]);
}
