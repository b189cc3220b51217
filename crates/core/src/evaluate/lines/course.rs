//! Interpolation of samples on a grid between incidences, if a divisor or a cubic is in use.

use super::sphere::Patch;
use crate::compress::Between;
use crate::evaluate::between::{Cubic, Divided, FOUR};

/// Interpolation between incidences.
#[derive(Debug)]
pub(super) struct Course {
    pub(super) stated: Between,
    pub(super) divided: Divided,
    pub(super) cubic: Option<Cubic>,
    /// Past the last elevation: its cosine, and the largest logarithm of f·cos θo there by index entry and wavelength.
    pub(super) last: Option<(f64, Vec<f32>)>,
}

/// Lookup of one query between incidences.
#[derive(Clone, Debug)]
pub(super) struct FoundBetween {
    /// Logarithms of the divisor at the mixed places, and at the queried place.
    pub(super) divisors: [f32; FOUR],
    pub(super) own: f32,
    /// Weights of a cubic, and the smallest alignment weight of its places.
    pub(super) cubic: Option<([f32; FOUR], f32)>,
    /// Between the rows of an incoming grid: the cubic's places beyond those that linear interpolation mixes.
    pub(super) outer: Option<Box<Outer>>,
    /// Past the last incidence: position of the entry's first largest logarithm, and the logarithm of cos θo.
    pub(super) held: Option<(usize, f32)>,
}

/// Places of a cubic on the rows before and after those around: tables, patches, logarithms of the divisor and weights.
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
