//! Quadratic elements on the octahedron: from a direction to six nodes and their weights, without search.
//!
//! Each octant of directions is a triangle with barycentric coordinates g(|x|), g(|y|), g(|z|) divided by their sum.
//! g(x) = x + 0.15 x³ + 0.42 x⁵ approximates the arc of x, so that elements are nearly equal in size. The octant is cut
//! into patches of a regular lattice. Each patch carries a quadratic through its corners and the midpoints of its
//! edges. Neighbouring patches share the nodes of their edge, also across octants, so that the function is continuous.

use crate::domain::vector::{Vector, unit};
use crate::domain::{Domain, TriangleMesh};
use crate::numeric::number::Number;

/// Least subdivision level of a triangle mesh at which interpolation patches (triangles with six nodes) are twice as
/// wide as the mesh's triangles; at coarser levels both are equally wide. Raising it costs memory on fine meshes.
const HALVED_LEVEL: u8 = 6;
/// Height below the horizon at which the lower one of two nodes counts, where sides are apart.
const JUST_BELOW: f64 = 1e-9;
/// Number of nodes of a quadratic interpolation patch: three corners, then the midpoints of the edges 01, 02 and 12.
pub(super) const NODES: usize = 6;

/// Nodes of the quadratic interpolation patch around a direction and their weights, which sum to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub(super) nodes: [u32; NODES],
    pub(super) weights: [f32; NODES],
}

/// Interpolation patches around `N` directions, one direction per SIMD lane.
#[derive(Clone, Debug)]
pub(super) struct Patches<const N: usize> {
    pub(super) nodes: [[u32; N]; NODES],
    pub(super) weights: [[f32; N]; NODES],
    /// Barycentric coordinates of each direction with respect to the corners of the interpolation patch (triangle) that
    /// contains it.
    pub(super) corners: [[f32; N]; 3],
}

impl<const N: usize> Patches<N> {
    pub(super) const NOWHERE: Self =
        Self { nodes: [[0; N]; NODES], weights: [[0.0; N]; NODES], corners: [[0.0; N]; 3] };
}

/// Regular lattice of quadratic interpolation patches over a domain of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Elements {
    domain: Domain,
    /// True if the nodes on the horizon of a sphere belong to one side of it each.
    is_parted: bool,
    /// Number of interpolation patches (triangles with six nodes) along an edge of an octant of the sphere.
    patches: u32,
    octant: u32,
}

impl Elements {
    /// Regular lattice of triangular patches over the directions of `mesh`, for quadratic interpolation in each patch.
    /// Patches are as fine as the mesh's triangles; half as fine from subdivision level [`HALVED_LEVEL`] on. If
    /// `is_parted`, nothing is interpolated across the horizon of a sphere: nodes on it that belong to octants below
    /// count as just below it, and so take the values of that side.
    pub(super) fn new(mesh: TriangleMesh, is_parted: bool) -> Self {
        let level = if mesh.level() < HALVED_LEVEL { mesh.level() } else { mesh.level() - 1 };
        let patches = 1 << level;
        let side = 2 * patches;
        Self { domain: mesh.domain(), is_parted, patches, octant: (side + 1) * (side + 2) / 2 }
    }

    fn octants(self) -> usize {
        if self.domain == Domain::Sphere { 8 } else { 4 }
    }

    /// Number of interpolation nodes; a node on the edge between two octants counts once in each.
    pub(super) fn len(self) -> usize {
        self.octants() * self.octant as usize
    }

    /// Directions of all interpolation nodes, octant by octant.
    pub(super) fn directions(self) -> Vec<Vector> {
        let n = 2 * self.patches;
        let part = |k: u32| f64::from(k) / f64::from(n);
        let octant: Vec<Vector> =
            (0..=n).flat_map(|p| (0..=n - p).map(move |q| direction([p, q, n - p - q].map(part)))).collect();
        (0..self.octants())
            .flat_map(|which| {
                let down = self.domain == Domain::Lower || which >= 4;
                let signs = [which & 1 != 0, which & 2 != 0, down];
                let is_nudged = self.is_parted && which >= 4;
                octant.iter().map(move |d| {
                    // Zero stays unsigned, so that equal nodes are equal bit for bit.
                    let [x, y, z] = [0, 1, 2].map(|k| if signs[k] && d[k] != 0.0 { -d[k] } else { d[k] });
                    [x, y, if is_nudged { z.min(-JUST_BELOW) } else { z }]
                })
            })
            .collect()
    }

    /// Interpolation patch around the direction (x, y, z), which need not be a unit vector. The sign of z matters only
    /// if the domain is the whole sphere.
    pub(super) fn at(self, d: [f32; 3]) -> Patch {
        let mut patches = Patches::<1>::NOWHERE;
        self.write(d, &mut patches, 0);
        Patch { nodes: patches.nodes.map(|[node]| node), weights: patches.weights.map(|[weight]| weight) }
    }

