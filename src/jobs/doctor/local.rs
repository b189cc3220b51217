//! Verdicts on the local disk: scratch space that can be written, free space, and the kind of file system.

use super::finding::Finding;
use crate::catalog::Database;
use crate::store::Place;
use rustix::fs::statvfs;
use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Directories of a service on this machine, for the checks of their disks, and the size of an upload.
pub(super) struct Disks {
    /// Data directory of the service; it holds temporary files.
    data: PathBuf,
    /// SQLite file, if the catalog is one.
    file: Option<PathBuf>,
    /// Directory of the store, if it is one apart from the data directory.
    store: Option<PathBuf>,
    /// Largest upload in bytes.
    upload: u64,
    /// Permissions that nobody but the owner shall have.
    umask: u32,
}

/// Number of largest uploads that must fit on a disk; below, a warning is given. Raising it warns earlier.
const UPLOADS: u64 = 8;

/// File systems by the number that Linux gives them, each with its name and its fitness for a SQLite file.
/// Locks of network file systems do not keep two hosts apart, or fail after a lost connection.
const KINDS: [(u32, &str, Fit); 20] = [
    (0x0000_6969, "NFS", Fit::Network),
    (0x0000_517B, "SMB", Fit::Network),
    (0xFF53_4D42, "CIFS", Fit::Network),
    (0xFE53_4D42, "SMB2", Fit::Network),
    (0x6573_5546, "FUSE", Fit::Network),
    (0x0102_1997, "9p", Fit::Network),
    (0x00C3_6400, "Ceph", Fit::Network),
    (0x5346_414F, "AFS", Fit::Network),
    (0x0BD0_0BD0, "Lustre", Fit::Network),
    (0x0116_1970, "GFS2", Fit::Network),
    (0x7461_636F, "OCFS2", Fit::Network),
    (0x4750_4653, "GPFS", Fit::Network),
    (0x0102_1994, "tmpfs", Fit::Memory),
    (0x8584_58F6, "ramfs", Fit::Memory),
    (0x0000_EF53, "ext", Fit::Disk),
    (0x5846_5342, "XFS", Fit::Disk),
    (0x9123_683E, "Btrfs", Fit::Disk),
    (0x2FC1_2FC1, "ZFS", Fit::Disk),
    (0xF2F5_2010, "F2FS", Fit::Disk),
    (0x794C_7630, "overlay", Fit::Disk),
];

/// Fitness of a file system for the data of a service, which must survive a restart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fit {
    /// The file system lies on a disk of this machine.
    Disk,
    /// Main memory, empty after a restart of the machine.
    Memory,
    /// The file system is reached over a network, or served by a program (FUSE).
    Network,
}

impl Disks {
    /// Returns the directories of a service whose data directory is `root`.
    pub(super) fn of(root: &Path, database: &Database, store: &Place, upload: u64, umask: u32) -> Self {
        let store = match store {
            Place::Directory(directory) if directory != root => Some(directory.clone()),
            _ => None,
        };
        Self { data: root.to_owned(), file: database.file().map(Path::to_owned), store, upload, umask }
    }

    /// Returns the verdicts on all directories. Blocks the thread.
    pub(super) fn judge(&self) -> Vec<Finding> {
        let mut findings = vec![scratch(&self.data), space("local space", &self.data, self.upload)];
        if let Some(store) = self.store.as_deref().filter(|store| store.is_dir()) {
            findings.push(space("store space", store, self.upload));
            findings.push(kind("store file system", store, false));
        }
        findings.extend(self.permissions());
        match &self.file {
            Some(file) => findings.push(kind("database file system", file.parent().unwrap_or(file), true)),
            None => findings.push(kind("local file system", &self.data, false)),
        }
        findings
    }
}

