//! Choices by the coordinates of the unit square, which are rescaled to the chosen part.

use super::mesh::FLIPS;
use std::hint::select_unpredictable;

/// Largest f64 below 1.
pub(in crate::evaluate) const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;
/// Minimum barycentric distance of drawn points from the edges of their leaf triangle, so that rounding cannot move a
/// point over an edge.
const MARGIN: f64 = 1e-9;

/// Number of levels of a sampling tree after which a coordinate of the unit square, kept as numerator and denominator,
/// is replaced by its quotient. Numerator and denominator shrink level by level with the probabilities of triangles,
/// which are at least 1e-45, and must not underflow.
pub(super) const UNREDUCED: u8 = 3;

/// Coordinate of the unit square as numerator and denominator, so that a random choice need not wait for a division.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fraction {
    pub(super) over: f64,
    pub(super) under: f64,
}

impl Fraction {
    #[inline(always)]
    pub(super) fn new(u: f64) -> Self {
        Self { over: u, under: 1.0 }
    }

    #[inline(always)]
    pub(super) fn value(self) -> f64 {
        let value = self.over / self.under;
        if value < BELOW_ONE { value } else { BELOW_ONE }
    }

    #[inline(always)]
    pub(super) fn reduced(self) -> Self {
        Self::new(self.value())
    }

    /// Splits 0..1 in proportion to two masses. Returns true if the coordinate lies in the second part (never if the
    /// second mass is 0), and the coordinate rescaled to its part.
    #[inline(always)]
    #[allow(clippy::needless_bitwise_bool, reason = "neither can be predicted")]
    fn split(self, first: f64, second: f64) -> (bool, Self) {
        let (over, start) = (self.over * (first + second), first * self.under);
        let beyond = (over >= start) & (second > 0.0);
        let rest = select_unpredictable(beyond, over - start, over);
        (beyond, Self { over: rest, under: select_unpredictable(beyond, second, first) * self.under })
    }
}

/// Chooses a quadrant of a square by four weights: the half along a by the first coordinate, then the half along b by
/// the second. Rescales both coordinates to the quadrant. Never chooses a quadrant of weight 0.
#[inline(always)]
pub(super) fn choose([w0, w1, w2, w3]: [f64; 4], u: &mut [Fraction; 2]) -> usize {
    let (a, first) = u[0].split(w0 + w1, w2 + w3);
    let (b, second) = u[1].split(select_unpredictable(a, w2, w0), select_unpredictable(a, w3, w1));
    *u = [first, second];
    2 * usize::from(a) + usize::from(b)
}

/// Start and length, along both coordinates, of the rectangle of points of the unit square for which [`choose`] selects
/// `quadrant`, given the weights of the four quadrants.
pub(super) fn interval([w0, w1, w2, w3]: [f64; 4], quadrant: usize) -> ([f64; 2], [f64; 2]) {
    let share = |first: f64, second: f64, which: usize| {
        let (first, second) = (first / (first + second), second / (first + second));
        if which == 0 { (0.0, first) } else { (first, second) }
    };
    let (bottom, top) = if quadrant < 2 { (w0, w1) } else { (w2, w3) };
    let (a, width) = share(w0 + w1, w2 + w3, quadrant / 2);
    let (b, height) = share(bottom, top, quadrant % 2);
    ([a, b], [width, height])
}

/// Mirrors the coordinates `u` within one of the squares into which the octahedron unfolds, as [`FLIPS`] states.
/// Squares that share an edge in the unfolded octahedron then also share it in the unit square.
#[inline(always)]
pub(super) fn flipped(square: usize, u: [Fraction; 2]) -> [Fraction; 2] {
    [0, 1].map(|k| {
        let [start, direction] = FLIPS[square][k];
        Fraction { over: start * u[k].under + direction * u[k].over, ..u[k] }
    })
}

/// Barycentric coordinates moved inwards to at least [`MARGIN`] from the triangle's edges.
#[inline(always)]
pub(super) fn inward([a, b, c]: [f64; 3]) -> [f64; 3] {
    if a.min(b).min(c) >= MARGIN {
        return [a, b, c];
    }
    let (a, b, c) = (a.max(MARGIN), b.max(MARGIN), c.max(MARGIN));
    let scale = 1.0 / (a + b + c);
    [a * scale, b * scale, c * scale]
}
