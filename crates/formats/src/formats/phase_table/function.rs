//! Phase function as a table over the scattering angle: interpolation, integrals, and evaluation at two directions.

use crate::domain::Direction;
use crate::formats::acquisition::DirectionalFunction;
use std::f64::consts::PI;

/// Angle in degrees below which a volume scattering function is interpolated by power laws, as in Petzold's tables.
/// Raising it uses power laws for more entries.
const POWER_LAW_BELOW: f64 = 10.0;

/// Variable in which a phase function is interpolated linearly between the entries of its table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Between {
    /// Values are linear in the scattering angle.
    Angles,
    /// Values are linear in the cosine of the scattering angle.
    Cosines,
    /// Values are linear in the scattering angle; below 10 degrees their logarithms are linear in the logarithm of the
    /// angle.
    PowerLaws,
}

/// Phase function as a table over the scattering angle in degrees, 0 = forward, strictly increasing; NaN = missing.
#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) angles: Vec<f64>,
    pub(super) values: Vec<f64>,
    pub(super) between: Between,
    /// Angle in degrees by which the phase function continues before the first and after the last scattering angle of
    /// its table, with the value at that angle.
    pub(super) held: f64,
    /// True if the file lists the scattering angles (or cosines) of the table; false if the table was computed from
    /// Legendre moments.
    pub(super) is_listed: bool,
    /// Cosines of the scattering angles, if the values are interpolated linearly in them; else empty.
    pub(super) cosines: Vec<f64>,
}

/// Position of a scattering angle relative to the entries of a phase function table.
#[derive(Clone, Copy)]
enum Place {
    Outside,
    /// Index of the first or last entry of a phase function table, whose value holds at the scattering angle: the angle
    /// lies beyond that end of the table, or is its last angle.
    At(usize),
    /// Index of the table entry below the scattering angle, which lies between this entry and the next one.
    Behind(usize),
}

impl Curve {
    /// Creates a phase function over scattering angles in degrees, without extrapolation.
    pub(super) fn over_angles(angles: Vec<f64>, values: Vec<f64>, is_volume: bool) -> Self {
        let between = if is_volume { Between::PowerLaws } else { Between::Angles };
        Self { angles, values, between, held: 0.0, is_listed: true, cosines: Vec::new() }
    }

    /// Creates a phase function over decreasing cosines of the scattering angle, without extrapolation.
    pub(super) fn over_cosines(cosines: Vec<f64>, values: Vec<f64>) -> Self {
        let angles = cosines.iter().map(|&cosine| libm::acos(cosine).to_degrees()).collect();
        Self { angles, values, between: Between::Cosines, held: 0.0, is_listed: true, cosines }
    }

    /// Locates a scattering angle, in degrees, in the table of a phase function: at an entry, between two entries, or
    /// outside.
    fn place(&self, angle: f64) -> Place {
        let last = self.angles.len() - 1;
        let (low, high) = (self.angles[0], self.angles[last]);
        if angle < low - self.held || angle > high + self.held {
            return Place::Outside;
        }
        if angle < low {
            return Place::At(0);
        }
        if angle >= high {
            return Place::At(last);
        }
        // Guess for even steps, which most tables have.
        let guess = ((angle - low) / (high - low) * last as f64) as usize;
        let is_there = guess < last && self.angles[guess] <= angle && angle < self.angles[guess + 1];
        Place::Behind(if is_there {
            guess
        } else {
            self.angles.partition_point(|&known| known <= angle).saturating_sub(1)
        })
    }

    /// Returns the phase function at a scattering angle in degrees; NaN outside the table and beside missing entries.
    fn at(&self, place: Place, angle: f64) -> f64 {
        match place {
            Place::Outside => f64::NAN,
            Place::At(entry) => self.values[entry],
            Place::Behind(entry) => self.inside(entry, angle),
        }
    }

    /// Returns the phase function at a scattering angle, in degrees, that lies between entries `i` and `i + 1` of its
    /// table.
    fn inside(&self, i: usize, angle: f64) -> f64 {
        let (x0, x1, y0, y1) = (self.angles[i], self.angles[i + 1], self.values[i], self.values[i + 1]);
        if self.is_power_law([x0, x1], [y0, y1]) {
            return y0 * libm::pow(angle / x0, libm::log(y1 / y0) / libm::log(x1 / x0));
        }
        let t = if self.between == Between::Cosines {
            let (c0, c1) = (self.cosines[i], self.cosines[i + 1]);
            (libm::cos(angle.to_radians()) - c0) / (c1 - c0)
        } else {
            (angle - x0) / (x1 - x0)
        };
        y0 + t * (y1 - y0)
    }

