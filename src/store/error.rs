//! Failures to store or to find bytes.

use super::digest::Digest;
use std::ops::Range;

/// Failure to store or to find bytes.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No blob has this digest.
    #[error("no blob has the digest {0}")]
    NotFound(Digest),
    /// The bytes stored under a digest have another digest.
    #[error("the bytes stored as {stored} have the digest {found}")]
    Corrupt {
        /// Digest under which the bytes are stored.
        stored: Digest,
        /// The digest of the bytes found.
        found: Digest,
    },
    /// The requested range is not inside the blob.
    #[error("bytes {}..{} of a blob of {size} bytes", range.start, range.end)]
    Range {
        /// Requested range.
        range: Range<u64>,
        /// The size of the blob.
        size: u64,
    },
    /// The file system failed.
    #[error("file system: {0}")]
    Io(#[from] std::io::Error),
    /// The object store failed.
    #[error("object store: {0}")]
    Objects(#[from] object_store::Error),
}
