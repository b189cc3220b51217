//! Triangles of a mesh on the integer lattice of the octahedron: exact neighbours and symmetries.
//!
//! At level L every vertex is an integer point with |x| + |y| + |z| = 2^L, and the sum of its three vertices identifies
//! a triangle. All arithmetic is exact, so that file formats can depend on it.

use super::triangles::{Domain, TriangleMesh};

/// Point with integer coordinates x, y and z.
type Point = [i32; 3];

/// Largest number of neighbours of a triangle, those that share a vertex: up to six triangles meet at each of its three
/// vertices.
pub(crate) const MOST_NEIGHBOURS: usize = 12;

/// Octants of the upper half of the octahedron, in the order of the mesh: the two coordinate axes that bound each of
/// them in addition to z.
const OCTANTS: [[Point; 2]; 4] =
    [[[1, 0, 0], [0, 1, 0]], [[0, 1, 0], [-1, 0, 0]], [[-1, 0, 0], [0, -1, 0]], [[0, -1, 0], [1, 0, 0]]];

/// Symmetry of the octahedron: a permutation of the coordinates x, y, z with changes of sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Symmetry {
    /// Index of the coordinate that the symmetry copies to each coordinate x, y, z of a mapped point.
    from: [u8; 3],
    /// True for each coordinate x, y, z of a mapped point whose sign the symmetry changes.
    negated: [bool; 3],
}

impl Symmetry {
    /// Identity, which leaves every point unchanged.
    pub const IDENTITY: Self = Self { from: [0, 1, 2], negated: [false; 3] };

    /// Returns the symmetries of a hemisphere or sphere: the 8 that preserve z (all that a hemisphere has), then the
    /// other 40 of the sphere. The order is fixed, with the identity first, because files refer to symmetries by
    /// number.
    pub fn of(domain: Domain) -> Vec<Self> {
        let exchanges = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let all = exchanges.iter().flat_map(|&from| {
            (0..8_u8).map(move |signs| Self { from, negated: [signs & 1 != 0, signs & 2 != 0, signs & 4 != 0] })
        });
        let keeps_z = |s: &Self| s.from[2] == 2 && !s.negated[2];
        let mut ordered: Vec<Self> = all.clone().filter(keeps_z).collect();
        if domain == Domain::Sphere {
            ordered.extend(all.filter(|s| !keeps_z(s)));
        }
        ordered
    }

    /// Maps a point by this symmetry of the octahedron: exchanges its coordinates and changes their signs.
    pub fn apply(self, point: [i32; 3]) -> [i32; 3] {
        std::array::from_fn(|k| {
            let value = point[usize::from(self.from[k])];
            if self.negated[k] { -value } else { value }
        })
    }

    /// Returns the symmetry that applies `other` first, then `self`.
    #[must_use]
    pub fn after(self, other: Self) -> Self {
        let from = self.from.map(|k| other.from[usize::from(k)]);
        let negated = std::array::from_fn(|k| self.negated[k] != other.negated[usize::from(self.from[k])]);
        Self { from, negated }
    }

    /// Returns the index of the image of each triangle of `mesh`; `None` if the symmetry does not map the mesh to
    /// itself.
    pub fn permutation(self, mesh: TriangleMesh) -> Option<Vec<u32>> {
        if !Self::of(mesh.domain()).contains(&self) {
            return None;
        }
        let level = u32::from(mesh.level());
        Some(triangles(mesh).map(|t| index_of(mesh.domain(), level, self.apply(sum(t)))).collect())
    }
}

/// Neighbours of all triangles of a mesh: those that share a vertex with a triangle, without the triangle itself, in
/// ascending order.
#[derive(Clone, Debug)]
pub(crate) struct Neighbours {
    of: Vec<[u32; MOST_NEIGHBOURS]>,
    count: Vec<u8>,
}

impl Neighbours {
    /// Finds the neighbours (triangles that share a vertex) of every triangle of `mesh`.
    pub(crate) fn new(mesh: TriangleMesh) -> Self {
        let size = 1_i32 << mesh.level();
        let side = 2 * size as usize + 1;
        let id = |[x, y, z]: Point| (((x + size) as usize * side) + (y + size) as usize) * 2 + usize::from(z < 0);
        let mut around = vec![([0_u32; 6], 0_u8); side * side * 2];
        for (i, triangle) in (0..).zip(triangles(mesh)) {
            for vertex in triangle {
                let (ring, count) = &mut around[id(vertex)];
                ring[usize::from(*count)] = i;
                *count += 1;
            }
        }
        let mut neighbours = Self { of: Vec::with_capacity(mesh.len()), count: Vec::with_capacity(mesh.len()) };
        for (i, triangle) in (0..).zip(triangles(mesh)) {
            let mut all: Vec<u32> = triangle
                .into_iter()
                .flat_map(|vertex| {
                    let (ring, count) = around[id(vertex)];
                    ring.into_iter().take(usize::from(count))
                })
                .filter(|&other| other != i)
                .collect();
            all.sort_unstable();
            all.dedup();
            let mut padded = [i; MOST_NEIGHBOURS];
            padded[..all.len()].copy_from_slice(&all);
            neighbours.of.push(padded);
            neighbours.count.push(all.len() as u8);
        }
        neighbours
    }

