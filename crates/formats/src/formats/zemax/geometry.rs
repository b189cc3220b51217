//! Directions about the specular ray: from the angles of the file to those of the surface frame.

use super::header::Header;
use crate::domain::vector::{Vector, about_y, about_z};
use crate::domain::{Direction, Quantity};

/// Number of rounding steps of angles in one degree, which removes the rounding errors that hide grids of angles.
/// Raising it keeps more of them.
const ROUNDING: f64 = 1e9;
/// Depth, as a cosine, by which a direction may lie below the horizon because of rounding.
const HORIZON: f64 = 1e-12;

/// Incidence of the light: its polar angle, and the rotation of the sample, in degrees.
#[derive(Clone, Copy)]
pub(super) struct Incidence {
    pub(super) theta: f64,
    pub(super) rotation: f64,
}

/// Returns the scattered direction at `radial` degrees from the specular ray and `azimuth` degrees about it, for light
/// from the azimuth 0; above the surface, also for transmission.
///
/// Azimuth 0 points from the specular ray to the normal; azimuths grow counter-clockwise, seen against the ray. These
/// are the specular coordinates of libbsdf.
pub(super) fn scattered(theta: f64, azimuth: f64, radial: f64) -> Vector {
    let [s, p] = [radial, azimuth].map(f64::to_radians);
    let (sin, cos) = libm::sincos(s);
    let about = [sin * libm::cos(p), sin * libm::sin(p), cos];
    about_y(about, -theta.to_radians())
}

/// Returns the pair of directions `[theta_i, phi_i, theta_o, phi_o]` in degrees; `None` if the scattered one lies
/// behind the surface from which the light leaves. The azimuth of the light is the rotation of the sample.
pub(super) fn pair(header: &Header, incidence: Incidence, azimuth: f64, radial: f64) -> Option<[f64; 4]> {
    let Incidence { theta, rotation } = incidence;
    let above = scattered(theta, azimuth, radial);
    if above[2] < -HORIZON {
        return None;
    }
    let [x, y, z] = about_z(above, rotation.to_radians());
    let out = Direction::from_unit([x, y, z]);
    let rounded = |degrees: f64| (degrees * ROUNDING).round() / ROUNDING;
    let theta_o = rounded(out.theta_degrees()).min(90.0);
    let theta_o = if header.quantity == Quantity::Btdf { 180.0 - theta_o } else { theta_o };
    // All azimuths denote one direction at a pole.
    let phi_o = if theta_o % 180.0 == 0.0 { 0.0 } else { rounded(out.phi_degrees()).rem_euclid(360.0) };
    let phi_i = if theta == 0.0 { 0.0 } else { rotation.rem_euclid(360.0) };
    Some([theta, phi_i, theta_o, phi_o])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specular_ray_is_the_centre_and_azimuth_0_leads_to_the_normal() {
        let close = |a: Vector, b: Vector| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        let at = |theta: f64, phi: f64| Direction::from_degrees(theta, phi).xyz();
        assert!(close(scattered(30.0, 77.0, 0.0), at(30.0, 180.0)));
        assert!(close(scattered(30.0, 0.0, 10.0), at(20.0, 180.0)));
        assert!(close(scattered(30.0, 0.0, 30.0), at(0.0, 0.0)));
        assert!(close(scattered(30.0, 0.0, 50.0), at(20.0, 0.0)));
        assert!(close(scattered(30.0, 180.0, 10.0), at(40.0, 180.0)));
        // Seen against the specular ray the normal is up, and +y is on the left.
        let left = scattered(30.0, 90.0, 10.0);
        assert!(left[1] > 0.0 && (left[2] - 30_f64.to_radians().cos() * 10_f64.to_radians().cos()).abs() < 1e-12);
        assert!(close(scattered(0.0, 40.0, 25.0), at(25.0, 40.0)));
    }
}
