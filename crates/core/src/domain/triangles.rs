//! Triangulation of the sphere: an octahedron whose faces are split in four per level, with indices, geometry and
//! sample points.
//!
//! Base octants 0..3 are (z; x, y), (z; y, −x), (z; −x, −y), (z; −y, x); octants 4..7 have −z instead. Triangle (v0,
//! v1, v2) has children 0: (v0, m01, m02), 1: (m01, v1, m12), 2: (m02, m12, v2), 3: (m12, m02, m01), with midpoints
//! projected onto the sphere. Index = base·4^L + c₁·4^(L−1) + … + `c_L`. (Schröder & Sweldens 1995, section 2;
//! \[CPB06\] section 4.1.)

use super::direction::Direction;
use super::limits::MAX_LEVEL;
use super::quantity::named;
use super::vector::{Vector, add, cross, dot, norm, scale, sub, unit};

/// Part of the sphere covered by a mesh of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Domain {
    /// Upper hemisphere, `z ≥ 0`: octants 0 to 3 of the octahedron.
    Hemisphere,
    /// Lower hemisphere, `z ≤ 0`: octants 4 to 7 of the octahedron, numbered from 0.
    Lower,
    /// Whole sphere: octants 0 to 7 of the octahedron.
    Sphere,
}
named!(Domain, "triangle domain", { Hemisphere = "hemisphere", Lower = "lower", Sphere = "sphere" });

/// Mesh of spherical triangles: an octahedron or half of one, subdivided a number of times. Cheap to copy; the geometry
/// is computed on demand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TriangleMesh {
    domain: Domain,
    level: u8,
}

/// Vertices of a spherical triangle, as unit vectors.
pub type Vertices = [Vector; 3];

const POLE_UP: Vector = [0.0, 0.0, 1.0];
const POLE_DOWN: Vector = [0.0, 0.0, -1.0];
const PX: Vector = [1.0, 0.0, 0.0];
const NX: Vector = [-1.0, 0.0, 0.0];
const PY: Vector = [0.0, 1.0, 0.0];
const NY: Vector = [0.0, -1.0, 0.0];
const BASES: [Vertices; 8] = [
    [POLE_UP, PX, PY],
    [POLE_UP, PY, NX],
    [POLE_UP, NX, NY],
    [POLE_UP, NY, PX],
    [POLE_DOWN, PX, PY],
    [POLE_DOWN, PY, NX],
    [POLE_DOWN, NX, NY],
    [POLE_DOWN, NY, PX],
];

impl TriangleMesh {
    /// Creates the triangle mesh of `domain`, subdivided `level` times; `None` above [`MAX_LEVEL`].
    pub fn new(domain: Domain, level: u8) -> Option<Self> {
        (level <= MAX_LEVEL).then_some(Self { domain, level })
    }

    /// Returns the part of the sphere that the mesh covers.
    pub fn domain(self) -> Domain {
        self.domain
    }

    /// Returns the subdivision level of the mesh; each level divides every triangle into four.
    pub fn level(self) -> u8 {
        self.level
    }

    /// Returns the number of triangles before subdivision: 8 on the sphere, 4 on a hemisphere.
    pub fn bases(self) -> usize {
        if self.domain == Domain::Sphere { 8 } else { 4 }
    }

    /// Returns the number of triangles of the mesh, `bases · 4^level`.
    #[allow(clippy::len_without_is_empty, reason = "a mesh is never empty")]
    pub fn len(self) -> usize {
        self.bases() << (2 * u32::from(self.level))
    }

    /// Returns the mesh one subdivision level coarser, whose triangle `i / 4` is the parent of triangle `i`; `None` at
    /// level 0.
    pub fn coarser(self) -> Option<Self> {
        Some(Self { domain: self.domain, level: self.level.checked_sub(1)? })
    }

    fn base_vertices(self, base: usize) -> Vertices {
        BASES[if self.domain == Domain::Lower { base + 4 } else { base }]
    }

