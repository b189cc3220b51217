//! Midpoint nodes between those around an incoming direction, for curves through six nodes of a triangle.

use super::{NONE, Nodes, Triangles};
use crate::domain::Domain;
use crate::domain::vector::{add, unit};
use crate::evaluate::reconstruct::Cells;
use std::collections::HashMap;

/// Six interpolation nodes with their weights: the three nodes around a direction, then the midpoints between nodes 1
/// and 2, 2 and 3, and 1 and 3.
pub(in crate::evaluate) type Six = ([u32; 6], [f32; 6]);

/// Numbers of sampled incoming directions with interpolation weights that sum to 1.
pub(in crate::evaluate) type Entries = Vec<(usize, f32)>;

/// Sampled incoming directions from which values under a left-out one are predicted (leave-one-out test), with weights
/// for three predictions: a mean, a linear and a quadratic interpolation.
#[derive(Clone, Debug)]
pub(in crate::evaluate) struct Predicting {
    /// Nonnegative weights of sampled incoming directions in a mean that predicts values under a left-out one. The mean
    /// replaces linear and quadratic interpolation where the function is 0 or masked under one of their directions.
    pub(in crate::evaluate) mean: Entries,
    /// Weights of sampled incoming directions for predicting values at the centroid of an incoming triangle as the mean
    /// of the values at its three vertices. Each of these is fitted to the samples around the vertex, without that of
    /// the triangle itself.
    pub(in crate::evaluate) linear: Entries,
    /// Weights of sampled incoming directions in a quadratic fit around a left-out one, which predicts values under it.
    pub(in crate::evaluate) quadratic: Entries,
}

impl Nodes {
    /// Adds interpolation nodes halfway between neighbouring nodes, with values derived from the samples around. Only
    /// incoming triangles have such midpoints. Edges that reach the rim of the domain get none: nothing is extrapolated
    /// there.
    pub(in crate::evaluate) fn add_middles(&mut self) {
        if let Self::Triangles(triangles) = self
            && triangles.lookup.mesh().level() > 0
        {
            triangles.add_middles();
        }
    }

    /// Nodes and weights of a quadratic through six nodes, given the three nodes around a direction and their linear
    /// weights. Along an edge without a midpoint node the curve is linear.
    #[inline]
    pub(in crate::evaluate) fn quadratic(&self, [a, b, c]: [u32; 3], [u, v, w]: [f32; 3]) -> Six {
        let mut six = ([a, b, c, a, a, a], [u, v, w, 0.0, 0.0, 0.0]);
        let Self::Triangles(triangles) = self else { return six };
        let Some(sectors) = triangles.middles.get(a as usize) else { return six };
        let Some(middles) = sectors.iter().find(|[nodes, _]| *nodes == [a, b, c]).map(|[_, middles]| middles) else {
            return six;
        };
        let weights = [u, v, w];
        for (k, (from, to)) in [(0, 1), (1, 2), (0, 2)].into_iter().enumerate() {
            if middles[k] != NONE {
                let product = weights[from] * weights[to];
                (six.0[3 + k], six.1[3 + k]) = (middles[k], 4.0 * product);
                six.1[from] -= 2.0 * product;
                six.1[to] -= 2.0 * product;
            }
        }
        six
    }
}

impl Nodes {
    /// Number of interpolation nodes over incoming directions for linear interpolation: all but the extra nodes halfway
    /// between two others, which only quadratic interpolation uses.
    pub(in crate::evaluate) fn around_count(&self) -> usize {
        match self {
            Self::Triangles(triangles) => triangles.cells + triangles.lookup.vertices(),
            _ => self.counts().0,
        }
    }

    /// Sampled incoming directions, with nonnegative weights, whose mean gives the value of an interpolation node
    /// between them. The mean replaces a least-squares fit where the function is 0 or masked under a direction of the
    /// fit.
    pub(in crate::evaluate) fn mean_sources(&self, node: usize) -> Entries {
        let Self::Triangles(triangles) = self else { return vec![(node, 1.0)] };
        let vertices = triangles.cells + triangles.lookup.vertices();
        match node {
            _ if node < triangles.cells => vec![(node, 1.0)],
            _ if node < vertices => triangles.lookup.ring((node - triangles.cells) as u32).collect(),
            _ => mean(triangles.ends[node - vertices].map(|end| self.mean_sources(end as usize))),
        }
    }

