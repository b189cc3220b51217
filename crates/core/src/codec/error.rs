//! Error type of the container format: position in the file, value found and value expected.

/// Reasons why bytes are not a valid material.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CodecError {
    /// The file does not start with the magic bytes.
    #[error("not a wavelume material: the first 4 bytes are not 89 57 4C 4D")]
    Magic,
    /// The format version is not supported.
    #[error("material version {found}, this program reads version {expected}")]
    Version {
        /// Version of the file.
        found: u8,
        /// Supported version.
        expected: u8,
    },
    /// The file is truncated.
    #[error("byte {at}: the file ends where {expected} was expected")]
    Truncated {
        /// Offset of the missing field, in bytes.
        at: usize,
        /// Name of the missing field.
        expected: &'static str,
    },
    /// A chunk does not match its checksum.
    #[error("byte {at}: the {chunk} does not match its checksum")]
    Checksum {
        /// Offset of the chunk, in bytes.
        at: usize,
        /// Name of the chunk.
        chunk: &'static str,
    },
    /// A field has an invalid value.
    #[error("byte {at}: {reason}")]
    Malformed {
        /// Offset of the end of the field, in bytes.
        at: usize,
        /// The value found and the one expected.
        reason: String,
    },
}