    /// Returns true if the phase function follows a power law, not a line, between two neighbouring entries of its
    /// table. They have the scattering angles `x0` and `x1`, in degrees, and the values `y0` and `y1`.
    fn is_power_law(&self, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) -> bool {
        self.between == Between::PowerLaws && x1 <= POWER_LAW_BELOW && x0 > 0.0 && y0 > 0.0 && y1 > 0.0
    }

    /// Returns the integral of the phase function over the sphere, `2π ∫ p sin ψ dψ`, the cosine-weighted integral `2π
    /// ∫ p cos ψ sin ψ dψ`, and the part of the first one up to the second angle of the table. They extend over the
    /// covered angles.
    pub(super) fn integrals(&self) -> Integrals {
        let mut all = Integrals::default();
        let last = self.angles.len() - 1;
        if self.held > 0.0 {
            all.add_line([0.0, self.angles[0]], [self.values[0]; 2]);
        }
        for i in 0..last {
            let (angles, values) = ([self.angles[i], self.angles[i + 1]], [self.values[i], self.values[i + 1]]);
            if self.between == Between::Cosines {
                all.add_line_of_cosines([self.cosines[i], self.cosines[i + 1]], values);
            } else if self.is_power_law(angles, values) {
                all.add(angles, |angle| self.inside(i, angle));
            } else {
                all.add_line(angles, values);
            }
            if i == 0 {
                all.first = all.total;
            }
        }
        if self.held > 0.0 {
            all.add_line([self.angles[last], 180.0], [self.values[last]; 2]);
        }
        all
    }
}

/// Integrals of a phase function over the sphere.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Integrals {
    pub(super) total: f64,
    /// Integral of the phase function weighted by the cosine of the scattering angle.
    pub(super) cosine: f64,
    /// Part of the phase function's integral over the sphere from scattering angles below the second angle in its
    /// table.
    pub(super) first: f64,
}

/// Abscissae and weights of the Gauss–Legendre rule with 4 points on -1..1 (Abramowitz & Stegun, table 25.4).
const RULE: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
    (-0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_3, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_86),
];
/// Number of pieces into which an interval between two entries of a phase function table is divided for Gauss
/// quadrature, if its values follow a power law. Raising it is slower and more accurate.
const PIECES: usize = 4;
/// Half width of an interval in radians below which Taylor polynomials replace sines and cosines in integrals.
const SHORT: f64 = 0.25;

/// Returns the integrals `∫ cos x dx` and `∫ x sin x dx` over `-half..half`, half in radians.
fn around_zero(half: f64) -> [f64; 2] {
    if half > SHORT {
        let (sin, cos) = libm::sincos(half);
        return [2.0 * sin, 2.0 * (sin - half * cos)];
    }
    // Taylor series, because the second integral would suffer cancellation.
    let x = half * half;
    let series = |terms: [f64; 6]| terms.iter().rev().fold(0.0, |sum, term| sum * x + term);
    [
        2.0 * half * series([1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362_880.0, -1.0 / 39_916_800.0]),
        2.0 * half * series([0.0, 1.0 / 3.0, -1.0 / 30.0, 1.0 / 840.0, -1.0 / 45_360.0, 1.0 / 3_991_680.0]),
    ]
}

impl Integrals {
    /// Adds the part of a phase function from cosine `c0` to cosine `c1` of the scattering angle to its integral over
    /// the sphere and to its cosine-weighted integral. The values `y0` and `y1` are interpolated linearly in the
    /// cosine.
    fn add_line_of_cosines(&mut self, [c0, c1]: [f64; 2], [y0, y1]: [f64; 2]) {
        let part = 2.0 * PI * (c0 - c1);
        self.total += part * 0.5 * (y0 + y1);
        self.cosine += part / 6.0 * (y0 * (2.0 * c0 + c1) + y1 * (c0 + 2.0 * c1));
    }

