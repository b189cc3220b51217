//! Grid of cubes over the first octant that gives the candidate leaves of a unit vector without division or search.
//!
//! Rounding the three coordinates of a unit vector gives its cube. Only cubes that the sphere passes through are
//! stored, column after column, in order within each column.

use crate::domain::vector::{Vector, add, dot};
use std::cell::OnceCell;
use wide::f32x4;

/// Candidate leaf triangles of the directions in a cube of the search grid: `inside` on the positive side of a plane,
/// `outside` on the negative side. If there is one candidate, both fields hold it, which avoids a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) plane: u16,
    pub(super) inside: u16,
    pub(super) outside: u16,
}

impl Place {
    /// Marker in place of the number of the plane that separates two candidate triangles, for a cube of the search grid
    /// with more than two. No mesh has a plane of this number.
    const MANY: u16 = u16::MAX;

    fn many(node: usize, level: u8) -> Self {
        Self { plane: Self::MANY, inside: node as u16, outside: u16::from(level) }
    }

    /// Common ancestor, and its subdivision level, of all leaf triangles that may contain a direction inside this cubic
    /// cell of the search grid; `None` if there are at most two such triangles.
    #[inline(always)]
    pub(super) fn root(self) -> Option<(usize, u8)> {
        (self.plane == Self::MANY).then_some((usize::from(self.inside), self.outside as u8))
    }

    /// Finds the candidate leaf triangles of a region, from bounds on the inner products of its points with a plane.
    /// `cuts` are the three planes of each inner triangle down to `level`, in search order.
    fn within(level: u8, cuts: &[Vector], range: impl Fn(Vector) -> [f64; 2]) -> Self {
        // The region may have a second node, across the plane between them; a third does not fit.
        let (mut nodes, mut split) = ([0, 0], None);
        let (mut root, mut offset, mut width) = ((0, 0), 0, 1);
        for above in 0..level {
            let mut below = nodes;
            if split.is_none() {
                root = (nodes[0], above);
            }
            for which in 0..=usize::from(split.is_some()) {
                let node = nodes[which];
                let sides = [0, 1, 2].map(|k| range(cuts[3 * (offset + node) + k]));
                if let Some(k) = sides.iter().position(|&[low, _]| low > 0.0) {
                    below[which] = 4 * node + k;
                    continue;
                }
                below[which] = 4 * node + 3;
                let mut open = (0..3).filter(|&k| sides[k][1] > 0.0);
                match (open.next(), open.next(), split) {
                    (None, ..) => {}
                    (Some(k), None, None) => {
                        split = Some(3 * (offset + node) + k);
                        below = [4 * node + k, 4 * node + 3];
                    }
                    _ => return Self::many(root.0, root.1),
                }
            }
            nodes = below;
            offset += width;
            width *= 4;
        }
        let [inside, outside] = if split.is_some() { nodes } else { [nodes[0]; 2] };
        Self { plane: split.unwrap_or(0) as u16, inside: inside as u16, outside: outside as u16 }
    }
}

/// Grid of cubes over the first octant, from which the leaf triangle of a direction is found without a search.
#[derive(Debug)]
pub(super) struct Grid {
    /// Number of cubic cells of the search grid per unit of length along x, y and z; directions are unit vectors.
    fine: f64,
    /// Number of columns of cubic cells along a side of the search grid.
    side: u32,
    /// For each column of grid cells along z, the number that gives the position of a cell in the list of stored cells
    /// when it is added, modulo 2¹⁶, to the cell's integer z coordinate.
    starts: Vec<u16>,
    places: Vec<Place>,
}

