//! Warps of the unit square onto directions, by descent of a tree of triangles; pure geometry, without a material.
//!
//! A warp draws directions in proportion to a function on a mesh, given by its integrals over the leaf triangles (and, for
//! a density that is linear inside them, by values at their vertices). \[CPB06\] section 6.1.2, figure 11, and its Table 9.
//!
//! # The map
//! * The octahedron is unfolded into two (hemisphere) or four (sphere) squares of two triangles each; the four-way split
//!   of the triangles is the split of the squares into quadrants (the `mesh` file has a picture). At every square the first
//!   coordinate chooses the half a by the quadrants' own sums and is stretched to 0..1 again, then the second chooses b
//!   (Clarberg et al. 2005, *Wavelet importance sampling*, section 4.2). No number is thrown away and none is added.
//! * Down to the *end level* the sums are those of the function; below it a triangle's probability is shared among its
//!   leaves by the measure alone: the projected solid angle, or the solid angle.
//! * Inside the last square the density is constant or linear on each of the two planar triangles. The marginal in a and
//!   the conditional in b are inverted in closed form: quadratics for the constant density, a cubic and quadratics for
//!   the linear one. The inverse of the map evaluates these polynomials.
//! * The planar point p is pushed onto the sphere. With A the triangle's area and d its plane's distance from the origin
//!   dω = d/|p|³ dA, so pdf(ω) = P·g(p)·|p|³/(A·d), P the leaf's probability and g the density's shape, mean 1. P is exact;
//!   a "constant" density varies as |p|³ over its leaf (by 0.6 % at level 4).
//!
//! # What is continuous
//! The map is one-to-one, and continuous on every image of a leaf square (an axis-parallel rectangle of the unit square).
//! At the rectangles' borders — finitely many segments, of measure zero — it is exactly continuous when the densities on
//! both sides agree (uniform densities give one continuous map of the whole unit square), and otherwise jumps along the
//! border by as much as the two sides' distributions along it differ; it never leaves the two squares' common edge but for
//! squares that the tree itself separates. So stratified and low-discrepancy points stay well distributed, and children
//! need no random order. The two sides of the unit square that are glued on the octahedron (the meridian through −x) are
//! not neighbours in u.
//!
//! # Precision
//! Tables are f32, arithmetic is f64. A parent is the rounded sum of its leaves, so that the probability with which the
//! descent reaches a leaf and the stored one that [`Warps::pdf`] tells differ by up to 1e-7 of it per level.

mod mesh;
mod square;
#[cfg(test)]
mod table9;
#[cfg(test)]
mod tests;

pub use mesh::WarpMesh;

use crate::domain::{Direction, Domain};
use mesh::{FLIPS, Group};
use rayon::prelude::*;
use square::{Constant, Linear, Point, scaled};
use std::f64::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;
/// Points keep this barycentric distance from the edges of their leaf, so that rounding cannot carry one over the edge.
const MARGIN: f64 = 1e-9;

/// What values are weighed with in the tree, and what shares a probability below the end level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// |cos θ| dω: BRDF, BTDF, BSDF.
    Projected,
    /// dω: emission and phase functions.
    SolidAngle,
}

/// The density inside the last triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Density {
    /// Constant on the planar triangle.
    Uniform,
    /// Linear on the planar triangle between the vertex values (f·cos; cos below a coarser end level); constant where the
    /// vertex values are all 0.
    #[default]
    Linear,
}

/// How directions are drawn. Sampling, density and inversion belong together only with the same options.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleOptions {
    /// Ends the choice by value at this level (0 = the base triangles, `None` or more than there are = the leaves) and
    /// goes on by the measure.
    pub level: Option<u8>,
    /// The density inside the last triangle.
    pub density: Density,
    /// The part δ in 0..1 of directions drawn without regard to the function: by the cosine for [`Measure::Projected`],
    /// uniformly for [`Measure::SolidAngle`], over the whole domain. Then no direction of the domain has density 0, as a
    /// function needs that is not 0 on leaves whose integral is (data evaluated smoothly at the edge of zeros). The first
    /// coordinate is split: below 1 − δ the tree's, above it the defensive one's.
    pub defensive: f64,
}

