//! The file that a measurement came from, as its provenance tells.

use crate::formats::Acquisition;

/// The file that a measurement came from, as its provenance tells.
#[derive(Clone, Copy, Debug)]
pub struct Origin<'a> {
    /// Name of the format in the table of formats.
    pub format: &'a str,
    /// Revision and flavour, as its reader named them.
    pub dialect: &'a str,
    /// Keywords and header fields in the order in which its reader kept them.
    pub metadata: &'a [(String, String)],
}

impl<'a> Origin<'a> {
    /// The origin of what was just read.
    pub fn of(acquisition: &'a Acquisition) -> Self {
        Self { format: acquisition.format, dialect: &acquisition.dialect, metadata: &acquisition.report.metadata }
    }
}
