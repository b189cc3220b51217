//! The incoming directions as nodes: which three lie around a direction, and where a lobe seen from one is seen from another.

use super::lookup::{MeshLookup, elevation};
use super::reconstruct::Cells;
use crate::domain::Domain;
use crate::domain::vector::{Vector, add, cross, dot, scale, unit};
use std::sync::Arc;

/// No cell beyond an edge of the domain.
const NONE: u32 = u32::MAX;

/// The height above the horizon below which carried directions lose their worth, and what they keep of it.
const LOW: f64 = 0.1;
const WORTHLESS: f32 = 1e-3;

/// How the function around one incoming direction is carried to another before two are mixed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Alignment {
    /// Outgoing directions stay.
    #[default]
    None,
    /// Reflected light keeps its half vector, so that a gloss lobe moves with the mirror direction and keeps its shape
    /// (Rusinkiewicz 1998); transmitted light turns with the incoming direction.
    HalfVector,
    /// As `HalfVector`, after turning about the normal to the same azimuth, as isotropic surfaces do.
    TurnedHalfVector,
    /// Outgoing directions turn with the incoming one, as scattering in a medium does.
    Rotation,
}

/// Up to three nodes with weights that add up to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Around {
    pub(super) nodes: [u32; 3],
    pub(super) weights: [f32; 3],
    pub(super) count: usize,
}

impl Around {
    fn one(node: u32) -> Self {
        Self { nodes: [node, 0, 0], weights: [1.0, 0.0, 0.0], count: 1 }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        self.nodes[..self.count].iter().zip(self.weights).map(|(&node, weight)| (node as usize, weight))
    }
}

/// The nodes of an incoming axis: its entries first, then those made from entries around.
#[derive(Debug)]
pub(super) enum Nodes {
    /// No incoming axis.
    One,
    /// Any incoming direction, carried to this one.
    Same(Vector),
    /// Elevations in degrees and their directions in the plane of azimuth 0.
    Elevations(Vec<f64>, Vec<Vector>),
    /// Cells and, between them, the vertices of a mesh.
    Triangles(Triangles),
}

/// Nodes at the centroids of triangles and at their vertices.
#[derive(Debug)]
pub(super) struct Triangles {
    lookup: Arc<MeshLookup>,
    cells: usize,
    /// Centroids, then vertices.
    positions: Vec<Vector>,
    /// The direction whose function a node holds: for a vertex that of the cells around it, which is inside at the rim.
    seen_from: Vec<Vector>,
    /// The cell beyond the edge opposite to corner k.
    beyond: Vec<[u32; 3]>,
    /// For each vertex, the cells that make it; for each cell, those that would make it without itself, none at the rim.
    sources: Vec<Vec<(usize, f32)>>,
    others: Vec<Vec<(usize, f32)>>,
}

impl Nodes {
    pub(super) fn elevations(values: &[f64]) -> Self {
        let direction = |&theta: &f64| {
            let (sin, cos) = libm::sincos(theta.to_radians());
            [sin, 0.0, cos]
        };
        Self::Elevations(values.to_vec(), values.iter().map(direction).collect())
    }

