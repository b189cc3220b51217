//! Prediction of the children of a triangle from the means of the triangles around it: details of smooth functions
//! become small.
//!
//! Around a node the function is modelled as a quadratic polynomial of tangent-plane coordinates. The mean of the
//! polynomial over the node is exact; its means over the neighbours are fitted by weighted least squares. Its means
//! over the four children are the prediction.
//!
//! A mean is taken over the centroids of the leaves with equal weights, as for the samples. Only square roots and
//! divisions are used, in a fixed order, so that the weights are identical on every machine.

use crate::domain::vector::{Vector, cross, dot, norm, scale, sub, unit};
use crate::domain::{MOST_NEIGHBOURS, Neighbours, TriangleMesh};
use crate::numeric::cholesky::Definite;
use std::cmp::Ordering;

/// Number of unknowns of the quadratic polynomial without its constant, in tangent-plane coordinates u and v: u, v, u²,
/// uv, v².
const TERMS: usize = 5;
/// Smallest number of neighbouring triangles for a quadratic fit; a linear fit needs three.
const FOR_QUADRATIC: usize = 7;
/// Ridge regularisation of the least-squares fit of neighbouring triangles, which keeps one-sided fits at the edge of a
/// hemisphere bounded. Raising it damps all predictions.
const RIDGE: f64 = 1e-4;

/// Weights that predict the means of the four children of every triangle of one level from neighbouring triangles.
#[derive(Clone, Debug)]
pub(crate) struct Prediction {
    neighbours: Neighbours,
    /// Prediction weights per triangle and neighbour: the weight of the difference neighbour − triangle in the means of
    /// corner children 0, 1 and 2, then a 0.
    weights: Vec<[[f32; 4]; MOST_NEIGHBOURS]>,
}

/// Mean position (x, y, z) and mean products of coordinates (xx, xy, xz, yy, yz, zz) over the finest triangles inside a
/// coarser one.
#[derive(Clone, Copy, Default)]
struct Moments {
    first: Vector,
    second: [f64; 6],
}

impl Moments {
    fn of_point(p: Vector) -> Self {
        Self { first: p, second: [p[0] * p[0], p[0] * p[1], p[0] * p[2], p[1] * p[1], p[1] * p[2], p[2] * p[2]] }
    }

    fn mean(four: &[Self]) -> Self {
        let mut mean = Self::default();
        for moments in four {
            mean.first.iter_mut().zip(moments.first).for_each(|(m, x)| *m += 0.25 * x);
            mean.second.iter_mut().zip(moments.second).for_each(|(m, x)| *m += 0.25 * x);
        }
        mean
    }

    /// Returns the mean of (p·a)(p·b) over the centroids p of the finest triangles inside a coarser one, for given
    /// vectors a and b.
    fn product(&self, a: Vector, b: Vector) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.second;
        let row =
            [xx * b[0] + xy * b[1] + xz * b[2], xy * b[0] + yy * b[1] + yz * b[2], xz * b[0] + yz * b[1] + zz * b[2]];
        dot(a, row)
    }

    /// Returns the means, over the finest triangles inside a coarser one, of the terms u, v, u², uv, v² of a
    /// polynomial. u and v are the coordinates of a triangle's position along the vectors a and b.
    fn terms(&self, a: Vector, b: Vector) -> [f64; TERMS] {
        [dot(self.first, a), dot(self.first, b), self.product(a, a), self.product(a, b), self.product(b, b)]
    }
}

impl Prediction {
    /// Computes the prediction weights of the mesh levels 0 to `mesh.level() − 1`, coarsest first.
    pub(crate) fn levels(mesh: TriangleMesh) -> Vec<Self> {
        let mut children: Vec<Moments> = (0..mesh.len()).map(|i| Moments::of_point(mesh.centroid(i).xyz())).collect();
        let mut levels = Vec::new();
        let mut level = mesh.coarser();
        while let Some(here) = level {
            let nodes: Vec<Moments> = children.chunks_exact(4).map(Moments::mean).collect();
            levels.push(Self::at(here, &nodes, &children));
            children = nodes;
            level = here.coarser();
        }
        levels.reverse();
        levels
    }

