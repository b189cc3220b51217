//! Failures to store or to find bytes.

use super::digest::Digest;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::PathBuf;

/// Failure to store or to find bytes.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No stored file has the given digest.
    #[error("no stored file has the digest {0}")]
    NotFound(Digest),
    /// The bytes stored under a digest have another digest, so they are damaged.
    #[error("stored bytes are damaged: found the digest {found}, expected {stored}")]
    Corrupt {
        /// Digest under which the damaged file is stored, that of its original bytes.
        stored: Digest,
        /// Digest computed from the bytes that were read from the store.
        found: Digest,
    },
    /// The requested byte range does not lie within the stored file.
    #[error("the byte range {}..{} is not inside the stored file of {size} bytes", range.start, range.end)]
    Range {
        /// Requested byte range; its end is exclusive.
        range: Range<u64>,
        /// Size of the stored file in bytes.
        size: u64,
    },
    /// The disk of the store, or that of temporary files, has no more space than is kept for deletions.
    #[error("the disk of {} has no space left for new data", directory.display())]
    NoSpace {
        /// Directory whose disk is full.
        directory: PathBuf,
    },
    /// The file system returned an error.
    #[error("the file system failed: {0}")]
    Io(#[from] std::io::Error),
    /// The library that accesses the store (a local directory or S3) returned an error.
    #[error("the object store failed: {0}")]
    Objects(#[from] object_store::Error),
}

impl StoreError {
    /// Returns the kind of damage of a stored file that this error reveals, `missing` or `corrupt`; `None` if the store
    /// itself failed.
    pub(crate) fn damage(&self) -> Option<&'static str> {
        match self {
            Self::NotFound(_) => Some("missing"),
            Self::Corrupt { .. } | Self::Range { .. } => Some("corrupt"),
            Self::NoSpace { .. } | Self::Io(_) | Self::Objects(_) => None,
        }
    }

    /// Returns true if a disk is full, or a quota of the file system is used up.
    pub(crate) fn is_full(&self) -> bool {
        let mut next: Option<&(dyn std::error::Error + 'static)> = Some(self);
        while let Some(error) = next {
            let kind = error.downcast_ref::<std::io::Error>().map(std::io::Error::kind);
            if matches!(kind, Some(ErrorKind::StorageFull | ErrorKind::QuotaExceeded))
                || matches!(error.downcast_ref(), Some(Self::NoSpace { .. }))
            {
                return true;
            }
            next = error.source();
        }
        false
    }
}
