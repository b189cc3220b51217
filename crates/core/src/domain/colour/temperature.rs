//! Correlated colour temperature of a light: the temperature of the nearest Planckian radiator in the CIE 1960 (u, v)
//! diagram, for the same observer. The definition (CIE 015:2018, section 9.5) uses (u′, 2/3 v′), which is (u, v).

use super::coverage::RANGE;
use super::tables::Observer;
use super::xyz::Xyz;

/// Correlated colour temperature of a light and its distance from the Planckian locus.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ColourTemperature {
    /// Correlated colour temperature of the light in K.
    pub kelvin: f64,
    /// Distance of the light from the Planckian locus in CIE 1960 (u, v); positive above it (towards green).
    pub duv: f64,
}

/// Second radiation constant h·c/k in nm·K (CODATA 2018; exact in the SI of 2019).
const C2: f64 = 1.438_776_877e7;
/// Largest distance from the Planckian locus, in CIE 1960 (u, v), at which a correlated colour temperature is
/// meaningful (CIE 015:2018, section 9.5).
const MOST_DISTANCE: f64 = 5e-2;
/// Range of the search for the correlated colour temperature, in reciprocal megakelvin: from 1 MK to 1000 K.
const MIREDS: (f64, f64) = (1.0, 1000.0);
const COARSE: usize = 64;
/// Golden-section ratio, (√5 − 1) / 2, by which the search for the colour temperature narrows its interval.
const RATIO: f64 = 0.618_033_988_749_894_9;
const REFINEMENTS: usize = 60;

impl ColourTemperature {
    /// Returns the correlated colour temperature of a light. `None` if the light has no chromaticity or is more than
    /// 0.05 from the Planckian locus in CIE 1960 (u, v).
    pub fn of(light: Xyz, observer: &Observer) -> Option<Self> {
        let here = uv(light)?;
        let distance = |mired: f64| {
            let [u, v] = planckian(mired, observer);
            (u - here[0]) * (u - here[0]) + (v - here[1]) * (v - here[1])
        };
        let step = (MIREDS.1 - MIREDS.0) / COARSE as f64;
        let mut nearest = (f64::INFINITY, 0.0);
        for i in 0..=COARSE {
            let mired = MIREDS.0 + step * i as f64;
            let found = distance(mired);
            if found < nearest.0 {
                nearest = (found, mired);
            }
        }
        // Golden-section search: the distance has one minimum between the neighbours of the nearest grid point.
        let (mut low, mut high) = ((nearest.1 - step).max(MIREDS.0), (nearest.1 + step).min(MIREDS.1));
        let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
        let (mut at_a, mut at_b) = (distance(a), distance(b));
        for _ in 0..REFINEMENTS {
            if at_a < at_b {
                (high, b, at_b) = (b, a, at_a);
                a = high - RATIO * (high - low);
                at_a = distance(a);
            } else {
                (low, a, at_a) = (a, b, at_b);
                b = low + RATIO * (high - low);
                at_b = distance(b);
            }
        }
        let mired = 0.5 * (low + high);
        let size = distance(mired).sqrt();
        let above = here[1] >= planckian(mired, observer)[1];
        (size <= MOST_DISTANCE).then_some(Self { kelvin: 1e6 / mired, duv: if above { size } else { -size } })
    }
}

/// Returns the CIE 1960 chromaticity (u, v) of tristimulus values; `None` without light.
pub(super) fn uv(light: Xyz) -> Option<[f64; 2]> {
    let sum = light.x + 15.0 * light.y + 3.0 * light.z;
    let finite = sum.is_finite() && sum > 0.0;
    finite.then(|| [4.0 * light.x / sum, 6.0 * light.y / sum])
}

/// Spectral power of a Planckian radiator of a temperature in K at a wavelength in nm, relative to that at 560 nm, so
/// that no temperature overflows.
pub(super) fn planckian_power(lambda: f64, temperature: f64) -> f64 {
    let ratio = 560.0 / lambda;
    let fifth = ratio * ratio * ratio * ratio * ratio;
    fifth * libm::expm1(C2 / (560.0 * temperature)) / libm::expm1(C2 / (lambda * temperature))
}

fn planckian(mired: f64, observer: &Observer) -> [f64; 2] {
    let temperature = 1e6 / mired;
    let (mut x, mut y, mut z) = (0.0, 0.0, 0.0);
    for nm in RANGE.0 as u32..=RANGE.1 as u32 {
        let lambda = f64::from(nm);
        let power = planckian_power(lambda, temperature);
        x += power * observer.x.at(lambda);
        y += power * observer.y.at(lambda);
        z += power * observer.z.at(lambda);
    }
    let sum = x + 15.0 * y + 3.0 * z;
    [4.0 * x / sum, 6.0 * y / sum]
}