    /// Adds the part of a phase function from scattering angle `from` to scattering angle `to`, in degrees, to its
    /// integral over the sphere and to its cosine-weighted integral. The values `y0` and `y1` are interpolated linearly
    /// in the angle.
    fn add_line(&mut self, [from, to]: [f64; 2], [y0, y1]: [f64; 2]) {
        let half = (0.5 * (to - from)).to_radians();
        if half <= 0.0 {
            return;
        }
        let (sin, cos) = libm::sincos((0.5 * (from + to)).to_radians());
        let (mean, slope) = (0.5 * (y0 + y1), 0.5 * (y1 - y0) / half);
        let [even, odd] = around_zero(half);
        self.total += 2.0 * PI * (mean * sin * even + slope * cos * odd);
        // cos ψ sin ψ = ½ sin 2ψ.
        let [even, odd] = around_zero(2.0 * half);
        let (sin_2, cos_2) = (2.0 * sin * cos, cos * cos - sin * sin);
        self.cosine += 0.5 * PI * (mean * sin_2 * even + 0.5 * slope * cos_2 * odd);
    }

    /// Adds the part of a phase function from scattering angle `from` to scattering angle `to`, in degrees, to its
    /// integral over the sphere and to its cosine-weighted integral, by Gauss quadrature.
    fn add(&mut self, [from, to]: [f64; 2], value: impl Fn(f64) -> f64) {
        let half = 0.5 * (to - from) / PIECES as f64;
        for piece in 0..PIECES {
            let middle = from + (2 * piece + 1) as f64 * half;
            for (x, weight) in RULE {
                let angle = middle + half * x;
                let (sin, cos) = libm::sincos(angle.to_radians());
                let part = 2.0 * PI * value(angle) * sin * weight * half.to_radians();
                self.total += part;
                self.cosine += part * cos;
            }
        }
    }
}

/// Phase functions at all wavelengths, as tables that share one list of scattering angles.
#[derive(Clone, Debug)]
pub(super) struct Curves(pub(super) Vec<Curve>);

impl DirectionalFunction for Curves {
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
        // wi points back to the source: light is unscattered at wo = −wi.
        let cosine = (-wi.dot(wo)).clamp(-1.0, 1.0);
        let angle = libm::acos(cosine).to_degrees();
        let place = self.0.first().map_or(Place::Outside, |curve| curve.place(angle));
        values.iter_mut().zip(&self.0).for_each(|(value, curve)| *value = curve.at(place, angle));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(between: Between, f: impl Fn(f64) -> f64) -> Curve {
        let angles: Vec<f64> = (0..=180).map(f64::from).collect();
        let cosines: Vec<f64> = angles.iter().map(|a| libm::cos(a.to_radians())).collect();
        let values = cosines.iter().map(|&mu| f(mu)).collect();
        match between {
            Between::Cosines => Curve::over_cosines(cosines, values),
            other => Curve::over_angles(angles, values, other == Between::PowerLaws),
        }
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
    fn lines_are_integrated_exactly_however_long_they_are() {
        // ∫ ψ sin ψ dψ and ∫ ψ cos ψ sin ψ dψ over 0..π are π and -π/4, in any steps.
        for steps in [1, 2, 3, 7, 20, 180, 65_535] {
            let angles: Vec<f64> = (0..=steps).map(|i| 180.0 * f64::from(i) / f64::from(steps)).collect();
            let values = angles.iter().map(|angle| angle.to_radians()).collect();
            let found = Curve::over_angles(angles, values, false).integrals();
            assert!((found.total / (2.0 * PI * PI) - 1.0).abs() < 1e-12, "{steps}: {found:?}");
            assert!((found.cosine / (-0.5 * PI * PI) - 1.0).abs() < 1e-12, "{steps}: {found:?}");
        }
        // The two forms of a sine agree where one takes over from the other.
        let (below, above) = (around_zero(SHORT), around_zero(SHORT * (1.0 + 1e-15)));
        assert!(below.iter().zip(above).all(|(a, b)| (a / b - 1.0).abs() < 1e-13), "{below:?} {above:?}");
    }

    #[test]
    fn small_angles_of_a_volume_scattering_function_follow_power_laws() {
        let law = |angle: f64| 3.0 * libm::pow(angle, -1.3);
        let angles = vec![0.1, 1.0, 10.0];
        let values = angles.iter().map(|&a| law(a)).collect();
        let curve = Curve::over_angles(angles, values, true);
        for angle in [0.1, 0.3, 5.0, 9.9] {
            assert!((curve.at(curve.place(angle), angle) / law(angle) - 1.0).abs() < 1e-12, "{angle}");
        }
        assert!([0.05, 11.0].iter().all(|&angle| curve.at(curve.place(angle), angle).is_nan()));
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