    /// Returns the three vertices of triangle `index` of the mesh.
    ///
    /// # Panics
    /// If `index >= len()`.
    pub fn vertices(self, index: usize) -> Vertices {
        let shift = 2 * u32::from(self.level);
        let mut triangle = self.base_vertices(index >> shift);
        for depth in (0..self.level).rev() {
            triangle = child(triangle, (index >> (2 * u32::from(depth))) & 3);
        }
        triangle
    }

    /// Returns the vertices of all triangles of the mesh, in index order.
    pub fn all_vertices(self) -> Vec<Vertices> {
        let mut triangles: Vec<Vertices> = (0..self.bases()).map(|base| self.base_vertices(base)).collect();
        for _ in 0..self.level {
            triangles = triangles.into_iter().flat_map(|t| (0..4).map(move |c| child(t, c))).collect();
        }
        triangles
    }

    /// Returns the centroid of triangle `index`: the normalised mean of its vertices.
    pub fn centroid(self, index: usize) -> Direction {
        centroid(self.vertices(index))
    }

    /// Returns the solid angle of triangle `index` of the mesh in sr.
    pub fn solid_angle(self, index: usize) -> f64 {
        solid_angle(self.vertices(index))
    }

    /// Returns the solid angles of all triangles of the mesh in sr, in index order.
    pub fn solid_angles(self) -> Vec<f64> {
        self.all_vertices().into_iter().map(solid_angle).collect()
    }

    /// Returns the integral of |cos θ| over triangle `index` in sr, in closed form.
    pub fn projected_solid_angle(self, index: usize) -> f64 {
        projected_solid_angle(self.vertices(index))
    }

    /// Returns the index of the triangle that contains `direction`; `None` outside the mesh. A direction on an edge
    /// belongs to exactly one triangle.
    pub fn locate(self, direction: Direction) -> Option<usize> {
        let d = direction.xyz();
        let outside = match self.domain {
            Domain::Hemisphere => d[2] < 0.0,
            Domain::Lower => d[2] > 0.0,
            Domain::Sphere => false,
        };
        if outside {
            return None;
        }
        let quadrant = match (d[0], d[1]) {
            (x, y) if x > 0.0 && y >= 0.0 => 0,
            (x, y) if x <= 0.0 && y > 0.0 => 1,
            (x, y) if x < 0.0 && y <= 0.0 => 2,
            (x, y) if x >= 0.0 && y < 0.0 => 3,
            _ => 0,
        };
        let base = if self.domain == Domain::Sphere && d[2] < 0.0 { quadrant + 4 } else { quadrant };
        let mut triangle = self.base_vertices(base);
        let mut index = base;
        for _ in 0..self.level {
            let c = child_holding(triangle, d);
            triangle = child(triangle, c);
            index = 4 * index + c;
        }
        Some(index)
    }

    /// Maps `(u, v)` of the unit square to a point of triangle `index`, uniformly in solid angle (Arvo 1995,
    /// *Stratified sampling of spherical triangles*).
    pub fn uniform_point(self, index: usize, u: f64, v: f64) -> Direction {
        uniform_point(self.vertices(index), u, v)
    }
}

fn midpoint(a: Vector, b: Vector) -> Vector {
    unit(add(a, b))
}

/// Returns child number `which` of a triangle divided into four: 0 to 2 are the corner triangles, 3 is the central one.
pub fn child([v0, v1, v2]: Vertices, which: usize) -> Vertices {
    let (m01, m12, m02) = (midpoint(v0, v1), midpoint(v1, v2), midpoint(v0, v2));
    match which {
        0 => [v0, m01, m02],
        1 => [m01, v1, m12],
        2 => [m02, m12, v2],
        _ => [m12, m02, m01],
    }
}

/// Returns the number of the child triangle that contains `d`, which lies in the parent. It is a corner child if `d` is
/// strictly beyond the edge that separates it from the centre.
fn child_holding([v0, v1, v2]: Vertices, d: Vector) -> usize {
    let (m01, m12, m02) = (midpoint(v0, v1), midpoint(v1, v2), midpoint(v0, v2));
    let beyond = |a: Vector, b: Vector, corner: Vector| {
        let plane = cross(a, b);
        dot(plane, d) * dot(plane, corner) > 0.0
    };
    if beyond(m01, m02, v0) {
        0
    } else if beyond(m12, m01, v1) {
        1
    } else if beyond(m02, m12, v2) {
        2
    } else {
        3
    }
}

