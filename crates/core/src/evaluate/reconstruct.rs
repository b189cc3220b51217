//! Reconstructs values at the nodes of elements from averages over cells: local quadratics that have the cells'
//! averages.
//!
//! A quadratic in the tangent plane is fitted around each node to the averages of nearby cells, by weighted least
//! squares. The average of a quadratic over a cell is linear in its coefficients, so that the fit undoes the averaging.

use super::elements::Elements;
use super::lookup::MeshLookup;
use crate::domain::vector::{Vector, add, cross, dot, scale, unit};
use crate::domain::{Neighbours, TriangleMesh};
use crate::numeric::cholesky::Definite;
use rayon::prelude::*;

/// Maximum number of triangles whose averages enter one local least-squares fit. More make fits smoother and slower.
const SEEN: usize = 18;
/// Number of coefficients of a quadratic in two coordinates.
const TERMS: usize = 6;
/// Relative regularisation of a local fit. Raising it prevents wild extrapolation where all triangles lie on one side,
/// and biases the fit; it is small against the data.
const CALM: f64 = 1e-3;

/// Triangles of a mesh, prepared for local quadratic fits to data on them: averages over the triangles, or samples at
/// their centroids.
#[derive(Debug)]
pub(super) struct Cells {
    mesh: TriangleMesh,
    neighbours: Neighbours,
    /// For each triangle, three points such that the mean of any quadratic function over them is its average over the
    /// triangle: the midpoints of the edges. For samples at centroids, the centroid, listed three times.
    points: Vec<[Vector; 3]>,
    vertices: Vec<[Vector; 3]>,
    has_averages: bool,
}

/// Upper bound on Σ|weight| / Σ weight of a quadratic fit to the triangles around a node, if some of these are left out
/// as zero or masked. Beyond the bound the fit extrapolates, which logarithms amplify. Fits to all triangles around
/// have 1.2 to 1.8.
pub(super) const STEEPEST: f32 = 2.0;

/// Tolerance of an inner product within which a direction counts as lying on a triangle's edge.
const ON_EDGE: f64 = 1e-9;

/// Indices of triangles, each with the triangle's weight in a fit.
pub(super) type Weights = Vec<(u32, f32)>;

impl Cells {
    /// Prepares the triangles of `mesh` for fits; `has_averages` is true for averages over triangles, false for
    /// samples at centroids.
    pub(super) fn new(mesh: TriangleMesh, has_averages: bool) -> Self {
        let middle = |a, b| unit(add(a, b));
        let vertices = mesh.all_vertices();
        let of = |&[a, b, c]: &[Vector; 3]| {
            if has_averages { [middle(b, c), middle(a, c), middle(a, b)] } else { [unit(add(a, add(b, c))); 3] }
        };
        let points = vertices.iter().map(of).collect();
        Self { mesh, neighbours: Neighbours::new(mesh), points, vertices, has_averages }
    }

    pub(super) fn mesh(&self) -> TriangleMesh {
        self.mesh
    }

    /// Triangles that contain the direction `d`, inside or on their edges.
    pub(super) fn touching(&self, lookup: &MeshLookup, d: Vector) -> Vec<u32> {
        let home = lookup.locate_vector(d).unwrap_or(0);
        let holds = |cell: u32| {
            let [a, b, c] = self.vertices[cell as usize];
            let turn = dot(a, cross(b, c)).signum();
            [cross(a, b), cross(b, c), cross(c, a)].into_iter().all(|plane| turn * dot(plane, d) > -ON_EDGE)
        };
        let around = self.neighbours.around(home).iter().copied().filter(|&cell| holds(cell) && lookup.sees(cell, d));
        std::iter::once(home as u32).chain(around).collect()
    }

    /// Returns true for averages over triangles, false for samples at centroids.
    pub(super) fn has_averages(&self) -> bool {
        self.has_averages
    }

    pub(super) fn points(&self, cell: usize) -> [Vector; 3] {
        self.points[cell]
    }

    /// Weights of the triangles, other than `left_out`, whose averages give the fitted value at the direction `d`.
    pub(super) fn value_at(&self, lookup: &MeshLookup, d: Vector, left_out: Option<usize>) -> Weights {
        let (near, reach) = self.near(lookup, d, |cell| left_out != Some(cell as usize));
        self.weights(d, &near, reach)
    }

