//! Haar-type wavelets on the triangle tree: in-place products with one 4 × 4 matrix per parent.
//!
//! At level l the value of node n lies at index n·4^(L−l). Analysis turns the four children of a node, at
//! n·4^(L−l) + k·4^(L−l−1), into its smooth value at k = 0 and three details at k = 1, 2, 3.

use super::basis::{SphereBasis, Weights};
use super::rows::{Pass, from_mean_and_rest, mean_and_rest, mix, reflect_four, scale};
use crate::domain::{Domain, TriangleMesh};

type Matrix = [[f32; 4]; 4];
type Exact = [[f64; 4]; 4];

/// Matrices of the wavelet transform on a triangle mesh. The octants of the octahedron are congruent, so the matrices
/// of one octant serve all.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SphereTables {
    basis: SphereBasis,
    level: u8,
    /// Pair of 4 × 4 matrices of each parent triangle: the forward one maps the smooth values of its four children to
    /// its own smooth value and three details, the second is its inverse.
    ///
    /// The outer index is the level of the parent, coarsest first. A level with a single pair of matrices uses it for
    /// all parents.
    nodes: Vec<Vec<(Matrix, Matrix)>>,
    /// Factor by which the forward transform multiplies the samples of an undivided mesh (level 0): the root of the
    /// triangle area for bases that are orthonormal by area, 1 for others.
    ///
    /// It is 1 for finer meshes, too, since their matrices include such factors.
    bare: f32,
}

impl SphereTables {
    pub(super) fn new(mesh: TriangleMesh, basis: SphereBasis) -> Self {
        let areas = octant_areas(mesh.level());
        let finest = mesh.level();
        let bare = match basis {
            SphereBasis::Orthonormal(Weights::Area) if finest == 0 => libm::sqrt(areas[0][0]) as f32,
            _ => 1.0,
        };
        let nodes = (0..finest)
            .map(|l| {
                let children = &areas[usize::from(l) + 1];
                let leaf_scaled = basis == SphereBasis::Orthonormal(Weights::Area) && l + 1 == finest;
                let same = basis == SphereBasis::Orthonormal(Weights::Count);
                let parents = if same { 1 } else { children.len() / 4 };
                (0..parents)
                    .map(|parent| {
                        let w = four(children, parent);
                        let (forward, inverse) = node(basis, w);
                        let g = if leaf_scaled { w.map(libm::sqrt) } else { [1.0; 4] };
                        let scaled_forward = fill(|r, c| (forward[r][c] * g[c]) as f32);
                        let scaled_inverse = fill(|r, c| (inverse[r][c] / g[r]) as f32);
                        (scaled_forward, scaled_inverse)
                    })
                    .collect()
            })
            .collect();
        Self { basis, level: finest, nodes, bare }
    }

    /// Applies the wavelet transform on triangles, its inverse or a transpose, in place; `rows` has one row per
    /// triangle.
    pub(super) fn transform(&self, rows: &mut [&mut [f32]], pass: Pass) {
        if self.bare != 1.0 {
            let by = match pass {
                Pass::Forward | Pass::ForwardTransposed => self.bare,
                Pass::Inverse | Pass::InverseTransposed => 1.0 / self.bare,
            };
            for row in rows {
                scale(row, by);
            }
            return;
        }
        for (node, group) in rows.chunks_exact_mut(self.place(0)).enumerate() {
            self.pass_node(group, 0, node, pass);
        }
    }

    /// Applies the wavelet transform to all triangles into which one triangle of the mesh is subdivided, depth first
    /// for cache locality. `rows` has one row of samples for each of the finest of them.
    fn pass_node(&self, rows: &mut [&mut [f32]], level: u8, node: usize, pass: Pass) {
        if level == self.level {
            return;
        }
        let upward = matches!(pass, Pass::Forward | Pass::InverseTransposed);
        let stride = rows.len() / 4;
        if !upward {
            self.mix(rows, level, node, pass);
        }
        if stride > 1 {
            for (child, rows) in rows.chunks_exact_mut(stride).enumerate() {
                self.pass_node(rows, level + 1, 4 * node + child, pass);
            }
        }
        if upward {
            self.mix(rows, level, node, pass);
        }
    }

    /// Transforms in place the smooth values of four child triangles to the smooth value and three details of their
    /// parent, or back.
    ///
    /// `rows` has one row for each finest triangle of the parent; a child's smooth value is the first row of its
    /// quarter.
    fn mix(&self, rows: &mut [&mut [f32]], level: u8, node: usize, pass: Pass) {
        let (a, rest) = rows.split_at_mut(rows.len() / 4);
        let (b, rest) = rest.split_at_mut(a.len());
        let (c, d) = rest.split_at_mut(a.len());
        let (a, b, c, d) = (&mut *a[0], &mut *b[0], &mut *c[0], &mut *d[0]);
        let (forward, inverse) = self.node(level, node);
        match (self.basis, pass) {
            (SphereBasis::Orthonormal(Weights::Count), _) => reflect_four(a, b, c, d),
            (SphereBasis::BioHaar, Pass::Forward) => mean_and_rest(forward[0], a, b, c, d),
            (SphereBasis::BioHaar, Pass::Inverse) => {
                let [_, w1, w2, w3] = inverse[0];
                from_mean_and_rest([-w1, -w2, -w3], a, b, c, d);
            }
            (_, Pass::Forward) => mix(forward, a, b, c, d),
            (_, Pass::Inverse) => mix(inverse, a, b, c, d),
            (_, Pass::ForwardTransposed) => mix(&transposed(forward), a, b, c, d),
            (_, Pass::InverseTransposed) => mix(&transposed(inverse), a, b, c, d),
        }
    }

