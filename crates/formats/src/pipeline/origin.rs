//! The source file of a measurement, according to its provenance.

use crate::formats::Acquisition;

/// Description of the source file of a measurement, from the provenance that the compressed file holds.
#[derive(Clone, Copy, Debug)]
pub struct Origin<'a> {
    /// Name of the source file's format in the table of formats.
    pub format: &'a str,
    /// Revision and flavour of the source file's format, as the parser named them.
    pub dialect: &'a str,
    /// Keywords and header fields of the source file, in the order in which the parser kept them.
    pub metadata: &'a [(String, String)],
}

impl<'a> Origin<'a> {
    /// Returns the description of the source file of a measurement that was just read.
    pub fn of(acquisition: &'a Acquisition) -> Self {
        Self { format: acquisition.format, dialect: &acquisition.dialect, metadata: &acquisition.report.metadata }
    }
}
