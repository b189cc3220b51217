//! Reserve of disk space beside a SQLite catalog, given up when the disk is full, so that deletions still work.

use super::file::directory_of;
use crate::store::Disk;
use rustix::fs::{FallocateFlags, fallocate};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Name of the file that holds the reserve of disk space, in the directory of the catalog.
const NAME: &str = "wavelume-reserve";

/// Reserve of disk space: a file beside the catalog. It is removed when the disk is full, and made again later.
#[derive(Clone, Debug)]
pub(crate) struct Reserve {
    file: PathBuf,
    /// Size in bytes that the reserve is to have; a small disk has a smaller one, and 0 means none.
    wanted: u64,
}

impl Reserve {
    /// Returns the reserve of `wanted` bytes beside the file of a catalog. Makes no file.
    pub(crate) fn beside(catalog: &Path, wanted: u64) -> Self {
        Self { file: catalog.with_file_name(NAME), wanted }
    }

    fn disk(&self) -> io::Result<Disk> {
        Disk::of(directory_of(&self.file))
    }

    /// Returns true if the disk has less free space than is kept for deletions.
    pub(crate) fn is_short(&self) -> bool {
        self.disk().is_ok_and(|disk| disk.is_short(self.wanted))
    }

    /// Returns true if the disk has no space for new rows of clients.
    pub(crate) fn is_short_for_clients(&self) -> bool {
        self.disk().is_ok_and(|disk| disk.is_short_for_clients(self.wanted, 0))
    }

    /// Returns the size of the reserve's file in bytes; 0 if the reserve was given up.
    pub(crate) fn held(&self) -> u64 {
        fs::metadata(&self.file).map_or(0, |metadata| metadata.len())
    }

    /// Removes the reserve. Returns true if this has freed space.
    pub(crate) fn give_up(&self) -> bool {
        let held = self.held();
        let given_up = held > 0 && fs::remove_file(&self.file).is_ok();
        if given_up {
            tracing::error!(
                file = %self.file.display(),
                bytes = held,
                "the disk is full: its reserve was given up; delete what is not needed, run `wavelume gc --now`, or make the \
                 disk larger"
            );
        }
        given_up
    }

    /// Gives the reserve up if the disk has less space left than the reserve holds.
    pub(crate) fn make_room(&self) {
        if self.is_short() {
            self.give_up();
        }
    }

    /// Makes the reserve if it is missing and the disk has four times its space free. Blocks the thread.
    pub(crate) fn make(&self) -> io::Result<()> {
        let disk = self.disk()?;
        let bytes = disk.kept(self.wanted);
        if bytes == 0 || self.held() >= bytes || disk.free / 4 < bytes {
            return Ok(());
        }
        let file = fs::File::create(&self.file)?;
        let made = fallocate(&file, FallocateFlags::empty(), 0, bytes)
            .map_err(io::Error::from)
            .or_else(|_| fill(&file, bytes));
        if made.is_err() {
            drop(fs::remove_file(&self.file));
        }
        made
    }
}

/// Writes bytes to a file on a file system that cannot allocate space by itself.
fn fill(mut file: &fs::File, bytes: u64) -> io::Result<()> {
    // Not zeros, which some file systems do not store.
    let piece = vec![0x5A_u8; 1 << 16];
    let mut left = bytes;
    while left > 0 {
        let length = left.min(piece.len() as u64);
        file.write_all(&piece[..length as usize])?;
        left -= length;
    }
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reserve_is_made_given_up_once_and_made_again() {
        let directory = tempfile::tempdir().unwrap();
        let reserve = Reserve::beside(&directory.path().join("catalog.sqlite"), 1 << 20);
        reserve.make().unwrap();
        assert_eq!((reserve.held(), reserve.is_short()), (1 << 20, false));
        reserve.make_room();
        assert!(reserve.held() > 0, "there is space");
        assert!(reserve.give_up() && !reserve.give_up());
        reserve.make().unwrap();
        assert_eq!(reserve.held(), 1 << 20);
        let none = Reserve::beside(&directory.path().join("other"), 0);
        assert!(!none.is_short());
    }
}
