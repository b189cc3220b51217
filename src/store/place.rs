//! Place of a store: a directory, or a prefix in an S3 bucket.

use super::error::StoreError;
use super::interface::Store;
use super::local::{self, STAGING};
use super::s3;
use super::staging::Staging;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

/// Place of a store; written as `dir:PATH` or `s3://BUCKET/PREFIX`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The store is a directory with this path.
    Directory(PathBuf),
    /// The store is a prefix in an S3 bucket; the prefix may be empty.
    S3 {
        /// Name of the S3 bucket.
        bucket: String,
        /// Prefix of the names of all objects in the bucket, without a slash at its ends.
        prefix: String,
    },
}

/// Text that is neither `dir:PATH` nor `s3://BUCKET/PREFIX`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found `{0}`, expected dir:PATH or s3://BUCKET/PREFIX")]
pub struct NotAStore(String);

impl Place {
    /// Opens the store, and makes the [directory for temporary files](Self::staging). The directory of the store and
    /// `scratch` must exist. Blocks the thread.
    pub(crate) fn open(&self, scratch: &Path) -> Result<(Arc<dyn Store>, Staging), StoreError> {
        let staging = self.staging(scratch);
        std::fs::create_dir_all(&staging)?;
        let store: Arc<dyn Store> = match self {
            Self::Directory(root) => Arc::new(local::open(root)?),
            Self::S3 { bucket, prefix } => Arc::new(s3::open(bucket, prefix)?),
        };
        Ok((store, Staging::new(staging)))
    }

    /// Returns the path of a store that is a directory, or `None` for S3.
    pub(crate) fn directory(&self) -> Option<&Path> {
        match self {
            Self::Directory(root) => Some(root),
            Self::S3 { .. } => None,
        }
    }

    /// Returns the directory for temporary files: in the directory of the store, or inside `scratch` if the store is in
    /// S3.
    pub(crate) fn staging(&self, scratch: &Path) -> PathBuf {
        match self {
            Self::Directory(root) => root.join(STAGING),
            Self::S3 { .. } => scratch.join(STAGING),
        }
    }

    /// Opens the store for reading alone, without creating anything in it; `None` if there is no such directory. Blocks
    /// the thread.
    pub(crate) fn open_to_read(&self) -> Result<Option<Arc<dyn Store>>, StoreError> {
        match self {
            Self::Directory(root) => Ok(local::open_to_read(root)?.map(|store| Arc::new(store) as _)),
            Self::S3 { bucket, prefix } => Ok(Some(Arc::new(s3::open(bucket, prefix)?))),
        }
    }
}

impl FromStr for Place {
    type Err = NotAStore;

    fn from_str(text: &str) -> Result<Self, NotAStore> {
        // A text with credentials must not reach the log.
        let shown = if text.contains('@') { "…" } else { text };
        let refused = || NotAStore(shown.chars().take(200).collect());
        if let Some(path) = text.strip_prefix("dir:") {
            return if path.is_empty() { Err(refused()) } else { Ok(Self::Directory(path.into())) };
        }
        let (bucket, prefix) =
            text.strip_prefix("s3://").map(|rest| rest.split_once('/').unwrap_or((rest, ""))).ok_or_else(refused)?;
        let named = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'-' | b'_');
        if bucket.is_empty() || !bucket.bytes().all(named) {
            return Err(refused());
        }
        Ok(Self::S3 { bucket: bucket.to_owned(), prefix: prefix.trim_matches('/').to_owned() })
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Directory(root) => write!(f, "dir:{}", root.display()),
            Self::S3 { bucket, prefix } if prefix.is_empty() => write!(f, "s3://{bucket}"),
            Self::S3 { bucket, prefix } => write!(f, "s3://{bucket}/{prefix}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_read_and_shown() {
        for (text, shown) in [
            ("dir:/srv/blobs", "dir:/srv/blobs"),
            ("s3://materials", "s3://materials"),
            ("s3://materials/prod/", "s3://materials/prod"),
            ("s3://my.bucket-1/a/b", "s3://my.bucket-1/a/b"),
        ] {
            assert_eq!(text.parse::<Place>().unwrap().to_string(), shown);
        }
        for text in ["", "dir:", "s3://", "s3:///x", "s3://a b", "/srv/blobs", "https://bucket"] {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
    }
}
