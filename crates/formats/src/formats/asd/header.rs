//! Header of an ASD file: 484 bytes in little-endian order, equal in all versions.

use super::about::NAME;
use crate::domain::limits::MAX_WAVELENGTHS;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::text::{self, Brief};

/// Length of the header in bytes; the spectrum follows.
pub(super) const LENGTH: usize = 484;

/// Byte offsets of the fields that are read.
mod at {
    pub(super) const COMMENT: usize = 3;
    pub(super) const SAVED: usize = 160;
    pub(super) const DARK_CORRECTED: usize = 181;
    pub(super) const KIND: usize = 186;
    pub(super) const FIRST: usize = 191;
    pub(super) const STEP: usize = 195;
    pub(super) const ELEMENT: usize = 199;
    pub(super) const CHANNELS: usize = 204;
    pub(super) const INTEGRATION: usize = 390;
    pub(super) const SERIAL: usize = 400;
    pub(super) const FLAGS: usize = 422;
    pub(super) const REFERENCES: usize = 427;
    pub(super) const SPECTRA: usize = 429;
    pub(super) const INSTRUMENT: usize = 431;
    pub(super) const GAINS: [usize; 2] = [436, 438];
    pub(super) const SPLICES: [usize; 2] = [444, 448];
}

/// Quantity in which the instrument showed the spectrum when it was saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Raw,
    Reflectance,
    Radiance,
    NoUnits,
    Irradiance,
    QualityIndex,
    Transmittance,
    Unknown,
    Absorbance,
}

impl Kind {
    const ALL: [Self; 9] = [
        Self::Raw,
        Self::Reflectance,
        Self::Radiance,
        Self::NoUnits,
        Self::Irradiance,
        Self::QualityIndex,
        Self::Transmittance,
        Self::Unknown,
        Self::Absorbance,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw counts",
            Self::Reflectance => "reflectance",
            Self::Radiance => "radiance",
            Self::NoUnits => "values without a unit",
            Self::Irradiance => "irradiance",
            Self::QualityIndex => "a quality index",
            Self::Transmittance => "transmittance",
            Self::Unknown => "values of an unknown kind",
            Self::Absorbance => "absorbance",
        }
    }
}

/// Number in which values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    Float32,
    Int32,
    Float64,
}

impl Element {
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Float32 | Self::Int32 => 4,
            Self::Float64 => 8,
        }
    }

    /// Returns the number in the first bytes of `from`, which has as many as the number needs.
    pub(super) fn number(self, from: &[u8]) -> f64 {
        match self {
            Self::Float32 => f64::from(f32::from_le_bytes(bytes(from, 0))),
            Self::Int32 => f64::from(i32::from_le_bytes(bytes(from, 0))),
            Self::Float64 => f64::from_le_bytes(bytes(from, 0)),
        }
    }
}

/// Detectors in the order of the bits that say that they were saturated.
const DETECTORS: [&str; 3] = ["VNIR", "SWIR1", "SWIR2"];

/// Fields of the header that matter for a reading.
pub(super) struct Header {
    /// Version of the file format, 1 to 8.
    pub(super) version: u8,
    pub(super) kind: Kind,
    /// First wavelength and distance to the next one, in nm.
    pub(super) first: f64,
    pub(super) step: f64,
    pub(super) channels: usize,
    pub(super) element: Element,
    pub(super) is_dark_corrected: bool,
    /// Detectors that were saturated.
    pub(super) saturated: Vec<&'static str>,
    /// Last wavelengths in nm of the first and of the second detector.
    pub(super) splices: [f64; 2],
    /// Description of the measurement for people.
    pub(super) fields: Vec<(String, String)>,
}

/// Returns the version of the file format, 1 to 8, from the first three bytes of a file.
pub(super) fn version(file: &[u8]) -> Option<u8> {
    match file.get(..3)? {
        b"ASD" | b"asd" => Some(1),
        [b'a', b's', digit @ b'2'..=b'8'] => Some(digit - b'0'),
        _ => None,
    }
}

/// Returns `N` bytes from an offset on; zeros behind the end, which callers have excluded.
fn bytes<const N: usize>(from: &[u8], offset: usize) -> [u8; N] {
    from.get(offset..).and_then(<[u8]>::first_chunk).copied().unwrap_or([0; N])
}

fn float(file: &[u8], offset: usize) -> f64 {
    f64::from(f32::from_le_bytes(bytes(file, offset)))
}

pub(super) fn short(file: &[u8], offset: usize) -> u16 {
    u16::from_le_bytes(bytes(file, offset))
}