    /// Finds the interpolation patch (triangle with six nodes) around each of one or four directions. Writes the nodes
    /// and their weights into the SIMD lanes of `to` from number `at` on.
    #[inline(always)]
    pub(super) fn write<T: Number, const N: usize>(self, [x, y, z]: [T; 3], to: &mut Patches<N>, at: usize) {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        let size = self.octant as f32;
        let mut base = T::choose(x.less(zero), T::of(size), zero) + T::choose(y.less(zero), T::of(2.0 * size), zero);
        if self.domain == Domain::Sphere {
            base = base + T::choose(z.less(zero), T::of(4.0 * size), zero);
        }
        let n = self.patches as f32;
        let (gx, gy, gz) = (arc(x.size()), arc(y.size()), arc(z.size()));
        let scale = T::of(n * WITHIN) / (gx + gy + gz).larger(T::of(1e-20));
        let (u, v) = (gx * scale, gy * scale);
        let round = T::of(ROUND);
        let half = T::of(0.5);
        let (i, j) = ((u - half + round) - round, (v - half + round) - round);
        let (s, t) = (u - i, v - j);
        let up = (s + t).at_most(one);
        let b0 = T::choose(up, (one - s - t).larger(zero), s + t - one);
        let (b1, b2) = (T::choose(up, s, one - s), T::choose(up, t, one - t));
        // Numbers of nodes are exact in f32: there are fewer than 2²³.
        let (p, q) = (i + i, j + j);
        let rows = T::of(2.0 * n);
        let row0 = base + q + p * (rows + one) - half * (p * p - p);
        let row1 = row0 + rows + one - p;
        let row2 = row1 + rows - p;
        let two = T::of(2.0);
        let nodes = [
            T::choose(up, row0, row2 + two),
            T::choose(up, row2, row0 + two),
            T::choose(up, row0 + two, row2),
            T::choose(up, row1, row1 + two),
            T::choose(up, row0 + one, row2 + one),
            row1 + one,
        ];
        let four = T::of(4.0);
        let weights = [
            b0 * (b0 + b0 - one),
            b1 * (b1 + b1 - one),
            b2 * (b2 + b2 - one),
            four * b0 * b1,
            four * b0 * b2,
            four * b1 * b2,
        ];
        for (to, nodes) in to.nodes.iter_mut().zip(nodes) {
            nodes.write_integer(to, at);
        }
        for (to, weights) in to.weights.iter_mut().zip(weights) {
            weights.write(to, at);
        }
        for (to, corners) in to.corners.iter_mut().zip([b0, b1, b2]) {
            corners.write(to, at);
        }
    }
}

/// Factor just below 1 on the first two barycentric coordinates of a direction in its octant of the sphere. It keeps
/// rounding from raising their sum above 1, which would move the direction out of the octant.
const WITHIN: f32 = 1.0 - 4e-7;
/// 1.5 · 2²³: adding it rounds a small number to an integer in the low bits of the mantissa.
const ROUND: f32 = 12_582_912.0;

#[inline(always)]
fn arc<T: Number>(x: T) -> T {
    let xx = x * x;
    x * (T::of(1.0) + xx * (T::of(0.15) + T::of(0.42) * xx))
}

/// Unit vector (x, y, z) of the first octant for which g(x), g(y), g(z) are proportional to `coordinates`, where g(x) =
/// x + 0.15 x³ + 0.42 x⁵ approximates the arc sine.
fn direction(coordinates: Vector) -> Vector {
    // The sum of squares is convex in the sum of arcs, which is 1.57 on an edge and 1.90 in the centre: Newton's method
    // from above descends to the root.
    let mut sum = 2.0;
    for _ in 0..8 {
        let d = coordinates.map(|a| inverse_arc(a * sum));
        let slope: f64 = d.iter().zip(coordinates).map(|(&x, a)| 2.0 * x * a / arc_slope(x)).sum();
        sum -= (d.iter().map(|x| x * x).sum::<f64>() - 1.0) / slope;
    }
    unit(coordinates.map(|a| inverse_arc(a * sum)))
}

/// Inverse of g(x) = x + 0.15 x³ + 0.42 x⁵, which approximates the arc sine, for x ≥ 0. Because g is convex and at
/// least x, Newton's method from the right descends to the root.
fn inverse_arc(value: f64) -> f64 {
    let mut x = value;
    for _ in 0..7 {
        let xx = x * x;
        x -= (x * (1.0 + xx * (0.15 + 0.42 * xx)) - value) / arc_slope(x);
    }
    x
}

