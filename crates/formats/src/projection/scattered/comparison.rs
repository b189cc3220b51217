//! Errors at the original samples: of the fit, of withheld samples, and of the cells.

use super::at_samples::each_sample;
use super::cells::{Fitted, Scratch};
use super::cloud::Cloud;
use super::plan::{Located, Plan};
use super::regions::{Region, Tally, brightest, region};
use super::report::{Regions, ScatterReport};
use super::rows::{Kind, Rows};
use super::trials::predict;
use super::withheld::{Trial, trials};
use crate::domain::Measurement;
use crate::formats::{Acquisition, Scattered};
use rayon::prelude::*;

/// Samples that are compared with the fit and left out at most.
const COMPARED: usize = 2000;
/// Values that are compared with the fit at most, in all bands.
const COMPARED_VALUES: usize = 1 << 20;
/// Samples are compared in pieces of this length.
const PIECE: usize = 256;

/// Reports the errors of a fit at withheld and other samples, and of the cells at all samples.
pub(super) fn report_of(
    acquisition: &Acquisition,
    scattered: &Scattered,
    (plan, located): (&Plan, &Located),
    rows: &Rows<'_>,
    measurement: &Measurement,
) -> ScatterReport {
    let light = |row: u32| rows.row(row).iter().map(|&v| f64::from(v)).filter(|v| !v.is_nan()).sum::<f64>();
    let mut regions = vec![Region::Middle; rows.kinds.len()];
    for members in &located.rows {
        let most = brightest(members.iter().map(|&row| light(row)).collect());
        for &row in members {
            regions[row as usize] = region(light(row), most, plan.directions[row as usize].1[2]);
        }
    }
    let count = COMPARED.min(COMPARED_VALUES / rows.width).max(100);
    let compared = trials(&plan.clouds, count);
    let like: Fitted<'_> = plan.fitted(rows, 0);
    let (left_out, outliers) = compare(&plan.clouds, like, &compared, &regions, true);
    let (fit, _) = compare(&plan.clouds, like, &compared, &regions, false);
    let mut tally = Tally::default();
    each_sample(acquisition, scattered, (measurement, Some(&located.cells)), |row, original, found| {
        original.iter().zip(found).for_each(|(&o, &f)| tally.add(regions[row], f, o));
    });
    ScatterReport {
        samples: rows.kinds.iter().filter(|kind| **kind != Kind::Missing).count() as u64,
        missing: scattered.values.iter().filter(|v| v.is_nan()).count() as u64,
        negative: scattered.values.iter().filter(|v| **v < 0.0).count() as u64,
        neighbours: plan.neighbours,
        left_out,
        fit,
        constant: tally.finish(),
        outliers,
        representation: plan.representation,
    }
}

/// Errors of predictions at `trials`; with them withheld, or not. Beside them the share of outliers.
fn compare(clouds: &[Cloud], like: Fitted<'_>, trials: &[Trial], regions: &[Region], withheld: bool) -> (Regions, f64) {
    let pieces: Vec<(Tally, Vec<f64>)> = trials
        .par_chunks(PIECE)
        .map_init(Scratch::default, |scratch, trials| {
            let (mut tally, mut lights) = (Tally::default(), Vec::new());
            for trial in trials {
                let cloud = &clouds[trial.cloud];
                let (row, wi, wo) = trial.of(cloud);
                let there = predict(&Fitted { cloud, ..like }, wi, wo, withheld, scratch);
                if there.is_none() {
                    continue;
                }
                let (mut light, mut whole) = (0.0, 0.0);
                for (&found, &expected) in scratch.row.iter().zip(like.rows.row(row)) {
                    tally.add(regions[row as usize], found, expected);
                    if !found.is_nan() && !expected.is_nan() {
                        light += f64::from(found - expected);
                        whole += f64::from(found.abs());
                    }
                }
                lights.push(if whole > 0.0 { (light / whole).abs() } else { 0.0 });
            }
            (tally, lights)
        })
        .collect();
    let (mut tally, mut lights) = (Tally::default(), Vec::new());
    for (part, more) in pieces {
        tally.join(&part);
        lights.extend(more);
    }
    (tally.finish(), outliers(lights))
}

fn outliers(mut lights: Vec<f64>) -> f64 {
    if lights.is_empty() {
        return 0.0;
    }
    let middle = lights.len() / 2;
    let usual = *lights.select_nth_unstable_by(middle, f64::total_cmp).1;
    let limit = (10.0 * usual).max(1.0 / 3.0);
    lights.iter().filter(|light| **light > limit).count() as f64 / lights.len() as f64
}
