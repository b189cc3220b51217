//! Colours that sRGB cannot show → the nearest in kind that it can: hue and lightness stay, chroma is reduced.
//!
//! Lightness, chroma and hue are those of Oklab (B. Ottosson, *A perceptual color space for image processing*, 2020; the
//! matrices between linear sRGB and its cones as corrected there in 2021). Chroma is halved in on to the boundary; a
//! colour inside is returned as it is, bit for bit. What is as light as white becomes white, what is as dark as black black.

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

/// A linear channel further than this outside 0..=1 is out of gamut: less than half a step of eight bits near white.
const TOLERANCE: f64 = 2e-3;
/// Halvings of the chroma.
const STEPS: usize = 24;

/// A colour in Oklab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oklab {
    /// Lightness, 1 for white.
    pub l: f64,
    /// Green to red.
    pub a: f64,
    /// Blue to yellow.
    pub b: f64,
}

impl Oklab {
    /// Of linear sRGB, in or out of gamut.
    pub fn of(linear: [f64; 3]) -> Self {
        let [l, m, s] = product(&TO_CONES, linear).map(libm::cbrt);
        Self {
            l: 0.210_454_255_3 * l + 0.793_617_785_0 * m - 0.004_072_046_8 * s,
            a: 1.977_998_495_1 * l - 2.428_592_205_0 * m + 0.450_593_709_9 * s,
            b: 0.025_904_037_1 * l + 0.782_771_766_2 * m - 0.808_675_766_0 * s,
        }
    }

    /// The linear sRGB, in or out of gamut.
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

/// Whether sRGB shows `linear` but for rounding (2e-3 in a channel: a table of D65 is not exactly the standard's white).
pub fn in_gamut(linear: [f64; 3]) -> bool {
    linear.iter().all(|c| (-TOLERANCE..=1.0 + TOLERANCE).contains(c))
}

/// The colour of the same Oklab hue and lightness with as much of its chroma as linear sRGB holds; every channel in 0..=1.
/// Samples that are not finite are black.
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
    // Inside at the lower end, outside at the upper one; grey is inside but for the rounding of the matrices.
    let (mut inside, mut outside) = (0.0, 1.0);
    for _ in 0..STEPS {
        let middle = 0.5 * (inside + outside);
        if with(middle).iter().all(|c| (0.0..=1.0).contains(c)) { inside = middle } else { outside = middle }
    }
    with(inside).map(|c| c.clamp(0.0, 1.0))
}
