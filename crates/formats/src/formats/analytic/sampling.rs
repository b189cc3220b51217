//! Evaluation of lobes on axes: cell averages by quadrature, values at centroids, values at the angles of a goniometer.

use super::lobes::Lobe;
use crate::domain::vector::Vector;
use crate::domain::{Axis, Direction, TriangleMesh, Vertices, centroid, child, solid_angle};
use crate::formats::{Angles, AzimuthExtent, Azimuths};
use rayon::prelude::*;

/// Quadrature points for each entry of an axis of directions. Every entry has an equal number of points, with weights
/// that sum to 1.
pub(super) struct Entries {
    points: usize,
    directions: Vec<(Vector, f64)>,
}

/// Upper bound on the number of values of a scattering model that one parallel task computes at a time. Raising it
/// makes fewer and longer tasks.
const BLOCK: usize = 1 << 12;

impl Entries {
    /// Returns the quadrature points for a measurement without an axis of directions: a single one, straight up.
    pub(super) fn none() -> Self {
        Self { points: 1, directions: vec![([0.0, 0.0, 1.0], 1.0)] }
    }

    /// Returns one point per triangle of a mesh: its centroid.
    pub(super) fn centroids(mesh: TriangleMesh) -> Self {
        let directions = (0..mesh.len()).map(|i| (mesh.centroid(i).xyz(), 1.0)).collect();
        Self { points: 1, directions }
    }

    /// Returns the quadrature points for averages over the triangles of a mesh: each triangle is subdivided at least
    /// once, and at least to level 3.
    pub(super) fn averages(mesh: TriangleMesh) -> Self {
        let depth = 3_u8.saturating_sub(mesh.level()).max(1);
        let points = 1_usize << (2 * u32::from(depth));
        let mut directions = Vec::with_capacity(points * mesh.len());
        let mut parts: Vec<Vertices> = Vec::with_capacity(points);
        for vertices in mesh.all_vertices() {
            parts.clear();
            parts.push(vertices);
            for _ in 0..depth {
                parts = parts.iter().flat_map(|&part| (0..4).map(move |k| child(part, k))).collect();
            }
            let areas: Vec<f64> = parts.iter().map(|&part| solid_angle(part)).collect();
            let total: f64 = areas.iter().sum();
            directions.extend(parts.iter().zip(areas).map(|(&part, area)| (centroid(part).xyz(), area / total)));
        }
        Self { points, directions }
    }

    /// Returns one quadrature point for each polar angle in `thetas` (degrees): the direction at azimuth 0.
    pub(super) fn elevations(thetas: &[f64]) -> Self {
        let directions = thetas.iter().map(|&theta| (Direction::from_degrees(theta, 0.0).xyz(), 1.0)).collect();
        Self { points: 1, directions }
    }

    /// Returns one point per pair of a polar angle and an azimuth, the polar angle varying slowest; azimuth 0 if the
    /// grid has none.
    pub(super) fn angles(angles: &Angles) -> Self {
        let zero = Azimuths { phi: vec![0.0], extent: AzimuthExtent::Circle };
        let azimuths = &angles.phi.as_ref().unwrap_or(&zero).phi;
        let direction = |theta: f64, phi: f64| (Direction::from_degrees(theta, phi).xyz(), 1.0);
        let directions =
            angles.theta.iter().flat_map(|&theta| azimuths.iter().map(move |&phi| direction(theta, phi))).collect();
        Self { points: 1, directions }
    }

    /// Returns the number of entries of the measurement's axis of directions.
    pub(super) fn len(&self) -> usize {
        self.directions.len() / self.points
    }

    /// Returns the number of quadrature points per entry of the measurement's axis of directions.
    pub(super) fn points(&self) -> usize {
        self.points
    }

    fn at(&self, entry: usize) -> &[(Vector, f64)] {
        &self.directions[entry * self.points..][..self.points]
    }
}

/// Returns the quadrature points of an axis of directions: for averages over its triangles or for point values; `None`
/// for an axis without directions.
pub(super) fn entries(axis: &Axis, average: bool) -> Option<Entries> {
    match axis {
        Axis::Triangles(mesh) if average => Some(Entries::averages(*mesh)),
        Axis::Triangles(mesh) => Some(Entries::centroids(*mesh)),
        Axis::Elevation(thetas) => Some(Entries::elevations(thetas)),
        _ => None,
    }
}

/// Evaluates the lobes of a model; returns values `[incoming, outgoing, lambda]`, row-major.
pub(super) fn evaluate(lobes: &[Lobe], incoming: &Entries, outgoing: &Entries, lambdas: usize) -> Vec<f32> {
    let outgoing_len = outgoing.len();
    let mut values = vec![0.0_f32; incoming.len() * outgoing_len * lambdas];
    let rows = (BLOCK / lambdas).max(1);
    values.par_chunks_mut(rows * lambdas).enumerate().for_each_init(
        || vec![0.0_f64; lambdas],
        |sums, (block, rows_out)| {
            for (i, row) in rows_out.chunks_mut(lambdas).enumerate() {
                let pair = block * rows + i;
                sums.fill(0.0);
                for lobe in lobes {
                    add(lobe, incoming.at(pair / outgoing_len), outgoing.at(pair % outgoing_len), sums);
                }
                row.iter_mut().zip(&*sums).for_each(|(value, &sum)| *value = sum as f32);
            }
        },
    );
    values
}

fn add(lobe: &Lobe, incoming: &[(Vector, f64)], outgoing: &[(Vector, f64)], sums: &mut [f64]) {
    let mut flat = 0.0;
    for &(wi, wi_weight) in incoming {
        for &(wo, wo_weight) in outgoing {
            let (value, cosine) = lobe.shape.at(wi, wo);
            let value = value * wi_weight * wo_weight;
            match &lobe.interface {
                None => flat += value,
                Some(_) if value == 0.0 => {}
                Some(interface) => {
                    for (lambda, (sum, weight)) in sums.iter_mut().zip(&lobe.weight).enumerate() {
                        *sum += value * weight * interface.reflectance(lambda, cosine);
                    }
                }
            }
        }
    }
    if lobe.interface.is_none() {
        sums.iter_mut().zip(&lobe.weight).for_each(|(sum, weight)| *sum += flat * weight);
    }
}
