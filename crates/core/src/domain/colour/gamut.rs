//! Gamut mapping to sRGB: hue and lightness are kept, chroma is reduced.
//!
//! Lightness, chroma and hue are those of Oklab (B. Ottosson, *A perceptual color space for image processing*, 2020;
//! with the matrices between linear sRGB and the cones as corrected there in 2021). Bisection of the chroma finds the
//! gamut boundary; a colour inside is returned unchanged, bit for bit. Colours at least as light as white become white,
//! those at least as dark as black become black.

use super::matrix::{Matrix, product};

const TO_CONES: Matrix = [
    [0.412_221_470_8, 0.536_332_536_3, 0.051_445_992_9],
    [0.211_903_498_2, 0.680_699_545_1, 0.107_396_956_6],
    [0.088_302_461_9, 0.281_718_837_6, 0.629_978_700_5],
];
const FROM_CONES: Matrix = [
    [4.076_741_662_1, -3.307_711_591_3, 0.230_969_929_2],
    [-1.268_438_004_6, 2.609_757_401_1, -0.341_319_396_5],
    [-0.004_196_086_3, -0.703_418_614_7, 1.707_614_701_0],
];

/// Tolerance of the sRGB gamut test: a linear channel may leave 0..=1 by this much, less than half an 8-bit step near
/// white.
const TOLERANCE: f64 = 2e-3;
/// Number of bisection steps in the search for the largest chroma inside the gamut. Raising it makes the chroma more
/// accurate.
const STEPS: usize = 24;

/// Colour in the Oklab colour space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oklab {
    /// Lightness L of the Oklab colour; 1 for white.
    pub l: f64,
    /// Oklab coordinate a, from green (negative) to red (positive).
    pub a: f64,
    /// Oklab coordinate b, from blue (negative) to yellow (positive).
    pub b: f64,
}

impl Oklab {
    /// Converts a colour from linear sRGB, inside or outside the gamut, to Oklab.
    pub fn of(linear: [f64; 3]) -> Self {
        let [l, m, s] = product(&TO_CONES, linear).map(libm::cbrt);
        Self {
            l: 0.210_454_255_3 * l + 0.793_617_785_0 * m - 0.004_072_046_8 * s,
            a: 1.977_998_495_1 * l - 2.428_592_205_0 * m + 0.450_593_709_9 * s,
            b: 0.025_904_037_1 * l + 0.782_771_766_2 * m - 0.808_675_766_0 * s,
        }
    }

    /// Converts an Oklab colour to linear sRGB, inside or outside the gamut.
    pub fn linear(self) -> [f64; 3] {
        let Self { l, a, b } = self;
        let cones = [
            l + 0.396_337_777_4 * a + 0.215_803_757_3 * b,
            l - 0.105_561_345_8 * a - 0.063_854_172_8 * b,
            l - 0.089_484_177_5 * a - 1.291_485_548_0 * b,
        ];
        product(&FROM_CONES, cones.map(|c| c * c * c))
    }
}

/// Returns true if linear sRGB `linear` is inside the gamut, with a tolerance of 2e-3 per channel (tabulated D65 is not
/// exactly the white of the standard).
pub fn in_gamut(linear: [f64; 3]) -> bool {
    linear.iter().all(|c| (-TOLERANCE..=1.0 + TOLERANCE).contains(c))
}

/// Returns the colour of equal Oklab hue and lightness with the largest chroma, up to the original one, inside the sRGB
/// gamut. Every channel of the result is in 0..=1. Colours that are not finite become black.
pub fn map_to_gamut(linear: [f64; 3]) -> [f64; 3] {
    if linear.iter().all(|c| (0.0..=1.0).contains(c)) {
        return linear;
    }
    if !linear.iter().all(|c| c.is_finite()) {
        return [0.0; 3];
    }
    let colour = Oklab::of(linear);
    if colour.l >= 1.0 {
        return [1.0; 3];
    }
    if colour.l <= 0.0 {
        return [0.0; 3];
    }
    let with = |share: f64| Oklab { l: colour.l, a: share * colour.a, b: share * colour.b }.linear();
    // The lower end is inside, the upper one outside; grey is inside up to rounding of the matrices.
    let (mut inside, mut outside) = (0.0, 1.0);
    for _ in 0..STEPS {
        let middle = 0.5 * (inside + outside);
        if with(middle).iter().all(|c| (0.0..=1.0).contains(c)) { inside = middle } else { outside = middle }
    }
    with(inside).map(|c| c.clamp(0.0, 1.0))
}
