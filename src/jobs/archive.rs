//! A data directory opened: its blobs and its catalog, swept and checked together.

use serde::Serialize;
use std::path::Path;

/// An opened data directory.
#[derive(Clone, Debug)]
pub struct Archive {}

/// Why a data directory was not opened or not looked after.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The directory cannot be used.
    #[error("{0}")]
    Directory(String),
}

/// What a sweep removed; the answer of `wavelume gc`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SweepReport {
    /// Blobs that nothing named.
    pub removed_blobs: u64,
    /// Their bytes.
    pub removed_bytes: u64,
    /// Staging files that nobody was writing.
    pub removed_staging: u64,
    /// Blobs that are named.
    pub kept_blobs: u64,
}

/// What a check found; the answer of `wavelume fsck`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FsckReport {
    /// Blobs whose digest was computed.
    pub checked_blobs: u64,
    /// Their bytes.
    pub checked_bytes: u64,
    /// What is wrong; empty if all is well.
    pub faults: Vec<Fault>,
}

/// One thing that is wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Fault {
    /// The bytes are not those of their digest.
    Corrupt {
        /// The digest.
        digest: String,
    },
    /// A row names bytes that are not there.
    Missing {
        /// The digest.
        digest: String,
        /// What names it: `measurement b3-…` or `material b3-…`.
        named_by: String,
    },
}

impl Archive {
    /// Opens the directory, makes what is missing and brings the catalog's schema up to date.
    pub async fn open(data: &Path) -> Result<Self, ArchiveError> {
        let _ = data;
        unimplemented!()
    }

    /// Brings the schema up to date without starting anything and returns how many migrations were applied.
    pub async fn migrate(data: &Path) -> Result<usize, ArchiveError> {
        let _ = data;
        unimplemented!()
    }

    /// Removes blobs that no row and no upload under way names, and stale staging files.
    pub async fn sweep(&self) -> Result<SweepReport, ArchiveError> {
        unimplemented!()
    }

    /// Recomputes every digest and looks for every blob that a row names.
    pub async fn check(&self) -> Result<FsckReport, ArchiveError> {
        unimplemented!()
    }
}
