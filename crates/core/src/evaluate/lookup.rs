//! From a direction to the entries of an axis and their weights: tables of a mesh, without search or allocation.

use super::grid::{Grid, Place};
use crate::domain::vector::{Vector, cross, dot};
use crate::domain::{Direction, Domain, TriangleMesh};
use crate::numeric::bracket::Bracket;
use std::hint::select_unpredictable;

/// Maximum number of samples that contribute to an interpolated value: three vertices with at most 6 triangles each.
const MOST: usize = 18;

/// Numbers of the samples of an axis that contribute to an interpolated value, with weights that are positive and sum
/// to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stencil {
    length: usize,
    entries: [(u32, f32); MOST],
}

impl Stencil {
    pub(super) fn one(entry: usize) -> Self {
        let mut stencil = Self { length: 1, entries: [(0, 0.0); MOST] };
        stencil.entries[0] = (entry as u32, 1.0);
        stencil
    }

    fn empty() -> Self {
        Self { length: 0, entries: [(0, 0.0); MOST] }
    }

    /// Samples whose weighted sum is the interpolated value at a direction, each as its number on the axis of
    /// directions and its weight.
    pub(super) fn entries(&self) -> impl Iterator<Item = (usize, f32)> + Clone + '_ {
        self.entries[..self.length].iter().map(|&(entry, weight)| (entry as usize, weight))
    }

    fn add(&mut self, entry: u32, weight: f32) {
        if let Some(known) = self.entries[..self.length].iter_mut().find(|known| known.0 == entry) {
            known.1 += weight;
        } else {
            self.entries[self.length] = (entry, weight);
            self.length += 1;
        }
    }
}

/// Lookup tables of a triangle mesh of directions. All octants of the octahedron are images of the first one under
/// exchanges and sign changes of coordinates. Geometry is therefore stored for one octant, and directions are mapped
/// into it.
#[derive(Debug)]
pub(super) struct MeshLookup {
    mesh: TriangleMesh,
    /// Sign of z in the mesh's domain: 1 on the upper hemisphere, −1 on the lower one, 0 on the sphere.
    up: f64,
    /// Number of the first octant below the horizon on a sphere, else 0.
    below: u32,
    /// True for a sphere of which the triangles on either side of the horizon share no vertices.
    is_parted: bool,
    /// Binary logarithm of the number of leaf triangles in an octant.
    shift: u32,
    /// For each triangle that is subdivided, coarsest level first: normals of the three planes that cut off the
    /// children at its corners, each pointing to the corner's side.
    cuts: Vec<Vector>,
    /// For each leaf triangle of the first octant: three vectors whose inner products with a direction are proportional
    /// to its barycentric coordinates.
    opposite: Vec<[Vector; 3]>,
    /// Vertex numbers of every triangle of the mesh.
    corners: Vec<[u32; 3]>,
    /// For each vertex, the position in the list `around` at which its triangles start; then the length of that list.
    starts: Vec<u32>,
    /// Numbers of the triangles around each vertex, with each triangle's fraction of the solid angle around that
    /// vertex.
    around: Vec<(u32, f32)>,
    grid: Grid,
}

impl MeshLookup {
    /// Prepares the tables of a mesh. If `is_parted`, each side of the horizon of a sphere has vertices of its own, so
    /// that nothing is interpolated across it.
    pub(super) fn new(mesh: TriangleMesh, is_parted: bool) -> Self {
        let is_parted = is_parted && mesh.domain() == Domain::Sphere;
        let mut cuts = Vec::new();
        for level in 0..mesh.level() {
            // The centre child of a node has the midpoints of its edges as vertices: (m12, m02, m01).
            for node in octant(level).zip(octant(level + 1).skip(3).step_by(4)) {
                let ([v0, v1, v2], [m12, m02, m01]) = node;
                cuts.extend([cut(m01, m02, v0), cut(m12, m01, v1), cut(m02, m12, v2)]);
            }
        }
        if cuts.is_empty() {
            // A place with a single leaf still refers to a plane.
            cuts.push([0.0; 3]);
        }
        let opposite = octant(mesh.level()).map(|[a, b, c]| [cut(b, c, a), cut(c, a, b), cut(a, b, c)]).collect();
        let (corners, vertices) = corners(mesh, is_parted);
        let (starts, around) = rings(&corners, vertices, &mesh.solid_angles());
        let grid = Grid::new(mesh.level(), &cuts);
        let (up, below) = match mesh.domain() {
            Domain::Hemisphere => (1.0, 0),
            Domain::Lower => (-1.0, 0),
            Domain::Sphere => (0.0, 4),
        };
        let shift = 2 * u32::from(mesh.level());
        Self { mesh, up, below, is_parted, shift, cuts, opposite, corners, starts, around, grid }
    }

