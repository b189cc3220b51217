//! Prediction of samples from their neighbours without themselves: the value that cells would have there.

use crate::projection::scattered::cells::{Fitted, Scratch};
use crate::projection::scattered::noise::without_itself;
use crate::projection::scattered::plan::Plan;
use crate::projection::scattered::rows::Rows;
use rayon::prelude::*;

/// Position of a sample: number of the k-d tree that contains it, and index in this tree. Each tree holds samples that
/// local fits combine, such as those of one incoming polar angle.
pub(super) type Point = (usize, u32);

/// Finds the samples `rows` (increasing indices) in the k-d trees of the groups of samples. Returns, in the order of
/// the trees, the position of each in its tree and its index in `rows`.
pub(super) fn points(plan: &Plan, rows: &[u32]) -> Vec<(Point, usize)> {
    let own = |(cloud, of): (usize, &crate::projection::scattered::cloud::Cloud)| {
        let found = of.rows[..of.own()].iter().zip(0..).filter_map(|(row, point)| {
            let at = rows.binary_search(row).ok()?;
            Some(((cloud, point), at))
        });
        found.collect::<Vec<_>>()
    };
    plan.clouds.iter().enumerate().flat_map(own).collect()
}

/// Predicts each sample from its neighbours. Returns, for each, the mean over bands of the prediction and of the
/// measured sample.
pub(super) fn predicted(plan: &Plan, rows: &Rows<'_>, points: &[Point]) -> Vec<Option<[f64; 2]>> {
    let of = |scratch: &mut Scratch, &(cloud, point): &Point| {
        let fitted = plan.fitted(rows, cloud);
        let found = grey(&fitted, point, scratch)?;
        Some([found, mean(rows.row(fitted.cloud.rows[point as usize]))?])
    };
    points.par_iter().map_init(Scratch::default, of).collect()
}

fn grey(fitted: &Fitted<'_>, point: u32, scratch: &mut Scratch) -> Option<f64> {
    without_itself(fitted, point, |_| false, scratch)?;
    mean(&scratch.row)
}

/// Returns the mean over the bands of a sample that are not missing.
fn mean(row: &[f32]) -> Option<f64> {
    let values = row.iter().map(|&value| f64::from(value)).filter(|value| !value.is_nan());
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then_some(sum / count)
}
