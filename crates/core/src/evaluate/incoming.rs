//! Incoming directions as nodes: the three around a direction, and the image of a lobe from one node to another.

pub(super) mod middles;

use super::lookup::MeshLookup;
use super::reconstruct::Cells;
use crate::domain::Domain;
use crate::domain::vector::{Vector, add, cross, dot, scale, unit};
use crate::numeric::bracket::Bracket;
use crate::numeric::number::Number;
use std::sync::Arc;
use wide::f32x4;

/// Placeholder for the number of a triangle's missing neighbour, beyond an edge of the domain.
const NONE: u32 = u32::MAX;

/// Height above the horizon (|cos θ|) below which a direction moved by the alignment of lobes between incoming
/// directions loses weight, and the weight that remains at the horizon.
const LOW: f32 = 0.1;
const WORTHLESS: f32 = 1e-3;
/// Height of a direction that counts as just below the horizon, not as on it.
const BELOW_HORIZON: f32 = 1e-6;
/// Squared length of a half vector (sum of two unit vectors) below which it has no direction.
pub(super) const NO_HALF_VECTOR: f32 = 1e-12;
/// Squared sine of the polar angle below which a direction counts as having azimuth 0.
const NO_AZIMUTH: f32 = 1e-18;
/// Cosine of the angle between two incoming directions; below this value they are so nearly opposite that the axis of
/// the rotation between them is ill-defined. An outgoing direction is then rotated as for the negative of the second
/// incoming direction, and negated.
pub(super) const NEARLY_BACK: f32 = -0.999;

/// Alignment of lobes: rule that maps outgoing directions from one incoming direction to another before the function is
/// interpolated between the two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Alignment {
    /// Lobes do not move: values are interpolated between equal outgoing directions under different incoming
    /// directions.
    #[default]
    None,
    /// Reflected light keeps its half vector, so that a gloss lobe moves with the mirror direction and keeps its shape
    /// (Rusinkiewicz 1998). Transmitted light rotates with the incoming direction.
    HalfVector,
    /// Reflected light keeps its half vector, as for `HalfVector`, after a rotation about the normal that gives both
    /// incoming directions the same azimuth. This suits isotropic surfaces.
    TurnedHalfVector,
    /// Outgoing directions rotate with the incoming direction, as suits scattering in a medium.
    Rotation,
}

/// Up to three interpolation nodes around an incoming direction, with weights that sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Around {
    pub(super) nodes: [u32; 3],
    pub(super) weights: [f32; 3],
    pub(super) count: usize,
}

impl Around {
    /// Placeholder until the interpolation nodes around an incoming direction are found: node 0 with weight 1.
    pub(super) const NOWHERE: Self = Self { nodes: [0; 3], weights: [1.0, 0.0, 0.0], count: 1 };

    fn one(node: u32) -> Self {
        Self { nodes: [node, 0, 0], weights: [1.0, 0.0, 0.0], count: 1 }
    }
}

/// Interpolation nodes over incoming directions: first the sampled directions, then directions between them whose
/// values derive from the samples around.
#[derive(Debug)]
pub(super) enum Nodes {
    /// Single interpolation node, for data that do not depend on an incoming direction.
    One,
    /// Single interpolation node of a function that only rotates with the incoming direction, as in many scattering
    /// media.
    Same(Vector),
    /// Incoming elevations in degrees and their directions at azimuth 0.
    Elevations(Vec<f64>, Vec<Vector>),
    /// Interpolation nodes at the centroids of a mesh of incoming triangles, which are sampled, and at the mesh's
    /// vertices, whose values derive from the centroids around.
    Triangles(Triangles),
}