    pub(super) fn triangles(lookup: Arc<MeshLookup>) -> Self {
        let mesh = lookup.mesh();
        let mut positions: Vec<Vector> = (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect();
        positions.resize(mesh.len() + lookup.vertices(), [0.0; 3]);
        for (i, vertices) in mesh.all_vertices().into_iter().enumerate() {
            for (vertex, position) in lookup.corners(i).into_iter().zip(vertices) {
                positions[mesh.len() + vertex as usize] = position;
            }
        }
        let beyond: Vec<[u32; 3]> = (0..mesh.len())
            .map(|i| {
                let corners = lookup.corners(i);
                [0, 1, 2].map(|k| {
                    let (a, b) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                    let mut sharing = lookup.ring(a).filter(|&(j, _)| j != i && lookup.corners(j).contains(&b));
                    sharing.next().map_or(NONE, |(j, _)| j as u32)
                })
            })
            .collect();
        let fits = Cells::new(mesh, false);
        let quadratic = |d: Vector, left_out: Option<usize>| -> Vec<(usize, f32)> {
            fits.value_at(&lookup, d, left_out).into_iter().map(|(cell, weight)| (cell as usize, weight)).collect()
        };
        let others = (0..mesh.len())
            .map(|i| if at_rim_of(&beyond, i) { Vec::new() } else { quadratic(positions[i], Some(i)) })
            .collect();
        let mut seen_from = positions[..mesh.len()].to_vec();
        let mut sources = Vec::with_capacity(lookup.vertices());
        for vertex in 0..lookup.vertices() as u32 {
            let position = positions[mesh.len() + vertex as usize];
            let at_rim = mesh.domain() != Domain::Sphere && position[2].abs() < 1e-9;
            // At the rim nothing is extrapolated: the mean of the cells there, as seen from where they are.
            if at_rim || mesh.level() == 0 {
                let sum =
                    |sum: Vector, (cell, weight): (usize, f32)| add(sum, scale(positions[cell], f64::from(weight)));
                seen_from.push(unit(lookup.ring(vertex).fold([0.0; 3], sum)));
                sources.push(lookup.ring(vertex).collect());
            } else {
                seen_from.push(position);
                sources.push(quadratic(position, None));
            }
        }
        Self::Triangles(Triangles { cells: mesh.len(), lookup, positions, seen_from, beyond, sources, others })
    }

    /// How many nodes, and how many of them are entries of the axis.
    pub(super) fn counts(&self) -> (usize, usize) {
        match self {
            Self::One | Self::Same(_) => (1, 1),
            Self::Elevations(values, _) => (values.len(), values.len()),
            Self::Triangles(triangles) => (triangles.positions.len(), triangles.cells),
        }
    }

    /// The incoming direction whose function a node holds.
    #[inline]
    pub(super) fn direction(&self, node: usize) -> Vector {
        match self {
            Self::One => [0.0, 0.0, 1.0],
            Self::Same(direction) => *direction,
            Self::Elevations(_, directions) => directions[node],
            Self::Triangles(triangles) => triangles.seen_from[node],
        }
    }

    /// The entries that make a node which is none itself: with weights that add up to 1.
    pub(super) fn sources(&self, node: usize) -> Vec<(usize, f32)> {
        match self {
            Self::Triangles(triangles) if node >= triangles.cells => triangles.sources[node - triangles.cells].clone(),
            _ => vec![(node, 1.0)],
        }
    }

    /// The entries next to entry `node`.
    pub(super) fn neighbours(&self, node: usize) -> Vec<usize> {
        match self {
            Self::One | Self::Same(_) => Vec::new(),
            Self::Elevations(values, _) => (node + 1 < values.len()).then_some(node + 1).into_iter().collect(),
            Self::Triangles(triangles) => {
                triangles.beyond[node].iter().filter(|&&j| j != NONE).map(|&j| j as usize).collect()
            }
        }
    }

    /// Entries that predict entry `node` without itself; `None` at the rim.
    pub(super) fn others(&self, node: usize) -> Option<Vec<(usize, f32)>> {
        match self {
            Self::One | Self::Same(_) => None,
            Self::Elevations(values, _) => {
                let (below, above) = (values.get(node.checked_sub(1)?)?, values.get(node + 1)?);
                let t = ((values[node] - below) / (above - below)) as f32;
                Some(vec![(node - 1, 1.0 - t), (node + 1, t)])
            }
            Self::Triangles(triangles) => {
                let others = &triangles.others[node];
                (!others.is_empty()).then(|| others.clone())
            }
        }
    }

    /// The nodes around an incoming direction (of azimuth 0 for elevations); `None` outside the domain.
    pub(super) fn around(&self, wi: Vector) -> Option<Around> {
        match self {
            Self::One | Self::Same(_) => Some(Around::one(0)),
            Self::Elevations(values, _) => {
                let (below, t) = elevation(values, libm::atan2(libm::hypot(wi[0], wi[1]), wi[2]).to_degrees());
                let t = t as f32;
                let one = Around::one(below as u32);
                if t > 0.0 {
                    Some(Around { nodes: [below as u32, below as u32 + 1, 0], weights: [1.0 - t, t, 0.0], count: 2 })
                } else {
                    Some(one)
                }
            }
            Self::Triangles(triangles) => triangles.around(wi),
        }
    }

    pub(super) fn memory(&self) -> usize {
        match self {
            Self::One | Self::Same(_) => 0,
            Self::Elevations(values, directions) => size_of_val(&**values) + size_of_val(&**directions),
            Self::Triangles(triangles) => {
                size_of_val(&*triangles.positions)
                    + size_of_val(&*triangles.seen_from)
                    + size_of_val(&*triangles.beyond)
            }
        }
    }
}

/// Whether cell `i` lies at the rim.
fn at_rim_of(beyond: &[[u32; 3]], i: usize) -> bool {
    beyond[i].contains(&NONE)
}

impl Triangles {
    /// A cell's centroid and the neighbour's span, with each end of the edge between them, a triangle; at the rim the
    /// centroid does so with both ends.
    fn around(&self, wi: Vector) -> Option<Around> {
        let cell = self.lookup.locate_vector(wi)?;
        let centre = self.positions[cell];
        let corners = self.lookup.corners(cell).map(|vertex| self.cells + vertex as usize);
        let sides = corners.map(|corner| dot(wi, cross(centre, self.positions[corner])));
        let turn = dot(centre, cross(self.positions[corners[0]], self.positions[corners[1]])).signum();
        // The sector between corners j and k: the direction is left of one and right of the other.
        let which = (0..3).find(|&i| turn * sides[(i + 1) % 3] >= 0.0 && turn * sides[(i + 2) % 3] <= 0.0).unwrap_or(0);
        let (j, k) = (corners[(which + 1) % 3], corners[(which + 2) % 3]);
        let beyond = self.beyond[cell][which];
        let nodes = if beyond == NONE {
            [cell, j, k]
        } else {
            let line = cross(centre, self.positions[beyond as usize]);
            let same_side = dot(wi, line) * dot(self.positions[j], line) >= 0.0;
            [cell, beyond as usize, if same_side { j } else { k }]
        };
        let [a, b, c] = nodes.map(|node| self.positions[node]);
        let orientation = dot(a, cross(b, c)).signum();
        let parts = [cross(b, c), cross(c, a), cross(a, b)].map(|plane| (orientation * dot(wi, plane)).max(0.0));
        let sum: f64 = parts.iter().sum();
        let weights = if sum > 0.0 { parts.map(|part| (part / sum) as f32) } else { [1.0, 0.0, 0.0] };
        Some(Around { nodes: nodes.map(|node| node as u32), weights, count: 3 })
    }
}

/// Where what is seen along `wo` under `wi` is seen under `to`, and how much that is worth: next to nothing where it would
/// be below the horizon, and is therefore looked up at it.
#[inline]
pub(super) fn carried(alignment: Alignment, domain: Domain, wi: Vector, to: Vector, wo: Vector) -> (Vector, f32) {
    let (wi, wo) = if alignment == Alignment::TurnedHalfVector { turned_to(to, wi, wo) } else { (wi, wo) };
    let moved = match alignment {
        Alignment::None => return (wo, 1.0),
        Alignment::HalfVector | Alignment::TurnedHalfVector if wo[2] >= 0.0 => {
            let h = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
            let square = dot(h, h);
            if square < 1e-12 {
                return (wo, WORTHLESS);
            }
            let along = 2.0 * dot(to, h) / square;
            [along * h[0] - to[0], along * h[1] - to[1], along * h[2] - to[2]]
        }
        _ => {
            let axis = cross(wi, to);
            let cos = dot(wi, to);
            if cos < -0.999 {
                return (wo, WORTHLESS);
            }
            let once = cross(axis, wo);
            let twice = cross(axis, once);
            let share = 1.0 / (1.0 + cos);
            [0, 1, 2].map(|k| wo[k] + once[k] + share * twice[k])
        }
    };
    if domain == Domain::Sphere && alignment == Alignment::Rotation {
        return (moved, 1.0);
    }
    let side = if wo[2] >= 0.0 { 1.0 } else { -1.0 };
    let height = side * moved[2];
    let worth = ((height / LOW) as f32).clamp(WORTHLESS, 1.0);
    ([moved[0], moved[1], side * height.max(0.0)], worth)
}

/// `wi` and `wo` turned about the normal until `wi` has the azimuth of `to`; that of the normal is 0.
#[inline]
fn turned_to(to: Vector, wi: Vector, wo: Vector) -> (Vector, Vector) {
    let azimuth = |d: Vector| {
        let length = (d[0] * d[0] + d[1] * d[1]).sqrt();
        if length > 1e-9 { [d[0] / length, d[1] / length] } else { [1.0, 0.0] }
    };
    let ([ca, sa], [cb, sb]) = (azimuth(to), azimuth(wi));
    let (cos, sin) = (ca * cb + sa * sb, sa * cb - ca * sb);
    let turn = |d: Vector| [cos * d[0] - sin * d[1], sin * d[0] + cos * d[1], d[2]];
    (turn(wi), turn(wo))
}