    /// Returns the synthesis function of coefficient `index`, as pairs of triangle index and value.
    pub(super) fn footprint(&self, index: usize) -> Vec<(u32, f64)> {
        self.descend(index, 1.0 / f64::from(self.bare), |(_, inverse), coefficient, child| inverse[child][coefficient])
    }

    /// Returns the nonzero weights of the samples in wavelet coefficient `index`, as pairs of index and weight; there
    /// is one sample for each triangle of the mesh.
    pub(super) fn analysis_row(&self, index: usize) -> Vec<(u32, f64)> {
        self.descend(index, f64::from(self.bare), |(forward, _), coefficient, child| forward[coefficient][child])
    }

    /// Returns the nonzero weights of the wavelet coefficients in the sum that reconstructs the sample of triangle
    /// `index` of the mesh, as pairs of coefficient index and weight.
    pub(super) fn synthesis_row(&self, index: usize) -> Vec<(u32, f64)> {
        let mut row = Vec::with_capacity(3 * usize::from(self.level) + 1);
        let mut smooth = 1.0 / f64::from(self.bare);
        for parent_level in (0..self.level).rev() {
            let place = self.place(parent_level + 1);
            let (node, child) = (index / (4 * place), index / place % 4);
            let (_, inverse) = self.node(parent_level, node);
            for (k, &w) in inverse[child].iter().enumerate().skip(1) {
                row.push(((node * 4 + k) * place, smooth * f64::from(w)));
            }
            smooth *= f64::from(inverse[child][0]);
        }
        let place = self.place(0);
        row.push((index / place * place, smooth));
        row.retain(|(_, w)| *w != 0.0);
        row.sort_unstable_by_key(|&(i, _)| i);
        row.into_iter().map(|(i, w)| (i as u32, w)).collect()
    }

    /// Computes the weights that connect a wavelet coefficient with the finest triangles, level by level down from the
    /// coefficient's parent triangle.
    ///
    /// `weight` takes the entry for a coefficient and a child from a parent's forward or inverse 4 × 4 matrix.
    fn descend(
        &self,
        index: usize,
        bare: f64,
        weight: impl Fn(&(Matrix, Matrix), usize, usize) -> f32,
    ) -> Vec<(u32, f64)> {
        let within = index % self.place(0);
        let mut level = 0;
        while !within.is_multiple_of(self.place(level)) {
            level += 1;
        }
        // First of the nodes at `level`, and their weights.
        let mut first = index / self.place(level);
        let mut weights = vec![bare];
        if level > 0 {
            let k = first % 4;
            first -= k;
            let matrices = self.node(level - 1, first / 4);
            weights = (0..4).map(|child| f64::from(weight(matrices, k, child))).collect();
        }
        for parent_level in level..self.level {
            let nodes = (first..).zip(&weights);
            weights = nodes
                .flat_map(|(node, w)| {
                    let matrices = self.node(parent_level, node);
                    [0, 1, 2, 3].map(|child| w * f64::from(weight(matrices, 0, child)))
                })
                .collect();
            first *= 4;
        }
        (first..).zip(weights).filter(|(_, w)| *w != 0.0).map(|(i, w)| (i as u32, w)).collect()
    }

    /// Returns the number of finest triangles inside a triangle of `level`.
    fn place(&self, level: u8) -> usize {
        1 << (2 * u32::from(self.level - level))
    }

    fn node(&self, parent_level: u8, node: usize) -> &(Matrix, Matrix) {
        let matrices = &self.nodes[usize::from(parent_level)];
        // One for all nodes, or one per node of an octant: a power of two, so that a mask replaces a division.
        &matrices[node & (matrices.len() - 1)]
    }
}

