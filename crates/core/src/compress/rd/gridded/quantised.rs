//! Quantiser of a grid chunk, and the bound on negative samples, whose error is not promised.

use super::super::lines::Quantiser;
use crate::codec::Class;

/// Scale, in quantiser steps, that the predictor assumes for values coded as samples rather than as logarithms: limits
/// on its predictions are multiples of it. Logarithms have the scale 1 (a factor of e).
const LINEAR_UNIT: f64 = 32.0;

/// Builds the quantiser for samples on a grid of angles, with the quantiser step that the file's header states.
pub(super) fn quantiser(step: f32, is_linear: bool, learns: bool) -> Quantiser {
    let step = f64::from(step);
    Quantiser { step, unit: if is_linear { LINEAR_UNIT * step } else { 1.0 }, learns, dead_zone: 0.0 }
}

/// Lowers decoded logarithms of negative samples' magnitudes to `bound` where they exceed it.
pub(super) fn bound_negative(bound: Option<f32>, classes: Option<&[Class]>, values: &mut [f32]) {
    if let (Some(bound), Some(classes)) = (bound, classes) {
        for (value, _) in values.iter_mut().zip(classes).filter(|(_, class)| **class == Class::Negative) {
            *value = value.min(bound);
        }
    }
}
