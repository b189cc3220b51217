//! Limits on the contents of a tensor file, for reading and writing.

/// Upper bound on values in a tensor file; larger numbers cannot be measurements.
pub(super) const LARGEST: f32 = 1e12;
/// Upper bound on the description in a tensor file, in bytes.
pub(super) const MAX_TEXT: usize = 1 << 16;