/// Interpolation nodes at the centroids of the triangles of an incoming mesh and at the mesh's vertices.
#[derive(Debug)]
pub(super) struct Triangles {
    lookup: Arc<MeshLookup>,
    cells: usize,
    /// Directions of the interpolation nodes: centroids of the triangles, then vertices, then midpoints if there are
    /// any.
    positions: Vec<Vector>,
    /// Incoming direction under which each interpolation node holds the function over outgoing directions. At a vertex
    /// on the rim of the domain this is the mean direction of the triangles around it, which lies inside the domain.
    seen_from: Vec<Vector>,
    /// For each triangle, its neighbours beyond the edges opposite corners 0, 1 and 2.
    beyond: Vec<[u32; 3]>,
    fans: Vec<Fan>,
    /// For each of six sectors of each incoming triangle, its three interpolation nodes and the midpoint nodes between
    /// them; empty without midpoint nodes.
    middles: Vec<[[[u32; 3]; 2]; 6]>,
    /// Pair of interpolation nodes between which each midpoint node lies.
    ends: Vec<[u32; 2]>,
    /// For each interpolation node that is not a sampled incoming direction (vertices of the incoming mesh, then
    /// midpoints): the sampled triangles and weights that give its values. Then, for each triangle, the other triangles
    /// and weights that predict its values; empty at the rim of the domain.
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
            let at_rim = lookup.ends_at_horizon() && position[2].abs() < 1e-9;
            // No extrapolation at the rim: a vertex there stores the mean of its cells, seen from their mean direction.
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
        let fans = (0..mesh.len()).map(|cell| Fan::new(&lookup, &positions, &beyond[cell], cell)).collect();
        let (cells, middles, ends) = (mesh.len(), Vec::new(), Vec::new());
        Self::Triangles(Triangles { lookup, cells, positions, seen_from, beyond, fans, middles, ends, sources, others })
    }

    /// Number of interpolation nodes, and number of those that are sampled incoming directions.
    pub(super) fn counts(&self) -> (usize, usize) {
        match self {
            Self::One | Self::Same(_) => (1, 1),
            Self::Elevations(values, _) => (values.len(), values.len()),
            Self::Triangles(triangles) => (triangles.positions.len(), triangles.cells),
        }
    }

    /// Incoming direction under which an interpolation node holds the function over outgoing directions.
    #[inline]
    pub(super) fn direction(&self, node: usize) -> Vector {
        match self {
            Self::One => [0.0, 0.0, 1.0],
            Self::Same(direction) => *direction,
            Self::Elevations(_, directions) => directions[node],
            Self::Triangles(triangles) => triangles.seen_from[node],
        }
    }

    /// Numbers of the sampled incoming directions from which the values under interpolation node `node` derive, with
    /// weights that sum to 1. A node that is itself a sampled direction derives from it alone.
    pub(super) fn sources(&self, node: usize) -> Vec<(usize, f32)> {
        match self {
            Self::Triangles(triangles) if node >= triangles.cells => triangles.sources[node - triangles.cells].clone(),
            _ => vec![(node, 1.0)],
        }
    }

    /// Numbers of the sampled incoming directions adjacent to sampled incoming direction number `node`; on an axis of
    /// elevations only the next larger one.
    pub(super) fn neighbours(&self, node: usize) -> Vec<usize> {
        match self {
            Self::One | Self::Same(_) => Vec::new(),
            Self::Elevations(values, _) => (node + 1 < values.len()).then_some(node + 1).into_iter().collect(),
            Self::Triangles(triangles) => {
                triangles.beyond[node].iter().filter(|&&j| j != NONE).map(|&j| j as usize).collect()
            }
        }
    }

    /// Sampled incoming directions, with weights, that predict sampled direction `node` without itself; `None` at the
    /// rim of the domain.
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

    /// Interpolation nodes around an incoming direction (at azimuth 0 for elevations); `None` outside the domain.
    #[inline(always)]
    pub(super) fn around(&self, wi: Vector) -> Option<Around> {
        match self {
            Self::One | Self::Same(_) => Some(Around::one(0)),
            Self::Elevations(values, _) => {
                let theta = libm::acos(wi[2].clamp(-1.0, 1.0)).to_degrees();
                let Bracket { below, t, .. } = Bracket::held(values, theta);
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

    /// Up to three interpolation nodes around the incoming direction `wi`, with their weights. Like [`Nodes::around`],
    /// but saves a search by the number `entry` of the incoming triangle that contains `wi`.
    #[inline(always)]
    pub(super) fn around_in(&self, entry: usize, wi: Vector) -> Option<Around> {
        match self {
            Self::Triangles(triangles) => Some(triangles.around_in(entry, wi)),
            _ => self.around(wi),
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
                    + size_of_val(&*triangles.fans)
                    + size_of_val(&*triangles.middles)
            }
        }
    }
}

/// Returns true if triangle `i` has an edge on the rim of the domain.
fn at_rim_of(beyond: &[[u32; 3]], i: usize) -> bool {
    beyond[i].contains(&NONE)
}

impl Triangles {
    #[inline(always)]
    fn around(&self, wi: Vector) -> Option<Around> {
        Some(self.around_in(self.lookup.locate_vector(wi)?, wi))
    }

    /// Interpolation nodes around the incoming direction `wi`, a vector of any length inside triangle `cell`.
    #[inline(always)]
    fn around_in(&self, cell: usize, wi: Vector) -> Around {
        let fan = &self.fans[cell];
        let [x, y, z] = wi.map(|x| x as f32);
        // Bit k: left of ray k.
        let side = |k: usize| {
            let at = |axis: usize| {
                f32x4::new([fan.rays[axis][k], fan.rays[axis][k + 1], fan.rays[axis][k + 2], fan.rays[axis][k + 3]])
            };
            at(0) * f32x4::splat(x) + at(1) * f32x4::splat(y) + at(2) * f32x4::splat(z)
        };
        let left = side(0).simd_ge(f32x4::ZERO).to_bitmask() | (side(4).simd_ge(f32x4::ZERO).to_bitmask() << 4);
        // Left of one ray and right of the next: exactly one of the six, except at the centroid itself.
        let next = (left >> 1) | ((left & 1) << 5);
        let sector = &fan.sectors[((left & !next & 63).trailing_zeros() as usize).min(5)];
        let [dx, dy, dz] = sector.duals.map(f32x4::new);
        let parts = (dx * f32x4::splat(x) + dy * f32x4::splat(y) + dz * f32x4::splat(z)).fast_max(f32x4::ZERO);
        let [a, b, c, _] = parts.to_array();
        let sum = a + b + c;
        let [a, b, c, _] = (parts / f32x4::splat(sum)).to_array();
        let weights = if sum > 0.0 { [a, b, c] } else { [1.0, 0.0, 0.0] };
        Around { nodes: sector.nodes, weights, count: 3 }
    }
}

/// Triangle cut into six sectors by rays from its centroid to its corners and, alternately, to its neighbours'
/// centroids. A sector spans the centroid, a neighbour's centroid and an end of the edge between them. At the rim it
/// spans the centroid and both ends.
#[derive(Debug)]
struct Fan {
    /// Normals of the planes that divide an incoming triangle into six sectors. Each plane contains the origin, the
    /// triangle's centroid and a ray from the centroid to a corner or a neighbour's centroid. Positive towards the next
    /// ray: all x, then all y, then all z.
    rays: [[f32; 8]; 3],
    /// Six sectors into which rays from its centroid divide a triangle of the incoming mesh, each between one ray and
    /// the next. Each sector has three nodes for interpolation between incoming directions.
    sectors: [Sector; 6],
}

#[derive(Clone, Copy, Debug)]
struct Sector {
    nodes: [u32; 3],
    /// Vectors whose inner products with an incoming direction are proportional to its barycentric coordinates in the
    /// triangle of three interpolation nodes around it: all x, then all y, then all z.
    duals: [[f32; 4]; 3],
}

impl Fan {
    fn new(lookup: &MeshLookup, positions: &[Vector], beyond: &[u32; 3], cell: usize) -> Self {
        let cells = lookup.mesh().len();
        let corners = lookup.corners(cell).map(|vertex| cells + vertex as usize);
        let centre = positions[cell];
        let turn = dot(centre, cross(positions[corners[0]], positions[corners[1]])).signum();
        // Ray to corner k/2 for even k; for odd k, across the edge to the next corner, which is opposite the corner
        // after it.
        let ray = |k: usize| -> (Vector, u32) {
            if k.is_multiple_of(2) {
                return (positions[corners[k / 2]], corners[k / 2] as u32);
            }
            let (from, to, other) = (corners[k / 2], corners[(k / 2 + 1) % 3], beyond[(k / 2 + 2) % 3]);
            if other == NONE { (add(positions[from], positions[to]), NONE) } else { (positions[other as usize], other) }
        };
        let mut rays = [[0.0; 8]; 3];
        for k in 0..6 {
            let plane = cross(centre, ray(k).0);
            for (axis, rays) in rays.iter_mut().enumerate() {
                rays[k] = (turn * plane[axis]) as f32;
            }
        }
        let sectors = std::array::from_fn(|k| {
            // Without a neighbour, the sectors on both sides are the same.
            let nodes = match (ray(k).1, ray((k + 1) % 6).1) {
                (NONE, end) => [cell as u32, ray((k + 5) % 6).1, end],
                (start, NONE) => [cell as u32, start, ray((k + 2) % 6).1],
                (start, end) => [cell as u32, start, end],
            };
            let [a, b, c] = nodes.map(|node| positions[node as usize]);
            let orientation = dot(a, cross(b, c)).signum();
            let planes = [cross(b, c), cross(c, a), cross(a, b), [0.0; 3]];
            let duals = [0, 1, 2].map(|axis| planes.map(|plane| (orientation * plane[axis]) as f32));
            Sector { nodes, duals }
        });
        Self { rays, sectors }
    }
}

/// Incoming direction prepared for queries, with cosine and sine of its azimuth. The azimuth of the normal counts as 0.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Origin<T = f32> {
    pub(super) direction: [T; 3],
    pub(super) azimuth: [T; 2],
}

