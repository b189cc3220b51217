//! Report on an opened material: its memory, its planes, and the error of interpolation between incoming directions.

use super::form::Form;
use super::incoming::Alignment;
use super::lines::Lines;

/// Memory and accuracy of an opened material.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OpenedReport {
    /// Total memory of the opened material in bytes.
    pub memory: usize,
    /// Number of spectral coefficients that represent each spectrum; `None` if all samples are stored instead.
    pub planes: Option<usize>,
    /// Largest relative deviation of the opened material from the decoded samples, or as a fraction of the largest
    /// sample if some are negative. It comes from the spectral coefficients, and is 0 if all samples are stored
    /// instead.
    pub deviation: f64,
    /// Alignment of lobes in smooth interpolation between incoming directions.
    pub alignment: Alignment,
    /// Change of the function's shape between neighbouring incoming directions, for each candidate rule by which lobes
    /// may follow the incoming direction. It is the standard deviation, over corresponding outgoing directions, of the
    /// logarithm of the ratio of the two values, weighted by the first value squared. The rule with the least change is
    /// used.
    pub changes: Vec<(Alignment, f64)>,
    /// Leave-one-out error over incoming directions: Σ |error| · cos θo over Σ value · cos θo, when each measured
    /// incoming direction is predicted from its neighbours. The error between measured directions, where gaps are half
    /// as wide, is usually about four times smaller.
    pub left_out_error: Option<f64>,
}

impl OpenedReport {
    /// Reports memory, spectral coefficients, motion of lobes with the incoming direction, and leave-one-out error of a
    /// material with samples over triangles. `memory` is the total memory of the opened material in bytes.
    pub(super) fn of(form: &Form, memory: usize) -> Self {
        let (planes, smooth) = match form {
            Form::Planes { planes, smooth } => (Some(planes), Some(smooth)),
            Form::Samples(_) => (None, None),
        };
        Self {
            memory,
            planes: planes.map(|planes| planes.count()),
            deviation: planes.map_or(0.0, |planes| planes.deviation()),
            alignment: smooth.map_or(Alignment::None, |smooth| smooth.alignment()),
            changes: smooth.map_or_else(Vec::new, |smooth| smooth.changes().to_vec()),
            left_out_error: smooth.and_then(|smooth| smooth.left_out_error()),
        }
    }

    /// Reports memory, and motion of lobes with the incoming direction, of a material with samples on a grid of angles.
    /// `memory` is the total memory of the opened material in bytes.
    pub(super) fn of_lines(lines: &Lines, memory: usize) -> Self {
        Self {
            memory,
            planes: None,
            deviation: 0.0,
            alignment: lines.alignment(),
            changes: lines.changes().to_vec(),
            left_out_error: None,
        }
    }
}
