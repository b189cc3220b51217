//! Head of an LM-63 file: revision, keywords, TILT line, and a unit stated in free text.

use crate::domain::Unit;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::FormatError;
use crate::formats::text::Source;
use crate::notes::{LuminaireNote, Quoted};

/// Revisions of LM-63 that differ in the meaning of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Revision {
    Lm63_1986,
    Lm63_1991,
    Lm63_1995,
    Lm63_2002,
    Lm63_2019,
}

impl Revision {
    /// Returns the revision that the first line of an LM-63 file names, and true if it is a known one; `None` if the
    /// line is no version tag. Case and blanks are ignored.
    pub(super) fn of_tag(line: &str) -> Option<(Self, bool)> {
        let tag: String = line.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_ascii_uppercase()).collect();
        let rest = tag.strip_prefix("IESNA").or_else(|| tag.strip_prefix("IES:"))?;
        let year = rest.trim_start_matches([':', '-']).trim_start_matches("LM-63").trim_start_matches([':', '-']);
        let known = match year {
            "86" | "1986" => Self::Lm63_1986,
            "91" | "1991" => Self::Lm63_1991,
            "95" | "1995" => Self::Lm63_1995,
            "02" | "2002" => Self::Lm63_2002,
            "19" | "2019" => Self::Lm63_2019,
            _ => return Some((Self::Lm63_2002, false)),
        };
        Some((known, true))
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Lm63_1986 => "LM-63-1986",
            Self::Lm63_1991 => "LM-63-1991",
            Self::Lm63_1995 => "LM-63-1995",
            Self::Lm63_2002 => "LM-63-2002",
            Self::Lm63_2019 => "LM-63-2019",
        }
    }

    /// Returns true if field 12 of the header is the ballast-lamp photometric factor. Later revisions reserve the
    /// field, then use it for a code of digits.
    pub(super) fn field_12_multiplies(self) -> bool {
        matches!(self, Self::Lm63_1986 | Self::Lm63_1991)
    }

    pub(super) fn field_12_name(self) -> &'static str {
        match self {
            Self::Lm63_1986 | Self::Lm63_1991 => "ballast_lamp_factor",
            Self::Lm63_1995 | Self::Lm63_2002 => "field_12",
            Self::Lm63_2019 => "file_generation_type",
        }
    }
}

/// Contents of an LM-63 file before its numbers.
pub(super) struct Labels {
    pub(super) revision: Revision,
    /// True if the file has the line TILT=INCLUDE, after which tilt factors follow.
    pub(super) tilt_included: bool,
    /// Byte offset of the first number after the TILT line.
    pub(super) numbers_at: usize,
    /// Keywords of the file and their text in order; `[MORE]` lines are joined to the keyword that they continue.
    keywords: Vec<(String, String)>,
}

/// Returns the text after `TILT=` in a line of an LM-63 file, or `None` for another line, such as one of a program that
/// names an argument so.
pub(super) fn tilt(line: &str) -> Option<&str> {
    let line = line.trim();
    let (word, rest) = line.split_at_checked(4)?;
    let value = rest.trim_start().strip_prefix('=')?;
    let is_code = value.trim_end().ends_with([')', ']', '}', ',', ';', ':']);
    (word.eq_ignore_ascii_case("TILT") && !is_code).then_some(value.trim())
}

/// Upper bound on the number of keywords that are kept of an LM-63 file; real files have a few dozen.
const MAX_KEYWORDS: usize = 1000;
/// Upper bound on the bytes of a keyword's text in an LM-63 file, continuation lines included; longer lines are
/// skipped.
const MAX_TEXT: usize = 4096;

