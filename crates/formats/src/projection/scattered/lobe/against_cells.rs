//! Whether cells hold a lobe as well: both predict the samples about it from their neighbours.

use super::choose::Found;
use super::scan::Scan;
use super::solve::predicted;
use crate::projection::scattered::cells::{Fitted, Scratch};
use crate::projection::scattered::noise::without_itself;
use crate::projection::scattered::rows::Rows;
use rayon::prelude::*;

/// Samples that are predicted, about.
const JUDGES: usize = 1200;
/// Half-widths about the centre within which they lie.
const WITHIN: f64 = 4.0;
/// A lobe beside the cells must have this part of their cost, and this much less, to be carried.
const BETTER: f64 = 0.85;
const LEAST_GAIN: f64 = 10.0;

/// Whether a lobe beside cells of what it leaves (`left`) predicts the samples about it clearly better than cells of them.
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
    let points: Vec<(usize, u32, f64, f64)> = (scan.plan.clouds.iter().enumerate())
        .flat_map(|(cloud, of)| of.rows[..of.own()].iter().zip(0..).map(move |(&row, point)| (cloud, row, point)))
        .filter_map(|(cloud, row, point)| {
            let at = judges.binary_search_by_key(&row, |judge| judge.0).ok()?;
            Some((cloud, point, judges[at].1, judges[at].2))
        })
        .collect();
    let costs = |scratch: &mut Scratch, &(cloud, point, lobe, noise): &(usize, u32, f64, f64)| {
        let row = scan.plan.clouds[cloud].rows[point as usize];
        let cells = grey(&scan.plan.fitted(scan.rows, cloud), point, scratch);
        let beside = grey(&scan.plan.fitted(left, cloud), point, scratch).map(|left| left + lobe);
        let cost = |found: f64| {
            let off = (scan.logs[row as usize] - libm::log(found.max(f64::MIN_POSITIVE))) / noise;
            2.0 * ((1.0 + off * off).sqrt() - 1.0)
        };
        Some([cost(cells?), cost(beside?)]).filter(|costs| costs.iter().all(|cost| cost.is_finite()))
    };
    let costs: Vec<Option<[f64; 2]>> = points.par_iter().map_init(Scratch::default, costs).collect();
    let [cells, beside] = costs.into_iter().flatten().fold([0.0; 2], |sum, [a, b]| [sum[0] + a, sum[1] + b]);
    beside < BETTER * cells && beside + LEAST_GAIN < cells
}

/// The grey value that the neighbours of a point make there.
fn grey(fitted: &Fitted<'_>, point: u32, scratch: &mut Scratch) -> Option<f64> {
    without_itself(fitted, point, |_| false, scratch)?;
    let values = scratch.row.iter().map(|&value| f64::from(value)).filter(|value| !value.is_nan());
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then_some(sum / count)
}
