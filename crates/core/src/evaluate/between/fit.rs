//! Fits the microfacet model to the light of all incidences, which gives the parameters of the divisors.

use super::tables::Tables;
use crate::compress::Divided;
use crate::compress::Divisor;
use crate::domain::vector::{Vector, dot, scale, sub, unit};

/// Maximum number of incoming directions and of combinations of indices (positions on the axes before the directions)
/// to which the microfacet model is fitted. More take longer and change the fit little.
const INCIDENCES: usize = 12;
const ENTRIES: usize = 4;
/// Slopes (tangents of the polar angle) of the half vectors at which the microfacet model is fitted, and azimuths per
/// slope.
const SLOPES: [f64; 12] = [0.01, 0.02, 0.04, 0.07, 0.11, 0.16, 0.23, 0.32, 0.45, 0.65, 1.0, 1.6];
const AZIMUTHS: u32 = 6;
/// Minimum cosine of the outgoing directions to which the microfacet model is fitted; directions below carry little
/// light.
const LOWEST: f64 = 0.1;
/// Stride through a list of outgoing directions spread over the whole hemisphere. The fit of the microfacet model uses
/// every 16th of them, besides directions around the mirror direction.
const SPREAD: usize = 16;
/// Starting values for the fit of the microfacet model: roughness, reflectance, and diffuse base as a multiple of the
/// reflectance.
const ROUGHNESS: [f64; 12] = [0.01, 0.02, 0.035, 0.055, 0.08, 0.12, 0.17, 0.24, 0.34, 0.48, 0.68, 0.95];
const REFLECTANCE: [f64; 4] = [0.04, 0.12, 0.4, 0.9];
const BASE: [f64; 10] = [0.0, 1e-3, 0.01, 0.05, 0.2, 0.5, 1.0, 3.0, 10.0, 100.0];
/// Number that replaces 0 as starting value of the microfacet model's diffuse base, because the fit varies the
/// logarithm of the base.
const NO_BASE: f64 = 1e-9;
/// Pattern search for the logarithms of the microfacet model's roughness, reflectance and diffuse base: initial steps,
/// number of halvings of the steps, and maximum rounds between halvings.
const STEPS: [f64; 3] = [0.2, 0.5, 0.7];
const HALVINGS: u32 = 10;
const ROUNDS: u32 = 32;
/// Least decrease of the variance of ln(measured BRDF / microfacet model) that counts as progress in fitting the model:
/// a fraction of the variance, plus an absolute amount. The amount excludes rounding errors, which are all that remains
/// if the model matches a surface exactly.
const LESS: f64 = 1e-3;
const ROUNDING: f64 = 1e-10;

/// Natural logarithm of the measured BRDF (mean over wavelengths, up to a common factor) for one pair of an incoming
/// and an outgoing direction.
struct Seen {
    wi: [f32; 3],
    wo: [f32; 3],
    logarithm: f64,
}

/// Microfacet model closest to the logarithms of measured light, up to a factor; `None` if too few directions have
/// light.
pub(super) fn model(tables: &Tables<'_>) -> Option<Divisor> {
    let seen = seen(tables);
    if seen.len() < 2 * STEPS.len() {
        return None;
    }
    let mut best = ([0.0; 3], f64::INFINITY);
    for (a, f) in ROUGHNESS.into_iter().flat_map(|a| REFLECTANCE.map(|f| (a, f))) {
        for base in BASE.map(|base| f * base) {
            let place = [a, f, base.max(NO_BASE)].map(libm::log);
            let spread = variance(&seen, place);
            if spread < best.1 {
                best = (place, spread);
            }
        }
    }
    let mut steps = STEPS;
    for _ in 0..HALVINGS {
        for _ in 0..ROUNDS {
            let mut moves = false;
            for (k, step) in steps.into_iter().enumerate().flat_map(|(k, step)| [(k, step), (k, -step)]) {
                let mut place = best.0;
                place[k] += step;
                // Reflectance is at most 1.
                place[1] = place[1].min(0.0);
                let spread = variance(&seen, place);
                if spread < (1.0 - LESS) * best.1 - ROUNDING {
                    (best, moves) = ((place, spread), true);
                }
            }
            if !moves {
                break;
            }
        }
        steps = steps.map(|step| 0.5 * step);
    }
    best.1.is_finite().then(|| divisor(best.0).stated())
}

fn divisor(place: [f64; 3]) -> Divisor {
    let [roughness, reflectance, base] = place.map(|x| libm::exp(x) as f32);
    Divisor::Model { roughness, reflectance, base }.stated()
}

/// Variance, over pairs of directions, of the natural logarithm of the ratio of the measured BRDF to the microfacet
/// model.
fn variance(seen: &[Seen], place: [f64; 3]) -> f64 {
    let model = Divided::by(divisor(place));
    let (mut sum, mut square) = (0.0, 0.0);
    for Seen { wi, wo, logarithm } in seen {
        let rest = logarithm - f64::from(model.one(*wi, *wo));
        sum += rest;
        square += rest * rest;
    }
    let count = seen.len() as f64;
    (square / count - (sum / count) * (sum / count)).max(0.0)
}

/// Returns the measured light to which the microfacet model is fitted: in outgoing directions around the mirror
/// direction of each incoming direction, and over the whole hemisphere. For a scan in planes they are the measured
/// ones.
fn seen(tables: &Tables<'_>) -> Vec<Seen> {
    let incidences = tables.incidences();
    let step = incidences.len().div_ceil(INCIDENCES).max(1);
    let (around, stride) = if tables.is_scan() { (None, 1) } else { (Some(half_vectors()), SPREAD) };
    let around: Vec<Vector> =
        around.into_iter().flat_map(|slopes| std::iter::once([0.0, 0.0, 1.0]).chain(slopes)).collect();
    let mut seen = Vec::new();
    for entry in 0..tables.entries().min(ENTRIES) {
        for (node, &wi) in incidences.iter().enumerate().step_by(step) {
            let near = around.iter().map(|&h| mirrored(wi, h));
            let spread = tables.outgoing().iter().step_by(stride).copied();
            for wo in near.chain(spread).filter(|wo| wo[2] > LOWEST) {
                let light = tables.light(entry, node, wo);
                if light > 0.0 {
                    let [wi, wo] = [wi, wo].map(|d| d.map(|x| x as f32));
                    seen.push(Seen { wi, wo, logarithm: libm::log(light) });
                }
            }
        }
    }
    seen
}

/// Returns the half vectors around the normal at which the microfacet model is fitted.
fn half_vectors() -> impl Iterator<Item = Vector> {
    let azimuths =
        (0..AZIMUTHS).map(|k| libm::sincos(std::f64::consts::TAU * (f64::from(k) + 0.25) / f64::from(AZIMUTHS)));
    let azimuths: Vec<(f64, f64)> = azimuths.collect();
    SLOPES.into_iter().flat_map(move |slope| {
        azimuths.clone().into_iter().map(move |(sin, cos)| unit([slope * cos, slope * sin, 1.0]))
    })
}

/// Incoming direction `wi` mirrored at the half vector `h`.
fn mirrored(wi: Vector, h: Vector) -> Vector {
    sub(scale(h, 2.0 * dot(wi, h)), wi)
}
