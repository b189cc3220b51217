//! Bytes on their way in: a file that is hashed while it is written, and vanishes unless it is published.

use super::digest::Digest;
use super::disk::Disk;
use super::error::StoreError;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

/// Directory of temporary files that become objects of the store. If the store is a directory, both lie on one file
/// system, so that publishing a file is a rename.
#[derive(Clone, Debug)]
pub(crate) struct Staging {
    directory: PathBuf,
    /// Space in bytes that temporary files leave free on their disk; less on a small disk.
    kept: u64,
    /// Id of the process that makes the files, with which their names begin; `None` for a command.
    owner: Option<Arc<str>>,
}

/// A temporary file that is being written. Dropping it removes the file.
#[derive(Debug)]
pub(crate) struct StagedWriter {
    file: File,
    hasher: blake3::Hasher,
    bytes: u64,
    path: TemporaryPath,
    staging: Staging,
}

/// A complete temporary file with its digest. Dropping it removes the file, unless the file was moved into the store.
#[derive(Debug)]
pub(crate) struct Staged {
    file: File,
    digest: Digest,
    bytes: u64,
    path: TemporaryPath,
}

/// Name of a temporary file that another process will create. Dropping it removes the file.
#[derive(Debug)]
pub(crate) struct Reserved {
    path: TemporaryPath,
}

#[derive(Debug)]
struct TemporaryPath(PathBuf);

impl TemporaryPath {
    fn fresh(staging: &Staging) -> Self {
        let name = uuid::Uuid::now_v7().simple().to_string();
        Self(staging.directory.join(match &staging.owner {
            Some(owner) => format!("{owner}.{name}"),
            None => name,
        }))
    }

    /// Returns the name of the file, without its directory.
    fn name(&self) -> &str {
        self.0.file_name().and_then(|name| name.to_str()).unwrap_or_default()
    }
}

impl Drop for TemporaryPath {
    fn drop(&mut self) {
        // Published files have left this path; a file that cannot be removed is swept later.
        let _ = fs::remove_file(&self.0);
    }
}

impl Staging {
    /// Uses an existing directory for temporary files.
    pub(crate) fn new(directory: impl Into<PathBuf>) -> Self {
        Self { directory: directory.into(), kept: 0, owner: None }
    }

    /// Returns the same directory, whose temporary files leave `kept` bytes of their disk free.
    pub(crate) fn keeping(self, kept: u64) -> Self {
        Self { kept, ..self }
    }

    /// Fails if the disk has no more space than is kept for deletions. Blocks the thread.
    pub(crate) fn has_room(&self) -> Result<(), StoreError> {
        if self.kept > 0 && Disk::of(&self.directory)?.is_short(self.kept) {
            return Err(StoreError::NoSpace { directory: self.directory.clone() });
        }
        Ok(())
    }

    /// Fails if the disk has no space for an upload of `bytes` bytes. Blocks the thread.
    pub(crate) fn takes_upload(&self, bytes: u64) -> Result<(), StoreError> {
        if self.kept > 0 && Disk::of(&self.directory)?.is_short_for_clients(self.kept, bytes) {
            return Err(StoreError::NoSpace { directory: self.directory.clone() });
        }
        Ok(())
    }

    /// Lets the names of further temporary files begin with the id of the process that makes them, so that they can be
    /// removed once it has died.
    pub(crate) fn owned_by(self, id: &str) -> Self {
        Self { owner: Some(id.into()), ..self }
    }

