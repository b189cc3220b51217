//! Comparison of files and directories by their identity: a copy must not be written into what it reads.

use std::fs::Metadata;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf};

/// Identity of a file or directory: device and inode number. Links to a file, and names that differ only in case on a
/// file system that folds case, have the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    device: u64,
    inode: u64,
}

impl Identity {
    /// Returns the identity of an opened file, or of the file to which a path leads.
    pub(crate) fn of(metadata: &Metadata) -> Self {
        Self { device: metadata.dev(), inode: metadata.ino() }
    }

    fn at(path: &Path) -> Option<Self> {
        path.metadata().ok().map(|metadata| Self::of(&metadata))
    }
}

/// Returns the first of the directories `own` that contains `to` or is the same directory. `to` need not exist yet.
pub(super) fn containing<'a>(to: &Path, own: impl IntoIterator<Item = &'a Path>) -> io::Result<Option<&'a Path>> {
    let to = resolved(to)?;
    let above: Vec<Identity> = to.ancestors().filter_map(Identity::at).collect();
    Ok(own.into_iter().find(|own| Identity::at(own).is_some_and(|own| above.contains(&own))))
}

/// Returns the absolute path of a file or directory, of which the last parts need not exist, without links.
fn resolved(path: &Path) -> io::Result<PathBuf> {
    let mut resolved = PathBuf::new();
    for part in std::path::absolute(path)?.components() {
        if part == Component::ParentDir {
            resolved.pop();
        } else {
            resolved.push(part);
            // An existing part may be a link.
            resolved = resolved.canonicalize().unwrap_or(resolved);
        }
    }
    Ok(resolved)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directories_are_found_by_what_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        std::fs::create_dir_all(path("data/staging")).unwrap();
        std::fs::create_dir(path("other")).unwrap();
        std::os::unix::fs::symlink("data", path("link")).unwrap();
        let (data, other) = (path("data"), path("other"));
        let own = [other.as_path(), data.as_path()];
        for inside in
            ["data", "data/staging", "data/new/deep", "link", "link/new", "other/../data/new", "link/../link/x"]
        {
            assert_eq!(containing(&path(inside), own).unwrap(), Some(data.as_path()), "{inside}");
        }
        for outside in ["", "database", "data/../new", "new/data"] {
            assert_eq!(containing(&path(outside), own).unwrap(), None, "{outside}");
        }
        assert_eq!(containing(&data, [path("absent").as_path()]).unwrap(), None);
    }
}
