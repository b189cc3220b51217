//! Generic wavelet transform of a tensor: each axis has its own basis and is transformed in place, by arithmetic
//! between rows.
//!
//! A *generic coefficient* over an axis (Claustres, Paulin & Boucher 2006, section 4, equations 11–12) is the
//! contiguous row at one index of that axis. A transform over the axis is arithmetic between such rows, whatever they
//! contain. Transforming axis after axis is the *standard* decomposition (a tensor product of transforms of one axis),
//! not the square one.
//!
//! Coefficients are not reordered. [`AxisTree`] gives the level and parent of each index, and the order from coarse to
//! fine.
//!
//! [`Plan::reconstruct`] computes one direction, level or wavelength without the rest. [`Plan::footprint`] returns the
//! synthesis function of one coefficient. [`Klt`] is a spectral basis computed from the data.
//!
//! Adding a basis on a line: one table in `tables/`, one line in `lines.rs`.

mod banded;
mod basis;
mod basis_info;
mod boundary;
mod ends;
mod filters;
mod klt;
mod level;
mod line;
mod lines;
mod partial;
mod plan;
mod prediction;
mod rows;
mod sphere;
mod tables;
mod tree;

pub use basis::{AxisTransform, SphereBasis, Weights, bases};
pub use basis_info::{BasisInfo, Space};
pub use boundary::Boundary;
pub use klt::{Klt, KltError};
pub use lines::LineBasis;
pub use partial::Part;
pub use plan::{Plan, PlanError};
pub(crate) use prediction::{Householder, Prediction};
pub use tree::AxisTree;

#[cfg(test)]
mod line_tests;
#[cfg(test)]
mod tests;
