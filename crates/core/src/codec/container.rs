//! Container format of a material: magic, version, then chunks, each with its length and checksum.
//!
//! ```text
//! offset  size    field
//! 0       4       magic 89 57 4C 4D ("\x89WLM")
//! 4       1       version, 1
//! 5       …       the header chunk H; then the chunks that it announces, of C classes, B basis, P pyramid, G grid,
//!                 Q coefficients, L light, R corrections and X exact samples, in this order; then the optional
//!                 metadata chunk M
//!
//! chunk:  varint  length of the payload in bytes (LEB128, shortest form)
//!         length  payload
//!         4       checksum: the first 4 bytes of the BLAKE3 hash of the letter above, the length and the payload
//! ```
//! No bytes follow the last chunk. A truncated file is an error, with one exception: a file cut exactly before M is the
//! material without its metadata. The BLAKE3 digest of a file is its name. The *payload digest* is that of the file
//! without its M chunk.
//!
//! A *prefix* is the beginning of a file. Complete chunks are verified; the truncated one cannot be. A header may state
//! the length of a chunk. Then a damaged length field in front of the chunk cannot make a whole file pass for a prefix.

use super::bytes::{Reader, Writer};
use super::error::CodecError;

/// First four bytes of every compressed material file.
pub(crate) const MAGIC: [u8; 4] = [0x89, b'W', b'L', b'M'];
/// Version of the file format that this program writes and reads.
pub(crate) const VERSION: u8 = 1;
/// Length of the checksum of a chunk in bytes.
const CHECKSUM: usize = 4;

/// Kinds of chunk (section of a compressed file), in their order in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ChunkKind {
    /// Description of the material: axes, settings and error report.
    Header,
    /// Rule for interpolation between incoming directions.
    Between,
    /// Analytic reflection lobe that is added to the stored samples.
    Lobe,
    /// Class of each sample: positive, negative, zero or masked.
    Classes,
    /// Class of each sample on grids of angles, coded in wide contexts.
    WideClasses,
    /// Spectral basis computed from the data (principal components).
    Basis,
    /// Samples on triangles of the sphere, predicted from one subdivision level to the next.
    Pyramid,
    /// Samples on grids of angles, predicted in steps that halve the grid spacing.
    Grid,
    /// Wavelet coefficients of the samples or of their logarithms, quantised or exact.
    Coefficients,
    /// Corrections that keep the light (albedo or flux) of each incoming direction and wavelength within an error
    /// bound. Light is the integral of the samples over the outgoing directions.
    Light,
    /// Corrections of single samples that enforce a pointwise error bound.
    Corrections,
    /// Samples stored without loss.
    Exact,
    /// Metadata, such as the origin of the data: a JSON object.
    Metadata,
    /// Metadata of measurements on grids of angles: a JSON object. Each hash digest in it is stored as 32 raw bytes
    /// instead of hexadecimal digits.
    Provenance,
}

impl ChunkKind {
    /// Returns true for chunks of metadata, which end a file and contain no samples.
    fn is_last(self) -> bool {
        matches!(self, Self::Metadata | Self::Provenance)
    }

    fn letter(self) -> u8 {
        match self {
            Self::Header => b'H',
            Self::Between => b'V',
            Self::Lobe => b'A',
            Self::Classes => b'C',
            Self::WideClasses => b'D',
            Self::Basis => b'B',
            Self::Pyramid => b'P',
            Self::Grid => b'G',
            Self::Coefficients => b'Q',
            Self::Light => b'L',
            Self::Corrections => b'R',
            Self::Exact => b'X',
            Self::Metadata => b'M',
            Self::Provenance => b'N',
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Header => "header chunk",
            Self::Between => "interpolation chunk",
            Self::Lobe => "lobe chunk",
            Self::Classes => "classes chunk",
            Self::WideClasses => "wide classes chunk",
            Self::Basis => "basis chunk",
            Self::Pyramid => "pyramid chunk",
            Self::Grid => "grid chunk",
            Self::Coefficients => "coefficients chunk",
            Self::Light => "light chunk",
            Self::Corrections => "corrections chunk",
            Self::Exact => "exact chunk",
            Self::Metadata => "metadata chunk",
            Self::Provenance => "provenance chunk",
        }
    }
}