/// Resolution of the search grid: cubes per unit of length for each leaf triangle along an octant's edge, then minimum
/// and maximum cubes per unit of length. Finer grids need more memory and leave fewer ambiguous cubes.
const FINER: u32 = 3;
const COARSEST: u32 = 16;
const FINEST: u32 = 128;
/// Number of parts along a side into which a cubic cell of the search grid is divided to bound the inner product of its
/// unit vectors with a plane's normal. Only parts that the unit sphere passes through count; more parts give tighter
/// bounds.
const PARTS: u32 = 3;
/// Tolerance on coordinates and inner products, larger than any rounding error of a unit vector, in f32 too.
const SLACK: f64 = 1e-6;
/// 1.5 · 2⁵² (1.5 · 2²³ in f32): adding it rounds a small number to an integer in the low bits of the mantissa.
const ROUND: f64 = 6_755_399_441_055_744.0;
const ROUND_F32: f32 = 12_582_912.0;

/// Cube given by its centre and half its side.
#[derive(Clone, Copy)]
struct Cube {
    centre: Vector,
    half: f64,
}

impl Cube {
    /// Returns true if the octant x, y, z ≥ 0 of the unit sphere passes through this axis-aligned cube, a cell of the
    /// search grid or a part of one; rounding errors are allowed for.
    fn is_passed(self) -> bool {
        let near = self.centre.map(|x| (x - self.half - SLACK).max(0.0));
        let far = self.centre.map(|x| x + self.half + SLACK);
        dot(near, near) <= 1.0 && dot(far, far) >= 1.0 && far.into_iter().all(|x| x >= 0.0)
    }

    /// Lower and upper bound of the inner product of the normal `plane` with the points of an axis-aligned cube, a cell
    /// of the search grid or a part of one.
    fn range(self, plane: Vector) -> [f64; 2] {
        let middle = dot(plane, self.centre);
        let reach = (self.half + SLACK) * (plane[0].abs() + plane[1].abs() + plane[2].abs());
        [middle - reach, middle + reach]
    }

    /// Smaller cubes into which this cube divides, without those that the octant x, y, z ≥ 0 of the unit sphere misses.
    fn parts(self) -> Vec<Self> {
        let half = self.half / f64::from(PARTS);
        let at = |part: u32| [part % PARTS, part / PARTS % PARTS, part / (PARTS * PARTS)];
        let corner = self.centre.map(|x| x - self.half);
        (0..PARTS.pow(3))
            .map(|part| add(corner, at(part).map(|k| f64::from(2 * k + 1) * half)))
            .map(|centre| Self { centre, half })
            .filter(|part| part.is_passed())
            .collect()
    }

    /// Finds the leaf triangles of the direction mesh that may contain a unit vector inside this cubic cell of the
    /// search grid.
    fn place(self, level: u8, cuts: &[Vector]) -> Place {
        let parts = OnceCell::new();
        Place::within(level, cuts, |plane| {
            // Bounds of the whole cube settle most planes.
            let [low, high] = self.range(plane);
            if low > 0.0 || high < 0.0 {
                return [low, high];
            }
            let ranges = parts.get_or_init(|| self.parts()).iter().map(|part| part.range(plane));
            ranges.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], [low, high]| [a.min(low), b.max(high)])
        })
    }
}

