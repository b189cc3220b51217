//! Tables that all warps on one mesh share: pairs of triangles as squares, places in the tree, geometry of the leaves.
//!
//! On the flat octahedron a triangle is half of a square: the triangle is right-angled, and the neighbour across its
//! hypotenuse is the other half. The four-way split of both halves is the split of the square into quadrants, level
//! after level. The corners (0,0) and (1,1) of a square are the ends of the hypotenuse. (1,0) is the right angle of its
//! *lower* half (b < a), (0,1) that of its *upper* half. Quadrants are numbered 2·a + b.
//!
//! The squares of level 0 unfold the octahedron, two of them a hemisphere:
//!
//! ```text
//! b   −x ─── y ─── −x'          (a, b) = (0,1): octants 0 | 1      (1,1): octants 4 | 5
//! │    │  1 ╱ │ ╲ 5 │
//! │    │  ╱ 0 │ 4 ╲ │           (a, b) = (0,0): octants 3 | 2      (1,0): octants 7 | 6
//! │    z ──── x ─── −z
//! │    │  ╲ 3 │ 7 ╱ │
//! │    │ 2 ╲  │ ╱ 6 │
//! └   −x ── −y ─── −x'      → a
//! ```

use super::options::Measure;
use crate::domain::limits::MAX_LEVEL;
use crate::domain::vector::{Vector, cross, dot};
use crate::domain::{Direction, Domain, TriangleMesh};
use crate::evaluate::lookup::{MeshLookup, octant};
use std::sync::Arc;

/// Eight numbers of a sampling tree, one for each triangle of four sibling squares (lower, then upper triangle of
/// each). One memory load fetches all that a descent compares.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub(super) struct Group(pub(super) [f32; 8]);

/// Order of a triangle's vertices within its square (pair of triangles): numbers of the vertex at the right angle, and
/// of the hypotenuse's ends (0,0) and (1,1).
pub(super) type Frame = [u8; 3];

