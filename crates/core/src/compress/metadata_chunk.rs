//! Chunk kind of the metadata, and its reading and writing.

use crate::codec::{Chunk, ChunkKind, CodecError, TYPICAL, read_provenance, read_text, write_provenance, write_text};
use crate::domain::Axis;

/// Largest length of the metadata text, in bytes.
pub(super) const MAX_METADATA: usize = 1 << 24;

/// Kind of file chunk that holds the metadata: one for measurements with a grid of angles among their axes, another for
/// all others.
pub(super) fn metadata_kind(axes: &[Axis]) -> ChunkKind {
    let on_grid = axes.iter().any(|axis| matches!(axis, Axis::Grid(_)));
    if on_grid { ChunkKind::Provenance } else { ChunkKind::Metadata }
}

/// Encodes the metadata text of a measurement as a chunk of the compressed file. The kind of chunk depends on `axes`,
/// the axes of the measurement.
pub(super) fn metadata_chunk(axes: &[Axis], text: &str) -> (ChunkKind, Vec<u8>) {
    match metadata_kind(axes) {
        ChunkKind::Provenance => (ChunkKind::Provenance, write_provenance(text)),
        kind => (kind, write_text(TYPICAL, text)),
    }
}

/// Reads the text of a metadata chunk.
pub(super) fn read_metadata(chunk: &Chunk<'_>) -> Result<String, CodecError> {
    match chunk.kind {
        ChunkKind::Provenance => read_provenance(&mut chunk.reader(), MAX_METADATA),
        _ => read_text(TYPICAL, &mut chunk.reader(), MAX_METADATA),
    }
}