    pub(super) fn mesh(&self) -> TriangleMesh {
        self.mesh
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.cuts)
            + size_of_val(&*self.opposite)
            + size_of_val(&*self.corners)
            + size_of_val(&*self.starts)
            + size_of_val(&*self.around)
            + self.grid.memory()
    }

    /// Number of the triangle that contains `direction`; `None` outside the domain of the mesh.
    #[inline(always)]
    pub(super) fn locate(&self, direction: Direction) -> Option<usize> {
        self.locate_vector(direction.xyz())
    }

    /// Number of the triangle that contains the unit vector `d`; `None` outside the domain of the mesh.
    #[inline(always)]
    pub(super) fn locate_vector(&self, d: Vector) -> Option<usize> {
        self.descend(d).map(|(triangle, _)| triangle)
    }

    /// Returns true if nothing is interpolated across the horizon, at which the mesh ends or is parted.
    pub(super) fn ends_at_horizon(&self) -> bool {
        self.is_parted || self.up != 0.0
    }

    /// Returns true if values of a triangle may count at a direction: not across the horizon of a parted mesh.
    pub(super) fn sees(&self, triangle: u32, [_, _, z]: Vector) -> bool {
        !self.is_parted || (triangle >= self.below << self.shift) == (z < 0.0)
    }

    /// Returns true if the two sides of the horizon of a sphere are apart.
    pub(super) fn is_parted(&self) -> bool {
        self.is_parted
    }

    /// Returns true if the unit vector `d` is in the domain of the mesh.
    #[inline(always)]
    pub(super) fn holds(&self, [_, _, z]: Vector) -> bool {
        z * self.up >= 0.0
    }

    /// Number of vertices of the mesh.
    pub(super) fn vertices(&self) -> usize {
        self.starts.len() - 1
    }

    /// Vertex numbers of one triangle.
    #[inline]
    pub(super) fn corners(&self, triangle: usize) -> [u32; 3] {
        self.corners[triangle]
    }

    /// Vertex numbers of all triangles of the mesh.
    pub(super) fn all_corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// Numbers of the triangles around a vertex, with each triangle's fraction of the solid angle around that vertex.
    pub(super) fn ring(&self, vertex: u32) -> impl Iterator<Item = (usize, f32)> + '_ {
        let ring = self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize;
        self.around[ring].iter().map(|&(triangle, weight)| (triangle as usize, weight))
    }

    /// Triangles and weights that give the smoothly interpolated value at `direction`; `None` outside the domain.
    pub(super) fn stencil(&self, direction: Direction) -> Option<Stencil> {
        let (triangle, folded) = self.descend(direction.xyz())?;
        let opposite = &self.opposite[triangle % self.opposite.len()];
        let coordinates = opposite.map(|plane| dot(plane, folded).max(0.0));
        let total = coordinates[0] + coordinates[1] + coordinates[2];
        let mut stencil = Stencil::empty();
        for (&vertex, coordinate) in self.corners[triangle].iter().zip(coordinates) {
            let share = (coordinate / total) as f32;
            if share > 0.0 {
                let ring = self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize;
                for &(neighbour, weight) in &self.around[ring] {
                    stencil.add(neighbour, share * weight);
                }
            }
        }
        Some(stencil)
    }

    /// Number of the triangle that contains a unit vector, and the vector mapped into the first octant; `None` outside
    /// the domain.
    #[inline(always)]
    pub(super) fn descend(&self, [x, y, z]: Vector) -> Option<(usize, Vector)> {
        if !self.holds([x, y, z]) {
            return None;
        }
        // Uses sign bits without branches, as the octant is unpredictable. On an edge between two octants it may be
        // either.
        let [left, back, down] = [x, y, z].map(|c| (c.to_bits() >> 63) as u32);
        let is_odd = left ^ back;
        let sides = [x.abs(), y.abs(), z.abs()];
        let folded = [sides[is_odd as usize], sides[is_odd as usize ^ 1], sides[2]];
        // Exchanges the column and the plane instead of the vector, so that they do not wait for it.
        let [i, j, k] = self.grid.cube(sides);
        let column = if is_odd != 0 { self.grid.column(j, i) } else { self.grid.column(i, j) };
        let place = self.grid.place(column, k);
        let leaf = if let Some(root) = place.root() {
            self.leaf_below(root, folded)
        } else {
            let plane = &self.cuts[usize::from(place.plane)];
            let exchanged = [plane[is_odd as usize], plane[is_odd as usize ^ 1], plane[2]];
            usize::from(select_unpredictable(dot(exchanged, sides) > 0.0, place.inside, place.outside))
        };
        Some((self.triangle(is_odd + 2 * back, down) as usize + leaf, folded))
    }

    /// Grid of cubes over the first octant that gives the candidate triangles of a direction.
    pub(super) fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Number of the first leaf triangle of an octant, given by its quadrant of azimuth and its side of the horizon
    /// (`down` is 1 below).
    #[inline(always)]
    pub(super) fn triangle(&self, quadrant: u32, down: u32) -> u32 {
        (quadrant + self.below * down) << self.shift
    }

    /// Number of the leaf triangle that contains the direction `folded`, a vector of any length that exchanges and sign
    /// changes of coordinates have mapped into the first octant. Only the candidates in `place`, found by the search
    /// grid, are considered.
    #[inline(always)]
    pub(super) fn leaf_at(&self, place: Place, folded: Vector) -> usize {
        if let Some(root) = place.root() {
            return self.leaf_below(root, folded);
        }
        let beyond = dot(self.cuts[usize::from(place.plane)], folded) > 0.0;
        usize::from(select_unpredictable(beyond, place.inside, place.outside))
    }

    /// Number of the leaf triangle that contains the direction `folded` of the first octant, by a search down from an
    /// ancestor triangle of a given level.
    #[cold]
    fn leaf_below(&self, (mut node, level): (usize, u8), folded: Vector) -> usize {
        let mut width = 1 << (2 * u32::from(level));
        let mut offset = (width - 1) / 3;
        for _ in level..self.mesh.level() {
            // All three planes without branches, as the corner is unpredictable.
            let planes = &self.cuts[3 * (offset + node)..][..3];
            let [beyond0, beyond1, beyond2] = [0, 1, 2].map(|k| dot(planes[k], folded) > 0.0);
            let mut child = if beyond2 { 2 } else { 3 };
            child = if beyond1 { 1 } else { child };
            child = if beyond0 { 0 } else { child };
            node = 4 * node + child;
            offset += width;
            width *= 4;
        }
        node
    }
}

