//! Numeric routines shared by several modules.
//!
//! Container files and digests of projections record results to the bit, so each routine has a fixed order of additions
//! and multiplications. Routines that differ only in this order are kept separately and give the reason.

pub(crate) mod arctangent;
pub mod bracket;
#[cfg(test)]
pub(crate) mod cases;
pub mod cholesky;
pub(crate) mod dense;
#[cfg(test)]
pub(crate) mod drawn;
pub mod exponential;
pub(crate) mod least_cut;
pub(crate) mod least_squares;
pub(crate) mod logarithm;
pub(crate) mod number;
pub(crate) mod orthogonal;
pub mod random;
pub(crate) mod recursive;
mod wide;

pub use wide::wide;
