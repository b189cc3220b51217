//! No more light than comes in: what a lobe may have beside the cells.

use super::bands::Colours;
use super::scan::Scan;
use crate::domain::{Direction, Domain, Lobe};

/// The factor, at most 1, by which a lobe may be as bright as it is: with it no albedo is above 1 that is not without the lobe.
///
/// `left` are the values without the lobe, `[row, band]`.
pub(super) fn factor(scan: &Scan<'_>, lobe: &Lobe, colours: &Colours, left: &[f32]) -> f64 {
    let width = scan.rows.width;
    let mut least = 1.0_f64;
    for incidence in scan.incidences {
        let Some(&first) = incidence.rows().first() else { continue };
        let (weights, are_areas) = incidence.weights(&scan.plan.directions, Domain::Hemisphere, true);
        let Some(under) = lobe.under(Direction::from_unit(scan.plan.directions[first as usize].0)) else { continue };
        if !are_areas {
            // Without areas the base is as bright as nothing.
            least = least.min(limited(under.light(), &colours.lobe, &vec![0.0; width]));
            continue;
        }
        let mut base = vec![0.0; width];
        for (&row, weight) in incidence.rows().iter().zip(weights) {
            for (sum, &value) in base.iter_mut().zip(&left[row as usize * width..][..width]) {
                *sum += if value.is_nan() { 0.0 } else { weight * f64::from(value) };
            }
        }
        if scan.plan.unfolded {
            base.iter_mut().for_each(|sum| *sum *= 2.0);
        }
        least = least.min(limited(under.light(), &colours.lobe, &base));
    }
    least
}

/// The factor with which light of these colours fits beside a base.
fn limited(light: f64, colours: &[f64], bases: &[f64]) -> f64 {
    let fits = |(&colour, &base): (&f64, &f64)| {
        let left = 1.0 - base;
        if left > 0.0 && light * colour > left { left / (light * colour) } else { 1.0 }
    };
    colours.iter().zip(bases).map(fits).fold(1.0, f64::min)
}
