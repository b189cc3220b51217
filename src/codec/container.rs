//! The container: magic, version, then chunks, each with its length and checksum.
//!
//! ```text
//! offset  size    field
//! 0       4       magic 89 57 4C 4D ("\x89WLM")
//! 4       1       version, 1
//! 5       …       chunks, in this order, each at most once; H and E always:
//!                   H header, C classes, B basis, P pyramid, Q coefficients, R corrections, X exact samples, M metadata, E end
//!
//! chunk:  1       kind, the letter above
//!         varint  length of the payload in bytes (LEB128, shortest form; 0 for E)
//!         length  payload
//!         4       checksum: the first 4 bytes of the BLAKE3 hash of kind, length and payload as they stand
//! ```
//! E is the last byte sequence of the file: nothing may follow it. Which of C, B, P, Q, R and X are there follows from the header.
//! The file's BLAKE3 digest is its name; the *payload digest* is that of the file without its M chunk.

use super::bytes::{Reader, Writer};
use super::error::CodecError;

/// The first bytes of every material.
pub const MAGIC: [u8; 4] = [0x89, b'W', b'L', b'M'];
/// The version written and read.
pub const VERSION: u8 = 1;

/// The kinds of chunk, in the order of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChunkKind {
    /// What the material is, and its error report.
    Header,
    /// Positive, negative, zero or masked.
    Classes,
    /// The data's own spectral basis.
    Basis,
    /// Triangles predicted level by level.
    Pyramid,
    /// Quantised or exact coefficients.
    Coefficients,
    /// The second layer of a pointwise guarantee.
    Corrections,
    /// Lossless samples.
    Exact,
    /// A JSON object of provenance and other free text.
    Metadata,
    /// The end of the file.
    End,
}

impl ChunkKind {
    const ALL: [Self; 9] = [
        Self::Header,
        Self::Classes,
        Self::Basis,
        Self::Pyramid,
        Self::Coefficients,
        Self::Corrections,
        Self::Exact,
        Self::Metadata,
        Self::End,
    ];

    fn letter(self) -> u8 {
        match self {
            Self::Header => b'H',
            Self::Classes => b'C',
            Self::Basis => b'B',
            Self::Pyramid => b'P',
            Self::Coefficients => b'Q',
            Self::Corrections => b'R',
            Self::Exact => b'X',
            Self::Metadata => b'M',
            Self::End => b'E',
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Header => "header",
            Self::Classes => "classes",
            Self::Basis => "basis",
            Self::Pyramid => "pyramid",
            Self::Coefficients => "coefficients",
            Self::Corrections => "corrections",
            Self::Exact => "exact",
            Self::Metadata => "metadata",
            Self::End => "end",
        }
    }
}

/// One chunk of a file.
#[derive(Clone, Copy, Debug)]
pub struct Chunk<'a> {
    /// Its kind.
    pub kind: ChunkKind,
    /// Its payload.
    pub payload: &'a [u8],
    /// The offset of the payload in the file.
    pub offset: usize,
    /// The offsets of the whole chunk in the file.
    span: (usize, usize),
}

impl<'a> Chunk<'a> {
    /// Reads the payload's fields.
    pub fn reader(&self) -> Reader<'a> {
        Reader::new(self.payload, self.offset)
    }
}

/// A file taken apart, every checksum verified.
#[derive(Clone, Debug)]
pub struct Container<'a> {
    bytes: &'a [u8],
    chunks: Vec<Chunk<'a>>,
}

/// Puts a file together; `chunks` in the order of their kinds, without the end.
pub fn write_container(chunks: &[(ChunkKind, Vec<u8>)]) -> Vec<u8> {
    let mut w = Writer::default();
    w.raw(&MAGIC);
    w.u8(VERSION);
    for (kind, payload) in chunks {
        write_chunk(&mut w, *kind, payload);
    }
    write_chunk(&mut w, ChunkKind::End, &[]);
    w.into_bytes()
}

fn write_chunk(w: &mut Writer, kind: ChunkKind, payload: &[u8]) {
    let mut chunk = Writer::default();
    chunk.u8(kind.letter());
    chunk.varint(payload.len() as u64);
    chunk.raw(payload);
    let chunk = chunk.into_bytes();
    w.raw(&chunk);
    w.raw(&checksum(&chunk));
}

fn checksum(chunk: &[u8]) -> [u8; 4] {
    let hash = blake3::hash(chunk);
    let [a, b, c, d, ..] = *hash.as_bytes();
    [a, b, c, d]
}

