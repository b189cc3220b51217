//! Steps of the quantiser: those of a first layer, and of the corrections behind it.

use super::super::search::Notch;

/// How finely a layer is quantised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fineness {
    /// The step of all normalised coefficients.
    pub(crate) step: f32,
    /// Vectors of the data's own basis more than the step suggests.
    pub(crate) more_vectors: i8,
    /// The step of those vectors, in doublings of the usual one.
    pub(crate) coarser_vectors: i8,
    /// Residuals of a grid's pyramid within half a step and this many sixteenths of one become 0.
    pub(crate) dead_zone: u8,
}

impl Fineness {
    /// The usual choices at `step`.
    pub(crate) fn of(step: f32) -> Self {
        Self { step: 0.0, more_vectors: 0, coarser_vectors: 0, dead_zone: 0 }.at(step)
    }

    /// The same choices at `step`, or the largest step below it that a header can hold: 8 significant bits.
    pub(crate) fn at(self, step: f32) -> Self {
        Self { step: Notch::below(step).value(), ..self }
    }
}

/// The quantiser's fineness and the step of the corrections, 0 without.
#[derive(Clone, Copy)]
pub(super) struct Steps {
    pub(super) first: Fineness,
    pub(super) correction: f32,
}

impl Steps {
    /// One layer at `step`.
    pub(super) fn of(step: f64) -> Self {
        Self { first: Fineness::of(step as f32), correction: 0.0 }
    }
}