    /// For each incoming triangle, the other triangles that predict it in a leave-one-out test, with weights; `None` at
    /// the rim of the domain. Empty if incoming directions are not triangles.
    pub(in crate::evaluate) fn predicting(&self) -> Vec<Option<Predicting>> {
        let Self::Triangles(triangles) = self else { return Vec::new() };
        let lookup = &triangles.lookup;
        let fits = Cells::new(lookup.mesh(), false);
        let of = |cell: usize| {
            let corners = lookup.corners(cell);
            let around = corners.map(|vertex| {
                let others: Entries = lookup.ring(vertex).filter(|(other, _)| *other != cell).collect();
                let sum: f32 = others.iter().map(|(_, weight)| weight).sum();
                others.into_iter().map(|(other, weight)| (other, weight / sum)).collect()
            });
            let fitted = corners.map(|vertex| {
                let position = triangles.positions[triangles.cells + vertex as usize];
                let fit = fits.value_at(lookup, position, Some(cell));
                fit.into_iter().map(|(other, weight)| (other as usize, weight)).collect()
            });
            Some(Predicting { mean: mean(around), linear: mean(fitted), quadratic: self.others(cell)? })
        };
        (0..triangles.cells).map(of).collect()
    }
}

/// Returns the mean of several lists of weights. Each weight belongs to the number of a sampled incoming direction;
/// weights of equal numbers are added.
fn mean<const COUNT: usize>(all: [Entries; COUNT]) -> Entries {
    let mut sums: Entries = Vec::new();
    for (entry, weight) in all.into_iter().flatten() {
        let share = weight / COUNT as f32;
        match sums.iter_mut().find(|(known, _)| *known == entry) {
            Some((_, sum)) => *sum += share,
            None => sums.push((entry, share)),
        }
    }
    sums
}

impl Triangles {
    fn add_middles(&mut self) {
        let mesh = self.lookup.mesh();
        let fits = Cells::new(mesh, false);
        let is_at_rim = |position: [f64; 3]| mesh.domain() != Domain::Sphere && position[2].abs() < 1e-9;
        let mut known: HashMap<[u32; 2], u32> = HashMap::new();
        for cell in 0..self.cells {
            let sectors = self.fans[cell].sectors.map(|sector| {
                let [a, b, c] = sector.nodes;
                let middles = [[a, b], [b, c], [a, c]].map(|[from, to]| {
                    let ends = [from, to].map(|node| self.positions[node as usize]);
                    if ends.into_iter().any(is_at_rim) {
                        return NONE;
                    }
                    *known.entry([from.min(to), from.max(to)]).or_insert_with(|| {
                        let middle = unit(add(ends[0], ends[1]));
                        let weights = fits.value_at(&self.lookup, middle, None);
                        self.ends.push([from, to]);
                        self.positions.push(middle);
                        self.seen_from.push(middle);
                        self.sources.push(weights.into_iter().map(|(cell, weight)| (cell as usize, weight)).collect());
                        (self.positions.len() - 1) as u32
                    })
                });
                [sector.nodes, middles]
            });
            self.middles.push(sectors);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::vector::Vector;
    use crate::domain::{Direction, TriangleMesh};
    use crate::evaluate::lookup::MeshLookup;
    use std::sync::Arc;

    #[test]
    fn quadratics_are_smooth_between_cells_and_nearer_than_straight_lines() {
        let lookup = Arc::new(MeshLookup::new(TriangleMesh::new(Domain::Hemisphere, 2).unwrap(), false));
        let mut nodes = Nodes::triangles(lookup);
        nodes.add_middles();
        let f = |[x, y, z]: Vector| 1.0 + 0.3 * x - y * y + x * z;
        let value = |node: u32| {
            let sources = nodes.sources(node as usize);
            sources.iter().map(|&(source, w)| f64::from(w) * f(nodes.direction(source))).sum::<f64>()
        };
        let mut errors = [0.0_f64; 2];
        for i in 0..400 {
            let d = Direction::from_degrees(60.0 * f64::from(i % 20) / 19.0, 18.3 * f64::from(i / 20)).xyz();
            let found = |d: Vector| {
                let around = nodes.around(d).unwrap();
                let (six, weights) = nodes.quadratic(around.nodes, around.weights);
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                let linear: f64 = around.nodes.iter().zip(around.weights).map(|(&n, w)| f64::from(w) * value(n)).sum();
                [linear, six.iter().zip(weights).map(|(&node, w)| f64::from(w) * value(node)).sum()]
            };
            let ([linear, curved], [_, beside]) = (found(d), found(unit(add(d, [1e-6, -1e-6, 1e-6]))));
            errors[0] += (linear - f(d)).powi(2);
            errors[1] += (curved - f(d)).powi(2);
            assert!((curved - beside).abs() < 1e-4, "{d:?}");
        }
        assert!(errors[1] < 0.1 * errors[0], "{errors:?}");
    }
}