    /// Creates a temporary file. This call and all calls on the file block the thread.
    pub(crate) fn begin(&self) -> Result<StagedWriter, StoreError> {
        self.has_room()?;
        let path = TemporaryPath::fresh(self);
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&path.0)?;
        Ok(StagedWriter { file, hasher: blake3::Hasher::new(), bytes: 0, path, staging: self.clone() })
    }

    /// Returns the directory of the temporary files.
    pub(crate) fn directory(&self) -> &Path {
        &self.directory
    }

    /// Reserves a name in the directory for a temporary file that another process creates.
    pub(crate) fn reserve(&self) -> Reserved {
        Reserved { path: TemporaryPath::fresh(self) }
    }

    /// Writes bytes that are in memory to a new temporary file. Blocks the thread.
    pub(crate) fn stage(&self, bytes: &[u8]) -> Result<Staged, StoreError> {
        let mut writer = self.begin()?;
        writer.write(bytes)?;
        writer.finish()
    }

    /// Copies the bytes of `staged` to a new temporary file, even if `staged` was moved into the store and removed from
    /// it. Blocks the thread.
    pub(crate) fn stage_again(&self, staged: &Staged) -> Result<Staged, StoreError> {
        // The open file keeps its bytes whatever became of its name.
        let mut from = staged.open()?;
        let mut writer = self.begin()?;
        let mut piece = vec![0; 1 << 20];
        loop {
            let read = from.read(&mut piece)?;
            if read == 0 {
                return writer.finish();
            }
            writer.write(&piece[..read])?;
        }
    }

    /// Removes the temporary files of processes that have died, and those of unknown processes that were last written
    /// more than `older_than` ago; returns their number. `is_alive` tells of the id of a process whether it runs, if
    /// that is known. Blocks the thread.
    pub(crate) fn sweep(
        &self,
        older_than: Duration,
        is_alive: impl Fn(&str) -> Option<bool>,
    ) -> Result<u64, StoreError> {
        let now = SystemTime::now();
        let mut removed = 0;
        let entries = match fs::read_dir(&self.directory) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(0),
            entries => entries?,
        };
        for entry in entries {
            let entry = entry?;
            let Ok(metadata) = entry.metadata() else { continue };
            let name = entry.file_name();
            let owner = name.to_str().and_then(|name| name.split_once('.')).map(|(owner, _)| owner);
            let is_stale = || {
                let age = metadata.modified().ok().and_then(|written| now.duration_since(written).ok());
                age.is_some_and(|age| age > older_than)
            };
            let is_abandoned = owner.and_then(&is_alive).map_or_else(is_stale, |is_alive| !is_alive);
            if metadata.is_file() && is_abandoned && fs::remove_file(entry.path()).is_ok() {
                removed += 1;
            }
        }
        Ok(removed)
    }
}

impl Reserved {
    /// Returns the name that the other process must give the file, without its directory.
    pub(crate) fn name(&self) -> &str {
        self.path.name()
    }

    /// Computes the digest of the file that the other process has written. Blocks the thread.
    pub(crate) fn take(self) -> Result<Staged, StoreError> {
        let mut file = OpenOptions::new().read(true).write(true).open(&self.path.0)?;
        let mut hasher = blake3::Hasher::new();
        let mut piece = vec![0; 1 << 20];
        let mut bytes = 0;
        loop {
            let read = file.read(&mut piece)?;
            if read == 0 {
                return Ok(Staged { file, digest: Digest::from(hasher.finalize()), bytes, path: self.path });
            }
            hasher.update(&piece[..read]);
            bytes += read as u64;
        }
    }
}

impl StagedWriter {
    /// Appends bytes to the temporary file, and adds them to its digest.
    pub(crate) fn write(&mut self, piece: &[u8]) -> Result<(), StoreError> {
        self.staging.has_room()?;
        self.file.write_all(piece)?;
        self.hasher.update(piece);
        self.bytes += piece.len() as u64;
        Ok(())
    }

    /// Completes the temporary file. The file becomes durable only when it is moved into the store.
    pub(crate) fn finish(mut self) -> Result<Staged, StoreError> {
        self.file.flush()?;
        let digest = Digest::from(self.hasher.finalize());
        Ok(Staged { file: self.file, digest, bytes: self.bytes, path: self.path })
    }
}

impl Staged {
    /// Returns the digest of the bytes of the temporary file.
    pub(crate) fn digest(&self) -> Digest {
        self.digest
    }

    /// Returns the size of the temporary file in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns the path of the temporary file.
    pub(crate) fn path(&self) -> &Path {
        &self.path.0
    }

