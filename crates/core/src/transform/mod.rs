//! The generic wavelet transform: a tensor's axes, each with its own basis, transformed in place between rows.
//!
//! A *generic coefficient* over an axis (Claustres, Paulin & Boucher 2006, section 4, equations 11–12) is the contiguous
//! row behind one index of that axis; a transform over the axis is arithmetic between such rows, whatever they hold.
//! Transforming axis after axis is the *standard* decomposition (a tensor product of one-space transforms), not the
//! square one.
//!
//! Coefficients stay where the tree has them: nothing moves. [`AxisTree`] says which level each index belongs to, who its
//! parent is, and in which order to read them coarse to fine.
//!
//! Any part can be had without the rest ([`Plan::reconstruct`]): one direction, one level, one wavelength; and
//! [`Plan::footprint`] is one coefficient's synthesis function. [`Klt`] is a spectral basis made from the data.
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
