//! Samples without a lobe: the values to which cells are fitted.

use super::bands::Colours;
use super::choose::Found;
use super::near::Near;
use super::scan::Scan;
use super::solve::predicted;
use crate::domain::{Direction, Lobe};

/// Least fraction of a sample's value that remains after subtracting a lobe, where the background beneath the lobe is
/// unknown.
const LEAST_LEFT: f64 = 0.5;
/// Least value of a sample after subtraction of a narrow lobe, as a fraction of the background that was fitted together
/// with the lobe.
const LEAST_OF_BASE: f64 = 0.01;
/// Rise of a value's natural logarithm by the lobe from which the value counts as raised clearly above the background:
/// 35 %. Raising it counts fewer values.
const OFF: f64 = 0.3;

/// Returns the values of the samples minus the lobe, `[sample, band]`, and the number of values that the lobe raises
/// clearly above the background: by more than 35 %.
///
/// If the lobe is brighter than the base beneath it, the difference from the sum of both is scaled by base / lobe.
/// Relative noise then stays constant, and an error of the lobe does not grow.
pub(super) fn residual(scan: &Scan<'_>, found: &Found, lobe: &Lobe, colours: &Colours) -> (Vec<f32>, u64) {
    let width = scan.rows.width;
    let prepared = found.shape.prepared();
    let count = scan.plan.directions.len();
    // Grey base of each row, and the number of its incidence.
    let mut known: Vec<Option<(f64, usize)>> = vec![None; count];
    let all = Near::new(scan, found.shape.centre, found.near.radius);
    for (number, (group, base)) in all.groups.iter().zip(&found.bases).enumerate() {
        for sample in group {
            let at = predicted(sample, base, Some(&prepared));
            known[sample.row as usize] = Some((libm::exp(at.base), number));
        }
    }
    let mut values = Vec::with_capacity(count * width);
    let mut of_lobe = 0;
    let (mut last, mut under) = ([f64::NAN; 3], None);
    for (row, &(wi, wo)) in (0_u32..).zip(&scan.plan.directions) {
        if wi != last {
            (last, under) = (wi, lobe.under(Direction::from_unit(wi)));
        }
        let grey = under.map_or(0.0, |under| under.shape(Direction::from_unit(wo)));
        let known = known[row as usize];
        for (band, &value) in scan.rows.row(row).iter().enumerate() {
            let lobe = grey * colours.lobe[band];
            let left = match known {
                Some((base, number)) => {
                    let base = base * colours.bases[number][band];
                    let off = f64::from(value) - lobe - base;
                    of_lobe += u64::from(libm::log1p(lobe / base) > OFF && !value.is_nan());
                    let part = if lobe > base { base / lobe } else { 1.0 };
                    if base > 0.0 { (base + off * part).max(LEAST_OF_BASE * base) } else { f64::from(value) - lobe }
                }
                None if value > 0.0 => (f64::from(value) - lobe).max(LEAST_LEFT * f64::from(value)),
                None => f64::from(value),
            };
            values.push(if value.is_nan() { f32::NAN } else { left as f32 });
        }
    }
    (values, of_lobe)
}