/// Returns the centroid of a spherical triangle: the normalised mean of its vertices.
pub fn centroid([a, b, c]: Vertices) -> Direction {
    Direction::from_unit(unit(add(add(a, b), c)))
}

/// Returns the solid angle of a spherical triangle in sr (Van Oosterom & Strackee 1983, equation 8).
pub fn solid_angle([a, b, c]: Vertices) -> f64 {
    let triple = dot(a, cross(b, c)).abs();
    2.0 * libm::atan2(triple, 1.0 + dot(a, b) + dot(b, c) + dot(c, a))
}

/// Returns the integral of |cos θ| over a spherical triangle in sr, by Lambert's formula: half the sum over the edges
/// of edge angle times z component of the edge plane's normal.
pub(crate) fn projected_solid_angle(vertices: Vertices) -> f64 {
    let mut sum = 0.0;
    for k in 0..3 {
        let (a, b) = (vertices[k], vertices[(k + 1) % 3]);
        let normal = cross(a, b);
        let length = norm(normal);
        sum += libm::atan2(length, dot(a, b)) * normal[2] / length;
    }
    (0.5 * sum).abs()
}

fn uniform_point([a, b, c]: Vertices, u: f64, v: f64) -> Direction {
    // The dihedral angle at each vertex, between the planes of its two edges.
    let angle_at = |p: Vector, q: Vector, r: Vector| {
        let (n1, n2) = (cross(p, q), cross(p, r));
        libm::atan2(norm(cross(n1, n2)), dot(n1, n2))
    };
    let alpha = angle_at(a, b, c);
    let area = solid_angle([a, b, c]);
    // The sub-triangle (a, b, c') with area u·area fixes c' on the edge a–c.
    let (sin_alpha, cos_alpha) = libm::sincos(alpha);
    let (s, t) = libm::sincos(u * area - alpha);
    let cos_c = dot(a, b);
    let (p, q) = (t - cos_alpha, s + sin_alpha * cos_c);
    let numerator = (q * t - p * s) * cos_alpha - q;
    let denominator = (q * s + p * t) * sin_alpha;
    let cos_b = if denominator == 0.0 { 1.0 } else { (numerator / denominator).clamp(-1.0, 1.0) };
    let toward_c = unit(sub(c, scale(a, dot(a, c))));
    let c_new = add(scale(a, cos_b), scale(toward_c, libm::sqrt((1.0 - cos_b * cos_b).max(0.0))));
    // A point on the arc b–c', uniform in the height above b.
    let z = 1.0 - v * (1.0 - dot(c_new, b));
    let off_b = sub(c_new, scale(b, dot(c_new, b)));
    let length = norm(off_b);
    if length < 1e-15 {
        return Direction::from_unit(b);
    }
    let sin = libm::sqrt((1.0 - z * z).max(0.0));
    Direction::from_unit(unit(add(scale(b, z), scale(off_b, sin / length))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn mesh(domain: Domain, level: u8) -> TriangleMesh {
        TriangleMesh::new(domain, level).unwrap()
    }

    fn all_meshes() -> impl Iterator<Item = TriangleMesh> {
        Domain::ALL.iter().flat_map(|&domain| (0..=5).map(move |level| mesh(domain, level)))
    }

    /// Returns a low-discrepancy sequence on the unit square.
    fn square_points(n: usize) -> impl Iterator<Item = (f64, f64)> {
        (0..n).map(|i| ((0.5 + i as f64 * 0.754_877_666_246_693) % 1.0, (0.5 + i as f64 * 0.569_840_290_998_053) % 1.0))
    }

    #[test]
    fn levels_stop_at_the_limit() {
        assert!(TriangleMesh::new(Domain::Sphere, 8).is_some());
        assert!(TriangleMesh::new(Domain::Sphere, 9).is_none());
        assert_eq!(mesh(Domain::Sphere, 4).len(), 2048);
        assert_eq!(mesh(Domain::Hemisphere, 4).len(), 1024);
    }

    #[test]
    fn solid_angles_fill_the_domain() {
        for m in all_meshes() {
            let full = if m.domain() == Domain::Sphere { 4.0 * PI } else { 2.0 * PI };
            let total: f64 = m.solid_angles().iter().sum();
            assert!((total - full).abs() < 1e-10, "{m:?}: {total}");
            let projected: f64 = (0..m.len()).map(|i| m.projected_solid_angle(i)).sum();
            let expected = if m.domain() == Domain::Sphere { 2.0 * PI } else { PI };
            assert!((projected - expected).abs() < 1e-10, "{m:?}: {projected}");
        }
    }

    #[test]
    fn every_centroid_is_in_its_own_triangle() {
        for m in all_meshes() {
            for i in 0..m.len() {
                assert_eq!(m.locate(m.centroid(i)), Some(i), "{m:?}");
            }
        }
        let fine = mesh(Domain::Sphere, 8);
        for i in (0..fine.len()).step_by(997) {
            assert_eq!(fine.locate(fine.centroid(i)), Some(i));
        }
    }

    #[test]
    fn children_refine_their_parent() {
        for m in all_meshes().filter(|m| m.level() > 0) {
            let parent = m.coarser().unwrap();
            for i in (0..m.len()).step_by(7) {
                assert_eq!(parent.locate(m.centroid(i)), Some(i / 4));
            }
        }
    }

    #[test]
    fn uniform_points_stay_inside_and_are_uniform() {
        for m in [mesh(Domain::Sphere, 0), mesh(Domain::Hemisphere, 1), mesh(Domain::Lower, 3)] {
            let finer = mesh(m.domain(), m.level() + 1);
            for i in (0..m.len()).step_by(5) {
                let mut counts = [0.0; 4];
                let n = 4000;
                for (u, v) in square_points(n) {
                    let point = m.uniform_point(i, u, v);
                    let inside = finer.locate(point).unwrap();
                    assert_eq!(inside / 4, i);
                    counts[inside % 4] += 1.0;
                }
                for (c, count) in counts.iter().enumerate() {
                    let expected = n as f64 * finer.solid_angle(4 * i + c) / m.solid_angle(i);
                    assert!((count - expected).abs() < 0.03 * expected, "{m:?} {i}: {count} vs {expected}");
                }
            }
        }
    }

    #[test]
    fn uniform_points_reach_the_corners_of_the_square() {
        let m = mesh(Domain::Sphere, 4);
        for i in (0..m.len()).step_by(31) {
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.0)] {
                let p = m.uniform_point(i, u, v);
                assert!((p.dot(p) - 1.0).abs() < 1e-12 && p.dot(m.centroid(i)) > 0.99);
            }
        }
    }

    #[test]
    fn edges_poles_and_the_horizon_belong_to_one_triangle() {
        let up = mesh(Domain::Hemisphere, 4);
        let down = mesh(Domain::Lower, 4);
        for phi in 0..360 {
            let horizon = Direction::from_degrees(90.0, f64::from(phi));
            assert!(up.locate(horizon).is_some() && down.locate(horizon).is_some());
        }
        assert!(up.locate(Direction::from_degrees(0.0, 0.0)).is_some());
        assert_eq!(up.locate(Direction::from_degrees(91.0, 0.0)), None);
        assert_eq!(down.locate(Direction::from_degrees(89.0, 0.0)), None);
    }

    #[test]
    fn the_order_is_that_of_the_design() {
        // Child 0 of a base contains the pole, child 3 is the central one.
        let m = mesh(Domain::Hemisphere, 1);
        assert_eq!(m.vertices(0)[0], [0.0, 0.0, 1.0]);
        let centre = m.centroid(3).xyz();
        assert!((centre[0] - centre[1]).abs() < 1e-15 && (centre[1] - centre[2]).abs() < 1e-15);
        assert_eq!(mesh(Domain::Lower, 0).vertices(0)[0], [0.0, 0.0, -1.0]);
    }
}