/// Reads the revision and the keywords of an LM-63 file, up to its TILT line.
pub(super) fn read(source: &Source, report: &mut ParseReport) -> Result<Labels, FormatError> {
    let mut revision = None;
    let mut keywords: Vec<(String, String)> = Vec::new();
    let mut skipped = 0_usize;
    let (mut lines, mut first) = (source.lines(), true);
    let (tilt_value, numbers_at) = loop {
        let Some(line) = lines.next() else {
            return Err(source.malformed(
                source.text().len(),
                "the file ends, expected a line TILT=NONE, TILT=INCLUDE or one that names a file",
            ));
        };
        if let Some(value) = tilt(line.text) {
            break (value, line.offset + line.text.len());
        }
        let text = line.text.trim();
        if text.is_empty() {
            continue;
        }
        if std::mem::take(&mut first)
            && let Some((tagged, known)) = Revision::of_tag(text)
        {
            revision = Some(tagged);
            if !known {
                report.note(LuminaireNote::RevisionUnknown { tag: Quoted::of(text) });
            }
            continue;
        }
        if keywords.len() >= MAX_KEYWORDS || text.len() > MAX_TEXT {
            skipped += 1;
            continue;
        }
        let keyword = text.strip_prefix('[').and_then(|rest| rest.split_once(']'));
        match (keyword, keywords.last_mut()) {
            (Some((key, more)), Some((_, text)))
                if key.trim().eq_ignore_ascii_case("MORE") && text.len() + more.len() <= MAX_TEXT =>
            {
                text.push('\n');
                text.push_str(more.trim());
            }
            (Some((key, text)), _) => {
                let key = key.trim().to_uppercase();
                if key == "MORE" {
                    report.note(LuminaireNote::MoreContinuesNothing);
                }
                keywords.push((key, text.trim().to_owned()));
            }
            (None, _) => keywords.push(("LABEL".to_owned(), text.to_owned())),
        }
    };
    if skipped > 0 {
        report.note(LuminaireNote::LongText { lines: skipped, most_keywords: MAX_KEYWORDS, most_bytes: MAX_TEXT });
    }
    let revision = revision.unwrap_or_else(|| {
        report.note(LuminaireNote::NoVersionTag);
        Revision::Lm63_1986
    });
    let tilt_included = tilt_value.eq_ignore_ascii_case("INCLUDE");
    if !tilt_included && !tilt_value.eq_ignore_ascii_case("NONE") {
        report.note(LuminaireNote::TiltFile { name: Quoted::of(tilt_value) });
    }
    if keywords.iter().any(|(key, _)| key == "NEARFIELD") {
        report.note(LuminaireNote::NearField);
    }
    report.metadata.extend(keywords.iter().cloned());
    report.metadata.push(("tilt".to_owned(), tilt_value.chars().take(256).collect()));
    Ok(Labels { revision, tilt_included, numbers_at, keywords })
}

impl Labels {
    /// Returns the unit of the intensities in an LM-63 luminaire file: candela, unless a keyword line of the file
    /// states another. Some laboratories write radiometric values into this photometric format and say so in free text
    /// only.
    pub(super) fn unit(&self, report: &mut ParseReport) -> Unit {
        let declared = self.keywords.iter().find(|(key, _)| key.trim_start_matches('_') == "INTENSITYUNITS");
        if let Some((_, text)) = declared {
            let text = text.trim();
            if ["cd", "candela", "candelas"].iter().any(|name| text.eq_ignore_ascii_case(name)) {
                return Unit::Candela;
            }
            if let Some(unit) = intensity_unit(text) {
                return unit;
            }
            if text.eq_ignore_ascii_case(Unit::Relative.name()) {
                return Unit::Relative;
            }
            report.note(LuminaireNote::UnitUnknown { unit: Quoted::of(text) });
            return Unit::Relative;
        }
        for (key, text) in &self.keywords {
            if let Some(unit) = intensity_unit(text) {
                report.note(LuminaireNote::UnitOfKeyword { unit, keyword: snippet_key(key) });
                return unit;
            }
        }
        for (key, text) in &self.keywords {
            if let Some(word) = radiometric_word(text) {
                report.note(LuminaireNote::UnitDoubtful { keyword: snippet_key(key), word });
                return Unit::Relative;
            }
        }
        Unit::Candela
    }
}

fn snippet_key(key: &str) -> String {
    key.chars().filter(|c| !c.is_control()).take(40).collect()
}

/// Returns the text in lower case, with `u` for the micro sign and without blanks around slashes, to search for units.
fn normalised(text: &str) -> String {
    let text = text.to_lowercase().replace(['µ', 'μ'], "u");
    text.split('/').map(str::trim).collect::<Vec<_>>().join("/")
}

