//! Decides if sampled directions follow the alignment from a node to the queried incoming direction, or stay.
//!
//! Following suits lobes and harms features that do not move. The choice is the one with less variance between the
//! nodes.

use super::carried::Carry;
use super::function::Function;
use super::lookup::MeshLookup;
use super::mixture::Mixture;
use super::place::{Interpolation, Place};
use super::trees::Trees;
use super::warp::SampleOptions;
use crate::domain::Direction;
use std::f64::consts::PI;
use std::sync::Arc;

/// Number of incoming directions at which sampling with and without lobe alignment is compared, and points per side of
/// the unit square drawn at each. More points make the choice more reliable and slower.
const COMPARED: u32 = 8;
const POINTS: u32 = 12;
/// Minimum cosine of the polar angle of incoming directions at which sampling with and without lobe alignment is
/// compared. At grazing incidence the function carries little light.
const LOWEST_COSINE: f64 = 0.15;

/// Builds the trees of triangles from which outgoing directions are drawn in proportion to the function's mean over
/// wavelengths. Drawn directions move with the lobes as the incoming direction changes, unless that raises the variance
/// of their weights.
pub(super) fn trees_of_mean(function: &Function, lookup: &Arc<MeshLookup>) -> Trees {
    let trees = Trees::of_mean(function, lookup);
    let carry = function.carry().filter(|carry| {
        let [carried, staying] = second_moments(&trees, function, *carry);
        carried <= staying
    });
    trees.carried_by(carry)
}

/// Second moments of f · |cos θo| / pdf for two densities: drawn outgoing directions move with their lobes to the
/// queried incoming direction, or they stay in place. Each is divided by the squared mean and summed over incoming
/// directions.
///
/// The estimate draws half of the directions with each density.
fn second_moments(trees: &Trees, function: &Function, carry: Carry) -> [f64; 2] {
    let mut sums = [0.0; 2];
    let options = SampleOptions::default();
    let ways = [Some(carry), None];
    for wi in compared(function) {
        let index = vec![0; function.geometry().layout().indices];
        let mixtures = ways.map(|carry| Mixture::new(function, trees, &index, Some(wi), options, carry).ok());
        let [Some(carried), Some(staying)] = mixtures else { continue };
        let (mut first, mut second) = (0.0, [0.0; 2]);
        for k in 0..2 * POINTS * POINTS {
            let from = if k % 2 == 0 { &carried } else { &staying };
            let u = [k / 2 / POINTS, k / 2 % POINTS].map(|k| (f64::from(k) + 0.5) / f64::from(POINTS));
            let Some((wo, _)) = from.draw(u) else { continue };
            let turned = function.geometry().turned_with(Some(wi), wo);
            let place = Place { index: &index, wi: Some(wi), wo: Some(turned) };
            let Ok(value) = function.weighted_known(place, Interpolation::Smooth, trees.weights()) else { continue };
            let cosine = if function.geometry().quantity().has_cosine() { wo.cos_theta().abs() } else { 1.0 };
            let value = f64::from(value.max(0.0)) * cosine;
            let densities = [&carried, &staying].map(|mixture| mixture.density(wo));
            let drawn = 0.5 * (densities[0] + densities[1]);
            if value > 0.0 && densities.iter().all(|density| *density > 0.0) {
                first += value / drawn;
                second.iter_mut().zip(densities).for_each(|(sum, pdf)| *sum += value * value / (pdf * drawn));
            }
        }
        if first > 0.0 {
            let count = f64::from(2 * POINTS * POINTS);
            sums.iter_mut().zip(second).for_each(|(sum, second)| *sum += second * count / (first * first));
        }
    }
    sums
}

/// Incoming directions spread over the domain of the incoming axis, in general between the sampled ones.
fn compared(function: &Function) -> Vec<Direction> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let directions = (0..COMPARED).map(|k| {
        let height = LOWEST_COSINE + (1.0 - LOWEST_COSINE) * (f64::from(k) + 0.5) / f64::from(COMPARED);
        let (sin, cos) = libm::sincos(0.4 + golden * f64::from(k));
        let radius = (1.0 - height * height).sqrt();
        [radius * cos, radius * sin, height]
    });
    let both = directions.flat_map(|[x, y, z]| [[x, y, z], [x, y, -z]]);
    both.filter_map(|[x, y, z]| Direction::new(x, y, z)).filter(|&wi| function.geometry().takes(wi)).collect()
}
