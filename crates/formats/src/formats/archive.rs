//! Zip archives of measurements: what is inside, every name and size checked before anything is unpacked.
//!
//! Members are unpacked into memory, one at a time, and never under their names. What an archive holds beside
//! measurements (documents, pictures, the description of a GLDF luminaire) is named with the reason why it is not read.

use super::error::{FormatError, FormatErrorKind};
use super::text::snippet;
use super::{Acquisition, Format, Interpretation, NoteKind, Reader, Sample, foreign};
use std::collections::HashSet;
use std::io::{Cursor, Read};
use zip::{CompressionMethod, ZipArchive, result::ZipError};

const NAME: &str = "zip";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "zip archive of files of the other formats, one of which is chosen (.zip, .gldf, .npz)",
        extensions: &["zip", "gldf", "npz"],
        reads: true,
        writes: false,
    },
    options: &["wavelength_unit", "column", "axes", "normalization", "member"],
    probe: |sample: &Sample<'_>| if is_archive(sample.bytes) { 100 } else { 0 },
    read,
};

/// Files of one archive.
const MAX_MEMBERS: usize = 1000;
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

fn refused(kind: FormatErrorKind, message: impl Into<String>) -> FormatError {
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

    /// Reads a file of this archive as it would be read alone; an array finds its manifest beside it.
    pub fn read(&mut self, member: &Member, how: &Interpretation) -> Result<Acquisition, FormatError> {
        let unpacked = self.unpack(member)?;
        self.read_unpacked(member, &unpacked, how)
    }

    fn read_unpacked(
        &mut self,
        member: &Member,
        unpacked: &[u8],
        how: &Interpretation,
    ) -> Result<Acquisition, FormatError> {
        let mut how = Interpretation { member: None, ..how.clone() };
        if how.axes.is_none() {
            how.axes = self.manifest_of(member)?;
        }
        super::read(unpacked, &how)
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
    fn find(&self, wanted: &str) -> Result<Member, FormatError> {
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

    fn names(&self) -> String {
        listed(&self.members)
    }
}

/// The names of the first members.
fn listed(members: &[Member]) -> String {
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

/// Reads the member that was asked for, or the only one that is a measurement.
fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let mut archive = Archive::open(bytes)?;
    let member = match &how.member {
        Some(wanted) => archive.find(wanted)?,
        None => archive.only_measurement()?,
    };
    let unpacked = archive.unpack(&member)?;
    let mut acquisition = archive
        .read_unpacked(&member, &unpacked, how)
        .map_err(|error| FormatError { message: format!("{}: {}", snippet(&member.name), error.message), ..error })?;
    acquisition.report.metadata.insert(0, ("member".to_owned(), member.name.clone()));
    if how.member.is_none() {
        let message = format!("{} is the only measurement of the archive", snippet(&member.name));
        acquisition.report.note(NoteKind::Assumed, message);
    }
    Ok(acquisition)
}

impl Archive<'_> {
    /// The only member that some reader recognises.
    fn only_measurement(&mut self) -> Result<Member, FormatError> {
        let mut found = Vec::new();
        for member in self.members.clone() {
            if super::recognises(&self.unpack(&member)?) {
                found.push(member);
            }
        }
        match found.as_slice() {
            [only] => Ok(only.clone()),
            [] => {
                let message = format!("an archive without a measurement, found: {}", self.names());
                Err(refused(FormatErrorKind::Unsupported, message))
            }
            several => {
                let message = format!(
                    "an archive of {} measurements, expected the option member, the name of one: {}",
                    several.len(),
                    listed(several)
                );
                Err(refused(FormatErrorKind::NeedsOption, message))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    const LAMP: &[u8] = b"IESNA:LM-63-2002\n[TEST] 1\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0 1 1 1\n0 90\n0\n10 0\n";

    fn zipped(files: &[(&str, &[u8])]) -> Vec<u8> {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in files {
            let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
            writer.start_file(*name, options).unwrap();
            writer.write_all(bytes).unwrap();
        }
        writer.finish().unwrap().into_inner()
    }

    fn plain(bytes: &[u8], member: Option<&str>) -> Result<Acquisition, FormatError> {
        let how = Interpretation { member: member.map(str::to_owned), ..Interpretation::default() };
        super::super::read(bytes, &how)
    }

    #[test]
    fn the_only_measurement_is_read_and_one_of_several_is_asked_for() {
        let one = zipped(&[("docs/readme.pdf", b"%PDF-1.7"), ("ldc/lamp.ies", LAMP), ("product.xml", b"<Root/>")]);
        let read = plain(&one, None).unwrap();
        assert_eq!((read.format, read.report.metadata[0].1.as_str()), ("lm-63", "ldc/lamp.ies"));
        assert!(read.report.notes.iter().any(|note| note.message.contains("only measurement")));
        let two = zipped(&[("a/x.ies", LAMP), ("b/x.ies", LAMP), ("y.ies", LAMP), ("__MACOSX/._y.ies", b"")]);
        let error = plain(&two, None).unwrap_err();
        assert!(
            error.kind == FormatErrorKind::NeedsOption && error.message.contains("`a/x.ies`, `b/x.ies`, `y.ies`"),
            "{error}"
        );
        assert_eq!(plain(&two, Some("y.ies")).unwrap().format, "lm-63");
        assert_eq!(plain(&two, Some("b/x.ies")).unwrap().report.metadata[0].1, "b/x.ies");
        for (wanted, words) in [("x.ies", "several files"), ("z.ies", "no file")] {
            let error = plain(&two, Some(wanted)).unwrap_err();
            assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains(words), "{error}");
        }
        let error = plain(LAMP, Some("y.ies")).unwrap_err();
        assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("`member`"), "{error}");
    }

    #[test]
    fn an_array_finds_its_manifest_beside_it() {
        let array = super::super::write_npy(&[4, 3], &[0.5; 12]);
        let bytes = zipped(&[("v.npy", &array), ("v.axes.json", br#"{"quantity":"edf","axes":["hemi:0","rgb"]}"#)]);
        assert_eq!(plain(&bytes, None).unwrap().format, "npy");
        let error = plain(&zipped(&[("v.npy", &array), ("v.axes.json", b"{")]), None).unwrap_err();
        assert!(error.kind == FormatErrorKind::Malformed && error.message.contains("v.axes.json"), "{error}");
    }

    #[test]
    fn hostile_archives_are_refused_before_they_are_unpacked() {
        use FormatErrorKind::{Malformed, OverLimit, Unsupported};
        let inner = zipped(&[("lamp.ies", LAMP)]);
        let bomb = zipped(&[("zeros.npy", &vec![0; 20 << 20])]);
        let many: Vec<String> = (0..=MAX_MEMBERS).map(|i| format!("{i}.ies")).collect();
        let many: Vec<(&str, &[u8])> = many.iter().map(|name| (name.as_str(), LAMP)).collect();
        let mut encrypted = zipped(&[("lamp.ies", LAMP)]);
        // Bit 0 of the flags, in the local header and in the directory.
        let directory = encrypted.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        encrypted[6] |= 1;
        encrypted[directory + 8] |= 1;
        let mut lying = zipped(&[("lamp.ies", LAMP)]);
        let directory = lying.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        lying[directory + 24..directory + 28].copy_from_slice(&5_u32.to_le_bytes());
        let mut damaged = zipped(&[("lamp.ies", LAMP)]);
        damaged[45] ^= 0xFF;
        let mut exotic = zipped(&[("lamp.ies", LAMP)]);
        let directory = exotic.windows(4).position(|w| w == b"PK\x01\x02").unwrap();
        exotic[directory + 10] = 12;
        exotic[8] = 12;
        for (bytes, kind, words) in [
            (zipped(&[("a.zip", &inner)]), Unsupported, "is an archive itself"),
            (zipped(&[("../lamp.ies", LAMP)]), Malformed, "expected a name inside the archive"),
            (zipped(&[("/etc/passwd", LAMP)]), Malformed, "expected a name inside the archive"),
            (zipped(&[("c:\\lamp.ies", LAMP)]), Malformed, "expected a name inside the archive"),
            (bomb, OverLimit, "unpack to 20971520 bytes"),
            (zipped(&many), OverLimit, "1001 files, expected at most 1000"),
            (encrypted, Unsupported, "is encrypted"),
            (lying, Malformed, "expected 5"),
            (damaged, Malformed, "lamp.ies"),
            (exotic, Unsupported, "expected deflate"),
            (zipped(&[("readme.pdf", b"%PDF-1.7")]), Unsupported, "without a measurement, found: `readme.pdf`"),
            (zipped(&[]), Unsupported, "without a measurement"),
            (b"PK\x03\x04 and nothing more".to_vec(), Malformed, "cannot be read"),
        ] {
            let error = plain(&bytes, None).unwrap_err();
            assert_eq!((error.kind, error.format), (kind, NAME), "{error}");
            assert!(error.message.contains(words), "{words}: {error}");
        }
    }

    #[test]
    fn a_cut_or_changed_archive_never_panics() {
        let whole = zipped(&[("a.ies", LAMP), ("b.ies", LAMP)]);
        for at in 0..whole.len() {
            assert!(plain(&whole[..at], Some("a.ies")).is_err(), "{at}");
            for with in [0, 1, 0x7F, 0xFF] {
                let mut changed = whole.clone();
                changed[at] = with;
                let _ = plain(&changed, Some("a.ies"));
            }
        }
    }
}
