//! Files inside a zip archive; every name and size is checked before anything is unpacked.
//!
//! Members are unpacked into memory, one at a time; no file is created under a member's name.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::foreign;
use crate::formats::text::snippet;
use std::collections::HashSet;
use std::io::{Cursor, Read};
use zip::{CompressionMethod, ZipArchive, result::ZipError};

/// Upper bound on the number of files in one archive.
pub(super) const MAX_MEMBERS: usize = 1000;
/// Upper bound on the unpacked size of all files in an archive together, in bytes.
const MAX_UNPACKED: u64 = 2 << 30;
/// Upper bound on the unpacked bytes per byte of an archive, beyond an allowance of [`FREE`] bytes. Tables of numbers
/// reach about 10. Raising it accepts archives that expand more.
const MAX_RATIO: u64 = 200;
const FREE: u64 = 1 << 20;
/// Upper bound on the length of a file's name in an archive, in bytes.
const MAX_NAME: usize = 1024;
/// Suffixes of the file names of an array and of the manifest that describes its axes.
const ARRAY: &str = ".npy";
const MANIFEST: &str = ".axes.json";
/// Upper bound on the number of file names that a message lists.
const SHOWN: usize = 10;

/// File within an archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Name of the file in the archive, including folders, separated by `/`.
    pub name: String,
    /// Unpacked size of the file in bytes.
    pub bytes: u64,
    index: usize,
}

/// Zip archive whose file names and sizes are within their limits.
#[derive(Debug)]
pub struct Archive<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    members: Vec<Member>,
}

/// Returns true if `bytes` begin as a zip archive other than a spreadsheet workbook.
pub fn is_archive(bytes: &[u8]) -> bool {
    (bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")) && !foreign::is_workbook(bytes)
}

pub(super) fn refused(kind: FormatErrorKind, message: impl Into<String>) -> FormatError {
    FormatError::new(kind, NAME, message)
}

impl<'a> Archive<'a> {
    /// Reads the list of files in an archive without unpacking any.
    pub fn open(bytes: &'a [u8]) -> Result<Self, FormatError> {
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken("the archive", &error))?;
        if zip.len() > MAX_MEMBERS {
            let message = format!("an archive of {} files, expected at most {MAX_MEMBERS}", zip.len());
            return Err(refused(FormatErrorKind::OverLimit, message));
        }
        let (mut members, mut known, mut total) = (Vec::new(), HashSet::new(), 0_u64);
        for index in 0..zip.len() {
            // Raw access, because a file that cannot be unpacked is reported with its reason below.
            let file = zip.by_index_raw(index).map_err(|error| broken(&format!("file {index}"), &error))?;
            let name = checked_name(file.name())?;
            let quoted = snippet(&name);
            if file.is_dir() {
                continue;
            }
            if file.encrypted() {
                let message = format!("{quoted} is encrypted, expected an archive without a password");
                return Err(refused(FormatErrorKind::Unsupported, message));
            }
            if file.is_symlink() {
                return Err(refused(FormatErrorKind::Unsupported, format!("{quoted} is a link, expected a file")));
            }
            if !matches!(file.compression(), CompressionMethod::Stored | CompressionMethod::Deflated) {
                let message =
                    format!("{quoted} is compressed with {:?}, expected deflate or no compression", file.compression());
                return Err(refused(FormatErrorKind::Unsupported, message));
            }
            total = total.saturating_add(file.size());
            let most = MAX_RATIO.saturating_mul(bytes.len() as u64).saturating_add(FREE).min(MAX_UNPACKED);
            if total > most {
                let message = format!(
                    "the files unpack to {total} bytes and more, expected at most {most} from an archive of {} bytes",
                    bytes.len()
                );
                return Err(refused(FormatErrorKind::OverLimit, message));
            }
            if !known.insert(name.clone()) {
                return Err(refused(
                    FormatErrorKind::Malformed,
                    format!("the archive lists {quoted} twice, expected each name once"),
                ));
            }
            if !is_litter(&name) {
                members.push(Member { name, bytes: file.size(), index });
            }
        }
        members.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Self { zip, members })
    }

    /// Returns the files of the archive, sorted by name, without the files that operating systems add.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// Unpacks a file of the archive and checks it against its size and checksum.
    pub fn unpack(&mut self, member: &Member) -> Result<Vec<u8>, FormatError> {
        let quoted = snippet(&member.name);
        let file = self.zip.by_index(member.index).map_err(|error| broken(&quoted, &error))?;
        // The size was checked when the archive was opened.
        let mut bytes = Vec::with_capacity(member.bytes as usize);
        let read = file.take(member.bytes + 1).read_to_end(&mut bytes);
        read.map_err(|error| {
            refused(FormatErrorKind::Malformed, format!("{quoted} does not unpack, expected a whole file: {error}"))
        })?;
        if bytes.len() as u64 != member.bytes {
            let message = format!(
                "{quoted} unpacks to {} bytes or more, expected {} as the archive states",
                bytes.len(),
                member.bytes
            );
            return Err(refused(FormatErrorKind::Malformed, message));
        }
        if is_archive(&bytes) {
            let message = format!("{quoted} is an archive itself, expected a file: unpack it");
            return Err(refused(FormatErrorKind::Unsupported, message));
        }
        Ok(bytes)
    }

    /// Returns the manifest of an array, from the file `NAME.axes.json` beside it in the archive; `None` if there is
    /// none.
    pub fn manifest_of(&mut self, array: &Member) -> Result<Option<serde_json::Value>, FormatError> {
        let Some(stem) = array.name.strip_suffix(ARRAY) else { return Ok(None) };
        let name = format!("{stem}{MANIFEST}");
        let Some(beside) = self.members.iter().find(|member| member.name == name).cloned() else { return Ok(None) };
        let manifest = serde_json::from_slice(&self.unpack(&beside)?);
        manifest.map(Some).map_err(|error| {
            refused(FormatErrorKind::Malformed, format!("{}: {error}, expected a manifest in JSON", snippet(&name)))
        })
    }

    /// Returns true if a file of the archive is the manifest of an array beside it.
    pub fn is_manifest(&self, member: &Member) -> bool {
        let Some(stem) = member.name.strip_suffix(MANIFEST) else { return false };
        self.members.iter().any(|other| other.name.strip_suffix(ARRAY) == Some(stem))
    }

    /// Returns the file of the archive whose path is `wanted`, or else the only file in any folder whose name without
    /// the folder is `wanted`.
    pub(super) fn find(&self, wanted: &str) -> Result<Member, FormatError> {
        let exact = self.members.iter().find(|member| member.name == wanted);
        let mut bare = self.members.iter().filter(|member| member.name.rsplit('/').next() == Some(wanted));
        match (exact, bare.next(), bare.next()) {
            (Some(member), ..) | (None, Some(member), None) => Ok(member.clone()),
            (None, found, _) => {
                let count = if found.is_some() { "several files" } else { "no file" };
                let message =
                    format!("{count} named {} in the archive, expected one of: {}", snippet(wanted), self.names());
                Err(refused(FormatErrorKind::NeedsOption, message))
            }
        }
    }

    pub(super) fn names(&self) -> String {
        listed(&self.members)
    }
}