impl Disks {
    /// Judges who may reach the data: `None` while there are none.
    fn permissions(&self) -> Option<Finding> {
        const CHECK: &str = "local permissions";
        let wider = |path: &Path| {
            let mode = path.metadata().ok()?.mode() & 0o777;
            (mode & self.umask != 0).then(|| format!("{} ({mode:03o})", path.display()))
        };
        let roots: Vec<&Path> = [Some(&self.data), self.store.as_ref()]
            .into_iter()
            .flatten()
            .map(PathBuf::as_path)
            .filter(|root| root.is_dir())
            .collect();
        let mut found = Vec::new();
        for root in &roots {
            found.extend(wider(root));
            // Nobody else gets past a closed directory.
            if root.metadata().is_ok_and(|root| root.mode() & 0o077 != 0) {
                found.extend(FOLDERS.iter().filter_map(|folder| wider(&root.join(folder))));
            }
        }
        if let Some(file) = &self.file {
            let is_closed = file.parent().and_then(|parent| parent.metadata().ok());
            if is_closed.is_none_or(|parent| parent.mode() & 0o077 != 0) {
                found.extend(wider(file));
            }
        }
        if roots.is_empty() {
            return None;
        }
        if found.is_empty() {
            return Some(Finding::ok(CHECK, format!("no wider than --umask {:03o} lets", self.umask)));
        }
        Some(Finding::warning(
            CHECK,
            format!("other users may read or list {}", found.join(", ")),
            "take their permissions away, such as with `chmod -R go= DIR`, or say with --umask that they shall have them",
        ))
    }
}

/// Folders of a data directory and of a store that hold what clients have sent.
const FOLDERS: [&str; 4] = ["blobs", "blobs/default", "uploads", "staging"];

/// Checks that a temporary file can be written in the data directory. The file has no name and leaves nothing behind.
fn scratch(data: &Path) -> Finding {
    const CHECK: &str = "local scratch";
    if !data.exists() {
        return Finding::warning(
            CHECK,
            format!("the data directory {} does not exist yet", data.display()),
            "`wavelume serve`, `worker` and `migrate` create the data directory; check --data if it should exist",
        );
    }
    // Temporary files of the service lie in this folder once it is there.
    let staging = data.join("staging");
    let directory = if staging.is_dir() { &staging } else { data };
    let written = tempfile::tempfile_in(directory).and_then(|mut file| {
        file.write_all(&[0; 4096])?;
        file.sync_all()
    });
    match written {
        Ok(()) => Finding::ok(CHECK, format!("{} can be written", directory.display())),
        Err(error) => Finding::fault(
            CHECK,
            format!("{} cannot be written: {error}", directory.display()),
            "let the user of the service own the directory and write to it",
        ),
    }
}

/// Returns the directory itself, or the nearest one above it that exists.
fn existing(directory: &Path) -> Option<&Path> {
    let above = |directory: &'_ Path| !directory.as_os_str().is_empty() && directory.exists();
    directory.ancestors().find(|directory| above(directory)).or(Some(Path::new(".")))
}

fn space(check: &str, directory: &Path, upload: u64) -> Finding {
    let Some(found) = existing(directory).and_then(|directory| statvfs(directory).ok()) else {
        return Finding::warning(check, format!("unknown for {}", directory.display()), "look with df");
    };
    let free = found.f_bavail.saturating_mul(found.f_frsize);
    let shown = format!("{} free for {}", size(free), directory.display());
    if free < upload.saturating_mul(2) {
        return Finding::fault(check, shown, format!("an upload takes up to {} on this disk: make room", size(upload)));
    }
    if found.f_files > 0 && found.f_favail < 1000 {
        let shown = format!("{shown}, but only {} more files", found.f_favail);
        return Finding::fault(check, shown, "remove files, or make a file system with more inodes");
    }
    if free < upload.saturating_mul(UPLOADS) {
        return Finding::warning(
            check,
            shown,
            format!("an upload takes up to {} on this disk: make room soon", size(upload)),
        );
    }
    Finding::ok(check, shown)
}

/// Judges the file system of a directory. `holds_sqlite` if the catalog lies on it.
fn kind(check: &str, directory: &Path, holds_sqlite: bool) -> Finding {
    let Some(number) = existing(directory).and_then(number) else {
        return Finding::ok(check, "of an unknown kind");
    };
    judged(check, number, holds_sqlite)
}