/// Chunk (section of a file) that the file header announces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Announced {
    /// Kind of the chunk that the file header announces.
    pub kind: ChunkKind,
    /// Length of the chunk's content in bytes, if the file header states it.
    pub length: Option<usize>,
}

/// One chunk (section) of a compressed file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chunk<'a> {
    /// Kind of this section of a compressed file, such as header or coefficients.
    pub kind: ChunkKind,
    /// Content of the chunk; only its beginning if the file is truncated there.
    pub payload: &'a [u8],
    /// Length of the complete content of the chunk in bytes.
    pub length: usize,
    /// Offset in the file of the chunk's content, in bytes.
    pub offset: usize,
    /// Offsets in the file of the start and the end of the whole chunk, in bytes.
    span: (usize, usize),
}

impl<'a> Chunk<'a> {
    /// Returns a reader of the fields inside the chunk.
    pub(crate) fn reader(&self) -> Reader<'a> {
        Reader::new(self.payload, self.offset)
    }

    /// Returns the offset in the file of the end of the chunk, which lies beyond the available bytes if the chunk is
    /// truncated.
    pub(crate) fn end(&self) -> usize {
        self.span.1
    }
}

/// Compressed file, or the first bytes of one, split into its chunks (sections). The checksums of all complete chunks
/// are verified.
#[derive(Clone, Debug)]
pub(crate) struct Container<'a> {
    bytes: &'a [u8],
    chunks: Vec<Chunk<'a>>,
}

/// Returns the bytes of one chunk: length, content, checksum.
pub(crate) fn write_chunk(kind: ChunkKind, payload: &[u8]) -> Vec<u8> {
    let mut chunk = Writer::default();
    chunk.varint(payload.len() as u64);
    chunk.raw(payload);
    let mut chunk = chunk.into_bytes();
    chunk.extend(checksum(kind, &chunk));
    chunk
}

/// Returns the bytes of a file made of `chunks`: the header, the chunks that it announces, then metadata.
pub(crate) fn write_container(chunks: &[(ChunkKind, Vec<u8>)]) -> Vec<u8> {
    let mut w = Writer::default();
    w.raw(&MAGIC);
    w.u8(VERSION);
    for (kind, payload) in chunks {
        w.raw(&write_chunk(*kind, payload));
    }
    w.into_bytes()
}

fn checksum(kind: ChunkKind, covered: &[u8]) -> [u8; CHECKSUM] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&[kind.letter()]);
    hasher.update(covered);
    let [a, b, c, d, ..] = *hasher.finalize().as_bytes();
    [a, b, c, d]
}

impl<'a> Container<'a> {
    /// Splits the bytes of a file into chunks and verifies every checksum. `header` reads the header and returns the
    /// chunks that it announces. The last one, the metadata, may be missing in the file.
    pub(crate) fn read<H>(
        bytes: &'a [u8],
        header: impl FnOnce(&mut Reader<'a>) -> Result<(H, Vec<Announced>), CodecError>,
    ) -> Result<(H, Self), CodecError> {
        let mut r = start(bytes)?;
        let first = read_chunk(&mut r, ChunkKind::Header.into())?;
        let (header, announced) = header(&mut first.reader())?;
        let mut chunks = vec![first];
        for chunk in announced {
            if r.remaining() > 0 || !chunk.kind.is_last() {
                chunks.push(read_chunk(&mut r, chunk)?);
            }
        }
        r.end("file")?;
        Ok((header, Self { bytes, chunks }))
    }

    /// Splits the first bytes of a file into chunks. The header must be complete, the last chunk may be truncated.
    pub(crate) fn prefix<H>(
        bytes: &'a [u8],
        header: impl FnOnce(&mut Reader<'a>) -> Result<(H, Vec<Announced>), CodecError>,
    ) -> Result<(H, Self), CodecError> {
        let mut r = start(bytes)?;
        let first = read_chunk(&mut r, ChunkKind::Header.into())?;
        let (header, announced) = header(&mut first.reader())?;
        let mut chunks = vec![first];
        for chunk in announced {
            let Some(cut) = cut_chunk(&r, chunk)? else {
                chunks.push(read_chunk(&mut r, chunk)?);
                if r.remaining() == 0 {
                    break;
                }
                continue;
            };
            chunks.extend(cut);
            return Ok((header, Self { bytes, chunks }));
        }
        r.end("file")?;
        Ok((header, Self { bytes, chunks }))
    }

    /// Returns the chunk of the given kind, if present.
    pub(crate) fn get(&self, kind: ChunkKind) -> Option<Chunk<'a>> {
        self.chunks.iter().find(|chunk| chunk.kind == kind).copied()
    }

    /// Returns the bytes of the file with the content of all chunks of `kind` replaced.
    pub(crate) fn replaced(&self, kind: ChunkKind, payload: &[u8]) -> Vec<u8> {
        let payload_of = |chunk: &Chunk<'_>| if chunk.kind == kind { payload } else { chunk.payload }.to_vec();
        let chunks: Vec<_> = self.chunks.iter().map(|chunk| (chunk.kind, payload_of(chunk))).collect();
        write_container(&chunks)
    }

    /// Returns the chunk of the given kind, or an error that names the missing chunk.
    pub(crate) fn require(&self, kind: ChunkKind) -> Result<Chunk<'a>, CodecError> {
        self.get(kind).ok_or(CodecError::Truncated { at: self.bytes.len(), expected: kind.name() })
    }

