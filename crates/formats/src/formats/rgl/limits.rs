//! Limits of what a tensor file of a material holds, when it is read and when it is written.

/// Larger numbers are no measurement.
pub(super) const LARGEST: f32 = 1e12;
/// The longest description.
pub(super) const MAX_TEXT: usize = 1 << 16;