/// Returns a text of a fixed or stated length without the zeros that fill it.
pub(super) fn text_of(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let text = text::head(&bytes[..end], bytes.len());
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>().trim().to_owned()
}

/// Reads the header of a file.
pub(super) fn read(file: &[u8]) -> Result<Header, FormatError> {
    let malformed = |offset, message: String| FormatError::at_byte(FormatErrorKind::Malformed, NAME, offset, message);
    let version = version(file).ok_or_else(|| malformed(0, "expected `ASD` or `as2` to `as8`".to_owned()))?;
    if file.len() < LENGTH {
        let message = format!("the file ends after {} bytes, expected a header of {LENGTH}", file.len());
        return Err(malformed(file.len(), message));
    }
    let kind = usize::from(file[at::KIND]);
    let kind = *Kind::ALL
        .get(kind)
        .ok_or_else(|| malformed(at::KIND, format!("found {kind} as the kind of data, expected 0 to 8")))?;
    let element = match file[at::ELEMENT] {
        0 => Element::Float32,
        1 => Element::Int32,
        2 => Element::Float64,
        other => {
            let message =
                format!("found {other} as the format of numbers, expected 0 (float), 1 (integer) or 2 (double)");
            return Err(malformed(at::ELEMENT, message));
        }
    };
    let channels = usize::from(short(file, at::CHANNELS));
    if channels == 0 || channels > MAX_WAVELENGTHS {
        let message = format!("found {channels} as the number of channels, expected 1 to {MAX_WAVELENGTHS}");
        return Err(malformed(at::CHANNELS, message));
    }
    let (first, step) = (float(file, at::FIRST), float(file, at::STEP));
    if !(first.is_finite() && first > 0.0) {
        return Err(malformed(
            at::FIRST,
            format!("first wavelength {}, expected a positive number of nm", Brief(first)),
        ));
    }
    if !(step.is_finite() && step > 0.0) {
        let message = format!("distance of wavelengths {}, expected a positive number of nm", Brief(step));
        return Err(malformed(at::STEP, message));
    }
    let flags = file[at::FLAGS];
    let saturated = (0..DETECTORS.len()).filter(|bit| flags & (1 << bit) != 0).map(|bit| DETECTORS[bit]).collect();
    Ok(Header {
        version,
        kind,
        first,
        step,
        channels,
        element,
        is_dark_corrected: file[at::DARK_CORRECTED] != 0,
        saturated,
        splices: at::SPLICES.map(|offset| float(file, offset)),
        fields: fields(file, kind),
    })
}

/// Returns the fields that describe the measurement for people; those that are empty or 0 are left out.
fn fields(file: &[u8], kind: Kind) -> Vec<(String, String)> {
    const INSTRUMENTS: [&str; 8] = ["", "PSII", "LSVNIR", "FSVNIR", "FSFR", "FSNIR", "CHEM", "FSFR unattended"];
    let number = |offset| match short(file, offset) {
        0 => String::new(),
        number => number.to_string(),
    };
    let model = INSTRUMENTS.get(usize::from(file[at::INSTRUMENT])).copied().unwrap_or_default();
    let integration = u32::from_le_bytes(bytes(file, at::INTEGRATION));
    let fields = [
        ("comment", text_of(&file[at::COMMENT..at::SAVED])),
        ("saved", saved(file).unwrap_or_default()),
        ("saved as", kind.name().to_owned()),
        ("instrument", format!("{model} {}", number(at::SERIAL)).trim().to_owned()),
        ("integration time (ms)", if integration == 0 { String::new() } else { integration.to_string() }),
        ("SWIR1 gain", number(at::GAINS[0])),
        ("SWIR2 gain", number(at::GAINS[1])),
        ("spectra averaged", number(at::SPECTRA)),
        ("white references averaged", number(at::REFERENCES)),
    ];
    let kept = fields.into_iter().filter(|(_, value)| !value.is_empty());
    kept.map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Returns the date and time at which the file was saved, by the instrument's clock, if it is one.
fn saved(file: &[u8]) -> Option<String> {
    let part = |index: usize| short(file, at::SAVED + 2 * index);
    let [second, minute, hour, day, month, year] = [0, 1, 2, 3, 4, 5].map(part);
    let is_date = second < 62 && minute < 60 && hour < 24 && (1..=31).contains(&day) && month < 12 && year < 500;
    is_date.then(|| format!("{:04}-{:02}-{day:02} {hour:02}:{minute:02}:{second:02}", year + 1900, month + 1))
}
