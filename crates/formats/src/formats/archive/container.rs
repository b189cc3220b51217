//! The files inside a zip archive: every name and size checked before anything is unpacked.
//!
//! Members are unpacked into memory, one at a time, and never under their names.

use super::about::NAME;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::foreign;
use crate::formats::text::snippet;
use std::collections::HashSet;
use std::io::{Cursor, Read};
use zip::{CompressionMethod, ZipArchive, result::ZipError};

/// Files of one archive.
pub(super) const MAX_MEMBERS: usize = 1000;
/// Bytes of all files together, unpacked.
const MAX_UNPACKED: u64 = 2 << 30;
/// Unpacked bytes for each of the archive's, beyond the first that are free: tables of numbers make some ten.
const MAX_RATIO: u64 = 200;
const FREE: u64 = 1 << 20;
/// Bytes of a name.
const MAX_NAME: usize = 1024;
/// How the names of an array and of the manifest beside it end.
const ARRAY: &str = ".npy";
const MANIFEST: &str = ".axes.json";
/// Names that a message lists.
const SHOWN: usize = 10;

/// A file of an archive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name with its folders, `/` between them.
    pub name: String,
    /// Its size, unpacked.
    pub bytes: u64,
    index: usize,
}

/// An archive whose names and sizes are within their limits.
#[derive(Debug)]
pub struct Archive<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    members: Vec<Member>,
}

/// Whether `bytes` begin a zip archive.
pub fn is_archive(bytes: &[u8]) -> bool {
    (bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")) && !foreign::is_workbook(bytes)
}

pub(super) fn refused(kind: FormatErrorKind, message: impl Into<String>) -> FormatError {
    FormatError::new(kind, NAME, message)
}

impl<'a> Archive<'a> {
    /// Reads the list of members; nothing is unpacked.
    pub fn open(bytes: &'a [u8]) -> Result<Self, FormatError> {
        let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken("the archive", &error))?;
        if zip.len() > MAX_MEMBERS {
            let message = format!("{} files, expected at most {MAX_MEMBERS}", zip.len());
            return Err(refused(FormatErrorKind::OverLimit, message));
        }
        let (mut members, mut known, mut total) = (Vec::new(), HashSet::new(), 0_u64);
        for index in 0..zip.len() {
            // Raw: of a file that cannot be unpacked, the reason is told below.
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
                let message = format!("{quoted} is packed with {:?}, expected deflate, or stored", file.compression());
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
                return Err(refused(FormatErrorKind::Malformed, format!("{quoted} twice, expected each name once")));
            }
            if !is_litter(&name) {
                members.push(Member { name, bytes: file.size(), index });
            }
        }
        members.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Self { zip, members })
    }

    /// The files, by name; those that operating systems add are left out.
    pub fn members(&self) -> &[Member] {
        &self.members
    }

    /// Unpacks a file of this archive and checks it against its size and checksum.
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
            let message =
                format!("{quoted} unpacks to {} bytes or more, expected {} as are stated", bytes.len(), member.bytes);
            return Err(refused(FormatErrorKind::Malformed, message));
        }
        if is_archive(&bytes) {
            let message = format!("{quoted} is an archive itself, expected a file: unpack it");
            return Err(refused(FormatErrorKind::Unsupported, message));
        }
        Ok(bytes)
    }

    /// The manifest that lies beside an array as `NAME.axes.json`.
    pub fn manifest_of(&mut self, array: &Member) -> Result<Option<serde_json::Value>, FormatError> {
        let Some(stem) = array.name.strip_suffix(ARRAY) else { return Ok(None) };
        let name = format!("{stem}{MANIFEST}");
        let Some(beside) = self.members.iter().find(|member| member.name == name).cloned() else { return Ok(None) };
        let manifest = serde_json::from_slice(&self.unpack(&beside)?);
        manifest.map(Some).map_err(|error| {
            refused(FormatErrorKind::Malformed, format!("{}: {error}, expected a manifest in JSON", snippet(&name)))
        })
    }

    /// Whether a file is the manifest of an array beside it.
    pub fn is_manifest(&self, member: &Member) -> bool {
        let Some(stem) = member.name.strip_suffix(MANIFEST) else { return false };
        self.members.iter().any(|other| other.name.strip_suffix(ARRAY) == Some(stem))
    }

    /// The member of that name, or whose name without folders it is.
    pub(super) fn find(&self, wanted: &str) -> Result<Member, FormatError> {
        let exact = self.members.iter().find(|member| member.name == wanted);
        let mut bare = self.members.iter().filter(|member| member.name.rsplit('/').next() == Some(wanted));
        match (exact, bare.next(), bare.next()) {
            (Some(member), ..) | (None, Some(member), None) => Ok(member.clone()),
            (None, found, _) => {
                let count = if found.is_some() { "several files" } else { "no file" };
                let message = format!("{count} {} in the archive, expected one of: {}", snippet(wanted), self.names());
                Err(refused(FormatErrorKind::NeedsOption, message))
            }
        }
    }

    pub(super) fn names(&self) -> String {
        listed(&self.members)
    }
}

/// The names of the first members.
pub(super) fn listed(members: &[Member]) -> String {
    let shown: Vec<String> = members.iter().take(SHOWN).map(|member| snippet(&member.name)).collect();
    let more = members.len().saturating_sub(SHOWN);
    format!("{}{}", shown.join(", "), if more > 0 { format!(" and {more} more") } else { String::new() })
}

/// A name inside the archive and nowhere else, in whatever way it is written.
fn checked_name(name: &str) -> Result<String, FormatError> {
    let outside = name.starts_with(['/', '\\'])
        || name.contains(['\\', ':'])
        || name.chars().any(char::is_control)
        || name.split('/').any(|part| part == "..");
    if outside || name.len() > MAX_NAME || name.is_empty() {
        let message = format!("a file called {}, expected a name inside the archive", snippet(name));
        return Err(refused(FormatErrorKind::Malformed, message));
    }
    Ok(name.to_owned())
}

/// What operating systems put into archives unasked.
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
