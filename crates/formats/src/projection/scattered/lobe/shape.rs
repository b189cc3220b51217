//! Fitted numbers of a lobe, and its logarithm and derivatives at a sample.

use super::near::Sample;
use crate::domain::{LobeCentre, LobeParameters, ROUGHNESS_OF_WIDTH, microfacets};
use std::f64::consts::LN_2;

/// Number of fitted parameters of a lobe.
pub(super) const NUMBERS: usize = 7;
/// Index, among the fitted parameters of a lobe, of the logarithm of its half-width.
pub(super) const WIDTH: usize = 3;
/// Index, among the fitted parameters of a lobe, of the one that sets how slowly the lobe falls off: 0 for a Gaussian,
/// 1/2 for GGX.
pub(super) const TAIL: usize = 4;
/// Index, among the fitted parameters of a lobe, of the logarithm of a ratio: the half-width along the lobe's first
/// axis over the geometric mean of both half-widths.
pub(super) const STRETCH: usize = 5;
/// Index, among the fitted parameters of a lobe, of the angle of the lobe's first axis.
pub(super) const ANGLE: usize = 6;
/// Least tail parameter in a fit; 0 is a Gaussian. Below twice this value a lobe is stored as a Gaussian.
pub(super) const LEAST_TAIL: f64 = 1e-3;

/// Fitted parameters of a lobe, in this order. First come coefficients p₀, p₁ and p₂ of the logarithm of its peak, in t
/// = −ln cos θi minus the mean of t. The logarithm of the (geometric mean) half-width and the tail follow. Last are the
/// logarithm of the first width over the mean width, and the angle of its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) centre: LobeCentre,
    pub(super) numbers: [f64; NUMBERS],
}

/// Natural logarithm of the value of a lobe at a sample, and the derivatives of this logarithm by the fitted
/// parameters.
pub(super) struct Value {
    pub(super) log: f64,
    pub(super) slopes: [f64; NUMBERS],
}

impl Shape {
    /// Returns the half-widths of the lobe along its two axes: in radians for a direction as centre, in slopes for half
    /// vectors.
    pub(super) fn widths(&self) -> [f64; 2] {
        let [mean, stretch] = [WIDTH, STRETCH].map(|i| self.numbers[i]);
        [libm::exp(mean + stretch), libm::exp(mean - stretch)]
    }

    /// Returns the (geometric mean) half-width of the lobe in outgoing directions at normal incidence, in radians.
    pub(super) fn width(&self) -> f64 {
        libm::exp(self.numbers[WIDTH]) * of_outgoing(self.centre)
    }

    /// Converts the fitted parameters to those of a stored `Lobe`. The logarithm of the peak, fitted as a polynomial in
    /// −ln cos θi minus its mean over incoming directions (`mean_t`), becomes one in −ln cos θi itself.
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

    /// Precomputes the factors of this lobe that are equal for all measured samples at which it is evaluated.
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

/// Returns the factor that converts a half-width, in the coordinates of a lobe, to an angle between outgoing directions
/// at normal incidence, in radians. It is 2 for half-widths in half-vector slopes and 1 for half-widths in radians.
pub(super) fn of_outgoing(centre: LobeCentre) -> f64 {
    if centre == LobeCentre::HalfVector { 2.0 } else { 1.0 }
}

/// A lobe with precomputed factors, ready to be evaluated at samples.
pub(super) struct Prepared {
    peak: [f64; 3],
    /// Inverse half-widths along the two axes of the lobe.
    inverse: [f64; 2],
    turn: [f64; 2],
    tail: f64,
    slope: f64,
    slope_by_tail: f64,
    /// Squared roughness of the microfacet masking term; `None` for lobes without masking.
    square: Option<f64>,
}

impl Prepared {
    /// Evaluates the lobe at a sample. The small derivative of the masking term by the width is ignored.
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

    /// Returns the logarithm of the microfacet masking term G at a sample.
    #[inline]
    fn masking(&self, sample: &Sample) -> f64 {
        self.square.map_or(0.0, |square| libm::log(microfacets(square, sample.cosines, sample.place)))
    }
}