/// Returns the L2 norms of all synthesis functions on the triangles of `mesh`, in closed form: a detail function is
/// constant on each child.
pub(super) fn norms(mesh: TriangleMesh, basis: SphereBasis, measure: Weights) -> Vec<f64> {
    let areas = octant_areas(mesh.level());
    let finest = mesh.level();
    let octant = areas[usize::from(finest)].len();
    let leaves = |level: u8| (1_u64 << (2 * u32::from(finest - level))) as f64;
    // Value, on the leaves below a node of this area and level, of its smooth coefficient 1; then the measure of the
    // leaves.
    let height = |area: f64, level: u8| match basis {
        SphereBasis::BioHaar => 1.0,
        SphereBasis::Orthonormal(Weights::Area) => 1.0 / libm::sqrt(area),
        SphereBasis::Orthonormal(Weights::Count) => 1.0 / libm::sqrt(leaves(level)),
    };
    let extent = |area: f64, level: u8| match measure {
        Weights::Area => area,
        Weights::Count => leaves(level),
    };
    let mut norms = vec![0.0; octant];
    norms[0] = height(areas[0][0], 0) * libm::sqrt(extent(areas[0][0], 0));
    for parent_level in 0..finest {
        let level = parent_level + 1;
        let stride = leaves(level) as usize;
        let children = &areas[usize::from(level)];
        for parent in 0..children.len() / 4 {
            let w = four(children, parent);
            let (_, inverse) = node(basis, w);
            for k in 1..4 {
                let square: f64 = (0..4)
                    .map(|j| {
                        let value = inverse[j][k] * height(w[j], level);
                        value * value * extent(w[j], level)
                    })
                    .sum();
                norms[(4 * parent + k) * stride] = libm::sqrt(square);
            }
        }
    }
    (0..mesh.len()).map(|i| norms[i % octant]).collect()
}

/// Returns the areas of the triangles of one octant, level by level; the area of a parent is the sum over its children.
fn octant_areas(level: u8) -> Vec<Vec<f64>> {
    let leaves = 1_usize << (2 * u32::from(level));
    let finest: Vec<f64> = TriangleMesh::new(Domain::Hemisphere, level)
        .map(|mesh| (0..leaves).map(|i| mesh.solid_angle(i)).collect())
        .unwrap_or_default();
    let mut areas = vec![finest];
    for _ in 0..level {
        let coarser = areas[areas.len() - 1].chunks_exact(4).map(|c| c[0] + c[1] + c[2] + c[3]).collect();
        areas.push(coarser);
    }
    areas.reverse();
    areas
}

fn four(children: &[f64], parent: usize) -> [f64; 4] {
    let c = &children[4 * parent..][..4];
    [c[0], c[1], c[2], c[3]]
}

/// Returns the analysis and synthesis matrices of a parent triangle whose four children have areas `w`.
fn node(basis: SphereBasis, w: [f64; 4]) -> (Exact, Exact) {
    let total = w[0] + w[1] + w[2] + w[3];
    match basis {
        SphereBasis::BioHaar => {
            let unit = |r: usize, c: usize| if r == c { 1.0 } else { 0.0 };
            let forward = fill(|r, c| if r == 0 { w[c] / total } else { unit(r, c) - w[c] / total });
            let inverse = fill(|r, c| match (r, c) {
                (_, 0) => 1.0,
                (0, c) => -w[c] / w[0],
                (r, c) => unit(r, c),
            });
            (forward, inverse)
        }
        SphereBasis::Orthonormal(Weights::Area) => {
            let h = householder(w.map(|w| libm::sqrt(w / total)));
            (h, h)
        }
        SphereBasis::Orthonormal(Weights::Count) => {
            let h = householder([0.5; 4]);
            (h, h)
        }
    }
}

/// Returns the 4 × 4 reflection that maps the unit vector `u` to (1, 0, 0, 0); it is symmetric and its own inverse.
fn householder(u: [f64; 4]) -> Exact {
    let v = [u[0] - 1.0, u[1], u[2], u[3]];
    let square = v.iter().map(|x| x * x).sum::<f64>();
    fill(|r, c| (if r == c { 1.0 } else { 0.0 }) - 2.0 * v[r] * v[c] / square)
}

fn fill<T: Copy + Default>(entry: impl Fn(usize, usize) -> T) -> [[T; 4]; 4] {
    let mut matrix = [[T::default(); 4]; 4];
    for (r, row) in matrix.iter_mut().enumerate() {
        for (c, value) in row.iter_mut().enumerate() {
            *value = entry(r, c);
        }
    }
    matrix
}

fn transposed(matrix: &Matrix) -> Matrix {
    fill(|r, c| matrix[c][r])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_octant_has_the_areas_of_the_first() {
        for &domain in Domain::ALL {
            let mesh = TriangleMesh::new(domain, 3).unwrap();
            let first = octant_areas(3).pop().unwrap();
            for (i, area) in mesh.solid_angles().into_iter().enumerate() {
                assert!((area - first[i % first.len()]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn node_matrices_are_inverse_to_each_other() {
        let w = [0.11, 0.12, 0.13, 0.2];
        for &basis in SphereBasis::ALL {
            let (forward, inverse) = node(basis, w);
            let product: Exact = fill(|r, c| (0..4).map(|k| inverse[r][k] * forward[k][c]).sum());
            for (r, row) in product.iter().enumerate() {
                for (c, &entry) in row.iter().enumerate() {
                    assert!((entry - if r == c { 1.0 } else { 0.0 }).abs() < 1e-14, "{basis:?}");
                }
            }
        }
    }
}
