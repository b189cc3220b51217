//! Interpolation of the smooth form between incidences, if a divisor or a cubic is in use.

use crate::compress::{Between, Divided, Divisor};
use crate::domain::vector::Vector;
use crate::evaluate::between::{Cubic, FOUR};
use crate::evaluate::incoming::{Around, Nodes};
use crate::evaluate::kernel::BLOCK;
use crate::evaluate::mixed::{Mixed, Row};
use crate::evaluate::planes::Planes;
use wide::f32x4;

/// Interpolation of spectral coefficients between incoming directions with a divisor (model divided out before
/// interpolation) or a cubic.
#[derive(Debug)]
pub(super) struct Course {
    stated: Between,
    pub(super) divided: Divided,
    curve: Option<Curve>,
    /// Spectral coefficients that, when added to those of any spectrum, raise the natural logarithm of that spectrum by
    /// 1 at every wavelength.
    pub(super) constant: Row,
    /// Data for extrapolation past the last measured polar angle of incidence: first the cosine of that angle. Then the
    /// largest natural logarithm of the function times cos θo there, averaged over wavelengths, for each combination of
    /// indices (positions on the axes before the directions).
    pub(super) last: Option<(f64, Vec<f32>)>,
}

/// Curve through interpolation nodes over incoming directions, if interpolation is not linear.
#[derive(Debug)]
enum Curve {
    /// Cubic in the polar angle of incidence, through the values at four of these angles.
    Cubic(Cubic),
    /// Quadratic through six nodes of a triangle of incoming directions: its corners and edge midpoints.
    Quadratic,
}

/// Number of SIMD lanes for the interpolation nodes around an incoming direction: enough for the six of a quadratic,
/// rounded up to two vectors of four.
const MOST_LANES: usize = 2 * FOUR;

/// Incoming directions around a queried one at which values are tabulated (interpolation nodes), one for each SIMD
/// lane; lanes with weight 0 are unused.
pub(super) struct Lanes {
    pub(super) nodes: [u32; MOST_LANES],
    /// Weights of the interpolation nodes in linear interpolation.
    pub(super) linear: [f32; MOST_LANES],
    /// Weights of the interpolation nodes on the cubic or quadratic curve; `None` if interpolation is linear.
    pub(super) curve: Option<[f32; MOST_LANES]>,
}

impl Lanes {
    /// Returns true if interpolation node number `k` has a weight other than 0.
    #[inline(always)]
    pub(super) fn is_used(&self, k: usize) -> bool {
        self.linear[k] > 0.0 || self.curve.is_some_and(|weights| weights[k] != 0.0)
    }
}

impl Course {
    /// Prepares interpolation between incoming directions with the divisor (model divided out before interpolation) and
    /// the curve that `between` chooses. `None` if `between` is the default (linear, no divisor), or if spectral
    /// coefficients do not represent logarithms.
    pub(super) fn new(between: &Between, planes: &Planes, nodes: &Nodes) -> Option<Self> {
        if between.is_default() || !planes.has_logarithms() {
            return None;
        }
        let curve = match nodes {
            Nodes::Elevations(angles, _) if between.cubic && angles.len() > 1 => Some(Curve::Cubic(Cubic::new(angles))),
            Nodes::Triangles(_) if between.cubic => Some(Curve::Quadratic),
            _ => None,
        };
        let (divided, constant) = (Divided::by(between.divisor), planes.constant());
        Some(Self { stated: *between, divided, curve, constant, last: None })
    }

    /// Interpolation that the file or the user specified for use between incoming directions.
    pub(super) fn stated(&self) -> Between {
        self.stated
    }

    /// Natural logarithm of the divisor (model by which samples are divided before interpolation) for a pair of
    /// directions.
    pub(super) fn divisor(&self, wi: Vector, wo: Vector) -> f32 {
        self.divided.one(wi.map(|x| x as f32), wo.map(|x| x as f32))
    }

