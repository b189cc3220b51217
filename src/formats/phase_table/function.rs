//! A phase function as a table over the scattering angle: its values between the entries, its integrals, its form as a
//! function of two directions.

use crate::domain::Direction;
use crate::formats::acquisition::DirectionalFunction;
use std::f64::consts::PI;

/// Below this angle a volume scattering function follows power laws between its entries (Petzold's tables do).
const POWER_LAW_BELOW: f64 = 10.0;

/// What the table is linear in between its entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Between {
    /// The scattering angle.
    Angles,
    /// Its cosine.
    Cosines,
    /// The scattering angle, and below 10 degrees both logarithms.
    PowerLaws,
}

/// Values over the scattering angle in degrees, 0 = forward, strictly increasing; NaN = missing.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) angles: Vec<f64>,
    pub(super) values: Vec<f64>,
    pub(super) between: Between,
    /// How far beyond the first and last entry their values hold.
    pub(super) held: f64,
    /// The cosines of the angles.
    cosines: Vec<f64>,
}

impl Curve {
    /// A table that holds nothing beyond its ends.
    pub(super) fn new(angles: Vec<f64>, values: Vec<f64>, between: Between) -> Self {
        let cosines = angles.iter().map(|angle| libm::cos(angle.to_radians())).collect();
        Self { angles, values, between, held: 0.0, cosines }
    }

    /// The value at a scattering angle in degrees; NaN outside the table and beside missing entries.
    pub(super) fn at(&self, angle: f64) -> f64 {
        let (first, last) = (self.angles[0], self.angles[self.angles.len() - 1]);
        if angle < first - self.held || angle > last + self.held {
            return f64::NAN;
        }
        let next = self.angles.partition_point(|&known| known <= angle);
        if next == 0 || next == self.angles.len() {
            return if next == 0 { self.values[0] } else { self.values[next - 1] };
        }
        self.inside(next - 1, angle)
    }

    /// The value between entries `i` and `i + 1`.
    fn inside(&self, i: usize, angle: f64) -> f64 {
        let (x0, x1, y0, y1) = (self.angles[i], self.angles[i + 1], self.values[i], self.values[i + 1]);
        let line = |t: f64| y0 + t * (y1 - y0);
        match self.between {
            Between::PowerLaws if x1 <= POWER_LAW_BELOW && x0 > 0.0 && y0 > 0.0 && y1 > 0.0 => {
                y0 * libm::pow(angle / x0, libm::log(y1 / y0) / libm::log(x1 / x0))
            }
            Between::Angles | Between::PowerLaws => line((angle - x0) / (x1 - x0)),
            Between::Cosines => {
                let (c0, c1) = (self.cosines[i], self.cosines[i + 1]);
                line((libm::cos(angle.to_radians()) - c0) / (c1 - c0))
            }
        }
    }

    /// `2π ∫ p sin ψ dψ` and `2π ∫ p cos ψ sin ψ dψ` from the first to the last angle that the table covers, and the
    /// first of them up to the second entry.
    pub(super) fn integrals(&self) -> Integrals {
        let mut all = Integrals::default();
        let (first, last) = (self.angles[0], self.angles[self.angles.len() - 1]);
        let least = if self.between == Between::PowerLaws { 4 } else { 1 };
        if self.held > 0.0 {
            all.add(0.0, first, 1, |_| self.values[0]);
        }
        for i in 0..self.angles.len() - 1 {
            if self.between == Between::Cosines {
                all.add_line([self.cosines[i], self.cosines[i + 1]], [self.values[i], self.values[i + 1]]);
            } else {
                all.add(self.angles[i], self.angles[i + 1], least, |angle| self.inside(i, angle));
            }
            if i == 0 {
                all.first = all.total;
            }
        }
        if self.held > 0.0 {
            all.add(last, 180.0, 1, |_| self.values[self.values.len() - 1]);
        }
        all
    }
}

/// Integrals over the sphere.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Integrals {
    pub(super) total: f64,
    /// Weighted by the cosine of the scattering angle.
    pub(super) cosine: f64,
    /// Up to the second entry of the table.
    pub(super) first: f64,
}

/// Abscissae and weights of Gauss and Legendre's rules of order 2 and 4 on -1..1 (Abramowitz & Stegun, table 25.4).
const SHORT_RULE: [(f64, f64); 2] = [(-0.577_350_269_189_625_8, 1.0), (0.577_350_269_189_625_8, 1.0)];
const RULE: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
];

