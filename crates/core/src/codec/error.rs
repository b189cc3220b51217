//! Error type of the container format: position in the file, value found and value expected.

/// Reasons why bytes are not a valid compressed material.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CodecError {
    /// The file does not start with the magic number of the format.
    #[error("not a wavelume material, whose first 4 bytes are 89 57 4C 4D")]
    Magic,
    /// The version of the file format is not supported.
    #[error("the file has format version {found}, expected version {expected}, which this program reads")]
    Version {
        /// Version of the file format found in the file.
        found: u8,
        /// Version of the file format that this program reads.
        expected: u8,
    },
    /// The file is truncated.
    #[error("byte {at}: the file is cut short: it ends where {expected} was expected")]
    Truncated {
        /// Offset in the file at which the missing field was expected, in bytes.
        at: usize,
        /// Name of the field that is missing at the end of the file.
        expected: &'static str,
    },
    /// A chunk (section of the file) does not match its checksum.
    #[error("byte {at}: the {chunk} does not match its checksum")]
    Checksum {
        /// Offset in the file of the damaged chunk, in bytes.
        at: usize,
        /// Name of the damaged chunk.
        chunk: &'static str,
    },
    /// A field of the file has an invalid value.
    #[error("byte {at}: {reason}")]
    Malformed {
        /// Offset in the file of the end of the invalid field, in bytes.
        at: usize,
        /// Fault of the invalid field: the value found, and what was expected.
        reason: String,
    },
}
