//! Size limits for untrusted input, checked before memory is allocated.

/// Largest number of samples of a tensor (4 bytes each, 1 GiB in all). 64 incoming × 65,536 outgoing directions × 64
/// wavelengths fit.
pub const MAX_SAMPLES: usize = 1 << 28;
/// Largest number of axes of a tensor.
pub const MAX_AXES: usize = 8;
/// Largest subdivision level of a triangle mesh; each level quadruples the number of triangles, up to 524,288 on the
/// sphere.
pub const MAX_LEVEL: u8 = 8;
/// Largest number of wavelengths on one axis.
pub const MAX_WAVELENGTHS: usize = 1 << 16;
/// Largest number of entries on an axis of elevations or of numbered entries.
pub const MAX_ENTRIES: usize = 1 << 20;
