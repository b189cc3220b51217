//! What is known of an opened material: its memory, its planes, and how well incoming directions stand for those between.

use super::form::Form;
use super::incoming::Alignment;
use super::lines::Lines;

/// What an opened material is made of.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OpenedReport {
    /// Memory of the opened form in bytes: all of it.
    pub memory: usize,
    /// Planes of coefficients; `None` where every sample is kept.
    pub planes: Option<usize>,
    /// The largest relative deviation of the planes from the decoded samples (parts of the largest sample where some are
    /// negative); 0 where every sample is kept.
    pub deviation: f64,
    /// How the smooth form goes from one incoming direction to the next.
    pub alignment: Alignment,
    /// How much the shape of the function changes from one incoming direction to its neighbours under each alignment that
    /// competed: the standard deviation, by the square of the light, of the logarithm of the ratio. The least one is taken.
    pub changes: Vec<(Alignment, f64)>,
    /// The share of light that goes astray (Σ |error| · cos θo over Σ value · cos θo) where each incoming direction is
    /// predicted from those around it without itself. Between incoming directions, where gaps are half as wide, it is
    /// usually some four times less.
    pub left_out_error: Option<f64>,
}

impl OpenedReport {
    /// The report of a form, with the memory of all that is opened.
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

    /// The report of samples on a grid of angles, with the memory of all that is opened.
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
