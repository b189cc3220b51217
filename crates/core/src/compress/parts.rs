//! Parts of a file before assembly: the header, and the chunks between it and the metadata.

use super::header::Header;
use super::lobe_chunk;
use super::metadata_chunk::metadata_chunk;
use crate::codec::{ChunkKind, write_container};

/// Chunks of a file between header and metadata, with the matching header.
pub(super) struct Parts {
    pub(super) header: Header,
    pub(super) chunks: Vec<(ChunkKind, Vec<u8>)>,
}

impl Parts {
    pub(super) fn chunk(&self, kind: ChunkKind) -> Option<&[u8]> {
        self.chunks.iter().find(|(k, _)| *k == kind).map(|(_, payload)| payload.as_slice())
    }
}

/// Assembles the bytes of a file from its header, chunks and metadata. The error figures in the header are written as
/// they currently stand, even if not yet final.
pub(super) fn assemble(parts: &Parts, metadata: Option<&str>) -> Vec<u8> {
    let kind = if parts.header.grid_levels { ChunkKind::Grid } else { ChunkKind::Pyramid };
    let pyramid_length = parts.chunk(kind).map_or(0, <[u8]>::len);
    let header = Header { pyramid_length, ..parts.header.clone() };
    let mut chunks = vec![(ChunkKind::Header, header.write())];
    chunks.extend(header.between.map(|between| (ChunkKind::Between, between.write())));
    chunks.extend(header.lobe.as_ref().map(|lobe| (ChunkKind::Lobe, lobe_chunk::write(lobe))));
    chunks.extend(parts.chunks.iter().cloned());
    if let Some(text) = metadata {
        chunks.push(metadata_chunk(&parts.header.axes, text));
    }
    write_container(&chunks)
}
