//! Angles of a file in steps, so that directions stated twice with a rounding between them are one.

/// Angles closer than this in degrees are one.
pub(super) const SAME: f64 = 0.05;
/// Steps in a turn.
const TURN: i64 = 7200;

/// Returns an angle in steps of [`SAME`].
pub(super) fn steps(degrees: f64) -> i64 {
    (degrees / SAME).round() as i64
}

/// Returns the azimuth of a direction in steps, 0 to a turn; 0 at the pole, where it is arbitrary.
pub(super) fn azimuth_steps(theta: f64, phi: f64) -> i64 {
    if theta < SAME { 0 } else { steps(phi.rem_euclid(360.0)) % TURN }
}
