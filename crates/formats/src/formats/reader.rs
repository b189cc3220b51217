//! Readers as data: what a format is called, how its content is recognised, which options it understands, what reads it.

use super::acquisition::Acquisition;
use super::error::{FormatError, FormatErrorKind};
use super::interpretation::Interpretation;
use crate::domain::Quantity;
use serde::Serialize;

/// The name under which a reader lists that it takes reflectance factors.
pub(super) const FACTOR: &str = "quantity reflectance-factor";
/// Bytes of a file that a probe sees as text.
pub(super) const HEAD_BYTES: usize = 1 << 16;

/// One format of the table.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Format {
    /// Its stable name.
    pub name: &'static str,
    /// What it is, for people.
    pub description: &'static str,
    /// Usual file extensions, without the dot; a hint only.
    pub extensions: &'static [&'static str],
    /// Whether it is read.
    pub reads: bool,
    /// Whether it is written.
    pub writes: bool,
}

/// A format as data, a probe and a function.
pub(super) struct Reader {
    pub(super) about: Format,
    /// The options it understands besides quantity and unit.
    pub(super) options: &'static [&'static str],
    /// How sure the content makes us, 0 (not this format) to 100 (a unique signature).
    pub(super) probe: fn(&Sample<'_>) -> u8,
    pub(super) read: fn(&[u8], &Interpretation) -> Result<Acquisition, FormatError>,
}

/// What a probe sees.
pub(super) struct Sample<'a> {
    pub(super) bytes: &'a [u8],
    /// The beginning, decoded as text whatever it is.
    pub(super) head: String,
    /// The quantity that the user named.
    pub(super) quantity: Option<Quantity>,
}

/// An option that does nothing for a format is a misunderstanding that the user should hear of.
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
