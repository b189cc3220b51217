//! Numeric routines that several rooms use, each in one place.
//!
//! Results are recorded to the bit, in container files and in digests of projections, so the order of additions and
//! multiplications of each routine is fixed. Routines that differ in it only stand side by side and say why.

pub(crate) mod arctangent;
pub mod bracket;
pub mod cholesky;
pub(crate) mod dense;
#[cfg(test)]
pub(crate) mod drawn;
pub mod exponential;
pub(crate) mod least_squares;
pub(crate) mod logarithm;
pub(crate) mod orthogonal;
pub mod random;
pub(crate) mod recursive;
mod wide;

pub use wide::wide;