impl Origin {
    #[inline(always)]
    pub(super) fn new(direction: Vector) -> Self {
        let [x, y, z] = direction.map(|x| x as f32);
        let azimuth = azimuth(direction).map(|x| x as f32);
        Self { direction: [x, y, z], azimuth }
    }

    /// Packs four prepared incoming directions, one per SIMD lane.
    #[inline(always)]
    fn four(of: [Self; 4]) -> Origin<f32x4> {
        let rows = of.map(|Self { direction: [x, y, z], azimuth: [cos, _] }| f32x4::new([x, y, z, cos]));
        let [x, y, z, cos] = f32x4::transpose(rows);
        Origin { direction: [x, y, z], azimuth: [cos, f32x4::new(of.map(|origin| origin.azimuth[1]))] }
    }

    /// Copies one prepared incoming direction to all four SIMD lanes.
    #[inline(always)]
    fn everywhere(self) -> Origin<f32x4> {
        Origin { direction: self.direction.map(f32x4::splat), azimuth: self.azimuth.map(f32x4::splat) }
    }
}

/// Outgoing direction to which `wo` moves when lobes follow the incoming direction from `wi` to `to`, and a factor on
/// the interpolation weight of `to`. The factor is 1, but falls to nearly 0 towards the horizon. A direction that would
/// lie below the horizon is moved up to it.
pub(super) fn carried(alignment: Alignment, domain: Domain, wi: Vector, to: Vector, wo: Vector) -> (Vector, f32) {
    let (there, worth) = carried_to_four(alignment, domain, Origin::new(wi), [Origin::new(to); 4], wo);
    (there.map(|x| f64::from(x.to_array()[0])), worth.to_array()[0])
}

