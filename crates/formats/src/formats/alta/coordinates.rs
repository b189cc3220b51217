//! Parametrisations of ALTA that fix a pair of directions, and their conversion (`params::to_cartesian` of ALTA).

use crate::domain::Direction;
use crate::domain::vector::{Vector, about_y, about_z, dot, norm, scale, sub};
use std::f64::consts::TAU;

/// Upper bound on the number of coordinates in a row of an ALTA file.
pub(super) const MOST: usize = 6;
/// Largest plausible angle in an ALTA file, in radians; larger numbers indicate degrees and are refused.
const LARGEST_ANGLE: f64 = TAU + 1e-6;
/// Tolerance on the length of a unit vector in an ALTA file, whose numbers have at least 3 digits. Raising it accepts
/// less exact vectors.
const UNIT_LENGTH: f64 = 5e-3;

/// Coordinates by which a row of an ALTA file gives the directions to the light and to the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coordinates {
    /// Four angles of the half vector and the difference vector: `theta_h, phi_h, theta_d, phi_d`.
    HalfAngles,
    /// Half and difference angles of an isotropic sample: `theta_h, theta_d, phi_d`.
    IsotropicHalfAngles,
    /// Polar angles and azimuths of the directions to the light and to the viewer: `theta_l, phi_l, theta_v, phi_v`.
    Spherical,
    /// Angles of an isotropic sample: `theta_v, theta_l`, and the azimuth of the light relative to that of the viewer.
    Isotropic,
    /// Angles of an isotropic sample: `theta_l`, then `theta_v cos(phi), theta_v sin(phi)`, phi being the azimuth of
    /// the viewer relative to that of the light.
    Projected,
    /// Unit vectors to the viewer and to the light, in this order.
    Cartesian,
}

/// Directions to the light and to the viewer of one measured value.
pub(super) struct Pair {
    pub(super) light: Direction,
    pub(super) view: Direction,
}

impl Coordinates {
    const ALL: [(Self, &'static str, usize); 6] = [
        (Self::HalfAngles, "RUSIN_TH_PH_TD_PD", 4),
        (Self::IsotropicHalfAngles, "RUSIN_TH_TD_PD", 3),
        (Self::Spherical, "SPHERICAL_TL_PL_TV_PV", 4),
        (Self::Isotropic, "ISOTROPIC_TV_TL_DPHI", 3),
        (Self::Projected, "ISOTROPIC_TL_TV_PROJ_DPHI", 3),
        (Self::Cartesian, "CARTESIAN", 6),
    ];

    fn entry(self) -> (&'static str, usize) {
        Self::ALL.iter().find(|(known, ..)| *known == self).map_or(("", 0), |&(_, name, dimensions)| (name, dimensions))
    }

    pub(super) fn of_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, known, _)| *known == name).map(|&(found, ..)| found)
    }

    /// Returns the name that ALTA files use for this set of coordinates of a pair of directions, such as
    /// `SPHERICAL_TL_PL_TV_PV`.
    pub(super) fn name(self) -> &'static str {
        self.entry().0
    }

    /// Returns the names that ALTA files use for all sets of coordinates of a pair of directions, for messages.
    pub(super) fn names() -> String {
        Self::ALL.map(|(_, name, _)| name).join(", ")
    }

    /// Returns the number of coordinates in a row of an ALTA file.
    pub(super) fn dimensions(self) -> usize {
        self.entry().1
    }

    /// Returns true for coordinates of isotropic samples, which give only the difference of the azimuths.
    pub(super) fn is_isotropic(self) -> bool {
        matches!(self, Self::IsotropicHalfAngles | Self::Isotropic | Self::Projected)
    }

    /// Returns the form that the coordinates in a row of an ALTA file must have, for error messages, such as `angles in
    /// radians`.
    pub(super) fn expected(self) -> &'static str {
        match self {
            Self::Cartesian => "two unit vectors",
            _ => "angles in radians",
        }
    }

    /// Converts the coordinates `x` in a row of an ALTA file to the directions to the light and to the viewer; `None`
    /// if they are invalid.
    pub(super) fn directions(self, x: &[f64]) -> Option<Pair> {
        let spherical = |theta: f64, phi: f64| Direction::from_radians(theta, phi);
        let pair = |light: Direction, view: Direction| Some(Pair { light, view });
        if self != Self::Cartesian && !x.iter().all(|angle| angle.abs() <= LARGEST_ANGLE) {
            return None;
        }
        match (self, x) {
            (Self::HalfAngles, &[theta_h, phi_h, theta_d, phi_d]) => Some(half_angles(theta_h, phi_h, theta_d, phi_d)),
            (Self::IsotropicHalfAngles, &[theta_h, theta_d, phi_d]) => Some(half_angles(theta_h, 0.0, theta_d, phi_d)),
            (Self::Spherical, &[theta_l, phi_l, theta_v, phi_v]) => {
                pair(spherical(theta_l, phi_l), spherical(theta_v, phi_v))
            }
            (Self::Isotropic, &[theta_v, theta_l, phi]) => pair(spherical(theta_l, phi), spherical(theta_v, 0.0)),
            (Self::Projected, &[theta_l, x, y]) => {
                pair(spherical(theta_l, 0.0), spherical(libm::hypot(x, y), libm::atan2(y, x)))
            }
            (Self::Cartesian, &[vx, vy, vz, lx, ly, lz]) => pair(unit([lx, ly, lz])?, unit([vx, vy, vz])?),
            _ => None,
        }
    }
}

/// Returns the direction of a vector whose length is 1 within [`UNIT_LENGTH`]; `None` for another length.
fn unit(vector: Vector) -> Option<Direction> {
    let length = norm(vector);
    ((length - 1.0).abs() <= UNIT_LENGTH).then(|| Direction::from_unit(scale(vector, 1.0 / length)))
}

/// Returns the directions to the light and to the viewer at half and difference angles. The viewer is in the difference
/// direction, rotated with the half vector away from the normal. The light is in the mirror image of that direction
/// about the half vector.
fn half_angles(theta_h: f64, phi_h: f64, theta_d: f64, phi_d: f64) -> Pair {
    let turned = |direction: Direction| about_z(about_y(direction.xyz(), theta_h), phi_h);
    let half = Direction::from_radians(theta_h, phi_h).xyz();
    let view = turned(Direction::from_radians(theta_d, phi_d));
    let light = sub(scale(half, 2.0 * dot(view, half)), view);
    Pair { light: Direction::from_unit(light), view: Direction::from_unit(view) }
}