fn arc_slope(x: f64) -> f64 {
    let xx = x * x;
    1.0 + xx * (0.45 + 2.1 * xx)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use wide::f32x4;

    fn meshes() -> impl Iterator<Item = TriangleMesh> {
        Domain::ALL.iter().flat_map(|&domain| (0..=7).map(move |level| TriangleMesh::new(domain, level).unwrap()))
    }

    fn random_in(domain: Domain, random: &mut impl Rng) -> Vector {
        loop {
            let v = [0; 3].map(|_| 2.0 * random.random::<f64>() - 1.0);
            let length = v.iter().map(|x| x * x).sum::<f64>();
            if length > 1e-3 && length < 1.0 {
                let [x, y, z] = unit(v);
                return match domain {
                    Domain::Hemisphere => [x, y, z.abs()],
                    Domain::Lower => [x, y, -z.abs()],
                    Domain::Sphere => [x, y, z],
                };
            }
        }
    }

    #[test]
    fn a_node_is_where_its_weight_is_one() {
        for mesh in meshes().filter(|mesh| mesh.level() < 5) {
            let elements = Elements::new(mesh, false);
            let directions = elements.directions();
            assert_eq!(directions.len(), elements.len());
            for d in &directions {
                let patch = elements.at(d.map(|x| x as f32));
                let (best, weight) = patch.nodes.iter().zip(patch.weights).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
                assert!((weight - 1.0).abs() < 2e-5 * 128.0, "{mesh:?} {d:?} {patch:?}");
                let found = directions[*best as usize];
                assert!(found.iter().zip(d).all(|(a, b)| (a - b).abs() < 1e-6), "{mesh:?} {d:?} {found:?}");
            }
        }
    }

    #[test]
    fn weights_add_up_and_quadratics_come_out_nearly_whole() {
        let mut random = Pcg64Mcg::seed_from_u64(1);
        for mesh in meshes() {
            let elements = Elements::new(mesh, false);
            let directions = elements.directions();
            let f = |[x, y, z]: Vector| 1.0 + x - 2.0 * y + 0.5 * z + x * y - z * z;
            let values: Vec<f64> = directions.iter().map(|&d| f(d)).collect();
            let mut worst = 0.0_f64;
            for _ in 0..2000 {
                let d = random_in(mesh.domain(), &mut random);
                let patch = elements.at(d.map(|x| x as f32));
                assert!((patch.weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                let mut four = Patches::<4>::NOWHERE;
                elements.write(d.map(|x| f32x4::splat(x as f32)), &mut four, 0);
                assert!(four.nodes.iter().zip(patch.nodes).all(|(four, node)| *four == [node; 4]));
                assert!(four.corners.iter().flatten().all(|b| (-1e-6..=1.000_001).contains(b)));
                let found: f64 =
                    patch.nodes.iter().zip(patch.weights).map(|(&n, w)| values[n as usize] * f64::from(w)).sum();
                worst = worst.max((found - f(d)).abs());
            }
            // Error is of third order in the side of a patch.
            let side = std::f64::consts::FRAC_PI_2 / f64::from(elements.patches);
            assert!(worst < 0.8 * side.powi(3) + 1e-5, "{mesh:?}: {worst}");
        }
    }

    #[test]
    fn the_function_is_continuous_over_every_edge() {
        let mut random = Pcg64Mcg::seed_from_u64(2);
        for mesh in meshes().filter(|mesh| mesh.level() < 6) {
            let elements = Elements::new(mesh, false);
            // Arbitrary values at the nodes, equal where nodes coincide.
            let hash = |d: &Vector| (d[0] * 12.9 + d[1] * 78.2 + d[2] * 37.7).sin();
            let values: Vec<f64> = elements.directions().iter().map(hash).collect();
            let value = |d: Vector| {
                let patch = elements.at(d.map(|x| x as f32));
                patch.nodes.iter().zip(patch.weights).map(|(&n, w)| values[n as usize] * f64::from(w)).sum::<f64>()
            };
            for _ in 0..5000 {
                let d = random_in(mesh.domain(), &mut random);
                // Across the planes between octants, where they are near.
                for k in (0..if mesh.domain() == Domain::Sphere { 3 } else { 2 }).filter(|&k| d[k].abs() < 0.9) {
                    let (mut a, mut b) = (d, d);
                    (a[k], b[k]) = (1e-6, -1e-6);
                    assert!((value(unit(a)) - value(unit(b))).abs() < 1e-2, "{mesh:?} {d:?}");
                }
                let step = 1e-5;
                let near = unit([d[0] + step * random.random::<f64>(), d[1], d[2]]);
                assert!((value(d) - value(near)).abs() < 40.0 * f64::from(elements.patches) * step);
            }
        }
    }
}
