//! Numbers that a lobe is made of, and their bounds.

use super::centre::LobeCentre;
use serde::{Deserialize, Serialize};

/// Largest natural logarithm of a peak in sr⁻¹: larger than any real surface, small enough not to overflow when
/// multiplied by a colour.
pub(super) const LARGEST_LOG: f64 = 40.0;
/// Largest value in sr⁻¹; multiplied by the largest colour it stays finite in f32.
pub(super) const LARGEST_VALUE: f64 = 1e25;
/// Smallest and largest half-width: from a hundredth of the sun's disc to one radian.
const WIDTHS: [f64; 2] = [1e-5, 1.0];
/// Largest −ln cos θi: an incidence of 89.98 degrees.
const LARGEST_T: f64 = 8.0;
/// Largest magnitude of the coefficients of the logarithm of a peak.
const LARGEST_COEFFICIENT: f64 = 1024.0;
/// Largest magnitude of the angle of the axes in radians, just over half a turn.
const LARGEST_ANGLE: f64 = 3.2;
/// Largest colour factor of a spectral sample.
const LARGEST_COLOUR: f32 = 65_536.0;

/// Parameters of a lobe, as defined by [`Lobe`](super::Lobe).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LobeParameters {
    /// Centre of the lobe.
    pub centre: LobeCentre,
    /// Coefficients p₀, p₁, p₂ of the logarithm of the peak.
    pub peak: [f64; 3],
    /// Smallest and largest −ln cos θi measured.
    pub range: [f64; 2],
    /// Half-widths at half the maximum: radians for a direction, slopes for half vectors.
    pub widths: [f64; 2],
    /// Angle from the surface's x to the axis of the first width, in radians.
    pub angle: f64,
    /// Tail parameter, from 0 (Gaussian) to 1/2 (GGX).
    pub tail: f64,
    /// Colour factors, one per sample of a spectrum.
    pub colours: Vec<f32>,
}

/// Error for a lobe parameter that is out of bounds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the {number} of a lobe is {found}, expected {low} to {high}")]
pub struct LobeError {
    /// Name of the parameter.
    pub number: &'static str,
    /// Value of the parameter.
    pub found: f64,
    /// Smallest value accepted.
    pub low: f64,
    /// Largest value accepted.
    pub high: f64,
}

/// Checks that all parameters are within their bounds.
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

/// Rounds a colour factor to the 24 high bits of an f32.
pub(super) fn short_colour(colour: f32) -> f32 {
    f32::from_bits(colour.to_bits().wrapping_add(0x7F) & 0xFFFF_FF00)
}
