//! Warps of the unit square onto directions, by descent of a tree of triangles; pure geometry, without a material.
//!
//! A warp draws directions in proportion to a function on a mesh, given by its integrals over the leaf triangles. A
//! density that is linear inside them also needs values at their vertices. \[CPB06\] section 6.1.2, figure 11, and its
//! Table 9.
//!
//! # The map
//! * The octahedron is unfolded into two (hemisphere) or four (sphere) squares of two triangles each. The four-way
//!   split of the triangles is the split of the squares into quadrants (the `mesh` file has a picture). At every square
//!   the first coordinate chooses the half a by the quadrants' own sums and is rescaled to 0..1; then the second
//!   chooses b (Clarberg et al. 2005, *Wavelet importance sampling*, section 4.2). No random number is discarded or
//!   added.
//! * Down to the *end level* the sums are those of the function. Below it a triangle's probability is divided among its
//!   leaves by the measure alone: the projected solid angle, or the solid angle.
//! * Inside the last square the density is constant or linear on each of the two planar triangles, drawn by the
//!   marginal in a and the conditional in b. The inverse, from a direction to the square, evaluates polynomials. In the
//!   forward direction, quadratics are solved by their formula. The marginal of the linear density is a monotone cubic,
//!   whose root two Halley steps between bounds find to rounding.
//! * The planar point p is projected onto the sphere. With A the triangle's area and d its plane's distance from the
//!   origin, dω = d/|p|³ dA, so pdf(ω) = P·g(p)·|p|³/(A·d). P is the leaf's probability and g the density's shape, mean
//!   1. P is exact; a "constant" density varies as |p|³ over its leaf (by 0.6 % at level 4).
//!
//! # Continuity
//! The map is one-to-one, and continuous on every image of a leaf square (an axis-parallel rectangle of the unit
//! square). The rectangles' borders are finitely many segments, of measure zero. The map is exactly continuous there if
//! the densities on both sides agree; uniform densities give one continuous map of the whole unit square. Otherwise it
//! jumps along the border by as much as the two sides' distributions along it differ. It stays on the two squares'
//! common edge except between squares that the tree itself separates. Hence stratified and low-discrepancy points stay
//! well distributed, and children need no random order. The two sides of the unit square that are glued on the
//! octahedron (the meridian through −x) are not neighbours in u.
//!
//! # Precision
//! Tables are f32, arithmetic is f64. A parent is the rounded sum of its leaves. The probability with which the descent
//! reaches a leaf and the stored one in [`Warps::pdf`] therefore differ by up to 1e-7 of it per level.

mod block;
mod fraction;
mod mesh;
mod options;
mod square;
#[cfg(test)]
mod table9;
#[cfg(test)]
mod tests;
mod warps;

pub(super) use block::Draws;
pub(super) use fraction::BELOW_ONE;
pub use mesh::WarpMesh;
pub use options::{Density, Measure, SampleOptions};
pub use warps::{Drawn, Warps};
