//! Way of the smooth form from one incidence to the next, where a divisor or a cubic was chosen.

use crate::compress::Between;
use crate::domain::vector::Vector;
use crate::evaluate::between::{Cubic, Divided, FOUR};
use crate::evaluate::incoming::{Around, Nodes};
use crate::evaluate::kernel::BLOCK;
use crate::evaluate::mixed::{Mixed, Row};
use crate::evaluate::planes::Planes;

/// The way from one incidence to the next.
#[derive(Debug)]
pub(super) struct Course {
    stated: Between,
    pub(super) divided: Divided,
    cubic: Option<Cubic>,
    /// The row that adds 1 to the logarithm of every wavelength.
    pub(super) constant: Row,
    /// Past the last elevation: its height, and for each index entry the largest logarithm of f·cos θo there, the mean over
    /// wavelengths.
    pub(super) last: Option<(f64, Vec<f32>)>,
}

/// The nodes around an incoming direction, in as many lanes.
pub(super) struct Lanes {
    pub(super) nodes: [u32; FOUR],
    pub(super) linear: [f32; FOUR],
    /// Weights of a cubic; its middle lanes are those of the straight line.
    pub(super) cubic: Option<[f32; FOUR]>,
}

impl Course {
    /// The way that `between` states; `None` where nothing differs from files that state none, and where planes are no logarithms.
    pub(super) fn new(between: &Between, planes: &Planes, nodes: &Nodes) -> Option<Self> {
        if between.is_default() || !planes.has_logarithms() {
            return None;
        }
        let cubic = match nodes {
            Nodes::Elevations(angles, _) if between.cubic && angles.len() > 1 => Some(Cubic::new(angles)),
            _ => None,
        };
        let (divided, constant) = (Divided::by(between.divisor), planes.constant());
        Some(Self { stated: *between, divided, cubic, constant, last: None })
    }

    /// The interpolation between incidences that was stated.
    pub(super) fn stated(&self) -> Between {
        self.stated
    }

    /// Logarithm of the divisor.
    fn divisor(&self, wi: Vector, wo: Vector) -> f32 {
        self.divided.one(wi.map(|x| x as f32), wo.map(|x| x as f32))
    }

    /// Divides what is seen along `there` under `to`.
    pub(super) fn divide(&self, mixed: &mut Mixed, to: Vector, there: Vector) {
        self.shift(&mut mixed.row, -self.divisor(to, there));
    }

    /// Multiplies what was mixed for `wo` under `wi`.
    pub(super) fn multiply(&self, mixed: &mut Mixed, wi: Vector, wo: Vector) {
        self.shift(&mut mixed.row, self.divisor(wi, wo));
    }

    /// Adds to the logarithm of every wavelength.
    #[inline(always)]
    pub(super) fn shift(&self, row: &mut Row, by: f32) {
        row.iter_mut().zip(self.constant).for_each(|(value, constant)| *value += by * constant);
    }

    /// The mean over wavelengths of the logarithm of a row, but for a constant of all rows.
    #[inline(always)]
    pub(super) fn brightness(&self, row: &[f32]) -> f32 {
        let (sum, square) = row.iter().zip(self.constant).fold((0.0, 0.0), |(sum, square), (value, constant)| {
            (sum + value * constant, square + constant * constant)
        });
        sum / square
    }

    #[inline(always)]
    pub(super) fn lanes(&self, around: &Around) -> Lanes {
        let ([a, b, c], [u, v, w]) = (around.nodes, around.weights);
        match &self.cubic {
            Some(cubic) if v > 0.0 => {
                let (nodes, weights) = cubic.around(a as usize, v);
                Lanes { nodes, linear: [0.0, u, v, 0.0], cubic: Some(weights) }
            }
            _ => Lanes { nodes: [a, b, c, a], linear: [u, v, w, 0.0], cubic: None },
        }
    }

    /// Returns true where more nodes are looked at than those of straight lines.
    #[inline]
    pub(super) fn has_cubic(&self) -> bool {
        self.cubic.is_some()
    }

    pub(super) fn memory(&self) -> usize {
        let cubic = self.cubic.as_ref().map_or(0, Cubic::memory);
        size_of::<Self>() + cubic + self.last.as_ref().map_or(0, |(_, peaks)| size_of_val(&**peaks))
    }
}

/// Logarithms of the divisor at the nodes around the places of a block: their weighted sums, and the sums of weights.
pub(super) struct Divisors {
    sums: [f32; BLOCK],
    weights: [f32; BLOCK],
}

impl Divisors {
    pub(super) const NOTHING: Self = Self { sums: [0.0; BLOCK], weights: [0.0; BLOCK] };

    /// Adds what place `i` is seen by under a node.
    #[inline(always)]
    pub(super) fn add(&mut self, course: &Course, i: usize, to: [f32; 3], there: [f32; 3], weight: f32) {
        self.sums[i] += weight * course.divided.one(to, there);
        self.weights[i] += weight;
    }

    /// The mean of the logarithms at place `i`.
    #[inline(always)]
    pub(super) fn mean(&self, i: usize) -> f32 {
        self.sums[i] / self.weights[i]
    }
}
