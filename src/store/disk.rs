//! Free space of a disk, and the part of it that is kept for deletions.

use rustix::fs::statvfs;
use std::io;
use std::path::Path;

/// Largest part of a disk that is kept free: one part in so many. Raising it leaves more of a small disk to data.
const PART: u64 = 16;

/// Smallest space in bytes that is kept free if any is: a few pages of a database and of its log. Raising it wastes
/// more of a tiny disk.
const LEAST: u64 = 64 << 10;

/// Free space of a disk, and the size of the disk, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Disk {
    /// Bytes that this user may still write.
    pub free: u64,
    /// Size of the disk in bytes.
    pub size: u64,
}

impl Disk {
    /// Measures the disk of a file or directory. Blocks the thread.
    pub(crate) fn of(path: &Path) -> io::Result<Self> {
        let found = statvfs(path)?;
        let bytes = |blocks: u64| blocks.saturating_mul(found.f_frsize);
        Ok(Self { free: bytes(found.f_bavail), size: bytes(found.f_blocks) })
    }

    /// Returns the space in bytes that is kept free on this disk: `wanted`, or a sixteenth of a small disk; 0 for none.
    pub(crate) fn kept(self, wanted: u64) -> u64 {
        if wanted == 0 { 0 } else { wanted.min(self.size / PART).max(LEAST) }
    }

    /// Returns true if the disk has less free space than is kept for deletions.
    pub(crate) fn is_short(self, wanted: u64) -> bool {
        self.free < self.kept(wanted)
    }

    /// Returns true if the disk has no space for `bytes` new bytes of clients. They leave twice the kept space free, so
    /// that jobs which wait for a disk that uploads have filled still find space for their results.
    pub(crate) fn is_short_for_clients(self, wanted: u64, bytes: u64) -> bool {
        let kept = self.kept(wanted);
        kept > 0 && self.free < kept.saturating_mul(2).saturating_add(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_disk_keeps_a_sixteenth() {
        let disk = Disk { free: 600 << 10, size: 8 << 20 };
        assert_eq!((disk.kept(16 << 20), disk.kept(1 << 10), disk.kept(0)), (512 << 10, LEAST, 0));
        assert!(!disk.is_short(16 << 20) && Disk { free: 500 << 10, ..disk }.is_short(16 << 20));
        assert!(!Disk { free: 0, ..disk }.is_short(0) && !Disk { free: 0, ..disk }.is_short_for_clients(0, 9));
        let enough = Disk { free: 1030 << 10, ..disk };
        assert!(disk.is_short_for_clients(16 << 20, 0) && !enough.is_short_for_clients(16 << 20, 0));
        assert!(enough.is_short_for_clients(16 << 20, 10 << 10));
        assert!(Disk::of(Path::new("/")).unwrap().size > 0);
    }
}
