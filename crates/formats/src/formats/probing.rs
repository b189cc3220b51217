//! Table of formats, and selection of the reader that recognises a file by its content.

use super::acquisition::Acquisition;
use super::archive::about::ABOUT as ARCHIVES;
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use super::reader::{Format, HEAD_BYTES, Reader, Sample, refuse_idle_options};
use super::{foreign, tabphase, text};

/// Readers of files that are no archives, in the order in which they are tried. A new format needs its module and a
/// line here.
const TABLE: &[Reader] = &[
    super::npy::READER,
    super::mbsdf::READER,
    super::rgl::READER,
    super::merl::READER,
    super::asd::READER,
    super::lm63::READER,
    super::eulumdat::READER,
    super::radiometric_csv::READER,
    super::radiometric_csv::arrow::READER,
    super::tm27::READER,
    super::tm33::READER,
    super::zemax::READER,
    super::bsdf_xml::READER,
    super::svc::READER,
    super::speos::READER,
    super::sekonic::READER,
    super::alta::READER,
    super::analytic::READER,
    super::phase_table::READER,
    super::spectral_table::READER,
];

/// Confidence (0 to 100) from which a reader takes precedence over the signatures of known formats that cannot be read.
/// Raising it refuses more files as such formats.
const SURE: u8 = 50;

/// Formats that can be written but not read.
const WRITTEN: &[Format] = &[tabphase::ABOUT];

/// Returns every known format: first those that can be read, in the order in which they are tried, then those that can
/// only be written.
pub fn formats() -> Vec<Format> {
    readable().chain(WRITTEN.iter().copied()).collect()
}

/// Returns the formats that can be read: archives, which are tried first, then the formats of single files.
fn readable() -> impl Iterator<Item = Format> {
    std::iter::once(ARCHIVES).chain(TABLE.iter().map(|reader| reader.about))
}

/// Reads a measurement in any known format from `bytes` that are not an archive.
pub(super) fn read_file(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let unrecognised = |message: String| FormatError::new(FormatErrorKind::Unrecognised, "", message);
    if bytes.is_empty() {
        return Err(unrecognised("the file is empty, expected a measurement".to_owned()));
    }
    let sample = Sample { bytes, head: text::head(bytes, HEAD_BYTES), quantity: how.quantity() };
    let reader = probed(&sample).map_err(|message| FormatError::new(FormatErrorKind::Unsupported, "", message))?;
    let Some(reader) = reader else {
        let known: Vec<&str> = readable().map(|about| about.name).collect();
        return Err(unrecognised(format!(
            "the content is of no format known here, expected one of {} (`wavelume formats` explains them)",
            known.join(", ")
        )));
    };
    refuse_idle_options(&reader.about, reader.options, how)?;
    (reader.read)(bytes, how)
}

/// Returns the reader with the highest confidence for the beginning of a file, if any. The error describes a known
/// format that cannot be read.
fn probed(sample: &Sample<'_>) -> Result<Option<&'static Reader>, String> {
    if let Some(message) = foreign::in_place(sample) {
        return Err(message);
    }
    let mut best: Option<(u8, &'static Reader)> = None;
    for reader in TABLE {
        let score = (reader.probe)(sample);
        if score > best.map_or(0, |(highest, _)| highest) {
            best = Some((score, reader));
        }
    }
    if best.is_none_or(|(score, _)| score < SURE)
        && let Some(message) = foreign::recognise(sample)
    {
        return Err(message);
    }
    Ok(best.map(|(_, reader)| reader))
}

/// Returns true if the beginning of a file matches some known format. The rest may be malformed.
pub(super) fn recognises_file(bytes: &[u8]) -> bool {
    let sample = Sample { bytes, head: text::head(bytes, HEAD_BYTES), quantity: None };
    matches!(probed(&sample), Ok(Some(_)))
}