impl From<Option<u8>> for SampleOptions {
    fn from(level: Option<u8>) -> Self {
        Self { level, ..Self::default() }
    }
}

/// A direction that a warp has drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// The direction.
    pub direction: Direction,
    /// Its density in sr⁻¹, of the mixture if there is one: what [`Warps::pdf`] tells of it.
    pub pdf: f64,
    /// The leaf triangle that holds it.
    pub leaf: usize,
}

/// The warps of many functions (one for each incoming cell) on one mesh, in flat tables.
#[derive(Clone, Debug)]
pub struct Warps {
    mesh: Arc<WarpMesh>,
    /// For each cell its tree, in parts of the cell's total.
    trees: Vec<Group>,
    /// `[cell, vertex]`, to any scale; empty without vertex values.
    vertices: Vec<f32>,
    totals: Vec<f64>,
}

impl Warps {
    /// The warps of `cells` functions. `fill(cell, integrals, values)` writes the integral of the cell's function over every
    /// leaf (mean × [`WarpMesh::measures`]) and its value times the measure's cosine at every vertex
    /// ([`WarpMesh::vertices`]), both in the order of the mesh, given as zeros. Negative and non-finite numbers count as 0.
    pub fn new(mesh: Arc<WarpMesh>, cells: usize, fill: impl Fn(usize, &mut [f64], &mut [f64]) + Sync) -> Self {
        let (leaves, groups, points) = (mesh.mesh().len(), mesh.groups(), mesh.vertices().len());
        let mut trees = vec![Group::default(); cells * groups];
        let mut vertices = vec![0.0_f32; cells * points];
        let mut totals = vec![0.0; cells];
        let each = trees.par_chunks_mut(groups).zip(vertices.par_chunks_mut(points)).zip(&mut totals).enumerate();
        each.for_each(|(cell, ((tree, vertices), total))| {
            let (mut integrals, mut values) = (vec![0.0; leaves], vec![0.0; points]);
            fill(cell, &mut integrals, &mut values);
            for number in integrals.iter_mut().chain(&mut values) {
                *number = if number.is_finite() { number.max(0.0) } else { 0.0 };
            }
            *total = integrals.iter().sum();
            if *total > 0.0 {
                integrals.iter_mut().for_each(|integral| *integral /= *total);
                mesh.fill(&mut integrals, tree);
            }
            let largest = values.iter().fold(0.0_f64, |a, &b| a.max(b));
            if largest > 0.0 {
                vertices.iter_mut().zip(values).for_each(|(to, from)| *to = (from / largest) as f32);
            }
        });
        Self { mesh, trees, vertices, totals }
    }

    /// The tables shared by all cells.
    pub fn mesh(&self) -> &Arc<WarpMesh> {
        &self.mesh
    }

    /// How many functions there are.
    pub fn cells(&self) -> usize {
        self.totals.len()
    }

    /// The integral of a cell's function over all leaves. At 0 nothing is drawn, unless defensively.
    pub fn total(&self, cell: usize) -> f64 {
        self.totals[cell]
    }

    /// The mean of a cell's function over a leaf, by the measure, as the tree holds it.
    pub fn mean(&self, cell: usize, leaf: usize) -> f64 {
        f64::from(self.probability_at(cell, self.mesh.mesh().level(), leaf)) * self.totals[cell]
            / self.mesh.measures()[leaf]
    }

