//! Warnings about incoming directions that are too sparse for the lobe between them.

use super::incidences::IncidenceReport;
use crate::compress;
use crate::domain::{Axis, DEFAULT_ERROR, Measurement, Note};
use crate::evaluate::{EvaluateError, Material, interpolation_between};

/// Upper bound on the number of pairs of stored incoming and outgoing directions of a material that is opened to check
/// its incoming directions. Opening this many takes two to four seconds; raising it checks larger materials.
const MOST_CELLS: usize = 1 << 18;

/// Returns a warning if the incoming directions of a material are too sparse to interpolate its lobe between them.
/// Materials with more than 262,144 pairs of stored incoming and outgoing directions are not checked.
pub fn sparse(bytes: &[u8]) -> Result<Option<Note>, EvaluateError> {
    let summary = compress::inspect(bytes)?;
    if !has_lobes(&summary.axes) {
        return Ok(None);
    }
    let promised = if summary.errors.er_l2 > 0.0 { summary.errors.er_l2 } else { DEFAULT_ERROR };
    let decoded = compress::decode(bytes)?;
    let noise = compress::estimate_noise(&decoded.measurement, 0.0);
    let report = IncidenceReport::of(&Material::decoded(decoded)?, noise);
    Ok(report.and_then(|report| report.warning(promised)))
}

/// Returns a warning if the incoming directions of a measurement, not compressed yet, are too sparse to interpolate its
/// lobe between them.
pub fn sparse_measurement(measurement: Measurement) -> Result<Option<Note>, EvaluateError> {
    if !has_lobes(measurement.tensor.axes()) {
        return Ok(None);
    }
    let noise = compress::estimate_noise(&measurement, 0.0);
    let between = interpolation_between(&measurement)?;
    let report = IncidenceReport::of(&Material::with_between(measurement, between)?, noise);
    Ok(report.and_then(|report| report.warning(DEFAULT_ERROR)))
}

/// Returns true if the axes have several incoming directions, each with outgoing ones, and few enough pairs of them to
/// open the material.
pub(super) fn has_lobes(axes: &[Axis]) -> bool {
    let cells = axes.iter().filter(|axis| !axis.is_spectral()).try_fold(1_usize, |n, axis| n.checked_mul(axis.len()));
    axes.iter().filter(|axis| axis.is_directional()).count() > 1 && cells.is_some_and(|cells| cells <= MOST_CELLS)
}
