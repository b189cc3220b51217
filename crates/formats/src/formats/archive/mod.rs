//! Zip archives of measurements; every name and size is checked before anything is unpacked.
//!
//! Members are unpacked into memory, one at a time; no file is created under a member's name. Other contents
//! (documents, pictures, the description of a GLDF luminaire) are reported with the reason why they are not read.

pub(super) mod about;
mod container;

pub use container::{Archive, Member, is_archive};

use super::acquisition::Acquisition;
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::probing;
use super::reader::refuse_idle_options;
use super::text::snippet;
use crate::notes::{Quoted, TextNote};
use about::ABOUT;
use container::{listed, refused};

/// Names of the options that the files inside an archive may accept, and of the option `member` that selects one.
const OPTIONS: &[&str] = &["wavelength_unit", "column", "axes", "normalization", "member"];

/// Reads the measurement in the requested file of an archive, or in the only file that is a measurement.
pub(super) fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    refuse_idle_options(&ABOUT, OPTIONS, how)?;
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
        acquisition.report.note(TextNote::OnlyMeasurementOfArchive { member: Quoted::of(&member.name) });
    }
    Ok(acquisition)
}

impl Archive<'_> {
    /// Reads the measurement in a file of the archive. An array takes the manifest beside it.
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
        probing::read_file(unpacked, &how)
    }

    /// Returns the only file of the archive that is a measurement in a known format; refuses none and several.
    fn only_measurement(&mut self) -> Result<Member, FormatError> {
        let mut found = Vec::new();
        for member in self.members().to_vec() {
            if probing::recognises_file(&self.unpack(&member)?) {
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
    use super::about::NAME;
    use super::container::MAX_MEMBERS;
    use super::*;
    use std::io::{Cursor, Write};
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipWriter};

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
    fn luminaires_of_a_gldf_archive_may_be_xml_and_have_emitters() {
        let data = "<LuminousData><LuminousIntensity><IntData h=\"0\" v=\"0\">9</IntData>\
                    <IntData h=\"0\" v=\"90\">0</IntData></LuminousIntensity></LuminousData>";
        let emitter = |id: &str| format!("<Emitter><ID>{id}</ID>{data}</Emitter>");
        let xml = format!("<IESTM33-22>{}{}</IESTM33-22>", emitter("up"), emitter("down"));
        let bytes = zipped(&[
            ("product.xml", b"<Root xmlns:x=\"https://gldf.io/xsd\"/>"),
            ("ldc/3000K.iesxml", xml.as_bytes()),
            ("ldc/4000K.iesxml", xml.as_bytes()),
            ("ldc/lamp.ies", LAMP),
        ]);
        let error = plain(&bytes, None).unwrap_err();
        assert!(error.message.contains("3 measurements") && error.message.contains("4000K.iesxml"), "{error}");
        let how = Interpretation {
            member: Some("4000K.iesxml".to_owned()),
            column: Some("down".to_owned()),
            ..Interpretation::default()
        };
        let lamp = super::super::read(&bytes, &how).unwrap();
        assert_eq!((lamp.format, lamp.report.metadata[0].1.as_str()), ("tm-33", "ldc/4000K.iesxml"));
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
