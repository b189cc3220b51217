//! Chromatic adaptation to another light: the linear Bradford transform (mentioned in CIE 160:2004; ICC.1:2022, annex
//! E).

use super::matrix::{Matrix, inverse, product};
use super::xyz::Xyz;

const CONES: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
const BACK: Matrix = inverse(CONES);

/// Chromatic adaptation of colours from one white point to another, as one matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation(Matrix);

impl Adaptation {
    /// Creates the chromatic adaptation from white point `from` to white point `to`; both must have positive luminance.
    /// A cone to which `from` does not respond (single spectral lines) keeps its scale.
    pub fn between(from: Xyz, to: Xyz) -> Self {
        let (from, to) = (product(&CONES, unit(from)), product(&CONES, unit(to)));
        let mut rows = CONES;
        for (k, row) in rows.iter_mut().enumerate() {
            let gain = if from[k] > 1e-6 { to[k] / from[k] } else { 1.0 };
            *row = row.map(|c| gain * c);
        }
        let column = |j: usize| product(&BACK, [rows[0][j], rows[1][j], rows[2][j]]);
        let (a, b, c) = (column(0), column(1), column(2));
        Self([0, 1, 2].map(|i| [a[i], b[i], c[i]]))
    }

    /// Returns the colour that looks, under the second white point, as `colour` does under the first.
    pub fn apply(&self, colour: Xyz) -> Xyz {
        let [x, y, z] = product(&self.0, [colour.x, colour.y, colour.z]);
        Xyz { x, y, z }
    }
}

fn unit(white: Xyz) -> [f64; 3] {
    [white.x / white.y, 1.0, white.z / white.y]
}
