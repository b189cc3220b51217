//! Share of the outgoing directions that was measured, and the planes between which nothing is known.

use crate::domain::{Axis, DirectionGrid, Domain, Measurement, Outside, Quantity};
use std::fmt;

/// Least share of the outgoing directions, from 0 to 1, whose measured values stand for all of them. Raising it refuses
/// albedos of instruments that do not reach the horizon: a measurement up to a polar angle of 64° has 0.8.
const ENOUGH: f64 = 0.8;
/// Distance of a unit vector from a plane within which the vector lies in the plane. It is larger than the error of
/// directions in float32 or with six digits. Raising it answers for more directions beside a scan in one plane.
pub(super) const ON_PLANE: f64 = 2e-5;

/// Part of the outgoing directions for which a material has measured values, at the incidence with the fewest.
///
/// Weights are solid angles, times |cos θ| for surfaces. Neither masked directions count, nor those that a rule filled
/// in, nor those between planes of a scan that are more than 90° apart. Directions that the standard of a file format
/// declares to be dark count as measured. A light of which one hemisphere was measured, as of downlights and panels, is
/// taken to be dark in the other one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct MeasuredShare {
    /// Measured share of the directions into which the quantity sends light, from 0 to 1.
    pub share: f64,
    /// Arrangement of the measured directions: an area, or planes.
    pub extent: MeasuredExtent,
    /// Directions into which the quantity sends light: a hemisphere or the sphere.
    #[serde(skip)]
    pub(super) domain: Domain,
    #[serde(skip)]
    pub(super) quantity: Quantity,
}

/// Arrangement of the measured outgoing directions of a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum MeasuredExtent {
    /// Directions that cover an area of the sphere.
    Area,
    /// Directions in the plane of incidence, on the sides of the source and of the mirror direction.
    Plane,
    /// Directions on one side of the plane of incidence.
    HalfPlane,
    /// Directions in several planes more than 90° apart.
    Planes,
}

impl MeasuredShare {
    /// Returns true if the measured directions stand for all: their share is at least 80 %.
    pub fn is_whole(&self) -> bool {
        self.share >= ENOUGH
    }

    /// Returns the name of the integral over all outgoing directions that the quantity has.
    pub fn light(&self) -> &'static str {
        match self.quantity {
            Quantity::Edf => "flux",
            Quantity::Phase => "integral over the sphere",
            _ => "albedo",
        }
    }

    /// Describes the weights of the directions beside their solid angle, and the incidence, for a refusal.
    pub(super) fn weight(&self) -> &'static str {
        if self.quantity.has_cosine() { " times cos θ, at the worst incidence" } else { "" }
    }
}

impl fmt::Display for MeasuredShare {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let domain = match self.domain {
            Domain::Hemisphere => "hemisphere",
            Domain::Lower => "lower hemisphere",
            Domain::Sphere => "sphere",
        };
        let share = 100.0 * self.share;
        match self.extent {
            MeasuredExtent::Area => write!(f, "measured in {share:.0} % of the {domain}"),
            MeasuredExtent::Plane => write!(f, "measured in the plane of incidence only: {share:.0} % of the {domain}"),
            MeasuredExtent::HalfPlane => {
                write!(f, "measured in half of the plane of incidence only: {share:.0} % of the {domain}")
            }
            MeasuredExtent::Planes => write!(f, "measured in separate planes only: {share:.0} % of the {domain}"),
        }
    }
}

/// Returns true for incoming directions that are all along the normal.
pub(super) fn is_normal(incoming: &Axis) -> bool {
    matches!(incoming, Axis::Elevation(elevations) if elevations[..] == [0.0])
}

/// Returns true if a surface was measured on one side of the plane of incidence: its outgoing directions are polar
/// angles without azimuths, although light came in obliquely.
pub(super) fn has_no_azimuths(measurement: &Measurement) -> bool {
    let axes = measurement.tensor.axes();
    let Ok(layout) = measurement.layout() else { return false };
    let is_oblique = layout.incoming.is_some_and(|axis| !is_normal(&axes[axis]));
    match layout.outgoing.map(|axis| &axes[axis]) {
        Some(Axis::Grid(grid)) => is_oblique && has_planes(measurement.quantity, grid) && grid.azimuths().is_none(),
        _ => false,
    }
}

/// Returns true if nothing is known between azimuths of a grid that are more than 90° apart: that is so for surfaces,
/// unless their file format says what is there.
pub(super) fn has_planes(quantity: Quantity, grid: &DirectionGrid) -> bool {
    quantity.has_cosine() && grid.outside() == Outside::Masked
}

/// Returns true if an outgoing direction lies on the mirror's side of the plane of incidence, or if `wi` is the normal.
/// Both are unit vectors, `wi` at azimuth 0.
#[inline]
pub(super) fn is_on_mirror_side(wi: [f64; 3], [x, y, _]: [f64; 3]) -> bool {
    wi[0].abs() <= ON_PLANE && wi[1].abs() <= ON_PLANE || y.abs() <= ON_PLANE && x <= ON_PLANE
}