    /// Memory in bytes, without the shared tables: 4 bytes for every triangle of every level and every vertex of a cell.
    pub fn memory(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.trees) + size_of_val(&*self.vertices) + size_of_val(&*self.totals)
    }

    /// Draws a direction from a point `u` of the unit square (held within it). `None` where the cell's total is 0 and
    /// nothing is drawn defensively; with a defensive part such a cell draws all its directions so.
    pub fn sample(&self, cell: usize, u: [f64; 2], options: &SampleOptions) -> Option<Drawn> {
        let [first, second] = u.map(|u| u.clamp(0.0, BELOW_ONE));
        let defensive = self.defensive(cell, options);
        if self.totals[cell] == 0.0 && defensive == 0.0 {
            return None;
        }
        let by_tree = 1.0 - defensive;
        if first < by_tree {
            let mut drawn = self.draw(cell, [(first / by_tree).min(BELOW_ONE), second], options);
            if defensive > 0.0 {
                drawn.pdf = by_tree * drawn.pdf + defensive * self.background(drawn.direction);
            }
            return Some(drawn);
        }
        let direction = self.draw_background([((first - by_tree) / defensive).min(BELOW_ONE), second]);
        let (leaf, tree) = self.leaf_density(cell, direction, options)?;
        Some(Drawn { direction, pdf: by_tree * tree + defensive * self.background(direction), leaf })
    }

    /// The density in sr⁻¹ with which [`Warps::sample`] draws `direction`; 0 outside the domain.
    pub fn pdf(&self, cell: usize, direction: Direction, options: &SampleOptions) -> f64 {
        let defensive = self.defensive(cell, options);
        match self.leaf_density(cell, direction, options) {
            None => 0.0,
            Some((_, tree)) if defensive == 0.0 => tree,
            Some((_, tree)) => (1.0 - defensive) * tree + defensive * self.background(direction),
        }
    }

    /// The point of the unit square that [`Warps::sample`] takes to `direction`. In a mixture two points lead to it: the
    /// tree's is given, but where the tree's density is 0 the defensive one's. `None` where nothing does.
    pub fn invert(&self, cell: usize, direction: Direction, options: &SampleOptions) -> Option<[f64; 2]> {
        let defensive = self.defensive(cell, options);
        let (leaf, coordinates, _) = self.mesh.locate(direction)?;
        let end = self.end(options);
        if defensive < 1.0 && self.probability(cell, end, leaf) > 0.0 {
            let [u, v] = self.place(cell, leaf, coordinates, options);
            return Some([u * (1.0 - defensive), v]);
        }
        let [u, v] = self.place_background(direction);
        (defensive > 0.0).then(|| [1.0 - defensive + u * defensive, v])
    }

    /// The part drawn defensively.
    fn defensive(&self, cell: usize, options: &SampleOptions) -> f64 {
        if self.totals[cell] > 0.0 {
            options.defensive.clamp(0.0, BELOW_ONE)
        } else {
            // Nothing by the tree: all or nothing.
            f64::from(u8::from(options.defensive > 0.0))
        }
    }

    fn end(&self, options: &SampleOptions) -> u8 {
        let level = self.mesh.mesh().level();
        options.level.map_or(level, |end| end.min(level))
    }

    fn tree(&self, cell: usize) -> &[Group] {
        let groups = self.mesh.groups();
        &self.trees[cell * groups..][..groups]
    }

    /// The share of triangle `node` of `level`.
    fn probability_at(&self, cell: usize, level: u8, node: usize) -> f32 {
        let slot = self.mesh.slot(level, node);
        self.tree(cell)[slot / 8].0[slot % 8]
    }

    /// The probability of a leaf with the end level `end`.
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

    /// The numbers at the vertices that shape the linear density inside a leaf.
    fn shape(&self, cell: usize, end: u8) -> &[f32] {
        if end == self.mesh.mesh().level() {
            let points = self.mesh.vertices().len();
            &self.vertices[cell * points..][..points]
        } else {
            self.mesh.cosines()
        }
    }

    /// The leaf that holds a direction and the tree's density there.
    fn leaf_density(&self, cell: usize, direction: Direction, options: &SampleOptions) -> Option<(usize, f64)> {
        let (leaf, coordinates, factor) = self.mesh.locate(direction)?;
        let end = self.end(options);
        let probability = self.probability(cell, end, leaf);
        let density = match options.density {
            Density::Uniform => probability,
            Density::Linear => {
                let shape = self.shape(cell, end);
                let values = self.mesh.corners_of(leaf).map(|id| f64::from(shape[id as usize]));
                dot(scaled(probability, values), coordinates)
            }
        };
        Some((leaf, density * factor))
    }

    /// The tree's warp.
    fn draw(&self, cell: usize, mut u: [f64; 2], options: &SampleOptions) -> Drawn {
        let end = self.end(options);
        let mut walk = Walk::new(self, cell, end);
        for level in 0..=self.mesh.mesh().level() {
            let quadrant = choose(walk.weights(), &mut u);
            if level == 0 {
                u = flipped(quadrant, u);
            }
            walk.enter(level, quadrant);
        }
        let place = 2 * walk.square;
        let (point, density) = match options.density {
            Density::Uniform => (Constant(walk.pair).draw(u), None),
            Density::Linear => {
                let density = self.linear(cell, end, walk.square, walk.pair);
                (density.draw(u), Some(density))
            }
        };
        let (leaf, frame) = self.mesh.framed(place + usize::from(point.upper));
        let inside = inward(point.coordinates());
        let mut coordinates = [0.0; 3];
        for (k, coordinate) in frame.into_iter().zip(inside) {
            coordinates[usize::from(k)] = coordinate;
        }
        let (direction, factor) = self.mesh.point(leaf, coordinates);
        let half = usize::from(point.upper);
        let density = density.map_or(walk.pair[half], |Linear(values)| dot(values[half], inside));
        Drawn { direction, pdf: density * factor, leaf }
    }

    /// The inverse of [`Warps::draw`]: the tree's point for a leaf and coordinates in it.
    fn place(&self, cell: usize, leaf: usize, coordinates: [f64; 3], options: &SampleOptions) -> [f64; 2] {
        let (level, end) = (self.mesh.mesh().level(), self.end(options));
        let place = self.mesh.place(level, leaf);
        let mut walk = Walk::new(self, cell, end);
        // u = offset + scale · what is left of it.
        let (mut offset, mut scale) = ([0.0; 2], [1.0; 2]);
        for depth in 0..=level {
            let square = place >> (1 + 2 * u32::from(level - depth));
            let quadrant = if depth == 0 { square } else { square & 3 };
            let (start, length) = interval(walk.weights(), quadrant);
            for k in 0..2 {
                offset[k] += scale[k] * start[k];
                scale[k] *= length[k];
                if depth == 0 && FLIPS[quadrant][k] {
                    offset[k] += scale[k];
                    scale[k] = -scale[k];
                }
            }
            walk.enter(depth, quadrant);
        }
        let upper = place & 1 == 1;
        let (_, frame) = self.mesh.framed(place);
        let point = Point::new(upper, frame.map(|k| coordinates[usize::from(k)]));
        let u = match options.density {
            Density::Uniform => Constant(walk.pair).place(point),
            Density::Linear => self.linear(cell, end, walk.square, walk.pair).place(point),
        };
        [0, 1].map(|k| (offset[k] + scale[k] * u[k]).clamp(0.0, BELOW_ONE))
    }

    /// The linear density on a square of leaves.
    fn linear(&self, cell: usize, end: u8, square: usize, masses: [f64; 2]) -> Linear {
        let shape = self.shape(cell, end);
        let values = [0, 1].map(|half| {
            let (leaf, frame) = self.mesh.framed(2 * square + half);
            let ids = self.mesh.corners_of(leaf);
            frame.map(|k| f64::from(shape[ids[usize::from(k)] as usize]))
        });
        Linear::new(masses, values)
    }

    /// The defensive density: |cos θ| over its integral, or 1 over the solid angle, on the domain.
    fn background(&self, direction: Direction) -> f64 {
        let sides = if self.mesh.mesh().domain() == Domain::Sphere { 0.5 } else { 1.0 };
        match self.mesh.measure() {
            Measure::Projected => sides * FRAC_1_PI * direction.cos_theta().abs(),
            Measure::SolidAngle => sides / TAU,
        }
    }

    /// By polar angles: the first coordinate is the height (each half of a sphere has half of it), the second the azimuth.
    fn draw_background(&self, [mut u, v]: [f64; 2]) -> Direction {
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

    fn place_background(&self, direction: Direction) -> [f64; 2] {
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

/// A descent: which group is next, from which table, and how it is scaled.
struct Walk<'a> {
    mesh: &'a WarpMesh,
    end: u8,
    table: &'a [Group],
    /// Below the end level the table is the measure's; its two kinds of triangles, those in the lower and in the upper
    /// triangle of the end level, share different probabilities.
    scale: [f64; 2],
    group: usize,
    /// The square entered last.
    square: usize,
    /// The probabilities of its halves.
    pair: [f64; 2],
}

impl<'a> Walk<'a> {
    fn new(warps: &'a Warps, cell: usize, end: u8) -> Self {
        let mesh = &*warps.mesh;
        Self { mesh, end, table: warps.tree(cell), scale: [1.0; 2], group: 0, square: 0, pair: [0.0; 2] }
    }

    /// The probabilities of the four quadrants next.
    #[inline]
    fn weights(&self) -> [f64; 4] {
        let group = self.table[self.group].0.map(f64::from);
        let [lower, upper] = self.scale;
        // Quadrant 1 is all in the upper triangle, 2 in the lower.
        [
            group[0] * lower + group[1] * upper,
            (group[2] + group[3]) * upper,
            (group[4] + group[5]) * lower,
            group[6] * lower + group[7] * upper,
        ]
    }

    #[inline]
    fn enter(&mut self, level: u8, quadrant: usize) {
        let at = self.group;
        let of = |table: &[Group]| [0, 1].map(|half| f64::from(table[at].0[2 * quadrant + half]));
        let [lower, upper] = self.scale;
        self.scale = [if quadrant == 1 { upper } else { lower }, if quadrant == 2 { lower } else { upper }];
        let own = of(self.table);
        self.pair = [own[0] * self.scale[0], own[1] * self.scale[1]];
        if level == self.end && level < self.mesh.mesh().level() {
            let measure = of(self.mesh.geometry());
            self.scale = [self.pair[0] / measure[0], self.pair[1] / measure[1]];
            self.table = self.mesh.geometry();
        }
        self.square = 4 * self.square + quadrant;
        self.group = self.mesh.children(level, self.square);
    }
}

/// Chooses a quadrant, the half a by the first coordinate and the half b by the second, and stretches both over the choice.
/// Never chooses one without weight.
#[inline]
fn choose([w0, w1, w2, w3]: [f64; 4], u: &mut [f64; 2]) -> usize {
    let (left, right) = (w0 + w1, w2 + w3);
    let a = stretch(left, right, &mut u[0]);
    let (bottom, top) = if a == 0 { (w0, w1) } else { (w2, w3) };
    2 * a + stretch(bottom, top, &mut u[1])
}

#[inline]
fn stretch(first: f64, second: f64, u: &mut f64) -> usize {
    let x = *u * (first + second);
    let beyond = (x >= first) & (second > 0.0);
    let (above, width) = if beyond { (x - first, second) } else { (x, first) };
    *u = (above / width).min(BELOW_ONE);
    usize::from(beyond)
}

/// Where [`choose`] takes a quadrant from: start and length in both coordinates.
fn interval([w0, w1, w2, w3]: [f64; 4], quadrant: usize) -> ([f64; 2], [f64; 2]) {
    let share = |first: f64, second: f64, which: usize| {
        let (first, second) = (first / (first + second), second / (first + second));
        if which == 0 { (0.0, first) } else { (first, second) }
    };
    let (bottom, top) = if quadrant < 2 { (w0, w1) } else { (w2, w3) };
    let (a, width) = share(w0 + w1, w2 + w3, quadrant / 2);
    let (b, height) = share(bottom, top, quadrant % 2);
    ([a, b], [width, height])
}

fn flipped(square: usize, u: [f64; 2]) -> [f64; 2] {
    let [a, b] = FLIPS[square];
    [if a { BELOW_ONE - u[0] } else { u[0] }, if b { BELOW_ONE - u[1] } else { u[1] }]
}

/// Coordinates at least [`MARGIN`] from the edges.
#[inline]
fn inward(coordinates: [f64; 3]) -> [f64; 3] {
    let held = coordinates.map(|c| c.max(MARGIN));
    let scale = 1.0 / (held[0] + held[1] + held[2]);
    held.map(|c| c * scale)
}

#[inline]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