    /// Returns the offset in the file at which the metadata chunk starts or would start. In a truncated file it is the
    /// end of the last chunk.
    pub(crate) fn payload_end(&self) -> usize {
        let before = self.chunks.iter().rfind(|chunk| !chunk.kind.is_last());
        before.map_or(0, Chunk::end)
    }

    /// Returns the BLAKE3 digest of the file's bytes without its metadata chunk.
    pub(crate) fn payload_digest(&self) -> blake3::Hash {
        blake3::hash(&self.bytes[..self.payload_end().min(self.bytes.len())])
    }
}

/// Reads the magic number and the format version at the start of a file.
fn start(bytes: &[u8]) -> Result<Reader<'_>, CodecError> {
    let mut r = Reader::new(bytes, 0);
    if r.take(MAGIC.len(), "magic").ok() != Some(&MAGIC) {
        return Err(CodecError::Magic);
    }
    let found = r.u8("version")?;
    if found != VERSION {
        return Err(CodecError::Version { found, expected: VERSION });
    }
    Ok(r)
}

fn read_chunk<'a>(r: &mut Reader<'a>, announced: Announced) -> Result<Chunk<'a>, CodecError> {
    let kind = announced.kind;
    let start = r.offset();
    if r.remaining() == 0 {
        return Err(CodecError::Truncated { at: start, expected: kind.name() });
    }
    let length = announced.read_length(r)?;
    let offset = r.offset();
    let payload = r.take(length, "the rest of a chunk")?;
    let covered = r.since(start);
    let stored = r.take(CHECKSUM, "chunk checksum")?;
    if stored != checksum(kind, covered) {
        return Err(CodecError::Checksum { at: start, chunk: kind.name() });
    }
    Ok(Chunk { kind, payload, length, offset, span: (start, r.offset()) })
}

/// Returns the available part of the next chunk if the file ends within its content. The result is `Some(None)` if the
/// file ends within its length field, and `None` if the chunk is complete.
#[allow(clippy::option_option, reason = "whether it is cut, and what is left of it")]
fn cut_chunk<'a>(r: &Reader<'a>, announced: Announced) -> Result<Option<Option<Chunk<'a>>>, CodecError> {
    let mut r = r.clone();
    let start = r.offset();
    let length = match announced.read_length(&mut r) {
        Ok(length) => length,
        Err(CodecError::Truncated { .. }) => return Ok(Some(None)),
        Err(error) => return Err(error),
    };
    let offset = r.offset();
    let there = r.remaining();
    if there >= length.saturating_add(CHECKSUM) {
        return Ok(None);
    }
    let payload = r.take(length.min(there), "the rest of a chunk")?;
    let end = offset.saturating_add(length).saturating_add(CHECKSUM);
    Ok(Some(Some(Chunk { kind: announced.kind, payload, length, offset, span: (start, end) })))
}

impl From<ChunkKind> for Announced {
    fn from(kind: ChunkKind) -> Self {
        Self { kind, length: None }
    }
}

impl Announced {
    /// Reads the length in front of a chunk's content, which must agree with the one stated in the file header.
    fn read_length(self, r: &mut Reader<'_>) -> Result<usize, CodecError> {
        let length = r.size(usize::MAX >> 1, "chunk length")?;
        match self.length {
            Some(stated) if stated != length => {
                let name = self.kind.name();
                Err(r.malformed(format!("the length of the {name} is {length}, expected {stated} as in the header")))
            }
            _ => Ok(length),
        }
    }
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