/// Outgoing directions under each of four incoming directions `to` that correspond to `wo` under the incoming direction
/// `wi`, if lobes follow the incoming direction. Also returns a factor on the interpolation weight of each of the four:
/// 1, but nearly 0 towards the horizon.
#[inline(always)]
pub(super) fn carried_to_four(
    alignment: Alignment,
    domain: Domain,
    wi: Origin,
    to: [Origin; 4],
    wo: Vector,
) -> ([f32x4; 3], f32x4) {
    let stays = wo.map(|x| f32x4::splat(x as f32));
    // Only a phase function rotates on the whole sphere; it has no horizon.
    let is_free = domain == Domain::Sphere && alignment == Alignment::Rotation;
    // Light transmitted through a surface rotates, unless nothing moves.
    let lower = domain == Domain::Sphere && wo[2] < 0.0 && alignment != Alignment::None;
    let alignment = if lower { Alignment::Rotation } else { alignment };
    carried_to(alignment, is_free, wi.everywhere(), Origin::four(to), stays)
}

/// Outgoing direction under the incoming direction `to` that corresponds to `wo` under `wi` if lobes follow the
/// incoming direction by the rule `alignment`. Also returns a factor on the interpolation weight of `to`, as
/// [`carried`] does. `is_free` is true if no horizon limits outgoing directions.
#[inline(always)]
pub(super) fn carried_to<T: Number>(
    alignment: Alignment,
    is_free: bool,
    wi: Origin<T>,
    to: Origin<T>,
    wo: [T; 3],
) -> ([T; 3], T) {
    let (zero, one, worthless) = (T::of(0.0), T::of(1.0), T::of(WORTHLESS));
    if alignment == Alignment::None {
        return (wo, one);
    }
    let [tx, ty, tz] = to.direction;
    let [wx, wy, wz] = wi.direction;
    let [x, y, z] = wo;
    let (moved, is_there) = if alignment == Alignment::Rotation {
        let axis = [wy * tz - wz * ty, wz * tx - wx * tz, wx * ty - wy * tx];
        let cos = wx * tx + wy * ty + wz * tz;
        let cross =
            |a: [T; 3], b: [T; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let once = cross(axis, wo);
        let twice = cross(axis, once);
        let sign = T::choose(T::of(NEARLY_BACK).at_most(cos), one, T::of(-1.0));
        let share = one / (sign + cos);
        let moved = |k: usize| sign * wo[k] + once[k] + share * twice[k];
        ([moved(0), moved(1), moved(2)], zero.at_most(one))
    } else {
        let [mut hx, mut hy, hz] = [wx + x, wy + y, wz + z];
        let square = hx * hx + hy * hy + hz * hz;
        if alignment == Alignment::TurnedHalfVector {
            let ([ca, sa], [cb, sb]) = (to.azimuth, wi.azimuth);
            let (cos, sin) = (ca * cb + sa * sb, sa * cb - ca * sb);
            (hx, hy) = (cos * hx - sin * hy, sin * hx + cos * hy);
        }
        let there = tx * hx + ty * hy + tz * hz;
        let nothing = T::of(NO_HALF_VECTOR);
        let along = there * (T::of(2.0) / square.larger(nothing));
        let bound = T::choose(nothing.less(square), zero, T::of(f32::INFINITY));
        ([along * hx - tx, along * hy - ty, along * hz - tz], bound.less(there))
    };
    let choose = |k: usize| T::choose(is_there, moved[k], wo[k]);
    let [mx, my, mz] = [choose(0), choose(1), choose(2)];
    if is_free {
        return ([mx, my, mz], T::choose(is_there, one, worthless));
    }
    let side = T::choose(zero.at_most(z), one, T::of(-1.0));
    let height = side * mz;
    let worth = (height * T::of(1.0 / LOW)).larger(worthless).smaller(one);
    // Directions that move to the horizon stay on their side of it; the horizon itself is above.
    let least = T::choose(zero.at_most(z), zero, T::of(BELOW_HORIZON));
    ([mx, my, side * height.larger(least)], T::choose(is_there, worth, worthless))
}

/// Cosine and sine of a direction's azimuth; [1, 0] for the normal.
#[inline(always)]
pub(super) fn azimuth(d: Vector) -> [f64; 2] {
    let square = d[0] * d[0] + d[1] * d[1];
    let is_turned = square > f64::from(NO_AZIMUTH);
    let length = if is_turned { square.sqrt() } else { 1.0 };
    [if is_turned { d[0] / length } else { 1.0 }, if is_turned { d[1] / length } else { 0.0 }]
}
