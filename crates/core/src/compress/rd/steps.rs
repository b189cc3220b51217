//! Steps of the quantiser: those of a first layer, and of its corrections.

use super::super::search::Notch;

/// Fineness of a layer's quantisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fineness {
    /// Step of all normalised coefficients.
    pub(crate) step: f32,
    /// Number of vectors of the data's own basis beyond those that the step suggests.
    pub(crate) more_vectors: i8,
    /// Doublings of the usual step of these vectors.
    pub(crate) coarser_vectors: i8,
    /// Extra width of the zero bin of a grid's pyramid, in sixteenths of a step: residuals within half a step and this
    /// become 0.
    pub(crate) dead_zone: u8,
}

impl Fineness {
    /// Default choices at `step`.
    pub(crate) fn of(step: f32) -> Self {
        Self { step: 0.0, more_vectors: 0, coarser_vectors: 0, dead_zone: 0 }.at(step)
    }

    /// Keeps the other choices and sets the step to `step`, rounded down to a number that a header can hold: 8
    /// significant bits.
    pub(crate) fn at(self, step: f32) -> Self {
        Self { step: Notch::below(step).value(), ..self }
    }
}

/// Fineness of the first layer and step of the corrections, 0 without.
#[derive(Clone, Copy)]
pub(super) struct Steps {
    pub(super) first: Fineness,
    pub(super) correction: f32,
}

impl Steps {
    /// Steps of a single layer.
    pub(super) fn of(step: f64) -> Self {
        Self { first: Fineness::of(step as f32), correction: 0.0 }
    }
}
