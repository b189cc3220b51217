//! Colour rendering index of a light by the test-colour method of the CIE.
//!
//! The light and a reference illuminant of its colour temperature, a Planckian radiator below 5000 K and a phase of
//! daylight from there on, light eight test colours. The index falls from 100 with the differences of their colours in
//! CIE 1964 U*V*W* after a von Kries adaptation (CIE 013.3-1995).

use super::coverage::{RANGE, check};
use super::rendering_tables::{COUNT, DAYLIGHT, SAMPLES};
use super::tables::Observer;
use super::temperature::{ColourTemperature, planckian_power, uv};
use super::xyz::Xyz;
use crate::domain::WavelengthGrid;
use crate::numeric::bracket::Bracket;

/// Colour rendering indices of a light.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ColourRendering {
    /// General colour rendering index Ra, the mean of the special ones; at most 100.
    pub general: f64,
    /// Special colour rendering indices R1 to R8.
    pub special: [f64; 8],
}

/// Colour temperature in K below which the reference is a Planckian radiator.
const DAYLIGHT_FROM: f64 = 5000.0;
/// Largest difference between light and reference in CIE 1960 (u, v) for which the index holds (CIE 013.3, section
/// 5.3).
const MOST_DIFFERENCE: f64 = 5.4e-3;
/// Spacing of the tables in nm.
const STEP: f64 = 5.0;
/// Fall of the index for each unit of colour difference.
const FALL: f64 = 4.6;

impl ColourRendering {
    /// Computes the colour rendering of a light with the spectrum `samples` on `grid`. `None` if the spectrum does not
    /// cover 380 to 780 nm in steps of at most 20 nm, is masked or dark, or if its chromaticity differs from that of
    /// its reference by more than 0.0054 in CIE 1960 (u, v).
    pub fn of(grid: &WavelengthGrid, samples: &[f32]) -> Option<Self> {
        let lambdas = grid.values();
        let (first, last) = grid.range();
        if first > RANGE.0 || last < RANGE.1 || check(&lambdas).is_err() || samples.iter().any(|s| s.is_nan()) {
            return None;
        }
        let light = |lambda: f64| {
            let [(below, a), (above, b)] = Bracket::held(&lambdas, lambda).weights();
            a * f64::from(samples[below]) + b * f64::from(samples[above])
        };
        let kelvin = ColourTemperature::of(lit(&light, |_| 1.0), Observer::cie_1931())?.kelvin;
        let daylight = daylight(kelvin);
        let reference = |lambda: f64| {
            if kelvin < DAYLIGHT_FROM {
                return planckian_power(lambda, kelvin);
            }
            let [s0, s1, s2] = DAYLIGHT.each_ref().map(|table| tabulated(table, lambda));
            s0 + daylight[0] * s1 + daylight[1] * s2
        };
        let [found, wanted] = [Seen::under(&light)?, Seen::under(&reference)?];
        let off = libm::hypot(found.white[0] - wanted.white[0], found.white[1] - wanted.white[1]);
        if off > MOST_DIFFERENCE {
            return None;
        }
        let adapted = Adapted { from: found.white, to: wanted.white };
        let mut special = [0.0; 8];
        for ((special, sample), reference) in special.iter_mut().zip(found.samples).zip(wanted.samples) {
            let colour = uniform(adapted.uv(sample.1), sample.0, wanted.white);
            let stated = uniform(reference.1, reference.0, wanted.white);
            let difference: f64 = colour.iter().zip(stated).map(|(a, b)| (a - b) * (a - b)).sum();
            *special = 100.0 - FALL * difference.sqrt();
        }
        Some(Self { general: special.iter().sum::<f64>() / special.len() as f64, special })
    }
}

/// Chromaticity of a light, and Y and chromaticity of each test colour under it, with Y = 100 for white.
struct Seen {
    white: [f64; 2],
    samples: [(f64, [f64; 2]); 8],
}

impl Seen {
    fn under(light: &impl Fn(f64) -> f64) -> Option<Self> {
        let white = lit(light, |_| 1.0);
        let mut samples = [(0.0, [0.0; 2]); 8];
        for (seen, table) in samples.iter_mut().zip(&SAMPLES) {
            let colour = lit(light, |lambda| tabulated(table, lambda));
            *seen = (100.0 * colour.y / white.y, uv(colour)?);
        }
        Some(Self { white: uv(white)?, samples })
    }
}

/// Tristimulus values of a surface under a light, summed at whole nm for the CIE 1931 observer.
fn lit(light: &impl Fn(f64) -> f64, surface: impl Fn(f64) -> f64) -> Xyz {
    let observer = Observer::cie_1931();
    let mut sum = Xyz { x: 0.0, y: 0.0, z: 0.0 };
    for nm in RANGE.0 as u32..=RANGE.1 as u32 {
        let lambda = f64::from(nm);
        let power = light(lambda) * surface(lambda);
        sum.x += power * observer.x.at(lambda);
        sum.y += power * observer.y.at(lambda);
        sum.z += power * observer.z.at(lambda);
    }
    sum
}

