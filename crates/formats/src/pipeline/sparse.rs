//! Warnings about incoming directions that are too sparse for the lobe between them, and about materials of which too
//! few directions were measured.

use super::incidences::IncidenceReport;
use super::measured;
use crate::compress;
use crate::domain::{Axis, DEFAULT_ERROR, Measurement, Note};
use crate::evaluate::{EvaluateError, Material, interpolation_between, measured_share};

/// Upper bound on the number of pairs of stored incoming and outgoing directions of a material that is opened to check
/// its incoming directions. Opening this many takes two to four seconds; raising it checks larger materials.
const MOST_CELLS: usize = 1 << 18;

/// Returns warnings if too few directions of a material were measured for an albedo or a flux, and if its incoming
/// directions are too sparse to interpolate its lobe between them. Materials with more than 262,144 pairs of stored
/// incoming and outgoing directions are not checked.
pub fn sparse(bytes: &[u8]) -> Result<Vec<Note>, EvaluateError> {
    let summary = compress::inspect(bytes)?;
    if !is_small(&summary.axes) {
        return Ok(Vec::new());
    }
    let promised = if summary.errors.er_l2 > 0.0 { summary.errors.er_l2 } else { DEFAULT_ERROR };
    let decoded = compress::decode(bytes)?;
    let mut warnings: Vec<Note> = Vec::new();
    warnings.extend(measured::warning(measured_share(&decoded.measurement, summary.metadata.as_deref())));
    if has_lobes(&summary.axes) {
        let noise = compress::estimate_noise(&decoded.measurement, 0.0);
        let report = IncidenceReport::of(&Material::decoded(decoded)?, noise);
        warnings.extend(report.and_then(|report| report.warning(promised)));
    }
    Ok(warnings)
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
    axes.iter().filter(|axis| axis.is_directional()).count() > 1 && is_small(axes)
}

/// Returns true if the axes have directions, and few enough pairs of them to open the material.
fn is_small(axes: &[Axis]) -> bool {
    let cells = axes.iter().filter(|axis| !axis.is_spectral()).try_fold(1_usize, |n, axis| n.checked_mul(axis.len()));
    axes.iter().any(Axis::is_directional) && cells.is_some_and(|cells| cells <= MOST_CELLS)
}
