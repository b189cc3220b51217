//! Blocks of places and lanes of wavelengths, in forms that compilers vectorise.

use crate::numeric::exponential::exp_estrin;

/// Number of wavelengths processed together.
pub(super) const LANES: usize = 16;

/// Number of places processed together. Each step runs for all of them before the next, so that they do not wait for
/// one another and loops vectorise.
pub(super) const BLOCK: usize = 48;
/// One number for each place of a block.
pub(super) type Block = [f64; BLOCK];
/// One vector for each place of a block: x, y, z.
pub(super) type Vectors = [Block; 3];

/// Vector of place `i` of a block.
#[inline(always)]
pub(super) fn vector_of([x, y, z]: &Vectors, i: usize) -> [f64; 3] {
    [x[i], y[i], z[i]]
}

/// Sets the vector of place `i` of a block.
#[inline(always)]
pub(super) fn set_vector([x, y, z]: &mut Vectors, i: usize, to: [f64; 3]) {
    [x[i], y[i], z[i]] = to;
}

/// Replaces all lanes by their exponentials.
#[inline(always)]
pub(super) fn exp_all<const N: usize>(values: &mut [f32; N]) {
    for value in values {
        *value = exp_estrin(*value);
    }
}
