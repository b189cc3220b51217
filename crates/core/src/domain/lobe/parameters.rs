//! Numbers that a lobe is made of, and their bounds.

use super::centre::LobeCentre;
use serde::{Deserialize, Serialize};

/// Largest natural logarithm of a lobe's peak in sr⁻¹: larger than any real surface, small enough not to overflow when
/// multiplied by a colour factor.
pub(super) const LARGEST_LOG: f64 = 40.0;
/// Largest value of a lobe in sr⁻¹; multiplied by the largest colour factor it stays finite in f32.
pub(super) const LARGEST_VALUE: f64 = 1e25;
/// Smallest and largest half-width of a lobe, in radians or slopes: from a hundredth of the sun's disc to one radian.
const WIDTHS: [f64; 2] = [1e-5, 1.0];
/// Largest t = −ln cos θi of an incoming direction that a lobe can be fitted to: an incidence of 89.98 degrees.
const LARGEST_T: f64 = 8.0;
/// Largest magnitude of the polynomial coefficients that give the logarithm of a lobe's peak.
const LARGEST_COEFFICIENT: f64 = 1024.0;
/// Largest magnitude, in radians, of the angle between the axes of a lobe and those of the surface: just over half a
/// turn.
const LARGEST_ANGLE: f64 = 3.2;
/// Upper bound on the colour factor by which a lobe is multiplied at one sample of its spectrum.
const LARGEST_COLOUR: f32 = 65_536.0;

/// Parameters of an analytic reflection lobe, as defined by [`Lobe`](super::Lobe).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LobeParameters {
    /// Direction about which the lobe is centred.
    pub centre: LobeCentre,
    /// Coefficients p₀, p₁, p₂ of the logarithm of the lobe's peak, p₀ + p₁·t + p₂·t² with t = −ln cos θi.
    pub peak: [f64; 3],
    /// Smallest and largest −ln cos θi of the measured incoming directions.
    pub range: [f64; 2],
    /// Two half-widths of the lobe at half its maximum: radians for a lobe about a direction, slopes for half vectors.
    pub widths: [f64; 2],
    /// Angle from the x axis of the surface to the axis of the lobe's first width, in radians.
    pub angle: f64,
    /// Tail parameter of the lobe, from 0 (Gaussian) to 1/2 (GGX).
    pub tail: f64,
    /// Colour factors of the lobe, one per sample of a spectrum.
    pub colours: Vec<f32>,
}

/// Error for a lobe parameter that is out of bounds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the {number} of a lobe is {found}, expected {low} to {high}")]
pub struct LobeError {
    /// Name of the parameter of a reflection lobe that is out of bounds, for example `half-width`.
    pub number: &'static str,
    /// Invalid value of the named parameter of a reflection lobe, in the unit of that parameter.
    pub found: f64,
    /// Smallest value accepted for the named parameter of a reflection lobe, in the unit of that parameter.
    pub low: f64,
    /// Largest value accepted for the named parameter of a reflection lobe, in the unit of that parameter.
    pub high: f64,
}

/// Checks that all parameters of a lobe are within their bounds.
pub(super) fn check(parameters: &LobeParameters) -> Result<(), LobeError> {
    let LobeParameters { peak, range, widths, angle, tail, colours, .. } = parameters;
    for &coefficient in peak {
        held("peak", coefficient, [-LARGEST_COEFFICIENT, LARGEST_COEFFICIENT])?;
    }
    held("least measured incidence", range[0], [0.0, LARGEST_T])?;
    held("largest measured incidence", range[1], [range[0], LARGEST_T])?;
    for &width in widths {
        held("half-width", width, WIDTHS)?;
    }
    held("angle", *angle, [-LARGEST_ANGLE, LARGEST_ANGLE])?;
    held("tail", *tail, [0.0, 0.5])?;
    for &colour in colours {
        held("colour", f64::from(colour), [0.0, f64::from(LARGEST_COLOUR)])?;
    }
    Ok(())
}

fn held(number: &'static str, found: f64, [low, high]: [f64; 2]) -> Result<(), LobeError> {
    if (low..=high).contains(&found) { Ok(()) } else { Err(LobeError { number, found, low, high }) }
}

/// Rounds the colour factor of a lobe to the 24 high bits of an f32.
pub(super) fn short_colour(colour: f32) -> f32 {
    f32::from_bits(colour.to_bits().wrapping_add(0x7F) & 0xFFFF_FF00)
}