    fn at(mesh: TriangleMesh, nodes: &[Moments], children: &[Moments]) -> Self {
        let neighbours = Neighbours::new(mesh);
        let weights = (0..mesh.len()).map(|i| {
            let [a, b, c] = weights(i, neighbours.around(i), nodes, children);
            std::array::from_fn(|k| [a[k], b[k], c[k], 0.0])
        });
        Self { weights: weights.collect(), neighbours }
    }

    /// Returns the indices of the triangles around triangle `i`.
    pub(crate) fn around(&self, i: usize) -> &[u32] {
        self.neighbours.around(i)
    }

    /// Predicts the values of the four children of triangle `i`, as deviations from its mean. `means` are the means of
    /// all triangles of its level.
    #[inline]
    pub(crate) fn children(&self, i: usize, means: &[f32]) -> [f32; 4] {
        let own = means[i];
        let mut corners = [0.0_f32; 4];
        for (&n, weights) in self.neighbours.padded(i).iter().zip(&self.weights[i]) {
            let difference = means[n as usize] - own;
            corners.iter_mut().zip(weights).for_each(|(corner, w)| *corner += w * difference);
        }
        [corners[0], corners[1], corners[2], -(corners[0] + corners[1] + corners[2])]
    }
}

/// Computes the prediction weights of triangle `i`; all are 0 if it has too few neighbours for a fit.
fn weights(i: usize, around: &[u32], nodes: &[Moments], children: &[Moments]) -> [[f32; MOST_NEIGHBOURS]; 3] {
    let mut result = [[0.0; MOST_NEIGHBOURS]; 3];
    let terms = if around.len() >= FOR_QUADRATIC {
        TERMS
    } else if around.len() >= 3 {
        2
    } else {
        return result;
    };
    let own = nodes[i];
    let normal = unit(own.first);
    let across = if normal[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let a = unit(cross(normal, across));
    let b = cross(normal, a);
    let distances: Vec<f64> = around.iter().map(|&j| norm(sub(unit(nodes[j as usize].first), normal))).collect();
    let nearest = distances.iter().fold(f64::INFINITY, |m, &d| m.min(d));
    // In units of the distance to the nearest neighbour, all terms have similar magnitudes.
    let (a, b) = (scale(a, 1.0 / nearest), scale(b, 1.0 / nearest));
    let centre = own.terms(a, b);
    let relative = |moments: &Moments| {
        let mut row = moments.terms(a, b);
        row.iter_mut().zip(centre).for_each(|(x, c)| *x -= c);
        row
    };
    let rows: Vec<[f64; TERMS]> = around.iter().map(|&j| relative(&nodes[j as usize])).collect();
    let trusts: Vec<f64> = distances
        .iter()
        .map(|&d| {
            let falling = nearest / (0.15 * nearest + d);
            falling * falling * falling * falling
        })
        .collect();
    let mut normal_matrix = [[0.0; TERMS]; TERMS];
    for (row, trust) in rows.iter().zip(&trusts) {
        for p in 0..terms {
            for q in 0..terms {
                normal_matrix[p][q] += trust * row[p] * row[q];
            }
        }
    }
    let total: f64 = trusts.iter().sum();
    for (p, row) in normal_matrix.iter_mut().enumerate().take(terms) {
        row[p] += RIDGE * total;
    }
    let Some(factor) = Definite::new(&normal_matrix, terms) else { return result };
    for (corner, target) in result.iter_mut().enumerate() {
        // Child mean = ⟨child's terms, A⁻¹ Σ trust · row · difference⟩.
        let solved = factor.solve(relative(&children[4 * i + corner]));
        for ((weight, row), trust) in target.iter_mut().zip(&rows).zip(&trusts) {
            *weight = (trust * (0..terms).map(|p| solved[p] * row[p]).sum::<f64>()) as f32;
        }
    }
    result
}

/// Orthonormal basis of the deviations of two, three or four sibling values from their mean: the Householder reflection
/// that maps (1, …, 1)/√n to the last unit vector, without its last row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Householder {
    siblings: usize,
    /// Value 1/√n of all entries but the last of the Householder vector v, for the reflection that maps (1, …, 1)/√n to
    /// the last unit vector; n is 2, 3 or 4. `beta` is the last entry, and `scale` is 2 / |v|².
    alpha: f32,
    beta: f32,
    scale: f32,
}

