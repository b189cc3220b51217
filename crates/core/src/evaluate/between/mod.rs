//! Interpolation from one measured incidence to the next: the divisor, the order of the curve, and the choice of both.

mod choice;
mod cubic;
mod fit;
mod left_out;
mod notes;
mod report;
mod tables;

pub use choice::interpolation_between;
pub(super) use cubic::{Cubic, FOUR, NO_WEIGHT, held};
pub use report::LeftOut;

/// Declarations of the notes (warnings in reports) about sparse incoming directions.
pub const NOTES: &[crate::domain::NoteTemplate] = notes::IncidenceNote::TEMPLATES;

/// Upper bound on f·cos θo past the last measured polar angle of incidence, as a multiple of its largest value at that
/// angle.
pub(super) const MOST_BEYOND: f32 = 1.5;
