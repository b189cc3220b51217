//! Integrals of a lobe: its directional albedo, and its mean over a triangle of directions.

use super::under::LobeUnder;
use crate::domain::vector::{Vector, norm, sub};
use crate::domain::{Vertices, centroid, child, solid_angle};

/// Numbers of quadrature points for the albedo of a reflection lobe: `TURNS` azimuths about its centre, times `SHARES`
/// distances between the centre and the horizon.
const TURNS: usize = 32;
const SHARES: usize = 32;
/// Subdivision criterion for the mean of a lobe over a triangle. A triangle is not divided if its radius is at most
/// this fraction of its distance from the lobe's centre or of the lobe's width. Raising it is faster and less accurate.
const COARSE: f64 = 0.3;
/// Lower bound on the ratio of smallest to largest width of a lobe, as used to decide on the subdivision of triangles.
/// Raising it divides less near elongated lobes.
const LEAST_ROUNDNESS: f64 = 0.1;
/// Largest number of subdivisions of a triangle in the mean of a lobe. Pieces 4,096 times narrower than the triangle
/// suffice for every accepted width.
const DEEPEST: u32 = 12;

impl LobeUnder {
    /// Returns the directional albedo ∫ f · cos θo dωo of a reflection lobe f, for a colour factor of 1.
    ///
    /// Quadrature points are distributed like sampled directions, so that narrow lobes are as accurate as wide ones.
    pub fn light(&self) -> f64 {
        let mut sum = 0.0;
        for turn in 0..TURNS {
            for share in 0..SHARES {
                let at = |i: usize, of: usize| (i as f64 + 0.5) / of as f64;
                // Points are denser in the tail, where a small share of the lobe spreads over many directions.
                let rest = 1.0 - at(share, SHARES);
                let wo = self.draw([1.0 - rest * rest, at(turn, TURNS)]);
                let density = self.density(wo);
                if density > 0.0 {
                    sum += 2.0 * rest * self.shape(wo) * wo.cos_theta() / density;
                }
            }
        }
        sum / (TURNS * SHARES) as f64
    }

    /// Returns the mean of the lobe over a spherical triangle, weighted by solid angle, for a colour factor of 1.
    /// Narrow lobes inside the triangle are not missed.
    pub fn mean_over(&self, vertices: Vertices) -> f64 {
        let mut sum = [0.0; 2];
        self.add_over(vertices, DEEPEST, &mut sum);
        sum[0] / sum[1]
    }

    /// Adds the integral of the lobe over a spherical triangle, and the solid angle of the triangle, to the two entries
    /// of `sum`.
    fn add_over(&self, vertices: Vertices, depth: u32, sum: &mut [f64; 2]) {
        let middle = centroid(vertices).xyz();
        let radius = vertices.iter().map(|&vertex| norm(sub(vertex, middle))).fold(0.0, f64::max);
        let distance = norm(sub(self.centre(), middle));
        let (width, roundness) = self.least_width();
        // Along a long lobe it stays narrow far from its centre.
        let reach = ((distance - radius) * roundness.max(LEAST_ROUNDNESS)).max(width);
        if depth > 0 && radius > COARSE * reach {
            (0..4).for_each(|which| self.add_over(child(vertices, which), depth - 1, sum));
            return;
        }
        let at = |d: Vector| self.shape_at([d[0], d[1], d[2].max(0.0)]);
        let corners: f64 = vertices.iter().map(|&vertex| at(vertex)).sum();
        let area = solid_angle(vertices);
        sum[0] += area * (0.75 * at(middle) + corners / 12.0);
        sum[1] += area;
    }
}