impl Householder {
    /// Creates the orthonormal basis of the deviations of two, three or four sibling values (children of one triangle)
    /// from their mean.
    pub(crate) fn new(siblings: usize) -> Self {
        let n = siblings as f64;
        let alpha = 1.0 / n.sqrt();
        let beta = alpha - 1.0;
        Self { siblings, alpha: alpha as f32, beta: beta as f32, scale: (1.0 / (1.0 - alpha)) as f32 }
    }

    /// Returns the number of detail coefficients: one less than the number of siblings.
    pub(crate) fn details(self) -> usize {
        self.siblings - 1
    }

    /// Returns the detail coefficients of two to four sibling values (of the children of one triangle). Adding a
    /// constant to all values does not change them.
    #[inline]
    pub(crate) fn analyse(self, values: &[f32; 4]) -> [f32; 3] {
        let n = self.siblings;
        let mut along = self.beta * values[n - 1];
        for &value in &values[..n - 1] {
            along += self.alpha * value;
        }
        let along = along * self.scale * self.alpha;
        std::array::from_fn(|k| if k < n - 1 { values[k] - along } else { 0.0 })
    }

    /// Returns the deviations of two to four sibling values (of the children of one triangle) from their mean, given
    /// their detail coefficients.
    #[inline]
    pub(crate) fn synthesise(self, details: &[f32; 3]) -> [f32; 4] {
        let n = self.siblings;
        let mut along = 0.0;
        for &detail in &details[..n - 1] {
            along += detail;
        }
        let along = along * self.alpha * self.scale;
        std::array::from_fn(|k| match k.cmp(&(n - 1)) {
            Ordering::Less => details[k] - along * self.alpha,
            Ordering::Equal => -along * self.beta,
            Ordering::Greater => 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Domain;

    #[test]
    fn reflections_are_orthonormal_and_blind_to_the_mean() {
        for n in 2..=4 {
            let basis = Householder::new(n);
            for k in 0..n - 1 {
                let mut unit = [0.0; 3];
                unit[k] = 1.0;
                let values = basis.synthesise(&unit);
                assert!((values.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-6);
                assert!(values.iter().sum::<f32>().abs() < 1e-6);
                let back = basis.analyse(&values.map(|v| v + 7.0));
                for (m, detail) in back.iter().enumerate() {
                    assert!((detail - unit[m]).abs() < 1e-5, "{n} {k}: {back:?}");
                }
            }
        }
    }

    #[test]
    fn quadratics_are_predicted() {
        for domain in [Domain::Sphere, Domain::Hemisphere, Domain::Lower] {
            let mesh = TriangleMesh::new(domain, 5).unwrap();
            let f = |d: Vector| 0.3 + d[0] - 2.0 * d[1] * d[2] + 0.5 * d[2] * d[2] + d[0] * d[1];
            let mut means: Vec<f32> = (0..mesh.len()).map(|i| f(mesh.centroid(i).xyz()) as f32).collect();
            let levels = Prediction::levels(mesh);
            assert_eq!(levels.len(), 5);
            for (level, prediction) in levels.iter().enumerate().rev() {
                let children = means;
                means = children.chunks_exact(4).map(|c| (c[0] + c[1] + c[2] + c[3]) / 4.0).collect();
                let (mut with, mut without) = (0.0_f32, 0.0_f32);
                for (i, c) in children.chunks_exact(4).enumerate() {
                    let predicted = prediction.children(i, &means);
                    assert!(predicted.iter().sum::<f32>().abs() < 1e-5);
                    for (value, p) in c.iter().zip(predicted) {
                        with += (value - means[i] - p).powi(2);
                        without += (value - means[i]).powi(2);
                    }
                }
                if level >= 3 {
                    assert!(with < 0.01 * without, "{domain:?} level {level}: {with} {without}");
                }
            }
        }
    }

    #[test]
    fn constants_have_no_details() {
        let mesh = TriangleMesh::new(Domain::Hemisphere, 3).unwrap();
        for (level, prediction) in Prediction::levels(mesh).iter().enumerate() {
            let means = vec![2.5; 4 << (2 * level)];
            for i in 0..means.len() {
                assert_eq!(prediction.children(i, &means), [0.0, 0.0, 0.0, -0.0]);
            }
        }
    }
}
