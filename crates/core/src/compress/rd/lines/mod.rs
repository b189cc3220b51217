//! Planes on a product of lines as a pyramid of pairs: weighted means, halved along one axis at a time. Each detail is
//! predicted from everything already decoded.
//!
//! Two entries with weights w₁, w₂ become their mean and the detail δ = c₁ − c₀. √W·δ with W = w₁w₂ / (w₁ + w₂) is an
//! orthonormal coefficient (Parseval is exact over weighted samples), so δ has the step Δ / √W. Predictions blend
//! average interpolation with recursive least squares. Residuals are coded with the density that errors nearby suggest.
//! Decoding uses only f64 additions, multiplications, divisions and square roots in a fixed order, and tables of
//! integers.

mod expectation;
mod grid;
mod guess;
mod halvings;
mod neighbours;
mod order;
mod pairs;
mod plane;
mod pyramid;
mod source;
mod template;
#[cfg(test)]
mod tests;
mod weights;

pub(crate) use grid::{AXES, Grid, Line};
pub(crate) use order::{code_order, order_of_halvings};
pub(crate) use pyramid::{PairPyramid, Quantiser};
pub(crate) use source::Source;
