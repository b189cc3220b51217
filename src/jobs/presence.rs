//! Liveness of the workers of a data directory: each holds a lock on a file of its own, and a killed process holds
//! none.
//!
//! Leases alone would do, but a service that is killed and started again would wait for its own lease to expire.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// Name of the folder of a data directory that holds the lock files of workers.
pub(super) const WORKERS: &str = "workers";

/// Sign of life of a worker: a locked file in the data directory. Dropping it, or the end of the process, releases the
/// lock.
#[derive(Debug)]
pub(crate) struct Presence {
    id: String,
    directory: PathBuf,
    path: PathBuf,
    _lock: File,
}

impl Presence {
    /// Creates and locks the file in `directory` that shows that this worker is alive. Blocks on disk access.
    pub(crate) fn enter(directory: &Path) -> io::Result<Self> {
        fs::create_dir_all(directory)?;
        // No dot: names of temporary files are the id of their worker, a dot and a name.
        let id = format!("{}-{}", boot(), uuid::Uuid::now_v7().simple());
        // Locked before it gets its name, so that nobody sees it unlocked while its process lives.
        let hidden = directory.join(format!(".{id}"));
        let path = directory.join(&id);
        let file = File::create(&hidden)?;
        file.lock()?;
        fs::rename(&hidden, &path)?;
        Ok(Self { id, directory: directory.to_owned(), path, _lock: file })
    }

    /// Returns the id of this worker, which is written to each job that it runs.
    pub(crate) fn id(&self) -> &str {
        &self.id
    }

    /// Returns the ids of the workers whose process ended without removing the lock file that shows that they are
    /// alive. Blocks on disk access.
    pub(crate) fn gone(&self) -> io::Result<Vec<String>> {
        let mut gone = Vec::new();
        for entry in fs::read_dir(&self.directory)? {
            let entry = entry?;
            let Ok(name) = entry.file_name().into_string() else { continue };
            // A lock is seen only on its own host, if at all; workers of others are judged by their leases.
            if name == self.id || !name.starts_with(&boot()) {
                continue;
            }
            let Ok(file) = File::open(entry.path()) else { continue };
            match file.try_lock() {
                Ok(()) => gone.push(name),
                // Alive, or on a file system without locks, where leases alone decide.
                Err(TryLockError::WouldBlock | TryLockError::Error(_)) => {}
            }
        }
        Ok(gone)
    }

    /// Removes the lock files of workers whose process has ended, after their jobs went back to the queue. Blocks on
    /// disk access.
    pub(crate) fn forget(&self, gone: &[String]) {
        for name in gone {
            // Another process may have been faster.
            let _ = fs::remove_file(self.directory.join(name));
        }
    }
}

/// Returns the number of running nodes and workers of this host that use a data directory; `directory` is its folder of
/// lock files. Blocks on disk access.
pub(super) fn living(directory: &Path) -> io::Result<usize> {
    let mut living = 0;
    let entries = match fs::read_dir(directory) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0),
        entries => entries?,
    };
    for entry in entries {
        let entry = entry?;
        if !entry.file_name().to_string_lossy().starts_with(&boot()) {
            continue;
        }
        let Ok(file) = File::open(entry.path()) else { continue };
        living += usize::from(matches!(file.try_lock(), Err(TryLockError::WouldBlock)));
    }
    Ok(living)
}

/// Returns true if the worker with an id runs, and false if it was killed; `None` if this cannot be told: it ran on
/// another host, or has ended well. `directory` is the folder of lock files. Blocks on disk access.
pub(super) fn is_alive(directory: &Path, id: &str) -> Option<bool> {
    if !id.starts_with(&boot()) {
        return None;
    }
    match File::open(directory.join(id)).ok()?.try_lock() {
        Ok(()) => Some(false),
        Err(TryLockError::WouldBlock) => Some(true),
        Err(TryLockError::Error(_)) => None,
    }
}

/// Returns a text that differs between hosts, and between starts of a host.
pub(super) fn boot() -> String {
    let id = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    id.chars().filter(char::is_ascii_hexdigit).collect()
}

impl Drop for Presence {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dead_are_told_from_the_living() {
        let directory = tempfile::tempdir().unwrap();
        let (a, b) = (Presence::enter(directory.path()).unwrap(), Presence::enter(directory.path()).unwrap());
        let killed = format!("{}-killed", boot());
        fs::write(directory.path().join(&killed), b"").unwrap();
        fs::write(directory.path().join("another host's"), b"").unwrap();
        assert_eq!(a.gone().unwrap(), std::slice::from_ref(&killed));
        for (id, expected) in [
            (a.id(), Some(true)),
            (killed.as_str(), Some(false)),
            ("another host's", None),
            (&format!("{}-ended", boot()), None),
        ] {
            assert_eq!(is_alive(directory.path(), id), expected, "{id}");
        }
        assert_eq!(living(directory.path()).unwrap(), 2);
        assert_eq!(living(&directory.path().join("nothing")).unwrap(), 0);
        b.forget(&a.gone().unwrap());
        assert!(a.gone().unwrap().is_empty());
        assert_ne!(a.id(), b.id());
    }
}