    /// Returns the temporary file, ready to be read from its beginning, even if it was moved into the store. One reader
    /// at a time may use it.
    pub(crate) fn open(&self) -> Result<File, StoreError> {
        let mut file = self.file.try_clone()?;
        file.rewind()?;
        Ok(file)
    }

    /// Reads all bytes of the temporary file. Blocks the thread.
    pub(crate) fn read(&self) -> Result<Vec<u8>, StoreError> {
        let mut bytes = Vec::new();
        File::open(self.path())?.read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// Returns the name of the temporary file, without its directory.
    pub(crate) fn name(&self) -> &str {
        self.path.name()
    }

    /// Waits until the bytes of the temporary file are on stable storage.
    pub(super) async fn sync(&self) -> Result<(), StoreError> {
        let file = self.file.try_clone()?;
        Ok(tokio::task::spawn_blocking(move || file.sync_all()).await.map_err(std::io::Error::other)??)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_staged_file_is_hashed_and_vanishes() {
        let directory = tempfile::tempdir().unwrap();
        let staging = Staging::new(directory.path());
        let mut writer = staging.begin().unwrap();
        writer.write(b"wave").unwrap();
        writer.write(b"lume").unwrap();
        assert_eq!(writer.bytes, 8);
        let staged = writer.finish().unwrap();
        assert_eq!((staged.digest(), staged.read().unwrap()), (Digest::of(b"wavelume"), b"wavelume".to_vec()));
        let path = staged.path().to_owned();
        assert!(path.exists());
        drop(staged);
        assert!(!path.exists());
    }

    #[test]
    fn a_file_of_another_process_is_taken_by_its_name_or_vanishes() {
        let directory = tempfile::tempdir().unwrap();
        let staging = Staging::new(directory.path());
        assert!(staging.reserve().take().is_err(), "nobody has written it");
        let (reserved, left) = (staging.reserve(), staging.reserve());
        for reserved in [&reserved, &left] {
            fs::write(directory.path().join(reserved.name()), b"wavelume").unwrap();
        }
        let staged = reserved.take().unwrap();
        assert_eq!((staged.digest(), staged.bytes()), (Digest::of(b"wavelume"), 8));
        drop(left);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[test]
    fn bytes_are_staged_again_after_their_file_is_gone() {
        let directory = tempfile::tempdir().unwrap();
        let staging = Staging::new(directory.path());
        let staged = staging.stage(b"wavelume").unwrap();
        fs::remove_file(staged.path()).unwrap();
        let again = staging.stage_again(&staged).unwrap();
        assert_eq!((again.digest(), again.bytes()), (staged.digest(), 8));
        assert_eq!(again.read().unwrap(), b"wavelume");
        assert_eq!(staging.stage_again(&again).unwrap().read().unwrap(), b"wavelume");
    }

    #[test]
    fn files_of_the_dead_and_stale_ones_are_swept() {
        let directory = tempfile::tempdir().unwrap();
        let staging = Staging::new(directory.path());
        let old = SystemTime::now() - Duration::from_hours(2);
        let alive = staging.clone().owned_by("alive").begin().unwrap();
        let dead = std::mem::ManuallyDrop::new(staging.clone().owned_by("dead").begin().unwrap());
        let (unknown, fresh) = (directory.path().join("unknown.x"), staging.begin().unwrap());
        fs::write(&unknown, b"half").unwrap();
        for path in [&alive.path.0, &unknown] {
            File::options().write(true).open(path).unwrap().set_modified(old).unwrap();
        }
        let is_alive = |id: &str| (id != "unknown").then_some(id == "alive");
        assert_eq!(staging.sweep(Duration::from_hours(1), is_alive).unwrap(), 2);
        assert!(fresh.path.0.exists() && alive.path.0.exists() && !unknown.exists() && !dead.path.0.exists());
        let missing = Staging::new(directory.path().join("missing"));
        assert_eq!(missing.sweep(Duration::ZERO, |_| None).unwrap(), 0);
    }
}
