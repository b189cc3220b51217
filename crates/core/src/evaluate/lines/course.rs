//! Interpolation of samples on a grid between incidences, if a divisor or a cubic is in use.

use super::sphere::Patch;
use crate::compress::{Between, Divided};
use crate::evaluate::between::{Cubic, FOUR};

/// Interpolation between measured incoming directions of samples on a grid.
#[derive(Debug)]
pub(super) struct Course {
    pub(super) stated: Between,
    pub(super) divided: Divided,
    pub(super) cubic: Option<Cubic>,
    /// Data for extrapolation past the last measured polar angle of incidence: first the cosine of that angle. Then the
    /// largest natural logarithm of the function times cos θo there, for each combination of indices (positions on the
    /// axes before the directions) and each wavelength.
    pub(super) last: Option<(f64, Vec<f32>)>,
}

/// Search result for one query, for interpolation between measured incoming directions that is cubic or that first
/// divides samples by a model.
#[derive(Clone, Debug)]
pub(super) struct FoundBetween {
    /// Logarithms of the divisor (model divided out before interpolation) at the measured incoming directions around
    /// the query, then at the queried pair of directions.
    pub(super) divisors: [f32; FOUR],
    pub(super) own: f32,
    /// Weights of the four incoming directions in cubic interpolation, and the share, 0 to 1, of the cubic in the
    /// result. The share falls where lobes that follow the incoming direction reach the horizon; linear interpolation
    /// has the rest.
    pub(super) cubic: Option<([f32; FOUR], f32)>,
    /// Samples at the smallest and the largest of the four polar angles of incidence between which a cubic
    /// interpolates, if incoming directions form a grid. Linear interpolation uses only the two angles in the middle.
    pub(super) outer: Option<Box<Outer>>,
    /// For a query past the last measured polar angle of incidence: index, in the table of largest logarithms in
    /// [`Course::last`], of the entry for the first wavelength. Then the natural logarithm of |cos θo| of the query.
    pub(super) held: Option<(usize, f32)>,
}

/// Samples that a cubic through four polar angles of incidence needs at the smallest and the largest of them, under two
/// azimuths each; `Found` has those at the middle two. Each of these four incoming directions has a table number, the
/// samples around the outgoing direction, the logarithm of the divisor (model divided out before interpolation), and a
/// weight.
#[derive(Clone, Debug)]
pub(super) struct Outer {
    pub(super) tables: [usize; FOUR],
    pub(super) patches: [Option<Patch>; FOUR],
    pub(super) divisors: [f32; FOUR],
    pub(super) weights: [f32; FOUR],
}

impl Course {
    pub(super) fn memory(&self) -> usize {
        let cubic = self.cubic.as_ref().map_or(0, Cubic::memory);
        size_of::<Self>() + cubic + self.last.as_ref().map_or(0, |(_, peaks)| size_of_val(&**peaks))
    }
}
