//! Angles of a file in steps, so that directions stated twice with a rounding between them are one.

/// Resolution in degrees to which angles of a file are rounded for comparison: closer angles count as equal. Raising it
/// joins more directions.
pub(super) const SAME: f64 = 0.05;
/// Number of steps of 0.05° in a full turn; angles are rounded to such steps before they are compared.
const TURN: i64 = 7200;

/// Rounds an angle in degrees to a whole number of steps of 0.05°. Angles with the same number count as equal.
pub(super) fn steps(degrees: f64) -> i64 {
    (degrees / SAME).round() as i64
}

/// Rounds the azimuth `phi` of a direction to a whole number of steps of 0.05°, from 0 to 7199. Directions whose polar
/// angles and azimuths round to equal numbers of steps count as equal.
///
/// Returns 0 if the polar angle `theta` is below 0.05°, where the azimuth is arbitrary. Both angles are in degrees.
pub(super) fn azimuth_steps(theta: f64, phi: f64) -> i64 {
    if theta < SAME { 0 } else { steps(phi.rem_euclid(360.0)) % TURN }
}