/// Sampled elevations around `theta` (degrees) with linear interpolation weights; the end's elevation alone beyond the
/// ends of the axis.
pub(super) fn elevation_stencil(values: &[f64], theta: f64) -> Stencil {
    let Bracket { below, t, .. } = Bracket::held(values, theta);
    let mut stencil = Stencil::one(below);
    if t > 0.0 {
        stencil.entries[0].1 = (1.0 - t) as f32;
        stencil.add(below as u32 + 1, t as f32);
    }
    stencil
}

/// Vertices of the leaf triangles of the first octant; triangles below the horizon are their mirror images.
pub(super) fn octant(level: u8) -> impl Iterator<Item = [Vector; 3]> {
    let mesh = TriangleMesh::new(Domain::Hemisphere, level);
    mesh.into_iter().flat_map(move |mesh| (0..1_usize << (2 * u32::from(level))).map(move |i| mesh.vertices(i)))
}

/// Normal, not of unit length, of the plane through `a`, `b` and the origin; it points to the side of the plane on
/// which `corner` lies.
fn cut(a: Vector, b: Vector, corner: Vector) -> Vector {
    let plane = cross(a, b);
    if dot(plane, corner) < 0.0 { plane.map(|x| -x) } else { plane }
}

/// Vertex numbers of every triangle, and the number of vertices; if `is_parted`, those on the horizon have a number for
/// each side. On the flat octahedron |x| + |y| + |z| = 2^L the vertices are lattice points, so that shared vertices are
/// found without comparing floats.
fn corners(mesh: TriangleMesh, is_parted: bool) -> (Vec<[u32; 3]>, usize) {
    type Lattice = [i32; 3];
    let size = 1_i32 << mesh.level();
    let half = |a: Lattice, b: Lattice| [0, 1, 2].map(|k| i32::midpoint(a[k], b[k]));
    let quadrants = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0]];
    let mut triangles: Vec<[Lattice; 3]> = (0..mesh.bases())
        .map(|base| {
            let down = mesh.domain() == Domain::Lower || base >= 4;
            let pole = [0, 0, if down { -size } else { size }];
            [pole, quadrants[base % 4].map(|x| x * size), quadrants[base % 4 + 1].map(|x| x * size)]
        })
        .collect();
    for _ in 0..mesh.level() {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ac) = (half(a, b), half(b, c), half(a, c));
                [[a, ab, ac], [ab, b, bc], [ac, bc, c], [bc, ac, ab]]
            })
            .collect();
    }
    let side = (2 * size + 1) as usize;
    let mut numbers = vec![u32::MAX; 2 * side * side];
    let mut count = 0;
    let mut number = |[x, y, z]: Lattice, is_below: bool| {
        let place = (usize::from(z < 0 || is_below) * side + (x + size) as usize) * side + (y + size) as usize;
        if numbers[place] == u32::MAX {
            numbers[place] = count;
            count += 1;
        }
        numbers[place]
    };
    let of = |triangle: [Lattice; 3]| {
        let is_below = is_parted && triangle.iter().any(|[_, _, z]| *z < 0);
        triangle.map(|vertex| number(vertex, is_below))
    };
    let corners = triangles.into_iter().map(of).collect();
    (corners, count as usize)
}