/// All orders of three vertices of a triangle; a vertex order is stored as its number in this list.
const FRAMES: [Frame; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Octants that form the lower and the upper triangle of each of the four squares into which the octahedron unfolds,
/// with the numbers of each triangle's vertices at the right angle and at the square's corners (0,0) and (1,1).
const TOP: [[(u32, Frame); 2]; 4] = [
    [(3, [2, 0, 1]), (2, [1, 0, 2])],
    [(0, [1, 0, 2]), (1, [2, 0, 1])],
    [(7, [2, 0, 1]), (6, [1, 0, 2])],
    [(4, [1, 0, 2]), (5, [2, 0, 1])],
];

/// Offset and sign of each of the two coordinates in each of the four squares into which the octahedron unfolds. A sign
/// of −1 mirrors a square, so that squares meet at the same edges in the unit square as in the unfolded octahedron.
pub(super) const FLIPS: [[[f64; 2]; 2]; 4] = [[ALONG, AGAINST], [ALONG, ALONG], [AGAINST, AGAINST], [AGAINST, ALONG]];
const ALONG: [f64; 2] = [0.0, 1.0];
const AGAINST: [f64; 2] = [1.0 - f64::EPSILON / 2.0, -1.0];

/// Maximum number of levels of a sampling tree.
const LEVELS: usize = MAX_LEVEL as usize + 1;

/// Cosine and sine of the rotation about z from octant 0 to each of the octants 0 to 3 on the same side of the horizon.
const TURNS: [[f64; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]];

/// Three vertices of a leaf triangle of octant 0, or their dual vectors. Inner products of the dual vectors with a
/// direction are barycentric coordinates, divided by the length of the point where its ray meets the planar triangle.
#[derive(Clone, Copy, Debug)]
struct Leaf {
    vectors: [Vector; 3],
    /// Constant factor 1 / (A · d) of the density in sr⁻¹ of directions drawn uniformly on the planar triangle, with A
    /// its area and d the distance of its plane from the origin.
    density: f64,
}

/// Geometry tables of one triangle mesh and one measure (solid angle or projected solid angle), which any number of
/// [`super::Warps`] share.
#[derive(Debug)]
pub struct WarpMesh {
    mesh: TriangleMesh,
    measure: Measure,
    lookup: Arc<MeshLookup>,
    leaves: Vec<Leaf>,
    /// Dual vectors of the leaf triangles, which give barycentric coordinates.
    duals: Vec<Leaf>,
    /// For each triangle, level by level: twice the number of its square (pair of triangles in the unfolded
    /// octahedron), plus 1 for the upper triangle.
    places: Vec<u32>,
    /// For each subdivision level, position in `places` of its first triangle.
    firsts: [usize; LEVELS],
    /// For each subdivision level, position of the first integral over its triangles in a sampling tree read as one
    /// list of numbers.
    starts: [usize; LEVELS],
    /// Number of groups (of eight triangles) in one sampling tree.
    groups: usize,
    /// For each leaf triangle, in the order of the squares (pairs of triangles): eight times its number in the mesh,
    /// plus the number of its vertex order within the square.
    framed: Vec<u32>,
    /// Vertex numbers of each square (pair of leaf triangles), in the order (0,0), (0,1), (1,0), (1,1).
    quads: Vec<[u32; 4]>,
    points: Vec<Direction>,
    /// Sampling tree of the measure alone: solid angles or projected solid angles of all triangles.
    measures: Vec<Group>,
    /// Cosine factor at each vertex of the mesh: |cos θ|, or 1 if the measure is the solid angle.
    cosines: Vec<f32>,
    /// Exact solid angle or projected solid angle of every leaf triangle, in sr.
    exact: Vec<f64>,
}

impl WarpMesh {
    /// Builds the tables of `mesh` that sampling needs: vertices, solid angles and order of the triangles. Sampling
    /// trees on them weight function values by `measure`.
    pub fn new(mesh: TriangleMesh, measure: Measure) -> Self {
        Self::over(Arc::new(MeshLookup::new(mesh, false)), measure)
    }

    /// Builds the geometry tables of a triangle mesh, for sampling trees that weight values by `measure`. Uses the
    /// existing tables `lookup`, which find the triangle that contains a direction.
    pub(in crate::evaluate) fn over(lookup: Arc<MeshLookup>, measure: Measure) -> Self {
        let mesh = lookup.mesh();
        let count = 1_usize << (2 * u32::from(mesh.level()));
        let (leaves, duals): (Vec<Leaf>, Vec<Leaf>) = octant(mesh.level()).map(leaf_and_dual).unzip();
        let (places, framed) = places(mesh);
        let vertex = |place: usize, corner: usize| {
            let (leaf, frame) = unframed(framed[place]);
            lookup.corners(leaf)[usize::from(frame[corner])]
        };
        let quads = (0..mesh.len() / 2)
            .map(|square| {
                [vertex(2 * square, 1), vertex(2 * square + 1, 0), vertex(2 * square, 0), vertex(2 * square, 2)]
            })
            .collect();
        let mut points = vec![Direction::from_unit([0.0, 0.0, 1.0]); lookup.vertices()];
        for (ids, vertices) in lookup.all_corners().iter().zip(mesh.all_vertices()) {
            for (&id, vertex) in ids.iter().zip(vertices) {
                points[id as usize] = Direction::from_unit(vertex);
            }
        }
        let own = |i: usize| match measure {
            Measure::Projected => mesh.projected_solid_angle(i),
            Measure::SolidAngle => mesh.solid_angle(i),
        };
        // All octants are congruent.
        let one: Vec<f64> = (0..count).map(own).collect();
        let exact: Vec<f64> = (0..mesh.len()).map(|i| one[i % count]).collect();
        let cosine =
            |point: &Direction| if measure == Measure::Projected { point.cos_theta().abs() as f32 } else { 1.0 };
        let cosines = points.iter().map(cosine).collect();
        let mut this = Self {
            mesh,
            measure,
            lookup,
            leaves,
            duals,
            places,
            firsts: std::array::from_fn(|level| mesh.bases() * first(level as u8)),
            starts: [0; LEVELS],
            groups: 0,
            framed,
            quads,
            points,
            measures: vec![],
            cosines,
            exact,
        };
        this.starts = std::array::from_fn(|level| 8 * this.group_of(level as u8, 0));
        this.groups = this.children(mesh.level(), 0);
        let mut measures = vec![Group::default(); this.groups];
        this.fill(&mut this.exact.clone(), &mut measures);
        this.measures = measures;
        this
    }

    /// Triangle mesh on the unit sphere from whose triangles outgoing directions are drawn.
    pub fn mesh(&self) -> TriangleMesh {
        self.mesh
    }

    /// Lookup tables that locate triangles of the mesh.
    pub(in crate::evaluate) fn lookup(&self) -> &MeshLookup {
        &self.lookup
    }

    /// Measure of the integrals over triangles from which sampling trees are built: solid angle or projected solid
    /// angle.
    pub fn measure(&self) -> Measure {
        self.measure
    }

    /// Exact projected solid angle or solid angle in sr of every leaf triangle, in the order of the mesh.
    pub fn measures(&self) -> &[f64] {
        &self.exact
    }

    /// Vertices of the mesh, each listed once although triangles share it.
    pub fn vertices(&self) -> &[Direction] {
        &self.points
    }

    /// Vertex numbers of every leaf triangle, as indices into [`WarpMesh::vertices`], in the order of the mesh.
    pub fn corners(&self) -> &[[u32; 3]] {
        self.lookup.all_corners()
    }

    /// Memory of the geometry tables in bytes, without the lookup tables of the mesh, which may be shared.
    pub fn memory(&self) -> usize {
        size_of::<Self>()
            + size_of_val(&*self.leaves)
            + size_of_val(&*self.duals)
            + size_of_val(&*self.places)
            + size_of_val(&*self.framed)
            + size_of_val(&*self.quads)
            + size_of_val(&*self.points)
            + size_of_val(&*self.measures)
            + size_of_val(&*self.cosines)
            + size_of_val(&*self.exact)
    }

    /// Expected memory in bytes of the geometry tables before they are built, and of each sampling tree that uses them.
    pub(in crate::evaluate) fn expected_memory(lookup: &MeshLookup) -> [usize; 2] {
        let (mesh, vertices) = (lookup.mesh(), lookup.vertices());
        let octant = 1_usize << (2 * u32::from(mesh.level()));
        let groups = size_of::<Group>() * (1 + mesh.bases() / 2 * (octant - 1) / 3);
        let leaf = 2 * size_of::<u32>() + size_of::<u32>() + size_of::<f64>();
        let point = size_of::<Direction>() + size_of::<f32>();
        let places = size_of::<u32>() * mesh.bases() * first(mesh.level() + 1);
        let shared =
            size_of::<Self>() + 2 * octant * size_of::<Leaf>() + places + mesh.len() * leaf + vertices * point + groups;
        [shared, groups + vertices * size_of::<f32>() + size_of::<f64>()]
    }

    /// Number of groups in one sampling tree. A group holds the integrals over up to eight triangles: the root those of
    /// the coarsest level, every other one those of the four quadrants of a square (pair of triangles) that is
    /// subdivided.
    #[inline]
    pub(super) fn groups(&self) -> usize {
        self.groups
    }

    /// Number of the group of integrals, in a sampling tree, over the eight triangles into which a square (pair of
    /// triangles) of subdivision level `level` is divided.
    pub(super) fn children(&self, level: u8, square: usize) -> usize {
        1 + self.mesh.bases() / 2 * first(level) + square
    }

    /// Sampling tree of the measure alone: solid angles or projected solid angles of all triangles.
    pub(super) fn geometry(&self) -> &[Group] {
        &self.measures
    }

    /// Cosine factor at each vertex of the mesh: |cos θ|, or 1 if the measure is the solid angle.
    pub(super) fn cosines(&self) -> &[f32] {
        &self.cosines
    }

    /// Writes the sampling tree for the integrals over leaf triangles given in `sums`, which is overwritten.
    pub(super) fn fill(&self, sums: &mut [f64], tree: &mut [Group]) {
        for level in (0..=self.mesh.level()).rev() {
            let nodes = self.mesh.bases() << (2 * u32::from(level));
            for (node, &sum) in sums[..nodes].iter().enumerate() {
                let at = self.slot(level, node);
                tree[at / 8].0[at % 8] = sum as f32;
            }
            for parent in 0..nodes / 4 {
                sums[parent] = sums[4 * parent] + sums[4 * parent + 1] + sums[4 * parent + 2] + sums[4 * parent + 3];
            }
        }
    }

    /// Position, in a sampling tree read as one list of numbers, of the sampled function's integral over triangle
    /// number `node` of subdivision level `level`.
    #[inline(always)]
    pub(super) fn slot(&self, level: u8, node: usize) -> usize {
        // Groups of a level are contiguous, in the order of their squares.
        self.starts[usize::from(level)] + self.place(level, node)
    }

    /// Number of the group that holds a square (pair of triangles) of a level together with its three siblings.
    pub(super) fn group_of(&self, level: u8, square: usize) -> usize {
        level.checked_sub(1).map_or(0, |above| self.children(above, square / 4))
    }

    /// Twice the number of the square (pair of triangles) that contains triangle `node` of a level, plus 1 if the
    /// triangle is the upper one.
    #[inline]
    pub(super) fn place(&self, level: u8, node: usize) -> usize {
        self.places[self.firsts[usize::from(level)] + node] as usize
    }

    /// Number of the finest triangle at position `place`, and the order of its vertices in its square (pair of
    /// triangles). The position is twice the number of the square, plus 1 for the upper triangle.
    #[inline]
    pub(super) fn framed(&self, place: usize) -> (usize, Frame) {
        unframed(self.framed[place])
    }

    /// Vertex numbers of a square (pair of leaf triangles), in the order (0,0), (0,1), (1,0), (1,1).
    #[inline]
    pub(super) fn quad(&self, square: usize) -> [u32; 4] {
        self.quads[square]
    }

    /// Vertex numbers of a leaf triangle.
    #[inline(always)]
    pub(super) fn corners_of(&self, leaf: usize) -> [u32; 3] {
        self.lookup.corners(leaf)
    }

    /// Direction through a point p of the planar triangle `leaf`, given by its barycentric coordinates for the vertex
    /// order `frame`. Also returns |p|³ / (A · d), with A the triangle's area and d the distance of its plane from the
    /// origin. This factor converts a density relative to the uniform one on the triangle to one of solid angle.
    #[inline]
    pub(super) fn point(&self, leaf: usize, frame: Frame, [a, b, c]: [f64; 3]) -> (Direction, f64) {
        let geometry = &self.leaves[leaf & (self.leaves.len() - 1)];
        let [v0, v1, v2] = frame;
        let vertex = |k: u8| &geometry.vectors[usize::from(k)];
        let (v0, v1, v2) = (vertex(v0), vertex(v1), vertex(v2));
        let on = |k: usize| a * v0[k] + b * v1[k] + c * v2[k];
        let [x, y, z] = [on(0), on(1), on(2)];
        let square = x * x + y * y + z * z;
        let length = square.sqrt();
        let inverse = 1.0 / length;
        let base = leaf >> (2 * u32::from(self.mesh.level()));
        let [cos, sin] = TURNS[base & 3];
        let up = if base >= 4 || self.mesh.domain() == Domain::Lower { -inverse } else { inverse };
        let direction = Direction::from_unit([(cos * x - sin * y) * inverse, (sin * x + cos * y) * inverse, z * up]);
        (direction, square * length * geometry.density)
    }

    /// Leaf triangle that contains `direction`, and the barycentric coordinates of the point where its ray meets the
    /// planar triangle. Also returns the factor from a density over the planar triangle to one of solid angle; `None`
    /// outside the domain.
    #[inline]
    pub(super) fn locate(&self, direction: Direction) -> Option<(usize, [f64; 3], f64)> {
        let (leaf, folded) = self.lookup.descend(direction.xyz())?;
        let (coordinates, factor) = self.coordinates(leaf, folded);
        Some((leaf, coordinates, factor))
    }

    /// Barycentric coordinates in `leaf` of a direction mapped into the first octant, and the factor from a density
    /// over the planar triangle to one of solid angle.
    #[inline(always)]
    fn coordinates(&self, leaf: usize, folded: Vector) -> ([f64; 3], f64) {
        let geometry = &self.duals[leaf & (self.duals.len() - 1)];
        let [d0, d1, d2] = geometry.vectors;
        let (a, b, c) = (dot(d0, folded).max(0.0), dot(d1, folded).max(0.0), dot(d2, folded).max(0.0));
        let length = 1.0 / (a + b + c);
        ([a * length, b * length, c * length], length * length * length * geometry.density)
    }

    /// Barycentric coordinates of the point where the ray of a unit vector meets the planar triangle `leaf`. Also
    /// returns the factor from a density over the planar triangle to one of solid angle.
    #[inline(always)]
    pub(super) fn coordinates_in(&self, leaf: usize, [x, y, z]: Vector) -> ([f64; 3], f64) {
        let is_odd = (leaf >> (2 * u32::from(self.mesh.level()))) & 1;
        let sides = [x.abs(), y.abs()];
        self.coordinates(leaf, [sides[is_odd], sides[is_odd ^ 1], z.abs()])
    }
}

/// Leaf triangle with the given vertices, and its dual vectors.
fn leaf_and_dual(vertices: [Vector; 3]) -> (Leaf, Leaf) {
    let [a, b, c] = vertices;
    let planes = [cross(b, c), cross(c, a), cross(a, b)];
    // Six volumes of the tetrahedron with the origin: twice the area times the distance. Negative for clockwise
    // vertices.
    let determinant = dot(a, planes[0]);
    let density = 2.0 / determinant.abs();
    let duals = planes.map(|plane| plane.map(|x| x / determinant));
    (Leaf { vectors: vertices, density }, Leaf { vectors: duals, density })
}

#[inline]
fn unframed(framed: u32) -> (usize, Frame) {
    ((framed >> 3) as usize, FRAMES[(framed & 7) as usize])
}

/// Total number of triangles of one octant of the sphere in all subdivision levels coarser than `level`.
fn first(level: u8) -> usize {
    ((1 << (2 * u32::from(level))) - 1) / 3
}

/// Two tables of the unfolded octahedron, where two triangles form a square: from each triangle of every level to its
/// half of a square, and from each half of a finest square back to its triangle.
///
/// The first lists the triangles of every level, coarsest first: for each, twice the number of its square, plus 1 for
/// the upper half. The second lists the halves in the order of the squares: eight times the triangle's number, plus the
/// number of the order of its vertices (right angle, then corners (0,0) and (1,1) of the square).
fn places(mesh: TriangleMesh) -> (Vec<u32>, Vec<u32>) {
    let bases = mesh.bases();
    let mut squares: Vec<[(u32, Frame); 2]> = TOP[..bases / 2].to_vec();
    let mut places = vec![0; bases * first(mesh.level() + 1)];
    for level in 0..=mesh.level() {
        if level > 0 {
            squares = squares.into_iter().flat_map(quadrants).collect();
        }
        let level = &mut places[bases * first(level)..];
        for (place, (node, _)) in (0..).zip(squares.as_flattened()) {
            level[*node as usize] = place;
        }
    }
    let number = |frame: &Frame| FRAMES.iter().position(|known| known == frame).unwrap_or(0) as u32;
    let framed = squares.as_flattened().iter().map(|(leaf, frame)| leaf << 3 | number(frame)).collect();
    (places, framed)
}

/// Splits a square of two triangles into its four quadrants. The centre child of a triangle has its right angle at the
/// midpoint of the parent's hypotenuse. It shares its own hypotenuse with the child at the parent's right angle.
fn quadrants([lower, upper]: [(u32, Frame); 2]) -> [[(u32, Frame); 2]; 4] {
    let child = |(node, frame): (u32, Frame), which: usize| (4 * node + u32::from(frame[which]), frame);
    let centre = |(node, [right, start, end]): (u32, Frame)| (4 * node + 3, [right, end, start]);
    [
        [child(lower, 1), child(upper, 1)],
        [centre(upper), child(upper, 0)],
        [child(lower, 0), centre(lower)],
        [child(lower, 2), child(upper, 2)],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meshes() -> impl Iterator<Item = TriangleMesh> {
        Domain::ALL.iter().flat_map(|&d| (0..=5).map(move |level| TriangleMesh::new(d, level).unwrap()))
    }

    fn close(a: Vector, b: Vector) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    #[test]
    fn halves_share_their_hypotenuse_and_quadrants_their_corners() {
        for mesh in meshes() {
            let warp = WarpMesh::new(mesh, Measure::SolidAngle);
            let corners_of = |square: usize| {
                let [lower, upper] = [0, 1].map(|half| {
                    let (leaf, frame) = warp.framed(2 * square + half);
                    frame.map(|k| mesh.vertices(leaf)[usize::from(k)])
                });
                assert!(close(lower[1], upper[1]) && close(lower[2], upper[2]), "{mesh:?} {square}");
                // In order of quadrant numbers: (0,0), (0,1), (1,0), (1,1).
                [lower[1], upper[0], lower[0], lower[2]]
            };
            for square in 0..mesh.len() / 2 {
                corners_of(square);
            }
            // Quadrants 0 and 1 of every parent share an edge, so do 0 and 2, and all four share the middle.
            if mesh.level() > 0 {
                for parent in 0..mesh.len() / 8 {
                    let [c0, c1, c2, c3] = [0, 1, 2, 3].map(|k| corners_of(4 * parent + k));
                    assert!(close(c0[1], c1[0]) && close(c0[3], c1[2]));
                    assert!(close(c0[2], c2[0]) && close(c0[3], c2[1]));
                    assert!(close(c0[3], c3[0]) && close(c1[3], c3[1]) && close(c2[3], c3[2]));
                }
            } else if mesh.bases() == 8 {
                // The unfolding: 0 and 1 share z–x against b, 1 and 3 share x–y against a.
                let [c0, c1, c2, c3] = [0, 1, 2, 3].map(corners_of);
                assert!(close(c0[0], c1[0]) && close(c0[2], c1[2]));
                assert!(close(c1[2], c3[2]) && close(c1[3], c3[3]));
                assert!(close(c0[2], c2[2]) && close(c0[3], c2[3]));
            }
        }
    }

    #[test]
    fn the_tables_find_the_triangle_that_the_mesh_finds_and_its_point() {
        for mesh in meshes() {
            let warp = WarpMesh::new(mesh, Measure::SolidAngle);
            for leaf in 0..mesh.len() {
                let coordinates = [0.2, 0.5, 0.3];
                let (direction, factor) = warp.point(leaf, [0, 1, 2], coordinates);
                let (found, back, again) = warp.locate(direction).unwrap();
                assert_eq!((found, mesh.locate(direction)), (leaf, Some(leaf)));
                assert!(back.iter().zip(coordinates).all(|(a, b)| (a - b).abs() < 1e-12));
                assert!((again / factor - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn places_are_a_numbering_of_every_level_and_parents_agree() {
        for mesh in meshes() {
            let warp = WarpMesh::new(mesh, Measure::Projected);
            for level in 0..=mesh.level() {
                let nodes = mesh.bases() << (2 * u32::from(level));
                let mut seen = vec![false; nodes];
                for node in 0..nodes {
                    seen[warp.place(level, node)] = true;
                    if level > 0 {
                        assert_eq!(warp.place(level, node) / 8, warp.place(level - 1, node / 4) / 2);
                    }
                }
                assert!(seen.into_iter().all(|s| s));
            }
            let total: f64 = warp.geometry()[0].0.iter().map(|&m| f64::from(m)).sum();
            assert!((total - warp.measures().iter().sum::<f64>()).abs() < 1e-6);
        }
    }
}
