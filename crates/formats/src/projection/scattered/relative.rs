//! Coordinates of samples relative to the mirror direction, in the slope of the half vector, and relative to the
//! direction back to the source.
//!
//! A lobe keeps its place in one of the three under every incidence, so that samples of all incidences show it
//! together.

use super::cloud::slope;
use crate::domain::Quantity;
use crate::domain::vector::{Vector, cross, dot, norm, unit};

/// Number of coordinate systems in which lobes are sought: about the mirror direction, in half-vector slopes, and about
/// the direction back to the source.
const COORDINATES: usize = 3;
/// Coordinates given to samples whose half vector has no slope, where lobes are sought in half-vector slopes: a point
/// far from all other samples.
const NOWHERE: Vector = [1e6, 0.0, 0.0];

/// Expected position of a lobe's peak in each of the three coordinate systems (mirror direction, half-vector slopes,
/// direction back to the source).
pub(super) const ORIGINS: [Vector; COORDINATES] = [[1.0, 0.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0]];

/// Returns three sets of coordinates of a pair of directions: about the mirror direction, in half-vector slopes, and
/// about the direction back to the source. In one of them a lobe peaks at the same place under all incoming directions.
///
/// Near that peak ([`ORIGINS`]), distances approximate those between outgoing directions, in radians.
pub(super) fn places(quantity: Quantity, (wi, wo): (Vector, Vector)) -> [Vector; COORDINATES] {
    let [x, y, z] = wi;
    let across = if norm([x, y, 0.0]) > 1e-6 { unit([-y, x, 0.0]) } else { [0.0, 1.0, 0.0] };
    let is_reflected = match quantity {
        Quantity::Btdf | Quantity::Phase => false,
        Quantity::Bsdf => wo[2] * z >= 0.0,
        _ => true,
    };
    let onward = if is_reflected { [-x, -y, z] } else { [-x, -y, -z] };
    let from = |d: Vector| [dot(wo, d), dot(wo, cross(across, d)), dot(wo, across)];
    let [a, b] = slope(wi, wo);
    let slopes = if a.is_nan() { NOWHERE } else { [2.0 * a, 2.0 * b, 0.0] };
    [from(onward), slopes, from(wi)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Direction;

    #[test]
    fn lobes_stay_where_they_are_under_every_incidence() {
        let at = |theta: f64, phi: f64| Direction::from_degrees(theta, phi).xyz();
        for theta in [0.0, 20.0, 50.0, 80.0] {
            let wi = at(theta, 0.0);
            let close = |a: Vector, b: Vector| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
            let [mirror, slopes, _] = places(Quantity::Brdf, (wi, at(theta, 180.0)));
            assert!(close(mirror, ORIGINS[0]) && close(slopes, ORIGINS[1]), "{mirror:?} {slopes:?}");
            let [_, _, back] = places(Quantity::Brdf, (wi, wi));
            assert!(close(back, ORIGINS[2]), "{back:?}");
            let [through, ..] = places(Quantity::Btdf, (wi, wi.map(|x| -x)));
            assert!(close(through, ORIGINS[0]), "{through:?}");
            // Two degrees beside the mirror direction, outside the plane of incidence.
            let beside = unit([-wi[0], 2_f64.to_radians().tan(), wi[2]]);
            let [place, ..] = places(Quantity::Brdf, (wi, beside));
            assert!((place[2] - 2_f64.to_radians().sin()).abs() < 1e-12 && place[1].abs() < 1e-12, "{place:?}");
        }
    }
}