/// Triangles around every vertex, in the order of the vertices, with each triangle's fraction of the solid angle around
/// the vertex. The first list holds the position at which each vertex's triangles start, then the length of the second.
fn rings(corners: &[[u32; 3]], vertices: usize, areas: &[f64]) -> (Vec<u32>, Vec<(u32, f32)>) {
    let mut starts = vec![0_u32; vertices + 1];
    let mut totals = vec![0.0; vertices];
    for (triangle, area) in corners.iter().zip(areas) {
        for &vertex in triangle {
            starts[vertex as usize + 1] += 1;
            totals[vertex as usize] += area;
        }
    }
    for v in 0..vertices {
        starts[v + 1] += starts[v];
    }
    let mut next = starts.clone();
    let mut around = vec![(0, 0.0); 3 * corners.len()];
    for (i, (triangle, area)) in corners.iter().zip(areas).enumerate() {
        for &vertex in triangle {
            let place = &mut next[vertex as usize];
            around[*place as usize] = (i as u32, (area / totals[vertex as usize]) as f32);
            *place += 1;
        }
    }
    (starts, around)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::bracket::nearest;
    use rand::RngExt;
    use rand_pcg::Pcg32;

    fn meshes() -> impl Iterator<Item = TriangleMesh> {
        Domain::ALL.iter().flat_map(|&domain| (0..=5).map(move |level| TriangleMesh::new(domain, level).unwrap()))
    }

    fn random_direction(rng: &mut Pcg32) -> Direction {
        let (z, phi) = (2.0 * rng.random::<f64>() - 1.0, std::f64::consts::TAU * rng.random::<f64>());
        Direction::from_radians(z.acos(), phi)
    }

    #[test]
    fn the_tables_find_the_triangle_that_the_mesh_finds() {
        let mut rng = Pcg32::new(1, 1);
        for mesh in meshes() {
            let lookup = MeshLookup::new(mesh, false);
            for _ in 0..2000 {
                let d = random_direction(&mut rng);
                assert_eq!(lookup.locate(d), mesh.locate(d), "{mesh:?} {d:?}");
            }
            for i in 0..mesh.len() {
                assert_eq!(lookup.locate(mesh.centroid(i)), Some(i));
            }
        }
    }

    #[test]
    fn vertices_are_shared_as_on_a_closed_surface() {
        for mesh in meshes() {
            let lookup = MeshLookup::new(mesh, false);
            let (n, vertices) = (mesh.len(), lookup.starts.len() - 1);
            // Euler: V − E + F = 2 on the sphere (E = 3F/2), 1 on a disk with 4·2^L edges on its rim.
            let rim = 4 << mesh.level();
            let edges = if mesh.domain() == Domain::Sphere { 3 * n / 2 } else { usize::midpoint(3 * n, rim) };
            let euler = if mesh.domain() == Domain::Sphere { 2 } else { 1 };
            assert_eq!(vertices + n, edges + euler, "{mesh:?}");
            // Each vertex number refers to one point.
            let mut points = vec![None; vertices];
            for i in 0..n {
                for (k, v) in mesh.vertices(i).into_iter().enumerate() {
                    let known = points[lookup.corners[i][k] as usize].get_or_insert(v);
                    assert!(known.iter().zip(v).all(|(a, b)| (a - b).abs() < 1e-14));
                }
            }
            for v in 0..vertices {
                let ring = lookup.starts[v] as usize..lookup.starts[v + 1] as usize;
                assert!((1..=6).contains(&ring.len()));
                let total: f32 = lookup.around[ring].iter().map(|entry| entry.1).sum();
                assert!((total - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn smooth_weights_are_a_partition_of_unity() {
        let mut rng = Pcg32::new(2, 1);
        for mesh in meshes() {
            let lookup = MeshLookup::new(mesh, false);
            for _ in 0..500 {
                let d = random_direction(&mut rng);
                let Some(stencil) = lookup.stencil(d) else {
                    assert_eq!(lookup.locate(d), None);
                    continue;
                };
                assert!(stencil.entries().all(|(entry, weight)| entry < mesh.len() && weight > 0.0));
                assert!(stencil.entries().count() <= 13);
                let total: f32 = stencil.entries().map(|(_, weight)| weight).sum();
                assert!((total - 1.0).abs() < 1e-6, "{total}");
            }
        }
    }

    #[test]
    fn at_a_vertex_the_triangles_around_it_weigh_by_solid_angle() {
        let mesh = TriangleMesh::new(Domain::Hemisphere, 3).unwrap();
        let lookup = MeshLookup::new(mesh, false);
        let pole = lookup.stencil(Direction::from_degrees(0.0, 0.0)).unwrap();
        let mut found: Vec<_> = pole.entries().collect();
        found.sort_by_key(|entry| entry.0);
        assert_eq!(found, [(0, 0.25), (64, 0.25), (128, 0.25), (192, 0.25)]);
        // On the horizon only the upper side counts; other weights are rounding errors.
        let horizon = lookup.stencil(Direction::from_degrees(90.0, 45.0)).unwrap();
        assert_eq!(horizon.entries().filter(|entry| entry.1 > 1e-6).count(), 3);
    }

    #[test]
    fn smooth_weights_do_not_jump_across_edges() {
        for mesh in meshes() {
            let lookup = MeshLookup::new(mesh, false);
            for i in (0..mesh.len()).step_by(3) {
                let centre = mesh.centroid(i).xyz();
                let vertices = mesh.vertices(i);
                for k in 0..3 {
                    // A point on the edge and two points, one barely inside and one barely outside.
                    let (a, b) = (vertices[k], vertices[(k + 1) % 3]);
                    let at = |t: f64| {
                        let p = [0, 1, 2].map(|j| 0.3 * a[j] + 0.7 * b[j] + t * (centre[j] - 0.3 * a[j] - 0.7 * b[j]));
                        Direction::new(p[0], p[1], p[2]).unwrap()
                    };
                    let (Some(inside), Some(outside)) = (lookup.stencil(at(1e-7)), lookup.stencil(at(-1e-7))) else {
                        continue;
                    };
                    for (entry, weight) in inside.entries() {
                        let other = outside.entries().find(|e| e.0 == entry).map_or(0.0, |e| e.1);
                        assert!((weight - other).abs() < 2e-6, "{mesh:?} {i}: {weight} {other}");
                    }
                }
            }
        }
    }

    #[test]
    fn elevations_are_nearest_linear_and_held_at_the_ends() {
        let values = [10.0, 20.0, 60.0];
        let at = |theta| elevation_stencil(&values, theta).entries().collect::<Vec<_>>();
        assert_eq!(at(0.0), [(0, 1.0)]);
        assert_eq!(at(90.0), [(2, 1.0)]);
        assert_eq!(at(60.0), [(2, 1.0)]);
        assert_eq!(at(20.0), [(1, 1.0)]);
        assert_eq!(at(30.0), [(1, 0.75), (2, 0.25)]);
        let entries = [0.0, 14.0, 15.0, 16.0, 39.0, 41.0, 90.0].map(|theta| nearest(&values, theta));
        assert_eq!(entries, [0, 0, 0, 1, 1, 2, 2]);
    }
}
