//! Warnings of incoming directions that are too sparse for the lobe between them.

use crate::compress;
use crate::domain::{Axis, Measurement};
use crate::evaluate::{EvaluateError, Material};

/// Pairs of incoming and outgoing cells that are opened for a warning at most: opening this many takes a second or two.
const MOST_CELLS: usize = 1 << 17;

/// A warning where a material's incoming directions are too sparse to say what the lobe does between them. The material is
/// opened for it; one of more than 131,072 pairs of incoming and outgoing cells is not, and never warned of.
pub fn sparse(bytes: &[u8]) -> Result<Option<String>, EvaluateError> {
    let axes = compress::inspect(bytes)?.axes;
    if has_lobes(&axes) { Ok(Material::open(bytes)?.report().warning()) } else { Ok(None) }
}

/// As [`sparse`], for what is not compressed yet.
pub fn sparse_measurement(measurement: Measurement) -> Result<Option<String>, EvaluateError> {
    let opens = has_lobes(measurement.tensor.axes());
    if opens { Ok(Material::of(measurement)?.report().warning()) } else { Ok(None) }
}

/// Whether there are outgoing directions for several incoming ones, and few enough to open.
fn has_lobes(axes: &[Axis]) -> bool {
    let cells = axes.iter().filter(|axis| !axis.is_spectral()).try_fold(1_usize, |n, axis| n.checked_mul(axis.len()));
    axes.iter().filter(|axis| axis.is_directional()).count() > 1 && cells.is_some_and(|cells| cells <= MOST_CELLS)
}
