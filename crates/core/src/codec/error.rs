//! Why bytes are no material: where, what was found, what was expected.

/// Why bytes are no material.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CodecError {
    /// The first bytes are not the magic.
    #[error("not a wavelume material: the first 4 bytes are not 89 57 4C 4D")]
    Magic,
    /// A version that this reader does not know.
    #[error("material version {found}, this program reads version {expected}")]
    Version {
        /// The version found.
        found: u8,
        /// The version known.
        expected: u8,
    },
    /// The bytes end too early.
    #[error("byte {at}: the file ends where {expected} was expected")]
    Truncated {
        /// Where the missing field starts.
        at: usize,
        /// The field.
        expected: &'static str,
    },
    /// A chunk does not match its checksum.
    #[error("byte {at}: the {chunk} does not match its checksum")]
    Checksum {
        /// Where the chunk starts.
        at: usize,
        /// Name of the chunk.
        chunk: &'static str,
    },
    /// A field holds what it must not.
    #[error("byte {at}: {reason}")]
    Malformed {
        /// Where.
        at: usize,
        /// What was found and what was expected.
        reason: String,
    },
}
