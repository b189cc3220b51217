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

/// Direction drawn from a sampling tree, with its density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Drawn direction, a unit vector.
    pub direction: Direction,
    /// Probability density of the direction in sr⁻¹, including the defensive component if there is one; equals
    /// [`Warps::pdf`].
    pub pdf: f64,
    /// Number of the leaf triangle that contains the direction.
    pub leaf: usize,
    /// Barycentric coordinates of the drawn direction in the planar triangle of the mesh that contains it (vertices
    /// [`WarpMesh::corners`]). A function that is linear on triangles can be evaluated from them without another
    /// search.
    pub coordinates: [f64; 3],
}

/// Sampling trees that map the unit square to directions in proportion to a function, for many functions (one for each
/// incoming direction) on one mesh.
#[derive(Clone, Debug)]
pub struct Warps {
    mesh: Arc<WarpMesh>,
    /// Sampling tree of each function: integrals over triangles as fractions of the function's total.
    trees: Vec<Group>,
    /// Values `[function, vertex]` at the mesh's vertices of the functions that the sampling trees follow (including
    /// the cosine factor, if any), divided by each function's largest vertex value; 0 without vertex values.
    vertices: Vec<f32>,
    totals: Vec<f64>,
}

impl Warps {
    /// Builds the sampling trees of `cells` functions. `fill(cell, integrals, values)` receives two slices of zeros in
    /// the order of the mesh. It writes the integral of function `cell` over every leaf triangle (mean ×
    /// [`WarpMesh::measures`]), and the function times the measure's cosine at every vertex. Negative and non-finite
    /// numbers count as 0.
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

    /// Sampling trees of all functions on the mesh, which hold integrals over triangles as fractions of the function's
    /// integral over all of them.
    #[inline(always)]
    pub(super) fn groups(&self) -> &[Group] {
        &self.trees
    }

    /// Values `[function, vertex]` at the mesh's vertices of the functions that the sampling trees follow, divided by
    /// each function's largest vertex value.
    #[inline(always)]
    pub(super) fn vertices(&self) -> &[f32] {
        &self.vertices
    }

    /// Geometry tables of the triangle mesh (vertices, solid angles, order of the triangles), shared by the sampling
    /// trees of all functions.
    #[inline]
    pub fn mesh(&self) -> &Arc<WarpMesh> {
        &self.mesh
    }

    /// Number of functions, each of which has a sampling tree.
    pub fn cells(&self) -> usize {
        self.totals.len()
    }

    /// Integral of function number `cell` over all triangles of the mesh. If it is 0, only a defensive component (drawn
    /// independently of the function) gives directions.
    #[inline]
    pub fn total(&self, cell: usize) -> f64 {
        self.totals[cell]
    }

    /// Mean over a leaf triangle of the function that sampling tree number `cell` follows, weighted by solid angle or
    /// projected solid angle. It is computed from the f32 probability stored in the tree.
    pub fn mean(&self, cell: usize, leaf: usize) -> f64 {
        f64::from(self.probability_at(cell, self.mesh.mesh().level(), leaf)) * self.totals[cell]
            / self.mesh.measures()[leaf]
    }

