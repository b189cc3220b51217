//! CIE 1976 L*a*b*, relative to a given white (CIE 015:2018, section 8.2.1).

use super::xyz::Xyz;

/// Colour in CIE 1976 L*a*b* (CIELAB). L* is 100 for the white, and may exceed 100 for radiance factors above 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lab {
    /// Lightness L* of CIELAB.
    pub l: f64,
    /// CIELAB coordinate a*, from green (negative) to red (positive).
    pub a: f64,
    /// CIELAB coordinate b*, from blue (negative) to yellow (positive).
    pub b: f64,
}

/// Cube root of the transition point of the CIELAB function: at (6/29)³ the cube root and the straight line meet with
/// equal values and slopes.
const DELTA: f64 = 6.0 / 29.0;

impl Lab {
    /// Converts tristimulus values to CIELAB; `white` is in the scale of the tristimulus values and positive.
    pub fn of(xyz: Xyz, white: Xyz) -> Self {
        let (x, y, z) = (curve(xyz.x / white.x), curve(xyz.y / white.y), curve(xyz.z / white.z));
        Self { l: 116.0 * y - 16.0, a: 500.0 * (x - y), b: 200.0 * (y - z) }
    }

    /// Converts a CIELAB colour to tristimulus values in the scale of `white`.
    pub fn xyz(self, white: Xyz) -> Xyz {
        let y = (self.l + 16.0) / 116.0;
        let (x, z) = (y + self.a / 500.0, y - self.b / 200.0);
        Xyz { x: white.x * inverse(x), y: white.y * inverse(y), z: white.z * inverse(z) }
    }
}

fn curve(t: f64) -> f64 {
    if t > DELTA * DELTA * DELTA { libm::cbrt(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}

fn inverse(f: f64) -> f64 {
    if f > DELTA { f * f * f } else { 3.0 * DELTA * DELTA * (f - 4.0 / 29.0) }
}
