//! Reasons why bytes were not stored or not found.

use super::digest::Digest;
use std::ops::Range;

/// Why bytes were not stored or not found.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No blob has this digest.
    #[error("no blob has the digest {0}")]
    NotFound(Digest),
    /// The bytes stored under a digest are others.
    #[error("the bytes stored as {stored} have the digest {found}")]
    Corrupt {
        /// The digest asked for.
        stored: Digest,
        /// The digest of the bytes found.
        found: Digest,
    },
    /// The range asked for is not inside the blob.
    #[error("bytes {}..{} of a blob of {size} bytes", range.start, range.end)]
    Range {
        /// The range asked for.
        range: Range<u64>,
        /// The size of the blob.
        size: u64,
    },
    /// The file system said no.
    #[error("file system: {0}")]
    Io(#[from] std::io::Error),
    /// The object store said no.
    #[error("object store: {0}")]
    Objects(#[from] object_store::Error),
}
