//! Integral over all outgoing directions of the function between samples on a grid, interval by interval.

use super::Lines;
use crate::domain::{Direction, Frame};

/// Gauss-Legendre points and weights on −1 … 1, four points: exact for polynomials to degree 7.
const POINTS: [[f64; 2]; 4] = [
    [-0.861_136_311_594_052_6, 0.347_854_845_137_453_86],
    [-0.339_981_043_584_856_3, 0.652_145_154_862_546_1],
    [0.339_981_043_584_856_3, 0.652_145_154_862_546_1],
    [0.861_136_311_594_052_6, 0.347_854_845_137_453_86],
];

impl Lines {
    /// Writes ∫ f dω over outgoing directions for one combination of indices (positions on the axes before the
    /// directions) into `out`, one number for each wavelength. The domain is the part of the sphere that the grid
    /// covers; masked directions count as dark. In a value of f, linear interpolation has the weight `straight`, 0..=1,
    /// and cubic interpolation of logarithms has the rest. For linear interpolation alone the quadrature is exact up to
    /// rounding.
    pub(in crate::evaluate) fn integrate(&self, entry: usize, straight: f32, out: &mut [f64]) {
        out.fill(0.0);
        let Some(sphere) = &self.outgoing else { return };
        let [polar, azimuth] = sphere.intervals();
        // Mirrored latitudes cover both sides of the equator.
        let sides = if sphere.grid().is_polar_mirrored() { 2.0 } else { 1.0 };
        let turned =
            |[a, b]: [f64; 2]| POINTS.map(|[x, weight]| [0.5 * (a + b) + 0.5 * (b - a) * x, 0.5 * (b - a) * weight]);
        let azimuths: Vec<[f64; 2]> = azimuth.into_iter().flat_map(turned).collect();
        let frame = sphere.grid().frame();
        let mut spectrum = vec![0.0; out.len()];
        for [angle, width] in polar.into_iter().flat_map(turned) {
            let (sin, cos) = libm::sincos(angle.to_radians());
            let circumference = if matches!(frame, Frame::TypeA | Frame::TypeB) { cos } else { sin };
            for &[turn, step] in &azimuths {
                let area = sides * circumference * width.to_radians() * step.to_radians();
                let wo: Direction = frame.direction(angle, turn);
                self.spectrum_with(straight, &self.under(entry, 0, wo), &mut spectrum);
                for (sum, &value) in out.iter_mut().zip(&spectrum).filter(|(_, value)| !value.is_nan()) {
                    *sum += area * f64::from(value);
                }
            }
        }
    }
}
