//! Plane coordinates of outgoing directions, with the centre of a lobe as origin.

use super::centre::LobeCentre;
use crate::domain::vector::{Vector, add, dot, norm, scale, sub};

/// Map of the outgoing directions for one incoming direction to points of a plane, with the centre of a reflection lobe
/// as origin.
///
/// For lobes about the mirror direction or the direction back to the source, it is Lambert's azimuthal equal-area
/// projection of the sphere: areas are solid angles, and an angle δ from the centre is at distance 2·sin(δ/2). For half
/// vectors h = (x, y, z), coordinates are the slopes (x/z, y/z).
#[derive(Clone, Copy, Debug)]
pub(super) enum Around {
    /// Azimuthal projection about a centre direction; `axes` are the unit vectors of the two coordinates there.
    Direction { centre: Vector, axes: [Vector; 2] },
    /// Slopes (x/z, y/z) of the half vector between the incoming direction `wi` and the outgoing direction.
    HalfVector { wi: Vector },
}

impl Around {
    /// Creates the map of outgoing directions to a plane about a lobe's centre. `wi` is the incoming direction, a unit
    /// vector above the horizon.
    #[inline]
    pub(super) fn new(centre: LobeCentre, wi: Vector) -> Self {
        match centre {
            LobeCentre::HalfVector => Self::HalfVector { wi },
            LobeCentre::Mirror => Self::about([-wi[0], -wi[1], wi[2]]),
            LobeCentre::Source => Self::about(wi),
        }
    }

    /// Creates the azimuthal projection about a direction. Its coordinate axes are x and y of the surface, rotated
    /// along the shortest arc from the normal to that direction.
    #[inline]
    fn about(centre: Vector) -> Self {
        let [x, y, z] = centre;
        let s = 1.0 / (1.0 + z);
        Self::Direction { centre, axes: [[1.0 - x * x * s, -x * y * s, -x], [-x * y * s, 1.0 - y * y * s, -y]] }
    }

    /// Returns the direction of the lobe's centre, which the map from outgoing directions to a plane takes to the
    /// plane's origin.
    pub(super) fn centre(&self) -> Vector {
        match *self {
            Self::Direction { centre, .. } => centre,
            Self::HalfVector { wi: [x, y, z] } => [-x, -y, z],
        }
    }

    /// Projects an outgoing direction to the plane about a lobe's centre: equal-area, or as slopes (x/z, y/z) of the
    /// half vector.
    #[inline]
    pub(super) fn place(&self, wo: Vector) -> [f64; 2] {
        match self {
            Self::Direction { centre, axes } => {
                let chord = sub(wo, *centre);
                // 1 + cos δ, without cancellation near the centre.
                let s = (2.0 / (2.0 - 0.5 * dot(chord, chord)).max(1e-12)).sqrt();
                [dot(wo, axes[0]) * s, dot(wo, axes[1]) * s]
            }
            Self::HalfVector { wi } => {
                let h = add(*wi, wo);
                [h[0] / h[2], h[1] / h[2]]
            }
        }
    }

    /// Returns the outgoing direction of a point in the plane about a lobe's centre (equal-area projection, or slopes
    /// of half vectors).
    #[inline]
    pub(super) fn direction(&self, [x, y]: [f64; 2]) -> Vector {
        match self {
            Self::Direction { centre, axes } => {
                let squared = (x * x + y * y).min(4.0);
                let (cos, s) = (1.0 - 0.5 * squared, (1.0 - 0.25 * squared).sqrt());
                add(scale(*centre, cos), scale(add(scale(axes[0], x), scale(axes[1], y)), s))
            }
            Self::HalfVector { wi } => {
                let length = (1.0 + x * x + y * y).sqrt();
                let h = [x / length, y / length, 1.0 / length];
                sub(scale(h, 2.0 * dot(*wi, h)), *wi)
            }
        }
    }

    /// Returns the solid angle of outgoing directions per unit area of the plane to which they are projected about a
    /// lobe's centre, at a point of that plane.
    #[inline]
    pub(super) fn solid_angle(&self, [x, y]: [f64; 2]) -> f64 {
        match self {
            Self::Direction { .. } => 1.0,
            // dωo = 4·(wi·h)·dωh, dωh = hz³·dA.
            Self::HalfVector { wi } => {
                let squared = 1.0 + x * x + y * y;
                4.0 * (wi[0] * x + wi[1] * y + wi[2]) / (squared * squared)
            }
        }
    }

    /// Returns the distance from the lobe's centre to the horizon in the projection plane, along a unit vector of that
    /// plane.
    #[inline]
    pub(super) fn horizon(&self, [x, y]: [f64; 2]) -> f64 {
        match self {
            Self::Direction { centre, axes } => {
                let rise = x * axes[0][2] + y * axes[1][2];
                // The height cos δ·cz + sin δ·rise is 0; the distance is 2·sin(δ/2) = √(2·(1 − cos δ)).
                let cos = -rise / norm([centre[2], rise, 0.0]);
                (2.0 * (1.0 - cos)).max(0.0).sqrt()
            }
            // The height 2·(wi·h)·hz − wi.z is 0.
            Self::HalfVector { wi } => {
                let along = wi[0] * x + wi[1] * y;
                (along + norm([along, wi[2], 0.0])) / wi[2]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::centre::CENTRES;
    use super::*;
    use crate::domain::Direction;

    #[test]
    fn places_and_directions_are_inverse_and_end_at_the_horizon() {
        for centre in CENTRES {
            for [theta, phi] in [[0.0, 0.0], [30.0, 20.0], [75.0, 200.0]] {
                let around = Around::new(centre, Direction::from_degrees(theta, phi).xyz());
                assert!(norm(sub(around.direction([0.0; 2]), around.centre())) < 1e-12);
                for turn in 0..12 {
                    let (sin, cos) = f64::from(turn).sin_cos();
                    let horizon = around.horizon([cos, sin]);
                    assert!(around.direction([cos * horizon, sin * horizon])[2].abs() < 1e-9);
                    for part in [1e-4, 0.3, 0.9] {
                        let place = [cos * horizon * part, sin * horizon * part];
                        let wo = around.direction(place);
                        assert!((norm(wo) - 1.0).abs() < 1e-12 && wo[2] > 0.0);
                        let again = around.place(wo);
                        let off = (again[0] - place[0]).hypot(again[1] - place[1]);
                        assert!(off < 1e-9 * (1.0 + horizon), "{centre:?} {theta}: {place:?} {again:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn solid_angles_are_those_of_small_triangles() {
        for centre in CENTRES {
            let around = Around::new(centre, Direction::from_degrees(50.0, 130.0).xyz());
            let place = [0.21, -0.13];
            let step = 1e-4;
            let corners =
                [[0.0, 0.0], [step, 0.0], [0.0, step]].map(|[x, y]| around.direction([place[0] + x, place[1] + y]));
            let found = crate::domain::solid_angle(corners) / (0.5 * step * step);
            let expected = around.solid_angle([place[0] + step / 3.0, place[1] + step / 3.0]);
            assert!((found / expected - 1.0).abs() < 1e-4, "{centre:?}: {found} against {expected}");
        }
    }
}
