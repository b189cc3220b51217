//! Directions as unit vectors, with named conversions from and to angles.

use super::vector::{self, Vector};

const RADIANS_PER_DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Direction: unit vector in the frame of a surface or luminaire (see [`crate::domain`]).
///
/// ```
/// use wavelume_core::domain::Direction;
/// // theta from the normal, phi counter-clockwise from +x.
/// let d = Direction::from_degrees(90.0, 90.0);
/// assert_eq!(d.xyz(), [0.0, 1.0, 0.0]);
/// assert!(Direction::new(0.0, 0.0, 0.0).is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction(Vector);

impl Direction {
    /// Creates a direction from a vector of any length; `None` if it is zero or not finite.
    #[inline]
    pub fn new(x: f64, y: f64, z: f64) -> Option<Self> {
        let length = vector::norm([x, y, z]);
        (length.is_finite() && length > 0.0).then(|| Self(vector::scale([x, y, z], 1.0 / length)))
    }

    /// Creates a direction from the polar angle `theta` (from `+z`) and the azimuth `phi` (counter-clockwise from
    /// `+x`), in radians.
    pub fn from_radians(theta: f64, phi: f64) -> Self {
        let (sin_theta, cos_theta) = libm::sincos(theta);
        let (sin_phi, cos_phi) = libm::sincos(phi);
        Self([sin_theta * cos_phi, sin_theta * sin_phi, cos_theta])
    }

    /// Creates a direction from the polar angle `theta` (from `+z`) and the azimuth `phi` (counter-clockwise from `+x`)
    /// in degrees. Multiples of 90° are exact.
    pub fn from_degrees(theta: f64, phi: f64) -> Self {
        let (sin_theta, cos_theta) = sin_cos_degrees(theta);
        let (sin_phi, cos_phi) = sin_cos_degrees(phi);
        Self([sin_theta * cos_phi, sin_theta * sin_phi, cos_theta])
    }

    /// Creates a direction from the photometric angles of a luminaire in degrees. `gamma` is counted from nadir (`-z`),
    /// `c` counter-clockwise seen from above, from `+x`.
    pub fn from_luminaire_degrees(c: f64, gamma: f64) -> Self {
        Self::from_degrees(180.0 - gamma, c)
    }

    /// Returns the photometric angles C (0..360) and gamma (0..=180) of the direction of a luminaire in degrees, the
    /// inverse of [`Direction::from_luminaire_degrees`].
    pub fn luminaire_degrees(self) -> [f64; 2] {
        let [x, y, z] = self.0;
        [self.phi_degrees(), Self([x, y, -z]).theta_degrees()]
    }

    /// Creates a direction from a vector that already has unit length, which is not checked.
    #[inline]
    pub fn from_unit(v: Vector) -> Self {
        Self(v)
    }

    /// Returns the components `[x, y, z]` of the direction.
    #[inline]
    pub fn xyz(self) -> [f64; 3] {
        self.0
    }

    /// Returns the cosine of the angle between the direction and `+z`: the `z` component.
    #[inline]
    pub fn cos_theta(self) -> f64 {
        self.0[2]
    }

    /// Returns the polar angle of the direction from `+z` in radians, 0..=π.
    pub fn theta(self) -> f64 {
        // atan2 is precise near the poles, acos is not.
        libm::atan2(libm::hypot(self.0[0], self.0[1]), self.0[2])
    }

    /// Returns the azimuth of the direction from `+x` in radians, 0..2π; 0 at the poles.
    pub fn phi(self) -> f64 {
        let phi = libm::atan2(self.0[1], self.0[0]);
        if phi < 0.0 { phi + std::f64::consts::TAU } else { phi }
    }

    /// Returns the polar angle of the direction from `+z` in degrees, 0..=180.
    pub fn theta_degrees(self) -> f64 {
        self.theta() / RADIANS_PER_DEGREE
    }

    /// Returns the azimuth of the direction from `+x` in degrees, 0..360.
    pub fn phi_degrees(self) -> f64 {
        self.phi() / RADIANS_PER_DEGREE
    }

    /// Returns the inner product with another direction: the cosine of the angle between them.
    pub fn dot(self, other: Self) -> f64 {
        vector::dot(self.0, other.0)
    }

    /// Returns the direction rotated by `phi` radians counter-clockwise about `+z`.
    #[must_use]
    pub fn rotated_about_z(self, phi: f64) -> Self {
        Self(vector::about_z(self.0, phi))
    }
}

/// Returns the sine and the cosine of an angle in degrees, exact at multiples of 90°.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let turned = degrees.rem_euclid(360.0);
    match turned {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => libm::sincos(turned * RADIANS_PER_DEGREE),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spherical_angles_round_trip() {
        for theta in [0.0, 1e-6, 13.0, 89.999, 90.0, 137.5, 180.0] {
            for phi in [0.0, 10.0, 90.0, 181.25, 359.0] {
                let d = Direction::from_degrees(theta, phi);
                assert!((d.dot(d) - 1.0).abs() < 1e-14);
                assert!((d.theta_degrees() - theta).abs() < 1e-9, "{theta} {phi}");
                if theta > 0.0 && theta < 180.0 {
                    assert!((d.phi_degrees() - phi).abs() < 1e-8, "{theta} {phi}");
                }
            }
        }
    }

    #[test]
    fn luminaire_nadir_points_down_and_c0_along_x() {
        assert_eq!(Direction::from_luminaire_degrees(0.0, 0.0).xyz(), [0.0, 0.0, -1.0]);
        assert_eq!(Direction::from_luminaire_degrees(90.0, 90.0).xyz(), [0.0, 1.0, 0.0]);
        for (c, gamma) in [(0.0, 0.0), (270.0, 30.0), (12.5, 179.0), (90.0, 90.0)] {
            let [found_c, found_gamma] = Direction::from_luminaire_degrees(c, gamma).luminaire_degrees();
            assert!((found_c - c).abs() < 1e-9 && (found_gamma - gamma).abs() < 1e-9, "{found_c} {found_gamma}");
        }
    }

    #[test]
    fn zero_and_non_finite_vectors_are_no_directions() {
        assert_eq!(Direction::new(0.0, 0.0, 0.0), None);
        assert_eq!(Direction::new(f64::NAN, 0.0, 1.0), None);
        assert_eq!(Direction::new(f64::INFINITY, 0.0, 1.0), None);
    }
}
