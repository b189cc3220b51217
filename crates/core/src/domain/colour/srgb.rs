//! XYZ ⇄ linear sRGB ⇄ sRGB (IEC 61966-2-1:1999).
//!
//! The standard's matrix from sRGB to XYZ has four decimals and is exact by definition; the matrix back is its inverse, of
//! which the standard prints four decimals and its Amendment 1 seven. White (1, 1, 1) is Y = 100 of D65.

use super::Xyz;

type Matrix = [[f64; 3]; 3];

const TO_XYZ: Matrix = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
pub(super) const FROM_XYZ: Matrix = inverse(TO_XYZ);

/// Linear sRGB of tristimulus values under D65 (Y = 100 is white); outside 0..=1 where a colour is outside the gamut.
pub fn xyz_to_linear(xyz: Xyz) -> [f64; 3] {
    product(&FROM_XYZ, [xyz.x / 100.0, xyz.y / 100.0, xyz.z / 100.0])
}

/// Tristimulus values of linear sRGB.
pub fn linear_to_xyz(rgb: [f64; 3]) -> Xyz {
    let [x, y, z] = product(&TO_XYZ, rgb);
    Xyz { x, y, z }.scaled(100.0)
}

/// The colour as eight bits a channel, clipped to 0..=255 where it is out of gamut.
pub fn linear_to_bytes(linear: [f64; 3]) -> [u8; 3] {
    linear.map(|c| (255.0 * linear_to_srgb(c.clamp(0.0, 1.0)) + 0.5) as u8)
}

/// A channel's linear value → its sRGB value; values below 0 continue the straight part.
pub fn linear_to_srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

/// A channel's sRGB value → its linear value.
pub fn srgb_to_linear(srgb: f64) -> f64 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { libm::pow((srgb + 0.055) / 1.055, 2.4) }
}

fn product(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// The inverse of a matrix, by cofactors.
pub(super) const fn inverse(m: Matrix) -> Matrix {
    let [[a, b, c], [d, e, f], [g, h, i]] = m;
    let (p, q, r) = (e * i - f * h, f * g - d * i, d * h - e * g);
    let n = 1.0 / (a * p + b * q + c * r);
    [
        [n * p, n * (c * h - b * i), n * (b * f - c * e)],
        [n * q, n * (a * i - c * g), n * (c * d - a * f)],
        [n * r, n * (b * g - a * h), n * (a * e - b * d)],
    ]
}
