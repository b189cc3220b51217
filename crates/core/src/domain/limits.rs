//! The sizes that untrusted input must stay within, checked before anything is allocated.

/// Samples in one tensor (4 bytes each, so 1 GiB): 64 × 65,536 × 64 fits.
pub const MAX_SAMPLES: usize = 1 << 28;
/// Axes of one tensor.
pub const MAX_AXES: usize = 8;
/// Subdivision level of a triangle mesh: 524,288 triangles on the sphere.
pub const MAX_LEVEL: u8 = 8;
/// Wavelengths on one axis.
pub const MAX_WAVELENGTHS: usize = 1 << 16;
/// Entries on an elevation or opaque index axis.
pub const MAX_ENTRIES: usize = 1 << 20;
