//! Samples on a grid of angles divided by the function of chunk V (see `between`) before they are coded.

use super::lattice::Shape;
use crate::compress::{Divided, Divisor};
use crate::domain::Direction;
use rayon::prelude::*;

/// Largest size of the logarithm of a function by which samples are divided. Where directions are opposite along the
/// horizon a microfacet model has no bound, and what is left of a sample there says nothing about its neighbours.
const MOST_LOGARITHM: f32 = 64.0;

/// Directions of a grid, each made of its angles when it is needed: a list of them would be larger than the samples.
struct Directions {
    /// Sine and cosine of each polar angle.
    polar: Vec<[f64; 2]>,
    /// Sine and cosine of each azimuth.
    azimuths: Vec<[f64; 2]>,
}

impl Directions {
    fn new([polar, azimuths]: [Vec<f64>; 2]) -> Self {
        let of_polar = |polar: f64| {
            let [sin, _, cos] = Direction::from_degrees(polar, 0.0).xyz();
            [sin, cos]
        };
        let of_azimuth = |azimuth: f64| {
            let [cos, sin, _] = Direction::from_degrees(90.0, azimuth).xyz();
            [sin, cos]
        };
        Self {
            polar: polar.into_iter().map(of_polar).collect(),
            azimuths: azimuths.into_iter().map(of_azimuth).collect(),
        }
    }

    fn len(&self) -> usize {
        self.polar.len() * self.azimuths.len()
    }

    fn get(&self, at: usize) -> [f32; 3] {
        let [sin_polar, z] = self.polar[at / self.azimuths.len()];
        let [sin, cos] = self.azimuths[at % self.azimuths.len()];
        [sin_polar * cos, sin_polar * sin, z].map(|x| x as f32)
    }
}

/// Function by which the samples of a grid are divided before they are coded, with all pairs of an incoming and an
/// outgoing direction.
pub(super) struct DividedRows {
    divided: Divided,
    incoming: Directions,
    outgoing: Directions,
    /// Number of samples for each pair of directions.
    length: usize,
}

impl DividedRows {
    /// Collects the angles of a grid; `None` without a function, or without incoming angles.
    pub(super) fn new(shape: &Shape, divisor: Divisor) -> Option<Self> {
        let [incoming, outgoing] = shape.angles().filter(|_| divisor != Divisor::None)?.map(Directions::new);
        Some(Self { divided: Divided::by(divisor), incoming, outgoing, length: shape.length() })
    }

    /// Returns true if the function has usable values at all pairs of directions.
    pub(super) fn is_usable(&self) -> bool {
        let rows = self.incoming.len() * self.outgoing.len();
        (0..rows).into_par_iter().all(|row| self.of_row(row).abs() <= MOST_LOGARITHM)
    }

    /// Natural logarithm of the function for one pair of directions; `row` numbers the spectra of the tensor,
    /// row-major.
    pub(super) fn of_row(&self, row: usize) -> f32 {
        let (incoming, outgoing) = (row / self.outgoing.len(), row % self.outgoing.len());
        self.divided.one(self.incoming.get(incoming % self.incoming.len()), self.outgoing.get(outgoing))
    }

    /// Multiplies samples by the function. `values` holds their logarithms from the first row of the tensor on.
    pub(super) fn restore(&self, values: &mut [f32]) {
        let slice = self.outgoing.len() * self.length;
        values.par_chunks_mut(slice).enumerate().for_each(|(entry, values)| self.restore_entry(entry, values));
    }

    /// Multiplies the samples under one incoming direction by the function; `entry` numbers the slices of outgoing
    /// directions, row-major. `values` holds logarithms.
    pub(super) fn restore_entry(&self, entry: usize, values: &mut [f32]) {
        let wi = self.incoming.get(entry % self.incoming.len());
        for (outgoing, row) in values.chunks_exact_mut(self.length).enumerate() {
            let logarithm = self.divided.one(wi, self.outgoing.get(outgoing));
            for value in row {
                *value += logarithm;
            }
        }
    }
}
