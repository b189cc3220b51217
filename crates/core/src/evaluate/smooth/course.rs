//! Interpolation of the smooth form between incidences, if a divisor or a cubic is in use.

use crate::compress::Between;
use crate::domain::vector::Vector;
use crate::evaluate::between::{Cubic, Divided, FOUR};
use crate::evaluate::incoming::{Around, Nodes};
use crate::evaluate::kernel::BLOCK;
use crate::evaluate::mixed::{Mixed, Row};
use crate::evaluate::planes::Planes;
use wide::f32x4;

/// Interpolation between incidences.
#[derive(Debug)]
pub(super) struct Course {
    stated: Between,
    pub(super) divided: Divided,
    curve: Option<Curve>,
    /// Row that adds 1 to the logarithm of every wavelength.
    pub(super) constant: Row,
    /// Past the last elevation: its cosine, and for each index entry the largest logarithm of f·cos θo there, averaged
    /// over wavelengths.
    pub(super) last: Option<(f64, Vec<f32>)>,
}

/// Curve through nodes over incoming directions, if it is not linear.
#[derive(Debug)]
enum Curve {
    /// Cubic through four elevations.
    Cubic(Cubic),
    /// Quadratic through six nodes of a triangle.
    Quadratic,
}

/// Maximum number of nodes of a curve.
pub(super) const MOST_LANES: usize = 2 * FOUR;

/// Nodes around an incoming direction, one for each lane; lanes with weight 0 are unused.
pub(super) struct Lanes {
    pub(super) nodes: [u32; MOST_LANES],
    /// Weights of linear interpolation.
    pub(super) linear: [f32; MOST_LANES],
    /// Weights of a curve.
    pub(super) curve: Option<[f32; MOST_LANES]>,
}

impl Course {
    /// Interpolation stated by `between`; `None` if it is the default, or if planes are not logarithms.
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

    /// Stated interpolation between incidences.
    pub(super) fn stated(&self) -> Between {
        self.stated
    }

    /// Logarithm of the divisor.
    fn divisor(&self, wi: Vector, wo: Vector) -> f32 {
        self.divided.one(wi.map(|x| x as f32), wo.map(|x| x as f32))
    }

    /// Logarithms of the divisor for a block of pairs.
    #[inline(always)]
    pub(super) fn divisors(&self, wi: [&[f32; BLOCK]; 3], wo: [&[f32; BLOCK]; 3]) -> [f32; BLOCK] {
        let mut logarithms = [0.0; BLOCK];
        for (k, four) in logarithms.as_chunks_mut::<FOUR>().0.iter_mut().enumerate() {
            let at = |of: [&[f32; BLOCK]; 3]| of.map(|numbers| f32x4::new(numbers.as_chunks::<FOUR>().0[k]));
            *four = self.divided.four(at(wi), at(wo)).to_array();
        }
        logarithms
    }

    /// Divides a row seen along `there` under `to` by the divisor.
    pub(super) fn divide(&self, mixed: &mut Mixed, to: Vector, there: Vector) {
        self.shift(&mut mixed.row, -self.divisor(to, there));
    }

    /// Multiplies a mixed row for `wo` under `wi` by the divisor.
    pub(super) fn multiply(&self, mixed: &mut Mixed, wi: Vector, wo: Vector) {
        self.shift(&mut mixed.row, self.divisor(wi, wo));
    }

    /// Adds to the logarithm of every wavelength.
    #[inline(always)]
    pub(super) fn shift(&self, row: &mut Row, by: f32) {
        row.iter_mut().zip(self.constant).for_each(|(value, constant)| *value += by * constant);
    }

    /// Mean over wavelengths of the logarithm of a row, up to a constant that all rows share.
    #[inline(always)]
    pub(super) fn brightness(&self, row: &[f32]) -> f32 {
        let (sum, square) = row.iter().zip(self.constant).fold((0.0, 0.0), |(sum, square), (value, constant)| {
            (sum + value * constant, square + constant * constant)
        });
        sum / square
    }

    /// Nodes around an incoming direction with their weights; up to three of them enter linear interpolation.
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

    /// Returns true if a curve has more than four nodes, which need two groups of lanes.
    #[inline]
    pub(super) fn is_wide(&self) -> bool {
        matches!(self.curve, Some(Curve::Quadratic))
    }

    /// Returns true if a curve is in use, which needs more nodes than linear interpolation.
    #[inline]
    pub(super) fn has_curve(&self) -> bool {
        self.curve.is_some()
    }

    pub(super) fn memory(&self) -> usize {
        let cubic = if let Some(Curve::Cubic(cubic)) = &self.curve { cubic.memory() } else { 0 };
        size_of::<Self>() + cubic + self.last.as_ref().map_or(0, |(_, peaks)| size_of_val(&**peaks))
    }
}

/// Logarithms of the divisor at the nodes around the places of a block: weighted sums, and sums of weights.
pub(super) struct Divisors {
    sums: [f32; BLOCK],
    weights: [f32; BLOCK],
}

impl Divisors {
    pub(super) const NOTHING: Self = Self { sums: [0.0; BLOCK], weights: [0.0; BLOCK] };

    /// Adds the divisors at nodes of these directions, with places looked up at `there`.
    #[inline(always)]
    pub(super) fn add(
        &mut self,
        course: &Course,
        [x, y, z, ..]: &[[f32; BLOCK]; 5],
        there: &[[f32; BLOCK]; 3],
        weights: &[f32; BLOCK],
    ) {
        let logarithms = course.divisors([x, y, z], there.each_ref());
        for i in 0..BLOCK {
            self.sums[i] += weights[i] * logarithms[i];
            self.weights[i] += weights[i];
        }
    }

    /// Mean of the logarithms at place `i`.
    #[inline(always)]
    pub(super) fn mean(&self, i: usize) -> f32 {
        self.sums[i] / self.weights[i]
    }
}
