//! Warps of many functions on one mesh: direction from a point of the unit square, density, and back.

use super::fraction::{BELOW_ONE, Fraction, UNREDUCED, choose, flipped, interval, inward};
use super::mesh::{FLIPS, Group, WarpMesh};
use super::options::{Density, Measure, SampleOptions};
use super::square::{Constant, Linear, Point, linear_at};
use crate::domain::{Direction, Domain};
use std::f64::consts::{FRAC_1_PI, TAU};
use std::hint::select_unpredictable;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

/// Direction drawn by a warp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Drawn direction.
    pub direction: Direction,
    /// Density in sr⁻¹ of the direction, of the mixture if there is a defensive part; equals [`Warps::pdf`].
    pub pdf: f64,
    /// Leaf triangle that contains the direction.
    pub leaf: usize,
    /// Barycentric coordinates in the planar triangle of the leaf's vertices ([`WarpMesh::corners`]). They allow
    /// evaluation of a function that is linear on triangles without another search.
    pub coordinates: [f64; 3],
}

/// Warps of many functions (one for each incoming cell) on one mesh, in flat tables.
#[derive(Clone, Debug)]
pub struct Warps {
    mesh: Arc<WarpMesh>,
    /// Tree of each cell, as fractions of the cell's total.
    trees: Vec<Group>,
    /// Vertex values `[cell, vertex]`, to any scale; empty without vertex values.
    vertices: Vec<f32>,
    totals: Vec<f64>,
}

impl Warps {
    /// Builds the warps of `cells` functions. `fill(cell, integrals, values)` receives two slices of zeros in the order
    /// of the mesh. It writes the integral of the cell's function over every leaf (mean × [`WarpMesh::measures`]). It
    /// also writes the function times the measure's cosine at every vertex ([`WarpMesh::vertices`]). Negative and
    /// non-finite numbers count as 0.
    pub fn new(mesh: Arc<WarpMesh>, cells: usize, fill: impl Fn(usize, &mut [f64], &mut [f64]) + Sync) -> Self {
        let (leaves, groups, points) = (mesh.mesh().len(), mesh.groups(), mesh.vertices().len());
        let mut trees = vec![Group::default(); cells * groups];
        let mut vertices = vec![0.0_f32; cells * points];
        let mut totals = vec![0.0; cells];
        let each = trees.chunks_mut(groups).zip(vertices.chunks_mut(points)).zip(&mut totals).enumerate();
        side_by_side(each.collect(), leaves, |(cell, ((tree, vertices), total))| {
            let (mut integrals, mut values) = (vec![0.0; leaves], vec![0.0; points]);
            fill(cell, &mut integrals, &mut values);
            for number in integrals.iter_mut().chain(&mut values) {
                *number = if number.is_finite() { number.max(0.0) } else { 0.0 };
            }
            *total = integrals.iter().sum();
            if *total > 0.0 {
                for integral in &mut integrals {
                    *integral /= *total;
                }
                mesh.fill(&mut integrals, tree);
            }
            let largest = values.iter().fold(0.0_f64, |a, &b| a.max(b));
            if largest > 0.0 {
                vertices.iter_mut().zip(values).for_each(|(to, from)| *to = (from / largest) as f32);
            }
        });
        Self { mesh, trees, vertices, totals }
    }

    /// Trees of all cells, as fractions of their totals.
    #[inline(always)]
    pub(super) fn groups(&self) -> &[Group] {
        &self.trees
    }

    /// Vertex values `[cell, vertex]`, to any scale.
    #[inline(always)]
    pub(super) fn vertices(&self) -> &[f32] {
        &self.vertices
    }

    /// Tables of the triangles, which do not depend on the material.
    #[inline]
    pub fn mesh(&self) -> &Arc<WarpMesh> {
        &self.mesh
    }

    /// Number of functions.
    pub fn cells(&self) -> usize {
        self.totals.len()
    }

    /// Integral of a cell's function over all leaves. If it is 0, only a defensive part draws directions.
    #[inline]
    pub fn total(&self, cell: usize) -> f64 {
        self.totals[cell]
    }

