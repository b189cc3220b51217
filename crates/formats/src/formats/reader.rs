//! Descriptions of readers: name, recognition by content, accepted options, and parsing function.

use super::acquisition::Acquisition;
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use crate::domain::Quantity;
use serde::Serialize;

/// Entry in a reader's list of options that means it accepts reflectance factors.
pub(super) const FACTOR: &str = "quantity reflectance-factor";
/// Number of bytes at the start of a file that a probe sees as text.
pub(super) const HEAD_BYTES: usize = 1 << 16;

/// File format in the table of formats.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Format {
    /// Stable name.
    pub name: &'static str,
    /// Description for people.
    pub description: &'static str,
    /// Usual file extensions, without the dot; a hint only.
    pub extensions: &'static [&'static str],
    /// True if the format can be read.
    pub reads: bool,
    /// True if the format can be written.
    pub writes: bool,
}

/// Reader of a format: its description, a probe and a parsing function.
pub(super) struct Reader {
    pub(super) about: Format,
    /// Accepted options besides quantity and unit.
    pub(super) options: &'static [&'static str],
    /// Confidence that the content has this format, from 0 (no) to 100 (a unique signature).
    pub(super) probe: fn(&Sample<'_>) -> u8,
    pub(super) read: fn(&[u8], &Interpretation) -> Result<Acquisition, FormatError>,
}

/// Input of a probe.
pub(super) struct Sample<'a> {
    pub(super) bytes: &'a [u8],
    /// Beginning of the file, decoded as text in any case.
    pub(super) head: String,
    /// Quantity given by the user.
    pub(super) quantity: Option<Quantity>,
}

/// Refuses options that have no effect for the format, because they indicate a misunderstanding.
pub(super) fn refuse_idle_options(about: &Format, options: &[&str], how: &Interpretation) -> Result<(), FormatError> {
    let given = [
        ("wavelength_unit", how.wavelength_unit.is_some()),
        ("column", how.column.is_some()),
        ("axes", how.axes.is_some()),
        ("normalization", how.normalization.is_some()),
        ("member", how.member.is_some()),
        (FACTOR, how.is_factor()),
    ];
    match given.iter().find(|(name, given)| *given && !options.contains(name)) {
        None => Ok(()),
        Some((name, _)) => Err(FormatError::new(
            FormatErrorKind::NeedsOption,
            about.name,
            format!("the option `{name}` was given, which does not apply to this file: {}", about.description),
        )),
    }
}
