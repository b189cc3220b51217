//! Warnings about incoming directions that are too sparse for the lobe between them.

use super::incidences::IncidenceReport;
use crate::compress;
use crate::domain::{Axis, Measurement, Note};
use crate::evaluate::{EvaluateError, Material, interpolation_between};

/// Largest number of pairs of incoming and outgoing cells for which a material is opened to check it. Opening this
/// many takes one or two seconds; raising it checks larger materials.
const MOST_CELLS: usize = 1 << 17;
/// Promised relative error assumed for materials and measurements that state none: 0.01 is 1 %.
const PROMISED: f64 = 0.01;

/// Returns a warning if the incoming directions of a material are too sparse to interpolate its lobe. Opens the
/// material for it. Materials with more than 131,072 pairs of incoming and outgoing cells are not checked.
pub fn sparse(bytes: &[u8]) -> Result<Option<Note>, EvaluateError> {
    let summary = compress::inspect(bytes)?;
    if !has_lobes(&summary.axes) {
        return Ok(None);
    }
    let promised = if summary.errors.er_l2 > 0.0 { summary.errors.er_l2 } else { PROMISED };
    let decoded = compress::decode(bytes)?;
    let noise = compress::estimate_noise(&decoded.measurement, 0.0);
    let report = IncidenceReport::of(&Material::decoded(decoded)?, noise);
    Ok(report.and_then(|report| report.warning(promised)))
}

/// Like [`sparse`], for a measurement that is not compressed yet.
pub fn sparse_measurement(measurement: Measurement) -> Result<Option<Note>, EvaluateError> {
    if !has_lobes(measurement.tensor.axes()) {
        return Ok(None);
    }
    let noise = compress::estimate_noise(&measurement, 0.0);
    let between = interpolation_between(&measurement)?;
    let report = IncidenceReport::of(&Material::with_between(measurement, between)?, noise);
    Ok(report.and_then(|report| report.warning(PROMISED)))
}

/// Returns true if there are outgoing directions for several incoming ones, and few enough cells to open.
pub(super) fn has_lobes(axes: &[Axis]) -> bool {
    let cells = axes.iter().filter(|axis| !axis.is_spectral()).try_fold(1_usize, |n, axis| n.checked_mul(axis.len()));
    axes.iter().filter(|axis| axis.is_directional()).count() > 1 && cells.is_some_and(|cells| cells <= MOST_CELLS)
}