    /// Natural logarithms of the divisor (model by which samples are divided before interpolation) for a block of pairs
    /// of an incoming and an outgoing direction.
    #[inline(always)]
    pub(super) fn divisors(&self, wi: [&[f32; BLOCK]; 3], wo: [&[f32; BLOCK]; 3]) -> [f32; BLOCK] {
        let mut logarithms = [0.0; BLOCK];
        for (k, four) in logarithms.as_chunks_mut::<FOUR>().0.iter_mut().enumerate() {
            let at = |of: [&[f32; BLOCK]; 3]| of.map(|numbers| f32x4::new(numbers.as_chunks::<FOUR>().0[k]));
            *four = self.divided.four(at(wi), at(wo)).to_array();
        }
        logarithms
    }

    /// Multiplies an interpolated spectrum, given by its coefficients, by the divisor (model by which samples were
    /// divided before interpolation), evaluated at the queried pair of directions.
    pub(super) fn multiply(&self, mixed: &mut Mixed, wi: Vector, wo: Vector) {
        self.shift(&mut mixed.row, self.divisor(wi, wo));
    }

    /// Adds `by` to the logarithm of the value at every wavelength, by a change of the spectral coefficients.
    #[inline(always)]
    pub(super) fn shift(&self, row: &mut Row, by: f32) {
        row.iter_mut().zip(self.constant).for_each(|(value, constant)| *value += by * constant);
    }

    /// Mean over wavelengths of the logarithm that spectral coefficients represent, up to a constant that all spectra
    /// share.
    #[inline(always)]
    pub(super) fn brightness(&self, row: &[f32]) -> f32 {
        let (sum, square) = row.iter().zip(self.constant).fold((0.0, 0.0), |(sum, square), (value, constant)| {
            (sum + value * constant, square + constant * constant)
        });
        sum / square
    }

    /// Interpolation nodes around an incoming direction with their weights, ordered by SIMD lane; up to three of them
    /// enter linear interpolation.
    #[inline(always)]
    pub(super) fn lanes(&self, nodes: &Nodes, around: &Around) -> Lanes {
        let ([a, b, c], [u, v, w]) = (around.nodes, around.weights);
        match &self.curve {
            Some(Curve::Cubic(cubic)) if v > 0.0 => {
                let ([e, f, g, h], [p, q, r, s]) = cubic.around(a as usize, v);
                Lanes {
                    nodes: [e, f, g, h, e, e, e, e],
                    linear: [0.0, u, v, 0.0, 0.0, 0.0, 0.0, 0.0],
                    curve: Some([p, q, r, s, 0.0, 0.0, 0.0, 0.0]),
                }
            }
            Some(Curve::Quadratic) => {
                let ([d, e, f, g, h, i], [p, q, r, s, t, x]) = nodes.quadratic(around.nodes, around.weights);
                Lanes {
                    nodes: [d, e, f, g, h, i, d, d],
                    linear: [u, v, w, 0.0, 0.0, 0.0, 0.0, 0.0],
                    curve: Some([p, q, r, s, t, x, 0.0, 0.0]),
                }
            }
            _ => Lanes { nodes: [a, b, c, a, a, a, a, a], linear: [u, v, w, 0.0, 0.0, 0.0, 0.0, 0.0], curve: None },
        }
    }

    /// Returns true if interpolation between incoming directions follows a curve through more than four of them, which
    /// need two SIMD vectors.
    #[inline]
    pub(super) fn is_wide(&self) -> bool {
        matches!(self.curve, Some(Curve::Quadratic))
    }

    /// Returns true if interpolation follows a cubic or quadratic curve, which needs more nodes than linear
    /// interpolation.
    #[inline]
    pub(super) fn has_curve(&self) -> bool {
        self.curve.is_some()
    }

    /// Returns true if samples are divided by a function before interpolation.
    pub(super) fn has_divisor(&self) -> bool {
        self.stated.divisor != Divisor::None
    }

    pub(super) fn memory(&self) -> usize {
        let cubic = if let Some(Curve::Cubic(cubic)) = &self.curve { cubic.memory() } else { 0 };
        size_of::<Self>() + cubic + self.last.as_ref().map_or(0, |(_, peaks)| size_of_val(&**peaks))
    }
}
