//! Defensive part of a sampler: directions drawn independently of the function's values, wherever it may be nonzero.

use super::function::Function;
use super::lookup::MeshLookup;
use super::smooth::Smooth;
use super::warp::{BELOW_ONE, Density, Warps};
use crate::domain::vector::{Vector, add, cross, dot, norm, scale, sub, unit};
use crate::domain::{Direction, TriangleMesh};

/// Squared sine of the angle to corner b of a spherical triangle below which a direction counts as that corner.
const CORNER: f64 = 1e-24;

/// Number of intervals along a triangle's edge between the points at which a material's smoothly interpolated function
/// is tested for nonzero values in the triangle. More intervals find narrower nonzero areas.
const STEPS: u32 = 24;
/// Distance from a triangle's edges of the nearest points at which a material's smoothly interpolated function is
/// tested for nonzero values, in intervals between these points. It keeps them from lying exactly on an edge.
const INSIDE: f64 = 1e-5;
/// Distance in radians, from an interpolation node, of eight points around it at which a material's smoothly
/// interpolated function is tested for nonzero values. Each lies in another of the interpolation patches that meet at
/// the node.
const BESIDE: f64 = 1e-5;
/// Offsets from an interpolation node of the eight points around it at which a material's smoothly interpolated
/// function is tested, in units of [`BESIDE`] along two tangents that are not parallel.
const WAYS: [[f64; 2]; 8] =
    [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0], [-1.0, 0.0], [-1.0, -1.0], [0.0, -1.0], [1.0, -1.0]];

/// Set of directions that defensive sampling (drawing independently of the function's values) can return.
#[derive(Debug)]
pub(super) enum Background {
    /// Defensive sampling draws from the whole outgoing domain, with density proportional to |cos θ| or uniform.
    Whole,
    /// Defensive sampling draws from the triangles in which the material's function is nonzero, uniformly in solid
    /// angle. Each combination of indices (positions on the axes before the directions) has two sets of triangles:
    /// nonzero in piecewise constant and in smooth evaluation.
    Lit(Vec<[LitCells; 2]>),
}

impl Background {
    /// Selects the directions that defensive sampling can return: the triangles with light for luminaires, the whole
    /// domain for quantities with an incoming direction or a cosine factor.
    pub(super) fn new(function: &Function, lookup: &MeshLookup) -> Self {
        if function.geometry().has_incoming() || function.geometry().quantity().has_cosine() {
            return Self::Whole;
        }
        let mesh = lookup.mesh();
        let lit = |entry: usize| {
            let has_light: Vec<bool> =
                (0..mesh.len()).map(|leaf| function.is_lit_cell(entry * mesh.len() + leaf)).collect();
            let reached = reached(function.form().smooth(), entry, lookup, &has_light);
            [has_light, reached].map(|is_lit| LitCells::new(mesh, is_lit))
        };
        let entries: Vec<[LitCells; 2]> = (0..function.geometry().entries()).map(lit).collect();
        let is_whole = |cells: &LitCells| cells.leaves.len() == mesh.len();
        if entries.iter().flatten().all(is_whole) { Self::Whole } else { Self::Lit(entries) }
    }

    /// Returns true if the function has light anywhere under one combination of indices (positions on the axes before
    /// the directions).
    #[inline]
    pub(super) fn has_any(&self, entry: usize, density: Density) -> bool {
        match self {
            Self::Whole => true,
            Self::Lit(entries) => !of(entries, entry, density).leaves.is_empty(),
        }
    }

    /// Density in sr⁻¹ of defensive sampling at a direction of the outgoing domain.
    #[inline]
    pub(super) fn pdf(&self, warps: &Warps, at: (usize, Density), direction: Direction) -> f64 {
        match self {
            Self::Whole => warps.background(direction),
            Self::Lit(entries) => of(entries, at.0, at.1).pdf(warps.mesh().lookup().locate(direction)),
        }
    }

    /// Maps a point of the unit square to an outgoing direction of defensive sampling, which draws independently of the
    /// function's values. `None` for a luminaire without light.
    pub(super) fn draw(&self, warps: &Warps, at: (usize, Density), u: [f64; 2]) -> Option<Direction> {
        match self {
            Self::Whole => Some(warps.draw_background(u)),
            Self::Lit(entries) => of(entries, at.0, at.1).draw(warps.mesh().mesh(), u),
        }
    }

    /// Point of the unit square that defensive sampling ([`Background::draw`]) maps to `direction`.
    pub(super) fn place(&self, warps: &Warps, at: (usize, Density), direction: Direction) -> Option<[f64; 2]> {
        match self {
            Self::Whole => Some(warps.place_background(direction)),
            Self::Lit(entries) => of(entries, at.0, at.1).place(warps.mesh().mesh(), direction),
        }
    }