    /// Triangles near the direction `d` that `is_live` accepts, with their distances, nearest first; and the distance
    /// of the first triangle too far away for the fit.
    fn near(&self, lookup: &MeshLookup, d: Vector, is_live: impl Fn(u32) -> bool) -> (Vec<(f64, u32)>, f64) {
        let home = lookup.locate_vector(d).unwrap_or(0);
        let mut cells: Vec<u32> = std::iter::once(home as u32)
            .chain(
                self.neighbours
                    .around(home)
                    .iter()
                    .flat_map(|&j| std::iter::once(j).chain(self.neighbours.around(j as usize).iter().copied())),
            )
            .collect();
        cells.sort_unstable();
        cells.dedup();
        cells.retain(|&cell| is_live(cell) && lookup.sees(cell, d));
        let distance = |cell: u32| {
            let [a, b, c] = self.points[cell as usize];
            let centre = unit(add(a, add(b, c)));
            let apart = add(centre, scale(d, -1.0));
            dot(apart, apart).sqrt()
        };
        let mut near: Vec<(f64, u32)> = cells.into_iter().map(|cell| (distance(cell), cell)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let reach = near.get(SEEN).or(near.last()).map_or(1.0, |&(distance, _)| distance) * (1.0 + 1e-9) + 1e-12;
        near.truncate(SEEN);
        (near, reach)
    }

    /// Weights with which the averages of nearby triangles enter the fitted value at `d`; empty if the fit is singular.
    fn weights(&self, d: Vector, near: &[(f64, u32)], reach: f64) -> Weights {
        let across = if d[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
        let first = unit(cross(across, d));
        let second = cross(d, first);
        let mut rows: Vec<(u32, f64, [f64; TERMS])> = Vec::with_capacity(near.len());
        for &(distance, cell) in near {
            let weight = nearness(distance, reach);
            let mut moments = [0.0; TERMS];
            for point in self.points[cell as usize] {
                let (x, y) = (dot(point, first) / reach, dot(point, second) / reach);
                for (moment, term) in moments.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                    *moment += term / 3.0;
                }
            }
            rows.push((cell, weight, moments));
        }
        let mut normal = [[0.0; TERMS]; TERMS];
        for (_, weight, moments) in &rows {
            for i in 0..TERMS {
                for j in 0..TERMS {
                    normal[i][j] += weight * moments[i] * moments[j];
                }
            }
        }
        let total = normal[0][0];
        for (i, row) in normal.iter_mut().enumerate().skip(1) {
            row[i] += CALM * total * if i < 3 { 1e-3 } else { 0.1 };
        }
        let Some(factor) = Definite::new(&normal, TERMS) else { return Vec::new() };
        // First column of the inverse: the value at `d` is the quadratic's constant.
        let z = factor.solve([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        rows.iter()
            .map(|(cell, weight, moments)| {
                (*cell, (weight * z.iter().zip(moments).map(|(a, b)| a * b).sum::<f64>()) as f32)
            })
            .collect()
    }
}

/// Weight of a triangle in a least-squares fit: it falls with the distance, to nearly 0 at `reach`.
fn nearness(distance: f64, reach: f64) -> f64 {
    let t = distance / reach;
    (1.0 - t * t).max(1e-6).powi(2)
}

/// Weights of a mean of nearby triangles, which stays within the range of their values.
fn mean(near: &[(f64, u32)], reach: f64) -> Weights {
    let sum: f64 = near.iter().map(|&(distance, _)| nearness(distance, reach)).sum();
    near.iter().map(|&(distance, cell)| (cell, (nearness(distance, reach) / sum) as f32)).collect()
}

/// For each interpolation node, weights of the nearby triangles whose values determine the value at the node. Only
/// triangles that `is_live` accepts enter. The weights are those of a quadratic fit, or of a mean if a nearby triangle
/// is rejected and the quadratic would extrapolate.
pub(super) fn node_weights(
    cells: &Cells,
    lookup: &MeshLookup,
    elements: Elements,
    is_live: Option<&(dyn Fn(u32) -> bool + Sync)>,
) -> Vec<Weights> {
    elements
        .directions()
        .par_iter()
        .map(|&d| {
            let (near, reach) = cells.near(lookup, d, |cell| is_live.is_none_or(|live| live(cell)));
            let weights = cells.weights(d, &near, reach);
            let misses = |live: &(dyn Fn(u32) -> bool + Sync)| {
                cells.near(lookup, d, |_| true).0.iter().any(|&(_, cell)| !live(cell))
            };
            let size: f64 = weights.iter().map(|&(_, weight)| f64::from(weight.abs())).sum();
            if size > f64::from(STEEPEST) && is_live.is_some_and(misses) { mean(&near, reach) } else { weights }
        })
        .collect()
}