    /// Mean of a cell's function over a leaf, weighted by the measure, as stored in the tree.
    pub fn mean(&self, cell: usize, leaf: usize) -> f64 {
        f64::from(self.probability_at(cell, self.mesh.mesh().level(), leaf)) * self.totals[cell]
            / self.mesh.measures()[leaf]
    }

    /// Memory in bytes, without the shared tables: for each cell, 4 bytes for every triangle of every level and every
    /// vertex.
    pub fn memory(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.trees) + size_of_val(&*self.vertices) + size_of_val(&*self.totals)
    }

    /// Draws a direction from a point `u`, clamped to the unit square. A cell of total 0 draws all its directions from
    /// the defensive part; `None` if there is none.
    #[inline(always)]
    pub fn sample(&self, cell: usize, u: [f64; 2], options: &SampleOptions) -> Option<Drawn> {
        let [first, second] = u.map(|u| u.clamp(0.0, BELOW_ONE));
        let defensive = self.defensive(cell, options);
        if self.totals[cell] == 0.0 && defensive == 0.0 {
            return None;
        }
        let by_tree = 1.0 - defensive;
        if first < by_tree {
            if defensive == 0.0 {
                return Some(self.draw(cell, [first, second], options));
            }
            let mut drawn = self.draw(cell, [(first / by_tree).min(BELOW_ONE), second], options);
            drawn.pdf = by_tree * drawn.pdf + defensive * self.background(drawn.direction);
            return Some(drawn);
        }
        let direction = self.draw_background([((first - by_tree) / defensive).min(BELOW_ONE), second]);
        let (leaf, coordinates, tree) = self.leaf_density(cell, direction, options)?;
        let pdf = by_tree * tree + defensive * self.background(direction);
        Some(Drawn { direction, pdf, leaf, coordinates })
    }

    /// Density in sr⁻¹ with which [`Warps::sample`] draws `direction`; 0 outside the domain.
    #[inline(always)]
    pub fn pdf(&self, cell: usize, direction: Direction, options: &SampleOptions) -> f64 {
        let defensive = self.defensive(cell, options);
        match self.leaf_density(cell, direction, options) {
            None => 0.0,
            Some((.., tree)) if defensive == 0.0 => tree,
            Some((.., tree)) => (1.0 - defensive) * tree + defensive * self.background(direction),
        }
    }

    /// Point of the unit square that [`Warps::sample`] maps to `direction`; `None` if there is none. In a mixture two
    /// points map to it: the result is the tree's, or the defensive part's if the tree's density is 0.
    pub fn invert(&self, cell: usize, direction: Direction, options: &SampleOptions) -> Option<[f64; 2]> {
        let defensive = self.defensive(cell, options);
        let (leaf, coordinates, _) = self.mesh.locate(direction)?;
        let end = self.end(options);
        if defensive < 1.0 && self.probability(cell, end, leaf) > 0.0 {
            let [u, v] = self.place(cell, leaf, coordinates, options);
            return Some([u * (1.0 - defensive), v]);
        }
        let [u, v] = self.place_background(direction);
        (defensive > 0.0).then_some([1.0 - defensive + u * defensive, v])
    }

    /// Fraction drawn by the defensive part.
    fn defensive(&self, cell: usize, options: &SampleOptions) -> f64 {
        if self.totals[cell] > 0.0 {
            options.defensive.clamp(0.0, BELOW_ONE)
        } else {
            // The tree draws no directions: all are defensive, or there are none.
            f64::from(u8::from(options.defensive > 0.0))
        }
    }

    #[inline]
    fn end(&self, options: &SampleOptions) -> u8 {
        let level = self.mesh.mesh().level();
        options.level.map_or(level, |end| end.min(level))
    }

    #[inline(always)]
    fn tree(&self, cell: usize) -> &[Group] {
        let groups = self.mesh.groups();
        &self.trees[cell * groups..][..groups]
    }

    /// Probability of triangle `node` of `level`.
    #[inline(always)]
    fn probability_at(&self, cell: usize, level: u8, node: usize) -> f32 {
        let slot = self.mesh.slot(level, node);
        self.tree(cell)[slot / 8].0[slot % 8]
    }

    /// Probability of a leaf with the end level `end`.
    fn probability(&self, cell: usize, end: u8, leaf: usize) -> f64 {
        let level = self.mesh.mesh().level();
        if end == level {
            return f64::from(self.probability_at(cell, level, leaf));
        }
        let node = leaf >> (2 * u32::from(level - end));
        let slot = self.mesh.slot(end, node);
        let of_measure = f64::from(self.mesh.geometry()[slot / 8].0[slot % 8]);
        f64::from(self.probability_at(cell, end, node)) * self.mesh.measures()[leaf] / of_measure
    }

    /// Shape numbers at the vertices for the linear density inside a leaf.
    #[inline(always)]
    fn shape(&self, cell: usize, end: u8) -> &[f32] {
        if end == self.mesh.mesh().level() {
            let points = self.mesh.vertices().len();
            &self.vertices[cell * points..][..points]
        } else {
            self.mesh.cosines()
        }
    }

    /// Density in sr⁻¹ of the tree at a unit vector in `leaf`, uniform in leaves of the last level.
    #[inline(always)]
    pub(in crate::evaluate) fn uniform_density(&self, cell: usize, leaf: usize, direction: [f64; 3]) -> f64 {
        f64::from(self.probability_at(cell, self.mesh.mesh().level(), leaf))
            * self.mesh.coordinates_in(leaf, direction).1
    }

    /// Like [`Warps::uniform_density`], but linear in leaves of the last level.
    #[inline(always)]
    pub(in crate::evaluate) fn linear_density(&self, cell: usize, leaf: usize, direction: [f64; 3]) -> f64 {
        let level = self.mesh.mesh().level();
        let (coordinates, factor) = self.mesh.coordinates_in(leaf, direction);
        let probability = f64::from(self.probability_at(cell, level, leaf));
        self.linear_in(cell, level, leaf, probability, coordinates) * factor
    }

    /// Sum of [`Warps::linear_density`] over several cells, weighted by their shares.
    #[inline(always)]
    pub(in crate::evaluate) fn linear_densities(
        &self,
        cells: &[usize],
        shares: &[f64],
        leaf: usize,
        direction: [f64; 3],
    ) -> f64 {
        let level = self.mesh.mesh().level();
        let (coordinates, factor) = self.mesh.coordinates_in(leaf, direction);
        let mut sum = 0.0;
        for (&cell, share) in cells.iter().zip(shares).filter(|(_, share)| **share > 0.0) {
            let probability = f64::from(self.probability_at(cell, level, leaf));
            sum += share * (self.linear_in(cell, level, leaf, probability, coordinates) * factor);
        }
        sum
    }

    /// Linear density inside a leaf of this probability, with respect to its triangle.
    #[inline(always)]
    fn linear_in(&self, cell: usize, end: u8, leaf: usize, probability: f64, coordinates: [f64; 3]) -> f64 {
        let shape = self.shape(cell, end);
        let values = self.mesh.corners_of(leaf).map(|id| f64::from(shape[id as usize]));
        linear_at(probability, values, coordinates)
    }

    /// Leaf that contains a direction, its coordinates there, and the tree's density in sr⁻¹.
    #[inline(always)]
    fn leaf_density(
        &self,
        cell: usize,
        direction: Direction,
        options: &SampleOptions,
    ) -> Option<(usize, [f64; 3], f64)> {
        let (leaf, coordinates, factor) = self.mesh.locate(direction)?;
        let end = self.end(options);
        let probability = self.probability(cell, end, leaf);
        let density = match options.density {
            Density::Uniform => probability,
            Density::Linear => self.linear_in(cell, end, leaf, probability, coordinates),
        };
        Some((leaf, coordinates, density * factor))
    }

    /// Draws a direction by the tree alone.
    #[inline(always)]
    fn draw(&self, cell: usize, u: [f64; 2], options: &SampleOptions) -> Drawn {
        let end = self.end(options);
        let mut left = u.map(Fraction::new);
        let (square, masses) = self.descend(cell, end, |level, weights| {
            let quadrant = choose(weights, &mut left);
            if level == 0 {
                left = flipped(quadrant, left);
            } else if level % UNREDUCED == 0 {
                left = left.map(Fraction::reduced);
            }
            quadrant
        });
        let u = left.map(Fraction::value);
        let (point, linear) = match options.density {
            Density::Uniform => (Constant(masses).draw(u), None),
            Density::Linear => {
                let linear = self.linear(cell, end, square, masses);
                (linear.draw(u), Some(linear))
            }
        };
        let half = usize::from(point.upper);
        let (leaf, frame) = self.mesh.framed(2 * square + half);
        let inside = inward(point.coordinates());
        let (direction, factor) = self.mesh.point(leaf, frame, inside);
        let density = linear.map_or(masses[half], |linear| linear.density(point.upper, inside));
        let mut coordinates = [0.0; 3];
        for (k, coordinate) in frame.into_iter().zip(inside) {
            coordinates[usize::from(k)] = coordinate;
        }
        Drawn { direction, pdf: density * factor, leaf, coordinates }
    }

    /// Returns the point of the unit square that [`Warps::draw`] maps to these barycentric coordinates in a leaf.
    fn place(&self, cell: usize, leaf: usize, coordinates: [f64; 3], options: &SampleOptions) -> [f64; 2] {
        let (last, end) = (self.mesh.mesh().level(), self.end(options));
        let place = self.mesh.place(last, leaf);
        // u = offset + scale · the coordinate within the current square.
        let (mut offset, mut scale) = ([0.0; 2], [1.0; 2]);
        let (square, masses) = self.descend(cell, end, |level, weights| {
            let quadrant = (place >> (1 + 2 * u32::from(last - level))) & 3;
            let (start, length) = interval(weights, quadrant);
            for k in 0..2 {
                offset[k] += scale[k] * start[k];
                scale[k] *= length[k];
                if level == 0 {
                    let [start, direction] = FLIPS[quadrant][k];
                    offset[k] += scale[k] * start;
                    scale[k] *= direction;
                }
            }
            quadrant
        });
        let (_, [right, start, end_of]) = self.mesh.framed(place);
        let in_frame = [right, start, end_of].map(|k| coordinates[usize::from(k)]);
        let point = Point::new(place & 1 == 1, in_frame);
        let u = match options.density {
            Density::Uniform => Constant(masses).place(point),
            Density::Linear => self.linear(cell, end, square, masses).place(point),
        };
        [0, 1].map(|k| (offset[k] + scale[k] * u[k]).clamp(0.0, BELOW_ONE))
    }

    /// Descends to a square of leaves. `decide` chooses a quadrant from a level and four weights. Returns the square
    /// and the probabilities of its halves.
    #[inline(always)]
    fn descend(&self, cell: usize, end: u8, mut decide: impl FnMut(u8, [f64; 4]) -> usize) -> (usize, [f64; 2]) {
        let (mesh, last) = (&*self.mesh, self.mesh.mesh().level());
        let tree = self.tree(cell);
        let (mut group, mut quadrant, mut square) = (&tree[0].0, 0, 0);
        // First group of the next level, and their number.
        let (mut start, mut width) = (1, mesh.mesh().bases() / 2);
        for level in 0..=end {
            if level > 0 {
                group = &tree[start + square].0;
                start += width;
                width *= 4;
            }
            let [a, b, c, d, e, f, g, h] = *group;
            quadrant = decide(level, [a + b, c + d, e + f, g + h].map(f64::from));
            square = 4 * square + quadrant;
        }
        let of =
            |group: &[f32; 8], quadrant: usize| [f64::from(group[2 * quadrant]), f64::from(group[2 * quadrant + 1])];
        let masses = of(group, quadrant);
        if end == last {
            return (square, masses);
        }
        // Below the end level the table is that of the measure. Triangles of the lower and of the upper half of the
        // square divide different probabilities. Quadrant 1 is all in the upper half, quadrant 2 in the lower.
        let table = mesh.geometry();
        let measures = of(&table[mesh.group_of(end, square)].0, quadrant);
        let (mut lower, mut upper) = (masses[0] / measures[0], masses[1] / measures[1]);
        for level in end + 1..=last {
            group = &table[start + square].0;
            start += width;
            width *= 4;
            let [a, b, c, d, e, f, g, h] = group.map(f64::from);
            let weights = [a * lower + b * upper, (c + d) * upper, (e + f) * lower, g * lower + h * upper];
            quadrant = decide(level, weights);
            square = 4 * square + quadrant;
            (lower, upper) =
                (select_unpredictable(quadrant == 1, upper, lower), select_unpredictable(quadrant == 2, lower, upper));
        }
        let measures = of(group, quadrant);
        (square, [measures[0] * lower, measures[1] * upper])
    }

    /// Linear density on a square of leaves.
    fn linear(&self, cell: usize, end: u8, square: usize, masses: [f64; 2]) -> Linear {
        let shape = self.shape(cell, end);
        let [start, upper, lower, end] = self.mesh.quad(square);
        let value = |id: u32| f64::from(shape[id as usize]);
        let (start, end) = (value(start), value(end));
        Linear::new(masses, [[value(lower), start, end], [value(upper), start, end]])
    }

    /// Defensive density in sr⁻¹ on the domain: |cos θ| over its integral, or 1 over the solid angle.
    pub(in crate::evaluate) fn background(&self, direction: Direction) -> f64 {
        let sides = if self.mesh.mesh().domain() == Domain::Sphere { 0.5 } else { 1.0 };
        match self.mesh.measure() {
            Measure::Projected => sides * FRAC_1_PI * direction.cos_theta().abs(),
            Measure::SolidAngle => sides / TAU,
        }
    }

    /// Draws a defensive direction by polar angles. The first coordinate gives the height (each hemisphere of a sphere
    /// takes half of its range), the second the azimuth.
    pub(in crate::evaluate) fn draw_background(&self, [mut u, v]: [f64; 2]) -> Direction {
        let mut down = self.mesh.mesh().domain() == Domain::Lower;
        if self.mesh.mesh().domain() == Domain::Sphere {
            down = u >= 0.5;
            u = if down { 2.0 * u - 1.0 } else { 2.0 * u };
        }
        let z = match self.mesh.measure() {
            Measure::Projected => (1.0 - u).sqrt(),
            Measure::SolidAngle => 1.0 - u,
        };
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = libm::sincos(TAU * v);
        Direction::from_unit([radius * cos, radius * sin, if down { -z } else { z }])
    }

    pub(in crate::evaluate) fn place_background(&self, direction: Direction) -> [f64; 2] {
        let z = direction.cos_theta().abs();
        let u = match self.mesh.measure() {
            Measure::Projected => 1.0 - z * z,
            Measure::SolidAngle => 1.0 - z,
        };
        let u = match self.mesh.mesh().domain() {
            Domain::Sphere if direction.cos_theta() < 0.0 => 0.5 + 0.5 * u,
            Domain::Sphere => 0.5 * u,
            _ => u,
        };
        [u, direction.phi() / TAU].map(|u| u.clamp(0.0, BELOW_ONE))
    }
}

