//! Blocks of places and lanes of wavelengths, in forms that compilers vectorise.

use crate::numeric::exponential::exp_estrin;

/// Number of wavelengths expanded together, one per SIMD lane.
pub(super) const LANES: usize = 16;

/// Number of queries evaluated together as a block. Each step runs for the whole block before the next step, so that
/// queries do not wait for one another and loops vectorise.
pub(super) const BLOCK: usize = 48;
/// Values of one scalar, such as a coordinate or a density, for each of the [`BLOCK`] queries evaluated together.
pub(super) type Block = [f64; BLOCK];
/// One 3D vector, such as a direction, for each of the [`BLOCK`] queries evaluated together: all x, then all y, then
/// all z.
pub(super) type Vectors = [Block; 3];

/// Reads vector number `i` (x, y, z), such as a direction, from a block of vectors stored as all x, all y, all z.
#[inline(always)]
pub(super) fn vector_of([x, y, z]: &Vectors, i: usize) -> [f64; 3] {
    [x[i], y[i], z[i]]
}

/// Overwrites vector number `i` (x, y, z), such as a direction, in a block of vectors stored as all x, all y, all z.
#[inline(always)]
pub(super) fn set_vector([x, y, z]: &mut Vectors, i: usize, to: [f64; 3]) {
    [x[i], y[i], z[i]] = to;
}

/// Replaces each of `N` numbers by its exponential.
#[inline(always)]
pub(super) fn exp_all<const N: usize>(values: &mut [f32; N]) {
    for value in values {
        *value = exp_estrin(*value);
    }
}