/// Entry of a table at a wavelength in nm, linear between its wavelengths.
fn tabulated(table: &[f64; COUNT], lambda: f64) -> f64 {
    let at = (lambda - RANGE.0) / STEP;
    let below = (at as usize).min(COUNT - 2);
    let t = at - below as f64;
    (1.0 - t) * table[below] + t * table[below + 1]
}

/// Factors M1 and M2 of the daylight of a colour temperature in K (CIE 015:2018, section 4.1.2).
fn daylight(kelvin: f64) -> [f64; 2] {
    let t = 1e3 / kelvin;
    let x = if kelvin <= 7000.0 {
        ((-4.607 * t + 2.9678) * t + 0.09911) * t + 0.244_063
    } else {
        ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237_04
    };
    let y = (-3.0 * x + 2.87) * x - 0.275;
    let m = 0.0241 + 0.2562 * x - 0.7341 * y;
    [(-1.3515 - 1.7703 * x + 5.9114 * y) / m, (0.03 - 31.4424 * x + 30.0717 * y) / m]
}

/// Von Kries adaptation between two lights, in CIE 1960 (u, v).
struct Adapted {
    from: [f64; 2],
    to: [f64; 2],
}

impl Adapted {
    fn uv(&self, colour: [f64; 2]) -> [f64; 2] {
        let parts = |[u, v]: [f64; 2]| [(4.0 - u - 10.0 * v) / v, (1.708 * v + 0.404 - 1.481 * u) / v];
        let ([c, d], [c_from, d_from], [c_to, d_to]) = (parts(colour), parts(self.from), parts(self.to));
        let (c, d) = (c_to / c_from * c, d_to / d_from * d);
        let below = 16.518 + 1.481 * c - d;
        [(10.872 + 0.404 * c - 4.0 * d) / below, 5.52 / below]
    }
}

/// CIE 1964 U*, V* and W* of a colour relative to a white.
fn uniform([u, v]: [f64; 2], y: f64, white: [f64; 2]) -> [f64; 3] {
    let w = 25.0 * libm::cbrt(y) - 17.0;
    [13.0 * w * (u - white[0]), 13.0 * w * (v - white[1]), w]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::colour::{Curve, Illuminant};

    fn rendering(light: Illuminant) -> ColourRendering {
        let curve: &Curve = light.power();
        let grid = WavelengthGrid::even(380.0, 5.0, 81).unwrap();
        let samples: Vec<f32> = grid.values().iter().map(|lambda| curve.at(*lambda) as f32).collect();
        ColourRendering::of(&grid, &samples).unwrap()
    }

    #[test]
    fn indices_are_those_of_another_program() {
        // colour-science 0.4.7, at 5 nm.
        let wanted = [98.2258, 92.7224, 51.0938, 88.4264, 87.2127, 77.3708, 88.6176, 79.2037];
        let found = rendering(Illuminant::F11);
        assert!((found.general - 82.859).abs() < 0.5, "{found:?}");
        assert!(found.special.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1.0), "{found:?}");
        for light in [Illuminant::A, Illuminant::D50, Illuminant::D65] {
            let found = rendering(light);
            assert!(found.general > 99.9 && found.general <= 100.0, "{light}: {found:?}");
        }
    }

    #[test]
    fn a_spectrum_that_is_too_short_or_too_coloured_has_no_index() {
        let flat = |first: f64, step: f64, count: usize, value: fn(f64) -> f32| {
            let grid = WavelengthGrid::even(first, step, count).unwrap();
            let samples: Vec<f32> = grid.values().iter().map(|lambda| value(*lambda)).collect();
            ColourRendering::of(&grid, &samples)
        };
        let lamp = |lambda: f64| Illuminant::A.power().at(lambda) as f32;
        assert!(flat(380.0, 10.0, 41, lamp).is_some() && flat(385.0, 5.0, 80, lamp).is_none());
        assert!(flat(380.0, 10.0, 40, lamp).is_none() && flat(380.0, 40.0, 11, lamp).is_none());
        // Equal energy is 0.008 from its phase of daylight.
        assert!(flat(380.0, 10.0, 41, |_| 1.0).is_none());
        assert!(flat(380.0, 10.0, 41, |lambda| if lambda > 550.0 { f32::NAN } else { 1.0 }).is_none());
        assert!(flat(380.0, 10.0, 41, |lambda| if (500.0..560.0).contains(&lambda) { 1.0 } else { 0.1 }).is_none());
        assert!(flat(380.0, 10.0, 41, |_| 0.0).is_none());
    }
}