/// Runs `work` on each of `items` of some `size`, on as many threads as rayon has, but on none of rayon's. Trees are
/// built on first use by a thread for which others may wait, and rayon's threads must not be among those.
fn side_by_side<T: Send>(items: Vec<T>, size: usize, work: impl Fn(T) + Sync) {
    let threads = rayon::current_num_threads().min(items.len() * size / LEAST_WORK).max(1);
    let share = items.len().div_ceil(threads).max(1);
    let mut items = items.into_iter();
    let mut shares =
        std::iter::from_fn(|| Some(items.by_ref().take(share).collect::<Vec<T>>()).filter(|s| !s.is_empty()));
    let own = shares.next().unwrap_or_default();
    let others: Vec<Mutex<Vec<T>>> = shares.map(Mutex::new).collect();
    let take = |share: &Mutex<Vec<T>>| {
        let items = std::mem::take(&mut *share.lock().unwrap_or_else(PoisonError::into_inner));
        items.into_iter().for_each(&work);
    };
    thread::scope(|scope| {
        let started: Vec<bool> =
            others.iter().map(|share| thread::Builder::new().spawn_scoped(scope, || take(share)).is_ok()).collect();
        own.into_iter().for_each(&work);
        // Shares for which no thread could be started.
        others.iter().zip(started).filter(|(_, started)| !started).for_each(|(share, _)| take(share));
    });
}

/// Minimum number of leaves for which a thread pays off.
const LEAST_WORK: usize = 1 << 14;
