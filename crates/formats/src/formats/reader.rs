//! Descriptions of readers: name, recognition by content, accepted options, and parsing function.

use super::acquisition::Acquisition;
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use crate::domain::Quantity;
use serde::Serialize;

/// Marker in a reader's list of accepted options: the reader accepts reflectance factors.
pub(super) const FACTOR: &str = "quantity reflectance-factor";
/// Options of the user that no reader of a file format refuses as without effect: all readers, or the choice of axes
/// after reading, use them.
const ANYWHERE: [&str; 3] = ["quantity", "unit", "wavelengths"];
/// Number of bytes at the start of a file that are decoded as text in order to recognise its format.
pub(super) const HEAD_BYTES: usize = 1 << 16;

/// Description of a file format for the list of known formats.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Format {
    /// Stable name of the format, for options and reports.
    pub name: &'static str,
    /// Description of the format for people.
    pub description: &'static str,
    /// Usual file extensions of the format, without the dot; files are recognised by content, not by extension.
    pub extensions: &'static [&'static str],
    /// True if files in the format can be read.
    pub reads: bool,
    /// True if files in the format can be written.
    pub writes: bool,
}

/// Reader of a file format: its description, a function that recognises files, and a parser.
pub(super) struct Reader {
    pub(super) about: Format,
    /// Names of the options that the reader accepts besides quantity and unit.
    pub(super) options: &'static [&'static str],
    /// Returns the confidence that a file has this format, from 0 (no) to 100 (a unique signature).
    pub(super) probe: fn(&Sample<'_>) -> u8,
    pub(super) read: fn(&[u8], &Interpretation) -> Result<Acquisition, FormatError>,
}

/// Beginning of a file, from which readers recognise their format.
pub(super) struct Sample<'a> {
    pub(super) bytes: &'a [u8],
    /// Beginning of the file, decoded as text even if the file is binary.
    pub(super) head: String,
    /// Radiometric quantity given by the user, if any.
    pub(super) quantity: Option<Quantity>,
}

/// Refuses options of the user that have no effect for the format, because they indicate a misunderstanding.
pub(super) fn refuse_idle_options(about: &Format, options: &[&str], how: &Interpretation) -> Result<(), FormatError> {
    let stated = how.stated().into_iter().map(|(name, _)| name).filter(|name| !ANYWHERE.contains(name));
    let idle = stated.chain(how.is_factor().then_some(FACTOR)).find(|name| !options.contains(name));
    match idle {
        None => Ok(()),
        Some(name) => Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            about.name,
            format!("the option `{name}` was given, which does not apply to this file: {}", about.description),
        )),
    }
}