    pub(super) fn memory(&self) -> usize {
        match self {
            Self::Whole => 0,
            Self::Lit(entries) => entries.iter().flatten().map(LitCells::memory).sum(),
        }
    }
}

/// Returns, for each triangle, true if the material's smoothly interpolated function may be nonzero in it. An
/// interpolation patch with light at one corner has light everywhere and may cover dark triangles. Without patches,
/// light reaches all triangles that share a corner with a triangle that has light.
fn reached(smooth: Option<&Smooth>, entry: usize, lookup: &MeshLookup, has_light: &[bool]) -> Vec<bool> {
    if !has_light.contains(&false) {
        return has_light.to_vec();
    }
    let cells = 0..has_light.len();
    let beside = |lit: &[bool]| -> Vec<bool> {
        let is_beside = |leaf: usize| {
            let mut around = lookup.corners(leaf).into_iter().flat_map(|corner| lookup.ring(corner));
            around.any(|(cell, _)| lit[cell])
        };
        cells.clone().map(is_beside).collect()
    };
    let near = beside(has_light);
    let Some(smooth) = smooth else { return near };
    let near = beside(&near);
    // Points all over a cell, slightly inside its edges.
    let vertices = lookup.mesh().all_vertices();
    let is_lit_at = |leaf: usize, parts: [u32; 3]| {
        let [a, b, c] = vertices[leaf];
        let [p, q, r] = parts.map(|part| f64::from(part) + INSIDE);
        smooth.is_lit_around(entry, unit(add(scale(a, p), add(scale(b, q), scale(c, r)))))
    };
    let is_reached = |leaf: usize| {
        is_lit_at(leaf, [1; 3]) || (0..=STEPS).any(|i| (0..=STEPS - i).any(|j| is_lit_at(leaf, [i, j, STEPS - i - j])))
    };
    let mut reached: Vec<bool> = cells.map(|leaf| near[leaf] && is_reached(leaf)).collect();
    // The corner of a patch may lie inside a cell, between those points.
    for node in smooth.outgoing_nodes() {
        let [across, along] = [perpendicular(node, [0.3, 0.5, 0.8]), perpendicular(node, [-0.7, 0.6, 0.1])];
        for [u, v] in WAYS {
            let beside = unit(add(node, add(scale(across, u * BESIDE), scale(along, v * BESIDE))));
            if let Some(leaf) = lookup.locate_vector(beside).filter(|_| smooth.is_lit_around(entry, beside)) {
                reached[leaf] = true;
            }
        }
    }
    reached
}

fn of(entries: &[[LitCells; 2]], entry: usize, density: Density) -> &LitCells {
    &entries[entry][usize::from(density == Density::Linear)]
}

/// Mesh triangles in which a function is nonzero, from which outgoing directions are drawn uniformly in solid angle.
#[derive(Debug)]
pub(super) struct LitCells {
    is_lit: Vec<bool>,
    leaves: Vec<u32>,
    /// Solid angle of the triangles in which the function is nonzero, summed up to and including each of them, as a
    /// fraction of the total.
    ends: Vec<f64>,
    solid_angle: f64,
}

impl LitCells {
    fn new(mesh: TriangleMesh, is_lit: Vec<bool>) -> Self {
        let leaves: Vec<u32> = (0..mesh.len()).filter(|&leaf| is_lit[leaf]).map(|leaf| leaf as u32).collect();
        let mut solid_angle = 0.0;
        let mut ends: Vec<f64> = Vec::with_capacity(leaves.len());
        for &leaf in &leaves {
            solid_angle += mesh.solid_angle(leaf as usize);
            ends.push(solid_angle);
        }
        for end in &mut ends {
            *end /= solid_angle;
        }
        Self { is_lit, leaves, ends, solid_angle }
    }

    fn pdf(&self, leaf: Option<usize>) -> f64 {
        if leaf.is_some_and(|leaf| self.is_lit[leaf]) { 1.0 / self.solid_angle } else { 0.0 }
    }

    fn draw(&self, mesh: TriangleMesh, [u, v]: [f64; 2]) -> Option<Direction> {
        let k = self.ends.partition_point(|&end| end <= u).min(self.leaves.len().checked_sub(1)?);
        let [start, length] = self.interval(k);
        let u = ((u - start) / length).clamp(0.0, BELOW_ONE);
        Some(Direction::from_unit(in_triangle(mesh.vertices(self.leaves[k] as usize), [u, v])))
    }

    fn place(&self, mesh: TriangleMesh, direction: Direction) -> Option<[f64; 2]> {
        let leaf = mesh.locate(direction).filter(|&leaf| self.is_lit[leaf])? as u32;
        let k = self.leaves.binary_search(&leaf).ok()?;
        let [start, length] = self.interval(k);
        let [u, v] = place_in_triangle(mesh.vertices(leaf as usize), direction.xyz());
        Some([start + length * u, v].map(|u| u.clamp(0.0, BELOW_ONE)))
    }

