//! Fitted numbers of a lobe, and its logarithm and derivatives at a sample.

use super::near::Sample;
use crate::domain::{LobeCentre, LobeParameters, ROUGHNESS_OF_WIDTH, microfacets};
use std::f64::consts::LN_2;

/// Number of fitted numbers of a lobe.
pub(super) const NUMBERS: usize = 7;
/// Indices of the numbers, after the three of the peak.
pub(super) const WIDTH: usize = 3;
pub(super) const TAIL: usize = 4;
pub(super) const STRETCH: usize = 5;
pub(super) const ANGLE: usize = 6;
/// Least tail in a fit. Below twice this value a lobe is stored as a Gaussian.
pub(super) const LEAST_TAIL: f64 = 1e-3;

/// Fitted numbers of a lobe, in this order. First come p₀, p₁ and p₂ of the logarithm of its peak, in t minus its
/// mean. The logarithm of the (geometric mean) half-width and the tail follow. Last are the logarithm of the first
/// width over that mean, and the angle of its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) centre: LobeCentre,
    pub(super) numbers: [f64; NUMBERS],
}

/// Logarithm of a lobe, and its derivatives by the numbers.
pub(super) struct Value {
    pub(super) log: f64,
    pub(super) slopes: [f64; NUMBERS],
}

impl Shape {
    /// Returns the half-widths along both axes.
    pub(super) fn widths(&self) -> [f64; 2] {
        let [mean, stretch] = [WIDTH, STRETCH].map(|i| self.numbers[i]);
        [libm::exp(mean + stretch), libm::exp(mean - stretch)]
    }

    /// Returns the (geometric mean) half-width in outgoing directions at normal incidence, in radians.
    pub(super) fn width(&self) -> f64 {
        libm::exp(self.numbers[WIDTH]) * of_outgoing(self.centre)
    }

    /// Converts to the parameters of a `Lobe`, whose t is absolute, not relative to its mean.
    pub(super) fn parameters(&self, mean_t: f64, range: [f64; 2]) -> LobeParameters {
        let [p0, p1, p2, _, tail, stretch, angle] = self.numbers;
        let widths = self.widths();
        LobeParameters {
            centre: self.centre,
            peak: [p0 - mean_t * (p1 - mean_t * p2), p1 - 2.0 * mean_t * p2, p2],
            range,
            widths: if stretch == 0.0 { [widths[0]; 2] } else { widths },
            angle: if stretch == 0.0 { 0.0 } else { libm::remainder(angle, std::f64::consts::PI) },
            tail: if tail < 2.0 * LEAST_TAIL { 0.0 } else { tail },
            colours: vec![1.0],
        }
    }

    /// Precomputes everything that is independent of the sample.
    pub(super) fn prepared(&self) -> Prepared {
        let tail = self.numbers[TAIL].max(LEAST_TAIL);
        let slope = libm::expm1(tail * LN_2);
        let (sin, cos) = if self.numbers[ANGLE] == 0.0 { (0.0, 1.0) } else { libm::sincos(self.numbers[ANGLE]) };
        let roughness = ROUGHNESS_OF_WIDTH * libm::exp(self.numbers[WIDTH]);
        Prepared {
            peak: [self.numbers[0], self.numbers[1], self.numbers[2]],
            inverse: self.widths().map(|width| 1.0 / width),
            turn: [cos, sin],
            tail,
            slope,
            slope_by_tail: LN_2 * (1.0 + slope),
            square: (self.centre == LobeCentre::HalfVector).then_some(roughness * roughness),
        }
    }
}

/// Returns radians of outgoing directions at normal incidence per unit of a half-width.
pub(super) fn of_outgoing(centre: LobeCentre) -> f64 {
    if centre == LobeCentre::HalfVector { 2.0 } else { 1.0 }
}

/// A shape with precomputed factors.
pub(super) struct Prepared {
    peak: [f64; 3],
    /// Inverse half-widths.
    inverse: [f64; 2],
    turn: [f64; 2],
    tail: f64,
    slope: f64,
    slope_by_tail: f64,
    /// Squared roughness; `None` without masking.
    square: Option<f64>,
}

impl Prepared {
    /// Evaluates the lobe at a sample. The small derivative of the masking by the width is ignored.
    #[inline]
    pub(super) fn at(&self, sample: &Sample) -> Value {
        let ([cos, sin], [x, y], t) = (self.turn, sample.place, sample.t);
        let [a, b] = [(cos * x + sin * y) * self.inverse[0], (cos * y - sin * x) * self.inverse[1]];
        let square = a * a + b * b;
        let grown = 1.0 + self.slope * square;
        let exponent = libm::log1p(self.slope * square) / self.tail;
        let by_square = self.slope / (grown * self.tail);
        let by_tail = (square * self.slope_by_tail / grown - exponent) / self.tail;
        let [p0, p1, p2] = self.peak;
        let across = a * b * (self.inverse[0] / self.inverse[1] - self.inverse[1] / self.inverse[0]);
        Value {
            log: p0 + t * (p1 + t * p2) - exponent + self.masking(sample),
            slopes: [
                1.0,
                t,
                t * t,
                2.0 * square * by_square,
                -by_tail,
                2.0 * by_square * (a * a - b * b),
                -2.0 * by_square * across,
            ],
        }
    }

    /// Returns the logarithm of the masking term G.
    #[inline]
    fn masking(&self, sample: &Sample) -> f64 {
        self.square.map_or(0.0, |square| libm::log(microfacets(square, sample.cosines, sample.place)))
    }
}
