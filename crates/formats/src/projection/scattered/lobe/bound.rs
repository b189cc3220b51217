//! Energy conservation: bound on the light of a lobe beside the cells.

use super::bands::Colours;
use super::scan::Scan;
use crate::domain::{Direction, Domain, Lobe, LobeUnder};
use crate::projection::scattered::incidences::Incidence;
use std::f64::consts::PI;

/// Approximate albedo, computed without solid angles, below which the exact one cannot exceed 1. Raising it saves exact
/// computations and may miss an excess.
const SAFE: f64 = 0.7;

/// Returns a factor of at most 1 by which to dim the lobe, so that the lobe lifts no directional albedo above 1.
///
/// `left` are the values without the lobe, `[row, band]`.
pub(super) fn factor(scan: &Scan<'_>, lobe: &Lobe, colours: &Colours, left: &[f32]) -> f64 {
    let width = scan.rows.width;
    let mut least = 1.0_f64;
    for incidence in scan.incidences {
        let Some(&first) = incidence.rows().first() else { continue };
        let Some(under) = lobe.under(Direction::from_unit(scan.plan.directions[first as usize].0)) else { continue };
        if rough(scan, incidence, &under, colours, left) < SAFE {
            continue;
        }
        let (weights, are_areas) = incidence.weights(&scan.plan.directions, Domain::Hemisphere, true);
        if !are_areas {
            // Without areas the base cannot be integrated and counts as black.
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
            for sum in &mut base {
                *sum *= 2.0;
            }
        }
        least = least.min(limited(under.light(), &colours.lobe, &base));
    }
    least
}

/// Returns the largest approximate albedo of a band under one incoming direction, from means of the values weighted by
/// cosines. It needs no solid angles.
fn rough(scan: &Scan<'_>, incidence: &Incidence, under: &LobeUnder, colours: &Colours, left: &[f32]) -> f64 {
    let width = scan.rows.width;
    let (mut sums, mut cosines) = (vec![0.0; width], vec![1e-9; width]);
    for &row in incidence.rows() {
        let cosine = scan.plan.directions[row as usize].1[2].max(0.0);
        let values = &left[row as usize * width..][..width];
        for ((sum, total), &value) in sums.iter_mut().zip(&mut cosines).zip(values).filter(|of| !of.1.is_nan()) {
            *sum += cosine * f64::from(value);
            *total += cosine;
        }
    }
    let light = under.light();
    let bands = sums.iter().zip(&cosines).zip(&colours.lobe);
    bands.map(|((sum, total), colour)| PI * sum / total + light * colour).fold(0.0, f64::max)
}

/// Returns the factor of at most 1 by which a lobe must be dimmed so that the albedos of lobe and background add up to
/// at most 1 in each spectral band. `light` times `colours` are the albedos of the lobe, `bases` those of the
/// background.
fn limited(light: f64, colours: &[f64], bases: &[f64]) -> f64 {
    let fits = |(&colour, &base): (&f64, &f64)| {
        let left = 1.0 - base;
        if left > 0.0 && light * colour > left { left / (light * colour) } else { 1.0 }
    };
    colours.iter().zip(bases).map(fits).fold(1.0, f64::min)
}
