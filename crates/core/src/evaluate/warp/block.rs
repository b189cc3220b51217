//! Warps a block of points at once: the steps of [`Warps::sample`] and [`Warps::pdf`], with bit-identical results.
//!
//! A descent waits at every level for the choice above; the descents of a block wait together. Pure arithmetic has
//! loops of its own, which vectorise; table lookups are in other loops.

use super::fraction::{BELOW_ONE, Fraction, UNREDUCED, choose, flipped, inward};
use super::options::Density;
use super::square::{Constant, Linear};
use super::warps::Warps;
use crate::evaluate::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use crate::numeric::wide;

/// Block of drawn outgoing directions with their densities and leaf triangles.
#[derive(Clone, Debug)]
pub(in crate::evaluate) struct Draws {
    pub(in crate::evaluate) directions: Vectors,
    /// Densities in sr⁻¹ of the drawn directions; not positive for a failed draw, whose direction is arbitrary.
    pub(in crate::evaluate) pdf: Block,
    pub(in crate::evaluate) leaves: [u32; BLOCK],
}

impl Draws {
    /// Initial value of a block of outgoing directions before any is drawn: all sampling densities are 0.
    pub(in crate::evaluate) const NOTHING: Self =
        Self { directions: [[0.0; BLOCK], [0.0; BLOCK], [1.0; BLOCK]], pdf: [0.0; BLOCK], leaves: [0; BLOCK] };

    /// Writes the coordinates and densities of drawn directions, all 0 for a failed draw, and returns |cos θ| (or 1
    /// without a cosine factor) over the density.
    pub(in crate::evaluate) fn write(&self, has_cosine: bool, [x, y, z, pdf]: [&mut [f32]; 4]) -> [f32; BLOCK] {
        let mut shares = [0.0; BLOCK];
        for (i, share) in shares.iter_mut().enumerate() {
            let cosine = if has_cosine { self.directions[2][i].abs() } else { 1.0 };
            *share = if self.pdf[i] > 0.0 { (cosine / self.pdf[i]) as f32 } else { 0.0 };
        }
        for (to, numbers) in [x, y, z].into_iter().zip(&self.directions) {
            for ((to, &number), &pdf) in to.iter_mut().zip(numbers).zip(&self.pdf) {
                *to = if pdf > 0.0 { number as f32 } else { 0.0 };
            }
        }
        for (to, &pdf) in pdf.iter_mut().zip(&self.pdf) {
            *to = if pdf > 0.0 { pdf as f32 } else { 0.0 };
        }
        shares
    }
}

/// Results of descending one sampling tree for each point of a block: the square (pair of the mesh's finest triangles)
/// reached, the probabilities of its two triangles, and the point of the unit square rescaled to that square.
struct Reached {
    squares: [u32; BLOCK],
    masses: [Block; 2],
    left: [Block; 2],
}

/// Points drawn inside the finest triangles of a mesh, as barycentric coordinates kept away from edges. Each has the
/// number of its triangle in a square of two (0 lower, 1 upper), and the probability density relative to the triangle's
/// area.
struct Inside {
    halves: [u32; BLOCK],
    coordinates: Vectors,
    densities: Block,
}

#[allow(clippy::needless_range_loop, reason = "places of many arrays side by side")]
impl Warps {
    /// Draws a direction for each sampling tree and point of the unit square, without a defensive component and down to
    /// the leaf triangles.
    pub(in crate::evaluate) fn draw_block(
        &self,
        cells: &[u32; BLOCK],
        u: &[Block; 2],
        density: Density,
        to: &mut Draws,
    ) {
        wide(
            #[inline(always)]
            || {
                let reached = self.reach(cells, u);
                let inside = match density {
                    Density::Uniform => Self::constant_inside(&reached),
                    Density::Linear => self.linear_inside(cells, &reached),
                };
                self.write_points(cells, &reached, &inside, to);
            },
        );
    }

    /// Writes the directions that belong to points inside the mesh's finest triangles, and the probability densities in
    /// sr⁻¹ with which these directions are drawn.
    #[inline(always)]
    fn write_points(&self, cells: &[u32; BLOCK], reached: &Reached, inside: &Inside, to: &mut Draws) {
        for i in 0..BLOCK {
            let (leaf, frame) = self.mesh().framed(2 * reached.squares[i] as usize + inside.halves[i] as usize);
            let (direction, factor) = self.mesh().point(leaf, frame, vector_of(&inside.coordinates, i));
            // A cell without light gives NaN.
            let is_drawn = self.total(cells[i] as usize) > 0.0;
            set_vector(&mut to.directions, i, if is_drawn { direction.xyz() } else { [0.0, 0.0, 1.0] });
            to.pdf[i] = if is_drawn { inside.densities[i] * factor } else { 0.0 };
            to.leaves[i] = leaf as u32;
        }
    }