    /// Start and length, on the unit interval, of the part that selects triangle `k` of those in which the function is
    /// nonzero.
    fn interval(&self, k: usize) -> [f64; 2] {
        let start = if k == 0 { 0.0 } else { self.ends[k - 1] };
        [start, self.ends[k] - start]
    }

    fn memory(&self) -> usize {
        size_of_val(&*self.is_lit) + size_of_val(&*self.leaves) + size_of_val(&*self.ends)
    }
}

/// Signed area of a spherical triangle of unit vectors, in sr (Van Oosterom and Strackee 1983, equation 8).
fn area([a, b, c]: [Vector; 3]) -> f64 {
    2.0 * libm::atan2(dot(a, cross(b, c)), 1.0 + dot(a, b) + dot(b, c) + dot(c, a))
}

/// Maps a point of the unit square to a spherical triangle, uniformly in solid angle (Arvo 1995, *Stratified sampling
/// of spherical triangles*). The first coordinate selects a point q of edge ac by the area of triangle abq. The second
/// coordinate selects the height along the arc from b to q.
fn in_triangle([a, b, c]: [Vector; 3], [u, v]: [f64; 2]) -> Vector {
    let whole = area([a, b, c]);
    // Angle at a, and the cut of the edge by the arc from b: tan of the half area is rational in tan of half the arc.
    let part = u * whole;
    let (x, y) = (perpendicular(a, b), perpendicular(a, c));
    let (cos_b, sin_b) = (dot(a, b), dot(x, b));
    let (cos_angle, sin_angle) = (dot(x, y), dot(a, cross(x, y)));
    // With t = tan(arc/2): tan(area/2) = t·s·sin A / (1 + t·s·cos A), s = tan(side/2) of the side ab (the area of a
    // triangle from two sides and the angle between them).
    let s = sin_b / (1.0 + cos_b);
    let (sin_part, cos_part) = libm::sincos(0.5 * part);
    let t = sin_part / (s * (sin_angle * cos_part - cos_angle * sin_part));
    let (cos_arc, sin_arc) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
    let cut = add(scale(a, cos_arc), scale(y, sin_arc));
    let cos = 1.0 - v * (1.0 - dot(b, cut));
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    unit(add(scale(b, cos), scale(perpendicular(b, cut), sin)))
}

/// Inverse of [`in_triangle`]: the point of the unit square that maps to the direction `d` inside the spherical
/// triangle.
fn place_in_triangle([a, b, c]: [Vector; 3], d: Vector) -> [f64; 2] {
    // Intersection of the arc from b through d with the edge from a to c.
    let normal = cross(b, d);
    if dot(normal, normal) < CORNER {
        return [0.0; 2];
    }
    let cut = unit(cross(cross(a, c), normal));
    let cut = if dot(cut, add(a, c)) < 0.0 { scale(cut, -1.0) } else { cut };
    let u = area([a, b, cut]) / area([a, b, c]);
    let v = (1.0 - dot(b, d)) / (1.0 - dot(b, cut));
    [u, v]
}

/// Unit vector perpendicular to `a`, in the plane of `a` and `b` and on the side of `b`; zero if `a` and `b` are
/// parallel.
fn perpendicular(a: Vector, b: Vector) -> Vector {
    let d = sub(b, scale(a, dot(a, b)));
    let length = norm(d);
    if length > 0.0 { scale(d, 1.0 / length) } else { [0.0; 3] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Domain;
    use std::f64::consts::TAU;

    #[test]
    fn points_of_spherical_triangles_are_uniform_and_lead_back() {
        for (level, leaf) in [(0, 0), (0, 5), (1, 13), (2, 7), (4, 900)] {
            let mesh = TriangleMesh::new(Domain::Sphere, level).unwrap();
            let corners = mesh.vertices(leaf);
            assert!((area(corners).abs() / mesh.solid_angle(leaf) - 1.0).abs() < 1e-9);
            let children = TriangleMesh::new(Domain::Sphere, level + 2).unwrap();
            let mut counts = [0.0; 16];
            let n = 64;
            for k in 0..n * n {
                let u = [k / n, k % n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
                let d = in_triangle(corners, u);
                let back = place_in_triangle(corners, d);
                assert!(u.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-9), "{level} {leaf} {u:?} {back:?}");
                counts[children.locate(Direction::from_unit(d)).unwrap() - 16 * leaf] += 1.0;
            }
            for (k, count) in counts.into_iter().enumerate() {
                let share = children.solid_angle(16 * leaf + k) / mesh.solid_angle(leaf);
                assert!(
                    (count / f64::from(n * n) - share).abs() < 4.0 / f64::from(n * n).sqrt() * share,
                    "{k} {count}"
                );
            }
        }
        assert!((TAU - 4.0 * area([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])).abs() < 1e-12);
    }
}
