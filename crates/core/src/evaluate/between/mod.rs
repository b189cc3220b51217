//! From one measured incidence to the next: the divisor, the order of the curve, and the choice of both.

mod choice;
mod cubic;
mod divisor;
mod fit;
mod left_out;
mod report;
mod tables;

pub use choice::interpolation_between;
pub(super) use cubic::{Cubic, FOUR, NO_WEIGHT, held, range};
pub(super) use divisor::Divided;
pub use report::LeftOut;

/// Past the last measured incidence f·cos θo stays at most this many times its largest value there.
pub(super) const MOST_BEYOND: f32 = 1.5;