/// Returns the names of the first files of an archive, for messages.
pub(super) fn listed(members: &[Member]) -> String {
    let shown: Vec<String> = members.iter().take(SHOWN).map(|member| snippet(&member.name)).collect();
    let more = members.len().saturating_sub(SHOWN);
    format!("{}{}", shown.join(", "), if more > 0 { format!(" and {more} more") } else { String::new() })
}

/// Returns the name of a file in an archive; `\` between folders, which programs of Windows write, becomes `/`. Refuses
/// a name that points outside the archive (absolute, with `..` or `:`), is empty or is too long.
fn checked_name(name: &str) -> Result<String, FormatError> {
    let name = name.replace('\\', "/");
    let outside = name.starts_with('/')
        || name.contains(':')
        || name.chars().any(char::is_control)
        || name.split('/').any(|part| part == "..");
    if outside || name.len() > MAX_NAME || name.is_empty() {
        let message = format!(
            "the file name {} is empty, too long or points elsewhere, expected a name inside the archive",
            snippet(&name)
        );
        return Err(refused(FormatErrorKind::Malformed, message));
    }
    Ok(name)
}

/// Returns true for the names of files that operating systems add to archives, such as `__MACOSX`.
fn is_litter(name: &str) -> bool {
    name.split('/').any(|part| part.starts_with('.') || part == "__MACOSX" || part.eq_ignore_ascii_case("thumbs.db"))
}

fn broken(what: &str, error: &ZipError) -> FormatError {
    let kind = match error {
        ZipError::UnsupportedArchive(_) => FormatErrorKind::Unsupported,
        _ => FormatErrorKind::Malformed,
    };
    refused(kind, format!("{what} cannot be read, expected a whole zip archive: {error}"))
}
