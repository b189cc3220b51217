//! Steps of the quantiser: those of a first layer, and of its corrections.

use super::super::search::Notch;

/// Quantiser setting of a coder: step, number of spectral basis vectors and width of the zero bin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fineness {
    /// Quantiser step of all normalised coefficients.
    pub(crate) step: f32,
    /// Number of spectral basis vectors more (or fewer, if negative) than the quantiser step suggests.
    pub(crate) more_vectors: i8,
    /// Binary logarithm of the factor on the usual quantiser step of the spectral basis vectors: 1 doubles the step, −1
    /// halves it.
    pub(crate) coarser_vectors: i8,
    /// Extra width of the quantiser's zero bin on grids of angles, in sixteenths of a step: residuals within half a
    /// step plus this become 0.
    pub(crate) dead_zone: u8,
}

impl Fineness {
    /// Returns the quantiser setting with step `step`, and otherwise the usual number and precision of spectral basis
    /// vectors and the usual zero bin.
    pub(crate) fn of(step: f32) -> Self {
        Self { step: 0.0, more_vectors: 0, coarser_vectors: 0, dead_zone: 0 }.at(step)
    }

    /// Sets the quantiser step to `step`, rounded down to a number that a header can hold (8 significant bits). Number
    /// and precision of the spectral basis vectors and width of the zero bin stay.
    pub(crate) fn at(self, step: f32) -> Self {
        Self { step: Notch::below(step).value(), ..self }
    }
}

/// Quantiser setting of the coefficients, and step of the corrections that bring single decoded samples within their
/// error bound, in the unit of the coded values (natural logarithms or samples); 0 without such corrections.
#[derive(Clone, Copy)]
pub(super) struct Steps {
    pub(super) first: Fineness,
    pub(super) correction: f32,
}

impl Steps {
    /// Builds the quantiser setting in which coefficients are quantised with `step`, and single samples are not
    /// corrected.
    pub(super) fn of(step: f64) -> Self {
        Self { first: Fineness::of(step as f32), correction: 0.0 }
    }
}