    /// Descends all sampling trees of a block together, level by level.
    #[inline(always)]
    fn reach(&self, cells: &[u32; BLOCK], u: &[Block; 2]) -> Reached {
        let (mesh, last) = (&**self.mesh(), self.mesh().mesh().level());
        let trees = cells.map(|cell| cell as usize * mesh.groups());
        let (mut over, mut under) = (*u, [[1.0; BLOCK]; 2]);
        for over in over.as_flattened_mut() {
            *over = if *over < BELOW_ONE { *over } else { BELOW_ONE };
        }
        let mut squares = [0_u32; BLOCK];
        let mut weights = [[0.0_f32; BLOCK]; 4];
        let (mut start, mut next, mut width) = (0, 1, mesh.mesh().bases() / 2);
        for level in 0..=last {
            if level > 0 {
                start = next;
                next += width;
                width *= 4;
            }
            for i in 0..BLOCK {
                let [a, b, c, d, e, f, g, h] = self.groups()[trees[i] + start + squares[i] as usize].0;
                for (weights, weight) in weights.iter_mut().zip([a + b, c + d, e + f, g + h]) {
                    weights[i] = weight;
                }
            }
            for i in 0..BLOCK {
                let mut left = [0, 1].map(|k| Fraction { over: over[k][i], under: under[k][i] });
                let quadrant = choose([0, 1, 2, 3].map(|k| f64::from(weights[k][i])), &mut left);
                squares[i] = 4 * squares[i] + quadrant as u32;
                [over[0][i], over[1][i]] = left.map(|left| left.over);
                [under[0][i], under[1][i]] = left.map(|left| left.under);
            }
            if level == 0 {
                for i in 0..BLOCK {
                    let left = [0, 1].map(|k| Fraction { over: over[k][i], under: under[k][i] });
                    [over[0][i], over[1][i]] = flipped(squares[i] as usize, left).map(|left| left.over);
                }
            } else if level % UNREDUCED == 0 {
                reduce(&mut over, &under);
                under = [[1.0; BLOCK]; 2];
            }
        }
        reduce(&mut over, &under);
        let mut masses = [[0.0; BLOCK]; 2];
        for i in 0..BLOCK {
            let group = &self.groups()[trees[i] + start + squares[i] as usize / 4].0;
            let lower = 2 * (squares[i] as usize % 4);
            [masses[0][i], masses[1][i]] = [group[lower], group[lower + 1]].map(f64::from);
        }
        Reached { squares, masses, left: over }
    }

    #[inline(always)]
    fn constant_inside(reached: &Reached) -> Inside {
        let [lower, upper] = &reached.masses;
        let mut inside = Inside { halves: [0; BLOCK], coordinates: [[0.0; BLOCK]; 3], densities: [0.0; BLOCK] };
        for i in 0..BLOCK {
            let point = Constant([lower[i], upper[i]]).draw([reached.left[0][i], reached.left[1][i]]);
            inside.halves[i] = u32::from(point.upper);
            inside.densities[i] = if point.upper { upper[i] } else { lower[i] };
            set_vector(&mut inside.coordinates, i, inward(point.coordinates()));
        }
        inside
    }

    #[inline(always)]
    fn linear_inside(&self, cells: &[u32; BLOCK], reached: &Reached) -> Inside {
        let shapes = self.shapes(cells, &reached.squares);
        let linear = |i: usize| {
            let [start, upper, lower, end] = [0, 1, 2, 3].map(|k| f64::from(shapes[k][i]));
            Linear::new([reached.masses[0][i], reached.masses[1][i]], [[lower, start, end], [upper, start, end]])
        };
        let mut a = [0.0; BLOCK];
        let mut far = [0_u32; BLOCK];
        for i in 0..BLOCK {
            let (near, is_exact) = linear(i).near(reached.left[0][i]);
            (a[i], far[i]) = (near, u32::from(!is_exact));
        }
        if far.iter().fold(0, |any, far| any | far) != 0 {
            for i in (0..BLOCK).filter(|&i| far[i] != 0) {
                a[i] = linear(i).line_at(reached.left[0][i]);
            }
        }
        let mut inside = Inside { halves: [0; BLOCK], coordinates: [[0.0; BLOCK]; 3], densities: [0.0; BLOCK] };
        for i in 0..BLOCK {
            let linear = linear(i);
            let point = linear.draw_on(a[i], reached.left[1][i]);
            let coordinates = inward(point.coordinates());
            inside.halves[i] = u32::from(point.upper);
            inside.densities[i] = linear.density(point.upper, coordinates);
            set_vector(&mut inside.coordinates, i, coordinates);
        }
        inside
    }

    /// Reads, for each direction of a block, the values to which the sampling density is proportional at the four
    /// corners of the square (pair of the mesh's finest triangles) that contains it.
    #[inline(always)]
    fn shapes(&self, cells: &[u32; BLOCK], squares: &[u32; BLOCK]) -> [[f32; BLOCK]; 4] {
        let points = self.mesh().vertices().len();
        let mut shapes = [[0.0; BLOCK]; 4];
        for i in 0..BLOCK {
            let shape = &self.vertices()[cells[i] as usize * points..][..points];
            for (shapes, vertex) in shapes.iter_mut().zip(self.mesh().quad(squares[i] as usize)) {
                shapes[i] = shape[vertex as usize];
            }
        }
        shapes
    }
}

/// Divides the coordinates of a block of points in the unit square, kept as numerators `over` and denominators `under`.
/// The quotients, limited to less than 1, replace the numerators.
#[inline(always)]
fn reduce(over: &mut [Block; 2], under: &[Block; 2]) {
    for (over, &under) in over.as_flattened_mut().iter_mut().zip(under.as_flattened()) {
        *over = Fraction { over: *over, under }.value();
    }
}