/// Returns the unit of radiant intensity that `text` mentions; `None` if there is none.
fn intensity_unit(text: &str) -> Option<Unit> {
    const UNITS: &[(&str, Unit)] = &[
        ("mw/sr", Unit::MilliwattPerSteradian),
        ("uw/sr", Unit::MicrowattPerSteradian),
        ("w/sr", Unit::WattPerSteradian),
        ("umol/s/sr", Unit::MicromolePerSecondSteradian),
        ("umol/(s sr)", Unit::MicromolePerSecondSteradian),
        ("milliwatts per steradian", Unit::MilliwattPerSteradian),
        ("microwatts per steradian", Unit::MicrowattPerSteradian),
        ("watts per steradian", Unit::WattPerSteradian),
    ];
    let text = normalised(text);
    UNITS.iter().find(|(name, _)| contains_word(&text, name)).map(|&(_, unit)| unit)
}

/// Returns a word of `text` that belongs to radiometry, not photometry; `None` if there is none.
fn radiometric_word(text: &str) -> Option<&'static str> {
    let text = normalised(text);
    ["uw", "umol", "ppf", "ppfd"].into_iter().find(|word| contains_word(&text, word))
}

/// Returns true if `text` contains `word` as a whole, without adjacent letters or digits.
fn contains_word(text: &str, word: &str) -> bool {
    let is_part = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
    text.match_indices(word)
        .any(|(at, _)| !is_part(text[..at].chars().next_back()) && !is_part(text[at + word.len()..].chars().next()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_read_whatever_their_blanks_and_case() {
        for (line, revision) in [
            ("IESNA91", Revision::Lm63_1991),
            ("IESNA95", Revision::Lm63_1995),
            ("IESNA:LM-63-1995", Revision::Lm63_1995),
            ("iesna: lm-63-2002 ", Revision::Lm63_2002),
            ("IES:LM-63-2019", Revision::Lm63_2019),
        ] {
            assert_eq!(Revision::of_tag(line), Some((revision, true)), "{line}");
        }
        assert_eq!(Revision::of_tag("IESNA:LM-63-2030"), Some((Revision::Lm63_2002, false)));
        assert_eq!(Revision::of_tag("[TEST] 1"), None);
    }

    #[test]
    fn the_tag_is_on_the_first_line_that_is_not_blank() {
        let revision = |text: &str| {
            let mut report = ParseReport::default();
            let labels = read(&Source::decode(text.as_bytes(), "t"), &mut report).unwrap();
            (labels.revision, report.notes.len())
        };
        assert_eq!(revision("\r\n \nIESNA:LM-63-1995\n[TEST] 1\nTILT=NONE\n"), (Revision::Lm63_1995, 0));
        assert_eq!(revision("[TEST] 1\nIESNA:LM-63-1995\nTILT=NONE\n"), (Revision::Lm63_1986, 1));
    }

    #[test]
    fn units_hide_in_sentences() {
        for (text, unit) in [
            ("Lumens-> mW, lux-> mW/m^2, candela-> mW/sr", Some(Unit::MilliwattPerSteradian)),
            ("file are expressed in mW/sr (200-280nm).", Some(Unit::MilliwattPerSteradian)),
            ("values in W / sr", Some(Unit::WattPerSteradian)),
            ("µW/sr", Some(Unit::MicrowattPerSteradian)),
            ("μmol/s/sr", Some(Unit::MicromolePerSecondSteradian)),
            ("kW/sr", None),
            ("a lamp of 5 mW", None),
        ] {
            assert_eq!(intensity_unit(text), unit, "{text}");
        }
        assert_eq!(radiometric_word("PPF: 1200 µmol"), Some("umol"));
        assert_eq!(radiometric_word("a nuwave ballast"), None);
    }

    #[test]
    fn tilt_lines_are_found_in_any_case() {
        assert_eq!(tilt(" tilt = NONE "), Some("NONE"));
        assert_eq!(tilt("TILT=../../etc/passwd"), Some("../../etc/passwd"));
        assert_eq!(tilt("TILTED"), None);
        assert_eq!((tilt("  tilt=None,"), tilt("tilt = none)")), (None, None));
        assert_eq!(tilt("äöü="), None);
    }
}