impl Integrals {
    /// Adds what is linear between two cosines, exactly.
    fn add_line(&mut self, [c0, c1]: [f64; 2], [y0, y1]: [f64; 2]) {
        let part = 2.0 * PI * (c0 - c1);
        self.total += part * 0.5 * (y0 + y1);
        self.cosine += part / 6.0 * (y0 * (2.0 * c0 + c1) + y1 * (c0 + 2.0 * c1));
    }

    /// Adds `value` from one angle to another in at least so many pieces: what is linear needs one, a power law several.
    fn add(&mut self, from: f64, to: f64, least: usize, value: impl Fn(f64) -> f64) {
        // Ten degrees of a sine are a polynomial as far as the longer rule is concerned, half a degree for the shorter.
        let pieces = (libm::ceil((to - from) / 5.0) as usize).max(least);
        let half = 0.5 * (to - from) / pieces as f64;
        let rule = if least == 1 && half <= 0.25 { &SHORT_RULE[..] } else { &RULE[..] };
        for piece in 0..pieces {
            let middle = from + (2 * piece + 1) as f64 * half;
            for &(x, weight) in rule {
                let angle = middle + half * x;
                let (sin, cos) = libm::sincos(angle.to_radians());
                let part = 2.0 * PI * value(angle) * sin * weight * half.to_radians();
                self.total += part;
                self.cosine += part * cos;
            }
        }
    }
}

/// One table for each wavelength.
#[derive(Clone, Debug)]
pub(super) struct Curves(pub(super) Vec<Curve>);

impl DirectionalFunction for Curves {
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
        // wi points back to where the light comes from: it goes on straight where wo = -wi.
        let cosine = (-wi.dot(wo)).clamp(-1.0, 1.0);
        let angle = libm::acos(cosine).to_degrees();
        values.iter_mut().zip(&self.0).for_each(|(value, curve)| *value = curve.at(angle));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(between: Between, f: impl Fn(f64) -> f64) -> Curve {
        let angles: Vec<f64> = (0..=180).map(f64::from).collect();
        let values = angles.iter().map(|a| f(libm::cos(a.to_radians()))).collect();
        Curve::new(angles, values, between)
    }

    #[test]
    fn integrals_are_those_of_known_functions() {
        let isotropic = curve(Between::Cosines, |_| 1.0).integrals();
        assert!((isotropic.total / (4.0 * PI) - 1.0).abs() < 1e-12 && isotropic.cosine.abs() < 1e-12);
        // Linear in the cosine: exact.
        let forward = curve(Between::Cosines, |mu| (1.0 + 3.0 * 0.25 * mu) / (4.0 * PI)).integrals();
        assert!((forward.total - 1.0).abs() < 1e-12 && (forward.cosine - 0.25).abs() < 1e-12, "{forward:?}");
        let rayleigh = curve(Between::Angles, |mu| 3.0 / (16.0 * PI) * (1.0 + mu * mu)).integrals();
        assert!((rayleigh.total - 1.0).abs() < 1e-4 && rayleigh.cosine.abs() < 1e-12, "{rayleigh:?}");
    }

    #[test]
    fn small_angles_of_a_volume_scattering_function_follow_power_laws() {
        let law = |angle: f64| 3.0 * libm::pow(angle, -1.3);
        let angles = vec![0.1, 1.0, 10.0];
        let values = angles.iter().map(|&a| law(a)).collect();
        let curve = Curve::new(angles, values, Between::PowerLaws);
        for angle in [0.1, 0.3, 5.0, 9.9] {
            assert!((curve.at(angle) / law(angle) - 1.0).abs() < 1e-12, "{angle}");
        }
        assert!(curve.at(0.05).is_nan() && curve.at(11.0).is_nan());
    }

    #[test]
    fn light_that_goes_straight_on_is_scattered_by_nothing() {
        let curve = Curves(vec![curve(Between::Angles, |mu| mu)]);
        let (wi, mut value) = (Direction::from_degrees(30.0, 40.0), [0.0]);
        let [x, y, z] = wi.xyz();
        for (wo, expected) in [(Direction::new(-x, -y, -z), 1.0), (Some(wi), -1.0)] {
            curve.evaluate(wi, wo.unwrap(), &mut value);
            assert!((value[0] - expected).abs() < 1e-6, "{value:?}");
        }
    }
}