impl<'a> Container<'a> {
    /// Takes `bytes` apart and verifies every checksum.
    pub fn read(bytes: &'a [u8]) -> Result<Self, CodecError> {
        let mut r = Reader::new(bytes, 0);
        if r.take(MAGIC.len(), "magic").ok() != Some(&MAGIC) {
            return Err(CodecError::Magic);
        }
        let found = r.u8("version")?;
        if found != VERSION {
            return Err(CodecError::Version { found, expected: VERSION });
        }
        let mut chunks: Vec<Chunk<'a>> = Vec::new();
        loop {
            let chunk = read_chunk(&mut r)?;
            let in_order = match chunks.last() {
                None => chunk.kind == ChunkKind::Header,
                Some(last) => chunk.kind > last.kind,
            };
            if !in_order {
                let reason = format!("the {} chunk is out of order", chunk.kind.name());
                return Err(CodecError::Malformed { at: chunk.span.0, reason });
            }
            chunks.push(chunk);
            if chunk.kind == ChunkKind::End {
                break;
            }
        }
        r.end("file")?;
        Ok(Self { bytes, chunks })
    }

    /// The chunk of this kind, if there is one.
    pub fn get(&self, kind: ChunkKind) -> Option<Chunk<'a>> {
        self.chunks.iter().find(|chunk| chunk.kind == kind).copied()
    }

    /// The chunk of this kind, or an error that names it.
    pub fn require(&self, kind: ChunkKind) -> Result<Chunk<'a>, CodecError> {
        self.get(kind).ok_or_else(|| CodecError::Malformed {
            at: self.bytes.len(),
            reason: format!("there is no {} chunk", kind.name()),
        })
    }

    /// The BLAKE3 digest of the file without its metadata chunk.
    pub fn payload_digest(&self) -> blake3::Hash {
        let (start, end) = self.get(ChunkKind::Metadata).map_or((0, 0), |chunk| chunk.span);
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.bytes[..start]);
        hasher.update(&self.bytes[end..]);
        hasher.finalize()
    }
}

fn read_chunk<'a>(r: &mut Reader<'a>) -> Result<Chunk<'a>, CodecError> {
    let start = r.offset();
    let letter = r.u8("chunk kind")?;
    let kind = ChunkKind::ALL.into_iter().find(|kind| kind.letter() == letter).ok_or_else(|| {
        CodecError::Malformed { at: start, reason: format!("chunk kind {letter:#04x}, expected one of HCBQRXME") }
    })?;
    let length = r.size(usize::MAX >> 1, "chunk length")?;
    if kind == ChunkKind::End && length != 0 {
        return Err(r.malformed(format!("the end chunk is {length} bytes long, expected 0")));
    }
    let offset = r.offset();
    let payload = r.take(length, "chunk payload")?;
    let covered = r.since(start);
    let stored = r.take(4, "chunk checksum")?;
    if stored != checksum(covered) {
        return Err(CodecError::Checksum { at: start, chunk: kind.name() });
    }
    Ok(Chunk { kind, payload, offset, span: (start, r.offset()) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(metadata: bool) -> Vec<u8> {
        let mut chunks = vec![(ChunkKind::Header, vec![1, 2, 3]), (ChunkKind::Coefficients, vec![7; 200])];
        if metadata {
            chunks.push((ChunkKind::Metadata, b"{}".to_vec()));
        }
        write_container(&chunks)
    }

    #[test]
    fn chunks_round_trip() {
        let bytes = sample(true);
        let container = Container::read(&bytes).unwrap();
        assert_eq!(container.require(ChunkKind::Coefficients).unwrap().payload, &[7; 200]);
        assert!(container.get(ChunkKind::Exact).is_none());
        assert!(matches!(container.require(ChunkKind::Exact), Err(CodecError::Malformed { .. })));
    }

    #[test]
    fn the_payload_digest_ignores_metadata() {
        let (with, without) = (sample(true), sample(false));
        assert_eq!(Container::read(&with).unwrap().payload_digest(), blake3::hash(&without));
        assert_eq!(Container::read(&without).unwrap().payload_digest(), blake3::hash(&without));
    }

    #[test]
    fn every_truncation_and_every_flipped_bit_is_an_error() {
        let bytes = sample(true);
        for end in 0..bytes.len() {
            assert!(Container::read(&bytes[..end]).is_err(), "truncated at {end}");
        }
        for i in 0..bytes.len() {
            for bit in 0..8 {
                let mut flipped = bytes.clone();
                flipped[i] ^= 1 << bit;
                assert!(Container::read(&flipped).is_err(), "byte {i} bit {bit}");
            }
        }
        let mut longer = bytes;
        longer.push(0);
        assert!(matches!(Container::read(&longer), Err(CodecError::Malformed { .. })));
    }

    #[test]
    fn later_versions_are_refused_by_number() {
        let mut bytes = sample(false);
        bytes[4] = 2;
        assert_eq!(Container::read(&bytes).unwrap_err(), CodecError::Version { found: 2, expected: 1 });
        assert_eq!(Container::read(b"PK\x03\x04").unwrap_err(), CodecError::Magic);
    }
}
