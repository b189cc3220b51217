//! Test whether cells alone represent a lobe as well: both variants predict the samples about it from their
//! neighbours.

use super::beside::{points, predicted as made};
use super::choose::Found;
use super::scan::Scan;
use super::solve::{predicted, robust};
use crate::projection::scattered::rows::Rows;

/// Approximate number of samples predicted to decide whether a separate lobe is better than triangles alone.
const JUDGES: usize = 800;
/// Radius about the centre of a narrow lobe, in half-widths of the lobe. The samples within decide, by how well they
/// are predicted, whether the lobe is stored apart from the triangles. Raising it lets farther samples decide, too.
const WITHIN: f64 = 4.0;
/// Largest ratio of the misfit of predicted samples with a separate narrow lobe to that without one, at which the lobe
/// is kept. The misfit is a sum of soft L1 costs, on which outliers have little influence. Lowering the ratio keeps
/// fewer lobes.
const BETTER: f64 = 0.85;
/// Least reduction of the misfit of predicted samples by a separate narrow lobe, at which the lobe is kept. The misfit
/// is a sum of soft L1 costs, on which outliers have little influence. Raising the reduction keeps fewer lobes.
const LEAST_GAIN: f64 = 10.0;

/// Returns true if a separate narrow lobe clearly improves the prediction of the samples about it from their
/// neighbours. With the lobe, neighbours have the values `left`, from which the lobe was subtracted, and the lobe is
/// added to the prediction.
pub(super) fn is_better(scan: &Scan<'_>, found: &Found, left: &Rows<'_>) -> bool {
    let prepared = found.shape.prepared();
    let within = (WITHIN * found.shape.width()).max(2.0 * found.spacing);
    let mut judges: Vec<(u32, f64, f64)> = Vec::new();
    for (group, base) in found.near.groups.iter().zip(&found.bases) {
        for sample in group.iter().filter(|sample| sample.distance <= within) {
            let at = predicted(sample, base, Some(&prepared));
            judges.push((sample.row, libm::exp(at.log) * at.share, found.noise.max(sample.stated)));
        }
    }
    let step = judges.len().div_ceil(JUDGES).max(1);
    let mut judges: Vec<(u32, f64, f64)> = judges.into_iter().step_by(step).collect();
    judges.sort_by_key(|judge| judge.0);
    let rows: Vec<u32> = judges.iter().map(|judge| judge.0).collect();
    let (points, order): (Vec<_>, Vec<usize>) = points(scan.plan, &rows).into_iter().unzip();
    let cells = made(scan.plan, scan.rows, &points);
    let beside = made(scan.plan, left, &points);
    let mut costs = [0.0; 2];
    for ((at, cells), beside) in order.into_iter().zip(cells).zip(beside) {
        let (row, lobe, noise) = judges[at];
        let (Some([cells, _]), Some([beside, _])) = (cells, beside) else { continue };
        let cost = |found: f64| robust((scan.logs[row as usize] - libm::log(found.max(f64::MIN_POSITIVE))) / noise).0;
        let both = [cost(cells), cost(beside + lobe)];
        if both.iter().all(|cost| cost.is_finite()) {
            costs = [costs[0] + both[0], costs[1] + both[1]];
        }
    }
    costs[1] < BETTER * costs[0] && costs[1] + LEAST_GAIN < costs[0]
}