    /// Returns the indices of the triangles that share a vertex with triangle `i`.
    pub(crate) fn around(&self, i: usize) -> &[u32] {
        &self.of[i][..usize::from(self.count[i])]
    }

    /// Returns the indices of the triangles that share a vertex with triangle `i`, padded with `i` to fixed length.
    pub(crate) fn padded(&self, i: usize) -> &[u32; MOST_NEIGHBOURS] {
        &self.of[i]
    }
}

fn sum([a, b, c]: [Point; 3]) -> Point {
    std::array::from_fn(|k| a[k] + b[k] + c[k])
}

fn scaled(point: Point, by: i32) -> Point {
    point.map(|x| x * by)
}

fn middle(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| i32::midpoint(a[k], b[k]))
}

/// Returns the triangles of a mesh, with integer vertices, in index order.
fn triangles(mesh: TriangleMesh) -> impl Iterator<Item = [Point; 3]> {
    let level = u32::from(mesh.level());
    (0..mesh.len()).map(move |index| {
        let size = 1 << level;
        let base = index >> (2 * level);
        let down = mesh.domain() == Domain::Lower || base >= 4;
        let [a, b] = OCTANTS[base % 4];
        let mut triangle = [[0, 0, if down { -size } else { size }], scaled(a, size), scaled(b, size)];
        for depth in (0..level).rev() {
            let [v0, v1, v2] = triangle;
            let (m01, m12, m02) = (middle(v0, v1), middle(v1, v2), middle(v0, v2));
            triangle = match index >> (2 * depth) & 3 {
                0 => [v0, m01, m02],
                1 => [m01, v1, m12],
                2 => [m02, m12, v2],
                _ => [m12, m02, m01],
            };
        }
        triangle
    })
}

/// Returns the index of the triangle whose three integer vertices have the given sum.
fn index_of(domain: Domain, level: u32, [x, y, z]: Point) -> u32 {
    let octant = match (x > 0, y > 0) {
        (true, true) => 0,
        (false, true) => 1,
        (false, false) => 2,
        (true, false) => 3,
    };
    let mut index = if domain == Domain::Sphere && z < 0 { octant + 4 } else { octant };
    let (first, second) = if octant % 2 == 0 { (x, y) } else { (y, x) };
    // Barycentric coordinates; their total stays constant.
    let mut b = [z.abs(), first.abs(), second.abs()];
    let total = b[0] + b[1] + b[2];
    for _ in 0..level {
        let child = b.iter().position(|&part| 2 * part > total).unwrap_or(3);
        b = if child == 3 {
            b.map(|part| total - 2 * part)
        } else {
            std::array::from_fn(|k| if k == child { 2 * b[k] - total } else { 2 * b[k] })
        };
        index = 4 * index + child as u32;
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::vector::dot;

    fn meshes() -> impl Iterator<Item = TriangleMesh> {
        Domain::ALL.iter().flat_map(|&d| (0..=4).map(move |level| TriangleMesh::new(d, level).unwrap()))
    }

    #[test]
    fn a_triangle_is_known_by_the_sum_of_its_vertices() {
        for mesh in meshes() {
            for (i, t) in (0..).zip(triangles(mesh)) {
                assert_eq!(index_of(mesh.domain(), u32::from(mesh.level()), sum(t)), i);
            }
        }
    }

    #[test]
    fn symmetries_are_those_of_the_geometry() {
        for mesh in meshes() {
            let all = Symmetry::of(mesh.domain());
            assert_eq!(all.len(), if mesh.domain() == Domain::Sphere { 48 } else { 8 });
            assert_eq!(all[0], Symmetry::IDENTITY);
            for symmetry in all {
                let permutation = symmetry.permutation(mesh).unwrap();
                for (i, &to) in permutation.iter().enumerate() {
                    let c = mesh.centroid(i).xyz();
                    let image = std::array::from_fn(|k| {
                        let value = c[usize::from(symmetry.from[k])];
                        if symmetry.negated[k] { -value } else { value }
                    });
                    assert!(dot(image, mesh.centroid(to as usize).xyz()) > 1.0 - 1e-12);
                }
            }
        }
    }

    #[test]
    fn symmetries_are_a_group() {
        let all = Symmetry::of(Domain::Sphere);
        for &a in &all {
            assert!(all.iter().any(|&b| a.after(b) == Symmetry::IDENTITY));
            for &b in &all {
                assert!(all.contains(&a.after(b)));
                let point = [3, -1, 2];
                assert_eq!(a.after(b).apply(point), a.apply(b.apply(point)));
            }
        }
        let hemisphere = TriangleMesh::new(Domain::Hemisphere, 1).unwrap();
        assert!(all.iter().filter(|s| s.permutation(hemisphere).is_some()).count() == 8);
    }

    #[test]
    fn neighbours_share_a_vertex_both_ways() {
        for mesh in meshes() {
            let neighbours = Neighbours::new(mesh);
            let vertices = mesh.all_vertices();
            for (i, own) in vertices.iter().enumerate() {
                let around = neighbours.around(i);
                let shares =
                    |other: usize| vertices[other].iter().any(|&v| own.iter().any(|&w| dot(v, w) > 1.0 - 1e-12));
                let expected: Vec<u32> = (0..mesh.len()).filter(|&j| j != i && shares(j)).map(|j| j as u32).collect();
                assert_eq!(around, expected);
            }
        }
    }
}