fn judged(check: &str, number: u32, holds_sqlite: bool) -> Finding {
    let Some((_, name, fit)) = KINDS.iter().find(|(known, ..)| *known == number) else {
        return Finding::ok(check, format!("of an unknown kind ({number:#x})"));
    };
    match fit {
        Fit::Memory => Finding::warning(
            check,
            *name,
            "a restart of the machine empties this file system: choose a directory on a disk",
        ),
        Fit::Network if holds_sqlite => Finding::fault(
            check,
            format!("{name}: SQLite does not keep its data whole there"),
            "move the catalog to a local disk, or use PostgreSQL (--database postgres://…)",
        ),
        Fit::Disk | Fit::Network => Finding::ok(check, *name),
    }
}

/// Returns a size in words: `12.3 GiB`.
fn size(bytes: u64) -> String {
    let (unit, name) = if bytes >= 1 << 30 { (1_u64 << 30, "GiB") } else { (1 << 20, "MiB") };
    format!("{:.1} {name}", bytes as f64 / unit as f64)
}

#[cfg(target_os = "linux")]
fn number(directory: &Path) -> Option<u32> {
    rustix::fs::statfs(directory).ok().map(|found| found.f_type as u32)
}

#[cfg(not(target_os = "linux"))]
fn number(_: &Path) -> Option<u32> {
    None
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;

    #[test]
    fn sqlite_is_refused_on_network_file_systems_and_bytes_are_not() {
        for (number, sqlite, other) in [
            (0x6969, Verdict::Fault, Verdict::Ok),
            (0xFE53_4D42, Verdict::Fault, Verdict::Ok),
            (0x6573_5546, Verdict::Fault, Verdict::Ok),
            (0x0102_1994, Verdict::Warning, Verdict::Warning),
            (0xEF53, Verdict::Ok, Verdict::Ok),
            (0x1234, Verdict::Ok, Verdict::Ok),
        ] {
            assert_eq!(judged("x", number, true).verdict, sqlite, "{number:#x}");
            assert_eq!(judged("x", number, false).verdict, other, "{number:#x}");
        }
        let mut numbers: Vec<u32> = KINDS.iter().map(|(number, ..)| *number).collect();
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!(numbers.len(), KINDS.len());
    }

    #[test]
    fn data_that_others_may_read_are_named() {
        use std::os::unix::fs::PermissionsExt;
        let directory = tempfile::tempdir().unwrap();
        let (data, mode) = (directory.path().join("data"), |mode| std::fs::Permissions::from_mode(mode));
        let (database, store) = (Database::File(data.join("catalog.sqlite")), Place::Directory(data.clone()));
        let judged = |umask| Disks::of(&data, &database, &store, 0, umask).permissions();
        assert!(judged(0o077).is_none(), "there is nothing yet");
        std::fs::create_dir_all(data.join("blobs")).unwrap();
        std::fs::write(data.join("catalog.sqlite"), b"").unwrap();
        for (path, bits) in [("blobs", 0o700), ("catalog.sqlite", 0o644), ("", 0o700)] {
            std::fs::set_permissions(data.join(path), mode(bits)).unwrap();
        }
        assert_eq!(judged(0o077).unwrap().verdict, Verdict::Ok, "nobody else gets into the directory");
        std::fs::set_permissions(&data, mode(0o750)).unwrap();
        let found = judged(0o077).unwrap();
        assert_eq!(found.verdict, Verdict::Warning);
        assert!(found.found.contains("data (750)") && found.found.contains("catalog.sqlite (644)"), "{}", found.found);
        std::fs::set_permissions(data.join("catalog.sqlite"), mode(0o640)).unwrap();
        assert_eq!(judged(0o027).unwrap().verdict, Verdict::Ok, "the group is meant to read");
    }

    #[test]
    fn a_disk_is_judged_without_leaving_anything_behind() {
        let directory = tempfile::tempdir().unwrap();
        assert_eq!(scratch(directory.path()).verdict, Verdict::Ok);
        let missing = directory.path().join("none/below");
        assert_eq!(scratch(&missing).verdict, Verdict::Warning);
        assert_eq!(space("x", &missing, 0).verdict, Verdict::Ok);
        assert_eq!(space("x", &missing, u64::MAX / 4).verdict, Verdict::Fault);
        assert!(!missing.exists());
        let file = directory.path().join("file");
        std::fs::write(&file, b"").unwrap();
        assert_eq!(scratch(&file).verdict, Verdict::Fault, "a file is no directory");
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