    /// Memory of the trees in bytes, without the shared geometry tables: for each function, 4 bytes for every triangle
    /// of every level and for every vertex.
    pub fn memory(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.trees) + size_of_val(&*self.vertices) + size_of_val(&*self.totals)
    }

    /// Draws a direction in proportion to function `cell` from a point `u`, clamped to the unit square. A function
    /// whose integral is 0 draws all directions from the defensive component; `None` if there is none.
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

    /// Point of the unit square that [`Warps::sample`] maps to `direction`; `None` if there is none. If a fraction of
    /// directions is drawn independently of the function, two points map to a direction. The result is the one drawn in
    /// proportion to the function, or the other if that density is 0.
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

    /// Fraction of directions that the defensive component draws.
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

    /// Probability with which a sampling tree reaches triangle number `node` of a level.
    #[inline(always)]
    fn probability_at(&self, cell: usize, level: u8, node: usize) -> f32 {
        let slot = self.mesh.slot(level, node);
        self.tree(cell)[slot / 8].0[slot % 8]
    }

    /// Probability with which a sampling tree reaches a leaf triangle if the tree stops following the function at level
    /// `end`.
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

    /// Values at the mesh's vertices to which the linear density inside a leaf triangle is proportional.
    #[inline(always)]
    fn shape(&self, cell: usize, end: u8) -> &[f32] {
        if end == self.mesh.mesh().level() {
            let points = self.mesh.vertices().len();
            &self.vertices[cell * points..][..points]
        } else {
            self.mesh.cosines()
        }
    }

    /// Density in sr⁻¹ with which a sampling tree draws a unit vector in triangle `leaf`, if the density is uniform
    /// inside leaf triangles.
    #[inline(always)]
    pub(in crate::evaluate) fn uniform_density(&self, cell: usize, leaf: usize, direction: [f64; 3]) -> f64 {
        f64::from(self.probability_at(cell, self.mesh.mesh().level(), leaf))
            * self.mesh.coordinates_in(leaf, direction).1
    }

    /// Density in sr⁻¹ with which a sampling tree draws a unit vector in triangle `leaf`, if the density is linear
    /// inside leaf triangles.
    #[inline(always)]
    pub(in crate::evaluate) fn linear_density(&self, cell: usize, leaf: usize, direction: [f64; 3]) -> f64 {
        let level = self.mesh.mesh().level();
        let (coordinates, factor) = self.mesh.coordinates_in(leaf, direction);
        let probability = f64::from(self.probability_at(cell, level, leaf));
        self.linear_in(cell, level, leaf, probability, coordinates) * factor
    }

    /// Density in sr⁻¹ with which a mixture of sampling trees draws a unit vector in triangle `leaf`, if the density is
    /// linear inside leaf triangles. Tree number `cells[k]` is drawn from with probability `shares[k]`.
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

    /// Probability density at a point of one of the mesh's finest triangles, over which it is linear, relative to a
    /// uniform density there. The mean over the triangle is `probability`, that of drawing any direction in it.
    #[inline(always)]
    fn linear_in(&self, cell: usize, end: u8, leaf: usize, probability: f64, coordinates: [f64; 3]) -> f64 {
        let shape = self.shape(cell, end);
        let values = self.mesh.corners_of(leaf).map(|id| f64::from(shape[id as usize]));
        linear_at(probability, values, coordinates)
    }

    /// Finest triangle of the mesh that contains a direction, the direction's barycentric coordinates in it, and the
    /// density in sr⁻¹ with which the sampling tree of function number `cell` draws the direction.
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

    /// Draws a direction from the sampling tree alone, without a defensive component.
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

    /// Returns the point of the unit square that [`Warps::draw`] maps to the given barycentric coordinates in a leaf
    /// triangle.
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

    /// Descends a sampling tree to a square of two leaf triangles. `decide` chooses a quadrant from a level and four
    /// weights. Returns the square's number and the probabilities of its triangles.
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

    /// Linear density on a square of two leaf triangles.
    fn linear(&self, cell: usize, end: u8, square: usize, masses: [f64; 2]) -> Linear {
        let shape = self.shape(cell, end);
        let [start, upper, lower, end] = self.mesh.quad(square);
        let value = |id: u32| f64::from(shape[id as usize]);
        let (start, end) = (value(start), value(end));
        Linear::new(masses, [[value(lower), start, end], [value(upper), start, end]])
    }

    /// Density in sr⁻¹ of defensive sampling over the whole domain: |cos θ| over its integral, or 1 over the solid
    /// angle.
    pub(in crate::evaluate) fn background(&self, direction: Direction) -> f64 {
        let sides = if self.mesh.mesh().domain() == Domain::Sphere { 0.5 } else { 1.0 };
        match self.mesh.measure() {
            Measure::Projected => sides * FRAC_1_PI * direction.cos_theta().abs(),
            Measure::SolidAngle => sides / TAU,
        }
    }

    /// Draws a defensive direction (independent of the function). The first coordinate gives the height above the
    /// horizon (each hemisphere of a sphere takes half of its range), the second the azimuth.
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

/// Runs `work` on each of `items`, each of `size` triangles, on up to as many threads as rayon's pool has, but outside
/// that pool. Sampling trees are built on first use by a thread for which others may wait, so that rayon's threads must
/// not be needed.
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

/// Minimum number of leaf triangles for which an additional thread pays off.
const LEAST_WORK: usize = 1 << 14;
