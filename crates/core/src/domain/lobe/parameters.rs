//! Numbers that a lobe is made of, and their bounds.

use super::centre::LobeCentre;
use serde::Serialize;

/// The largest logarithm of a peak in sr⁻¹: more than any surface reflects, less than overflows with a colour.
pub(super) const LARGEST_LOG: f64 = 40.0;
/// The largest value in sr⁻¹; times the largest colour it moves no sample to infinity.
pub(super) const LARGEST_VALUE: f64 = 1e25;
/// Half-widths: from a hundredth of the sun's disc to a radian.
const WIDTHS: [f64; 2] = [1e-5, 1.0];
/// The largest −ln cos θi: an incidence of 89.98 degrees.
const LARGEST_T: f64 = 8.0;
/// The largest coefficient of the logarithm of a peak.
const LARGEST_COEFFICIENT: f64 = 1024.0;
/// Half a turn.
const LARGEST_ANGLE: f64 = 3.2;
/// The largest factor of a sample of a spectrum.
const LARGEST_COLOUR: f32 = 65_536.0;

/// Numbers that a lobe is made of, as [`Lobe`](super::Lobe) names them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LobeParameters {
    /// What it stays with.
    pub centre: LobeCentre,
    /// p₀, p₁, p₂ of the logarithm of the peak.
    pub peak: [f64; 3],
    /// The least and the largest −ln cos θi that were measured.
    pub range: [f64; 2],
    /// Half-widths at half the maximum: radians for a direction, slopes for half vectors.
    pub widths: [f64; 2],
    /// Angle from the surface's x to the axis of the first width, in radians.
    pub angle: f64,
    /// 0 for a Gaussian … 1/2 for GGX.
    pub tail: f64,
    /// One factor for each sample of a spectrum.
    pub colours: Vec<f32>,
}

/// A number of a lobe that is out of its bounds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("the {number} of a lobe is {found}, expected {low} to {high}")]
pub struct LobeError {
    /// The number, by its name.
    pub number: &'static str,
    /// Its value.
    pub found: f64,
    /// The least that is taken.
    pub low: f64,
    /// The largest that is taken.
    pub high: f64,
}

/// Refuses a number out of its bounds.
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

/// A factor with the 24 high bits of an f32.
pub(super) fn short_colour(colour: f32) -> f32 {
    f32::from_bits(colour.to_bits().wrapping_add(0x7F) & 0xFFFF_FF00)
}
