//! Report on an opened material: its memory, its planes, and the error of interpolation between incoming directions.

use super::form::Form;
use super::incoming::Alignment;
use super::lines::Lines;

/// Composition of an opened material.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OpenedReport {
    /// Total memory of the opened form in bytes.
    pub memory: usize,
    /// Number of planes of coefficients; `None` if every sample is kept.
    pub planes: Option<usize>,
    /// Largest relative deviation of the planes from the decoded samples, or as a fraction of the largest sample if
    /// some are negative. 0 if every sample is kept.
    pub deviation: f64,
    /// Alignment of the smooth form between incoming directions.
    pub alignment: Alignment,
    /// Change of the function's shape between neighbouring incoming directions under each candidate alignment. It is
    /// the standard deviation of the logarithm of the ratio, weighted by squared light. The alignment with the least
    /// change is used.
    pub changes: Vec<(Alignment, f64)>,
    /// Leave-one-out error over incoming directions: share of light misplaced, Σ |error| · cos θo over Σ value · cos
    /// θo, when each is predicted from its neighbours. The error between incoming directions, where gaps are half as
    /// wide, is usually about four times smaller.
    pub left_out_error: Option<f64>,
}

impl OpenedReport {
    /// Report on a form; `memory` is that of the whole material.
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

    /// Report on samples on a grid of angles; `memory` is that of the whole material.
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
