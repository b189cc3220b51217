//! Owner of the files that a command of root makes in the directory of another user: that user, whose service could not
//! use them otherwise.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{MetadataExt, fchown, lchown};
use std::path::Path;

/// Gives a file that root has just made in `directory` to the owner of the directory. Other users own what they make.
pub(crate) fn give(file: &File, directory: &Path) -> io::Result<()> {
    match owner(directory)? {
        Some((user, group)) => fchown(file, Some(user), Some(group)),
        None => Ok(()),
    }
}

/// Gives all files and directories of root below `directory` to the owner of the directory. Blocks the thread.
pub(crate) fn give_all(directory: &Path) -> io::Result<()> {
    let Some((user, group)) = owner(directory)? else { return Ok(()) };
    let mut folders = vec![directory.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            let found = fs::symlink_metadata(&path)?;
            if found.is_dir() {
                folders.push(path.clone());
            }
            // A second name of a file may lie where the owner of the directory has no rights.
            if found.uid() == 0 && (found.is_dir() || found.nlink() == 1) {
                lchown(&path, Some(user), Some(group))?;
            }
        }
    }
    Ok(())
}

/// Returns user and group of a directory if this process runs as root and the directory is another user's.
fn owner(directory: &Path) -> io::Result<Option<(u32, u32)>> {
    if !rustix::process::geteuid().is_root() {
        return Ok(None);
    }
    let found = fs::metadata(directory)?;
    Ok((found.uid() != 0).then(|| (found.uid(), found.gid())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_root_makes_belongs_to_the_owner_of_the_directory() {
        let directory = tempfile::tempdir().unwrap();
        fs::create_dir(directory.path().join("folder")).unwrap();
        let file = File::create(directory.path().join("folder/file")).unwrap();
        let owner = |path: &str| fs::symlink_metadata(directory.path().join(path)).unwrap().uid();
        let me = rustix::process::geteuid();
        give(&file, directory.path()).unwrap();
        give_all(directory.path()).unwrap();
        assert_eq!([owner("folder"), owner("folder/file")], [me.as_raw(); 2], "the directory is this user's");
        if !me.is_root() {
            return;
        }
        lchown(directory.path(), Some(65534), Some(65534)).unwrap();
        give(&file, directory.path()).unwrap();
        assert_eq!([owner("folder"), owner("folder/file")], [0, 65534]);
        give_all(directory.path()).unwrap();
        assert_eq!(owner("folder"), 65534);
    }
}