    fn header(r: &mut Reader<'_>) -> Result<(u8, Vec<Announced>), CodecError> {
        Ok((r.u8("first")?, vec![ChunkKind::Coefficients.into(), ChunkKind::Metadata.into()]))
    }

    fn read(bytes: &[u8]) -> Result<Container<'_>, CodecError> {
        Container::read(bytes, header).map(|(_, container)| container)
    }

    #[test]
    fn chunks_round_trip() {
        let bytes = sample(true);
        let (first, container) = Container::read(&bytes, header).unwrap();
        assert_eq!(first, 1);
        assert_eq!(container.require(ChunkKind::Coefficients).unwrap().payload, &[7; 200]);
        assert!(container.get(ChunkKind::Exact).is_none());
        let truncated = CodecError::Truncated { at: bytes.len(), expected: "exact chunk" };
        assert_eq!(container.require(ChunkKind::Exact).unwrap_err(), truncated);
        assert_eq!(bytes.len(), 5 + (1 + 3 + 4) + (2 + 200 + 4) + (1 + 2 + 4));
    }

    #[test]
    fn the_payload_digest_ignores_metadata() {
        let (with, without) = (sample(true), sample(false));
        assert_eq!(read(&with).unwrap().payload_digest(), blake3::hash(&without));
        assert_eq!(read(&without).unwrap().payload_digest(), blake3::hash(&without));
    }

    #[test]
    fn every_truncation_but_in_front_of_metadata_and_every_flipped_bit_is_an_error() {
        let bytes = sample(true);
        let bare = sample(false);
        for end in 0..bytes.len() {
            assert_eq!(read(&bytes[..end]).is_ok(), end == bare.len(), "truncated at {end}");
        }
        for i in 0..bytes.len() {
            for bit in 0..8 {
                let mut flipped = bytes.clone();
                flipped[i] ^= 1 << bit;
                assert!(read(&flipped).is_err(), "byte {i} bit {bit}");
            }
        }
        for longer in [bytes, bare] {
            for extra in [&[0][..], &[0; 5], &[7; 300]] {
                let mut longer = longer.clone();
                longer.extend_from_slice(extra);
                assert!(read(&longer).is_err());
            }
        }
    }

    #[test]
    fn a_prefix_has_what_is_there() {
        let bytes = sample(true);
        for end in 0..=bytes.len() {
            let prefix = Container::prefix(&bytes[..end], header);
            let Ok((_, prefix)) = prefix else {
                assert!(end < 13, "{end}");
                continue;
            };
            let there = prefix.get(ChunkKind::Coefficients).map_or(0, |chunk| chunk.payload.len());
            assert_eq!(there, end.saturating_sub(15).min(200));
        }
        // A complete chunk is verified; a truncated one cannot be.
        let mut flipped = bytes.clone();
        flipped[20] ^= 1;
        assert!(Container::prefix(&flipped[..219], header).is_err());
        assert!(Container::prefix(&flipped[..218], header).is_ok());
        let mut longer = bytes;
        longer.push(0);
        assert!(matches!(Container::prefix(&longer, header), Err(CodecError::Malformed { .. })));
    }

    #[test]
    fn a_length_that_a_header_states_is_that_of_the_chunk() {
        let bytes = sample(false);
        let stated = |length| {
            move |r: &mut Reader<'_>| {
                let chunk = Announced { kind: ChunkKind::Coefficients, length: Some(length) };
                Ok((r.u8("first")?, vec![chunk]))
            }
        };
        assert!(Container::read(&bytes, stated(200)).is_ok());
        assert!(matches!(Container::read(&bytes, stated(199)), Err(CodecError::Malformed { at: 15, .. })));
        for end in 13..=bytes.len() {
            assert!(Container::prefix(&bytes[..end], stated(200)).is_ok());
            let other = Container::prefix(&bytes[..end], stated(201));
            assert_eq!(other.is_err(), end >= 15, "{end}");
        }
    }

    #[test]
    fn later_versions_are_refused_by_number() {
        let mut bytes = sample(false);
        bytes[4] = 2;
        assert_eq!(read(&bytes).unwrap_err(), CodecError::Version { found: 2, expected: 1 });
        assert_eq!(read(b"PK\x03\x04").unwrap_err(), CodecError::Magic);
    }
}
