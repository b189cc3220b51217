//! Conversions between XYZ, linear sRGB and sRGB (IEC 61966-2-1:1999).
//!
//! The matrix from sRGB to XYZ has four decimals in the standard and is exact by definition. The matrix back is its
//! inverse, of which the standard prints four decimals and its Amendment 1 seven. White (1, 1, 1) is D65 with Y = 100.

use super::matrix::{Matrix, inverse, product};
use super::xyz::Xyz;

const TO_XYZ: Matrix = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
pub(super) const FROM_XYZ: Matrix = inverse(TO_XYZ);

/// Converts tristimulus values under D65 (Y = 100 is white) to linear sRGB. Channels are outside 0..=1 if the colour is
/// out of gamut.
pub fn xyz_to_linear(xyz: Xyz) -> [f64; 3] {
    product(&FROM_XYZ, [xyz.x / 100.0, xyz.y / 100.0, xyz.z / 100.0])
}

/// Converts linear sRGB to tristimulus values under D65 (Y = 100 is white).
pub fn linear_to_xyz(rgb: [f64; 3]) -> Xyz {
    let [x, y, z] = product(&TO_XYZ, rgb);
    Xyz { x, y, z }.scaled(100.0)
}

/// Converts linear sRGB to sRGB with eight bits per channel; channels out of gamut are clipped to 0..=255.
pub fn linear_to_bytes(linear: [f64; 3]) -> [u8; 3] {
    linear.map(|c| (255.0 * linear_to_srgb(c.clamp(0.0, 1.0)) + 0.5) as u8)
}

/// Converts the linear value of a colour channel to its sRGB value; values below 0 continue the straight part of the
/// curve.
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

/// Converts the sRGB value of a colour channel to its linear value.
pub fn srgb_to_linear(srgb: f64) -> f64 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { libm::pow((srgb + 0.055) / 1.055, 2.4) }
}