impl Grid {
    /// Builds the grid of cubic cells that speeds up the search for the triangle that contains a direction, for a mesh
    /// of subdivision level `level`. `cuts` has three planes for each triangle that is subdivided, level by level. Each
    /// separates the child at one corner from the other children.
    pub(super) fn new(level: u8, cuts: &[Vector]) -> Self {
        let fine = (FINER << level).clamp(COARSEST, FINEST);
        let (mut starts, mut places) = (Vec::new(), Vec::new());
        let half = 0.5 / f64::from(fine);
        for i in 0..=fine {
            for j in 0..=fine {
                let cube = |k| Cube { centre: [i, j, k].map(|x| 2.0 * half * f64::from(x)), half };
                let [x, y, _] = cube(0).centre.map(|x| x + half + SLACK);
                let lowest = (1.0 - x * x - y * y).max(0.0).sqrt() * f64::from(fine) - 1.0;
                let first = (lowest as u32..=fine).take(3).find(|&k| cube(k).is_passed()).unwrap_or(fine + 1);
                starts.push((places.len() as u16).wrapping_sub(first as u16));
                for cube in (first..=fine).map(cube).take_while(|cube| cube.is_passed()) {
                    places.push(cube.place(level, cuts));
                }
            }
        }
        Self { fine: f64::from(fine), side: fine + 1, starts, places }
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.starts) + size_of_val(&*self.places)
    }

    /// Integer coordinates of the grid cube that contains a unit vector of the first octant.
    #[inline(always)]
    pub(super) fn cube(&self, d: Vector) -> [u32; 3] {
        d.map(|x| (x * self.fine + ROUND).to_bits() as u32)
    }

    /// Number of a column of cubes along z in the search grid over unit vectors of the first octant; the cubes have
    /// integer x and y coordinates `i` and `j`.
    #[inline(always)]
    pub(super) fn column(&self, i: u32, j: u32) -> u32 {
        i * self.side + j
    }

    /// Finds the cells of the search grid that contain four unit vectors of the first octant. Returns the numbers of
    /// the cells' columns along z, then their integer z coordinates. Integers are exact in f32.
    #[inline(always)]
    pub(super) fn columns_of_four(&self, d: [f32x4; 3]) -> [[i32; 4]; 2] {
        let (fine, round) = (f32x4::splat(self.fine as f32), f32x4::splat(ROUND_F32));
        let [i, j, k] = d.map(|x| (x * fine + round) - round);
        [i * f32x4::splat(self.side as f32) + j, k].map(|numbers| numbers.fast_trunc_int().to_array())
    }

    /// Mesh triangles that may contain the directions inside a cube of the search grid: the cube with integer z
    /// coordinate `k` in column number `column` along z.
    #[inline(always)]
    pub(super) fn place(&self, column: u32, k: u32) -> Place {
        let start = self.starts.get(column as usize).copied().unwrap_or(u16::MAX);
        let place = usize::from(start.wrapping_add(k as u16));
        self.places.get(place).copied().unwrap_or(Place::many(0, 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::vector::unit;
    use crate::domain::{Domain, TriangleMesh};
    use crate::evaluate::lookup::{MeshLookup, octant};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Triangle lookups to test: all subdivision levels on the sphere. Octants are alike, so that one level of the
    /// other domains suffices.
    fn lookups() -> impl Iterator<Item = MeshLookup> {
        let meshes = (0..=8).map(|level| (Domain::Sphere, level)).chain([(Domain::Hemisphere, 4), (Domain::Lower, 4)]);
        meshes.map(|(domain, level)| MeshLookup::new(TriangleMesh::new(domain, level).unwrap(), false))
    }

    /// Triangle that contains a vector, found by a search from the base triangle down; `None` outside the domain.
    fn searched(lookup: &MeshLookup, [x, y, z]: Vector) -> Option<usize> {
        let [left, back, down] = [x, y, z].map(f64::is_sign_negative);
        let [x, y] = if left == back { [x.abs(), y.abs()] } else { [y.abs(), x.abs()] };
        let first = lookup.triangle(u32::from(left != back) + 2 * u32::from(back), u32::from(down)) as usize;
        let is_inside = match lookup.mesh().domain() {
            Domain::Hemisphere => z >= 0.0,
            Domain::Lower => z <= 0.0,
            Domain::Sphere => true,
        };
        is_inside.then(|| first + lookup.leaf_at(Place::many(0, 0), [x, y, z.abs()]))
    }

    /// Checks which mesh triangle the search grid gives for a vector, in f64 and as one of four vectors in f32. A
    /// search down from the base triangle must give the same.
    fn check(lookup: &MeshLookup, d: Vector) {
        assert_eq!(lookup.locate_vector(d), searched(lookup, d), "{:?} {d:?}", lookup.mesh());
        let single = d.map(|x| x.abs() as f32);
        let [columns, heights] = lookup.grid().columns_of_four(single.map(f32x4::splat));
        let (place, exact) = (lookup.grid().place(columns[3] as u32, heights[3] as u32), single.map(f64::from));
        assert_eq!(lookup.leaf_at(place, exact), lookup.leaf_at(Place::many(0, 0), exact), "{single:?}");
    }

    /// Checks which mesh triangles the search grid gives for a vector of the first octant and its neighbours one unit
    /// in the last place away. Tests them also mirrored into three other octants, one of them below the horizon.
    fn check_near(lookup: &MeshLookup, d: Vector) {
        for step in 0..27 {
            let near = |x: f64, step: u64| if x > 0.0 { f64::from_bits(x.to_bits() + step - 1) } else { x };
            let d = [near(d[0], step % 3), near(d[1], step / 3 % 3), near(d[2], step / 9)];
            for signs in [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [1.0, -1.0, -1.0]] {
                check(lookup, [0, 1, 2].map(|k| d[k] * signs[k]));
            }
        }
    }

    fn random(rng: &mut Pcg64Mcg) -> Vector {
        loop {
            let v = [0; 3].map(|_| 2.0 * rng.random::<f64>() - 1.0);
            let square = dot(v, v);
            if square > 1e-3 && square < 1.0 {
                return unit(v);
            }
        }
    }

    #[test]
    fn random_directions_lie_where_the_search_finds_them() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        for lookup in lookups() {
            for _ in 0..100_000 {
                check(&lookup, random(&mut rng));
            }
        }
    }

    #[test]
    fn so_do_axes_vertices_edges_and_what_is_next_to_them() {
        let mut rng = Pcg64Mcg::seed_from_u64(6);
        for lookup in lookups() {
            for k in 0..3 {
                let axis = [0, 1, 2].map(|j| f64::from(u8::from(j == k)));
                check_near(&lookup, axis);
                check(&lookup, axis.map(|x| -x));
                let mut plane = random(&mut rng).map(f64::abs);
                plane[k] = 0.0;
                check_near(&lookup, unit(plane));
            }
            let level = lookup.mesh().level();
            // Deep levels have many triangles: check a subset.
            let step = if level < 4 { 1 } else { (1 << (2 * (level - 3))) - 3 };
            for [a, b, c] in octant(level).step_by(step) {
                for (a, b) in [(a, b), (b, c), (c, a)] {
                    for t in [0.0, 1e-15, 1e-9, 0.3, 0.5, rng.random()] {
                        check_near(&lookup, unit([0, 1, 2].map(|k| (1.0 - t) * a[k] + t * b[k])));
                    }
                }
            }
        }
    }

    #[test]
    fn so_do_those_on_the_sides_of_cubes() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        for lookup in lookups() {
            let fine = lookup.grid().fine;
            for _ in 0..2000 {
                let [x, y] = [0; 2].map(|_| ((rng.random::<f64>() * fine).floor() + 0.5) / fine);
                let square = 1.0 - x * x - y * y;
                if square >= 0.0 {
                    check_near(&lookup, [x, y, square.sqrt()]);
                    check_near(&lookup, [square.sqrt(), x, y]);
                }
            }
        }
    }

    #[test]
    fn few_cubes_have_more_than_two_leaves() {
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        for lookup in lookups() {
            let grid = lookup.grid();
            let is_open = |d: Vector| {
                let [i, j, k] = grid.cube(d.map(f64::abs));
                grid.place(grid.column(i, j), k).root().is_some()
            };
            let open = (0..50_000).filter(|_| is_open(random(&mut rng))).count();
            let level = lookup.mesh().level();
            println!("level {level}: {open} of 50000, {} bytes", grid.memory());
            // The finest grid is only as fine as leaves of level 7.
            assert!(open < 50_000 / 8 || level > 5, "level {level}: {open}");
        }
    }
}
