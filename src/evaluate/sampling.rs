//! Importance sampling of outgoing directions by descending the triangle tree (\[CPB06\] section 6.1.2, figure 11).
//!
//! For each incoming cell a tree holds, for every triangle of every level, the sum over its leaves of
//! max(0, mean over wavelengths) × the integral of |cos θ| over the leaf (BRDF, BTDF, BSDF) or × its solid angle (emission,
//! phase functions). A child is chosen in proportion to the children's own sums, so nothing is lost between parent and
//! children; then a point of the leaf is drawn uniform in solid angle. Choices consume the unit square pairwise and
//! rescale it (Clarberg et al. 2005, *Wavelet importance sampling*, hierarchical sample warping), so that stratified
//! points stay stratified. With a coarser end level the descent goes on by the geometric factor alone.

use super::material::turned;
use super::{DirectionSample, EvaluateError, Material, unfit};
use crate::domain::{Direction, Measurement, TriangleMesh};
use rayon::prelude::*;

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;
/// Points of a leaf keep this far from the ends of the unit square, so that rounding cannot carry one over the leaf's edge
/// and its density stays that of its own leaf.
const MARGIN: f64 = 1e-7;

/// The sampling trees of all incoming cells.
#[derive(Debug)]
pub(super) struct Trees {
    bases: usize,
    level: u8,
    has_cosine: bool,
    /// For each cell, level by level from the bases: sums over the leaves, in parts of the cell's total.
    sums: Vec<f32>,
    /// For each cell the sum over all its leaves: its albedo, emitted flux, or integral.
    totals: Vec<f64>,
    /// The geometric factor of the triangles of one octant, level by level; all octants are congruent.
    measures: Vec<f64>,
    /// The solid angles of one octant's leaves.
    solid_angles: Vec<f64>,
}

impl Trees {
    pub(super) fn new(measurement: &Measurement, mesh: TriangleMesh, lambdas: usize) -> Self {
        let has_cosine = measurement.quantity.has_cosine();
        let (bases, level) = (mesh.bases(), mesh.level());
        let octant = mesh.len() / bases;
        let solid_angles: Vec<f64> = (0..octant).map(|i| mesh.solid_angle(i)).collect();
        let mut measures = vec![0.0; first(level + 1)];
        for (i, leaf) in measures[first(level)..].iter_mut().enumerate() {
            *leaf = if has_cosine { mesh.projected_solid_angle(i) } else { solid_angles[i] };
        }
        for parent in (0..first(level)).rev() {
            // Node k of a level, counted from the first of all, has children 4k + 1 … 4k + 4.
            measures[parent] = measures[4 * parent + 1..][..4].iter().sum();
        }
        let nodes = bases * first(level + 1);
        let samples = measurement.tensor.samples();
        let cells = samples.len() / (mesh.len() * lambdas);
        let mut sums = vec![0.0_f32; cells * nodes];
        let mut totals = vec![0.0; cells];
        sums.par_chunks_mut(nodes).zip(&mut totals).zip(samples.par_chunks(mesh.len() * lambdas)).for_each(
            |((sums, total), cell)| {
                *total = fill(sums, cell, bases, level, &measures[first(level)..]);
            },
        );
        Self { bases, level, has_cosine, sums, totals, measures, solid_angles }
    }

    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.sums)
            + size_of_val(&*self.totals)
            + size_of_val(&*self.measures)
            + size_of_val(&*self.solid_angles)
    }

    fn cell(&self, cell: usize) -> &[f32] {
        let nodes = self.bases * first(self.level + 1);
        &self.sums[cell * nodes..][..nodes]
    }

    /// What the four children of `parent` (a node of `level`) weigh.
    fn children(&self, sums: &[f32], level: u8, parent: usize, end: u8) -> [f64; 4] {
        if level < end {
            let c = &sums[self.bases * first(level + 1) + 4 * parent..][..4];
            [c[0], c[1], c[2], c[3]].map(f64::from)
        } else {
            let within = parent % (1 << (2 * u32::from(level)));
            let c = &self.measures[first(level + 1) + 4 * within..][..4];
            [c[0], c[1], c[2], c[3]]
        }
    }

    /// Draws a leaf; `u` becomes what is left of the unit square.
    fn draw(&self, cell: usize, u: &mut [f64; 2], end: u8) -> (usize, f64) {
        let sums = self.cell(cell);
        let mut probability = 1.0;
        let half = if self.bases == 8 {
            let (which, p) = halve(half_sums(sums), &mut u[0]);
            probability *= p;
            4 * which
        } else {
            0
        };
        let (base, p) = choose(four(&sums[half..]), u);
        probability *= p;
        let mut node = half + base;
        for level in 0..self.level {
            let (child, p) = choose(self.children(sums, level, node, end), u);
            probability *= p;
            node = 4 * node + child;
        }
        (node, probability)
    }

    /// The probability of [`Trees::draw`] to give `leaf`.
    fn probability(&self, cell: usize, leaf: usize, end: u8) -> f64 {
        let sums = self.cell(cell);
        let mut node = leaf >> (2 * u32::from(self.level));
        let mut probability = 1.0;
        if self.bases == 8 {
            probability *= share_of_half(half_sums(sums), node / 4);
        }
        probability *= share(four(&sums[node / 4 * 4..]), node % 4);
        for level in 0..self.level {
            let child = (leaf >> (2 * u32::from(self.level - level - 1))) & 3;
            probability *= share(self.children(sums, level, node, end), child);
            node = 4 * node + child;
        }
        probability
    }

    /// The piecewise constant mean over wavelengths of a leaf.
    fn value(&self, cell: usize, leaf: usize) -> f64 {
        let part = f64::from(self.cell(cell)[self.bases * first(self.level) + leaf]);
        part * self.totals[cell] / self.measures[first(self.level) + leaf % self.solid_angles.len()]
    }

    fn solid_angle(&self, leaf: usize) -> f64 {
        self.solid_angles[leaf % self.solid_angles.len()]
    }
}

impl Material {
    /// The density in sr⁻¹ with which [`Material::sample`] draws `wo`: uniform in solid angle within a leaf triangle;
    /// 0 outside the outgoing domain and where nothing is emitted or reflected.
    pub fn pdf(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        wo: Direction,
        level: Option<u8>,
    ) -> Result<f64, EvaluateError> {
        let (trees, cell) = self.tree(index, wi)?;
        let Some((lookup, wo)) = self.outgoing(wi, Some(wo))? else { return Ok(0.0) };
        let Some(leaf) = lookup.locate(wo) else { return Ok(0.0) };
        if trees.totals[cell] == 0.0 {
            return Ok(0.0);
        }
        Ok(trees.probability(cell, leaf, level.unwrap_or(trees.level)) / trees.solid_angle(leaf))
    }

    /// Draws an outgoing direction from the unit square's `u`; `None` where nothing is emitted or reflected. Incoming
    /// directions take their cell as [`super::Interpolation::Constant`] does. `level` ends the choice by value at that level
    /// (0 = the base triangles) and goes on by the geometric factor.
    pub fn sample(
        &self,
        index: &[usize],
        wi: Option<Direction>,
        u: [f64; 2],
        level: Option<u8>,
    ) -> Result<Option<DirectionSample>, EvaluateError> {
        let (trees, cell) = self.tree(index, wi)?;
        if !u.iter().all(|u| (0.0..=1.0).contains(u)) {
            return unfit(format!("u = [{}, {}], expected a point of the unit square", u[0], u[1]));
        }
        let Some(lookup) = self.outgoing.as_ref().filter(|_| trees.totals[cell] > 0.0) else { return Ok(None) };
        let mut u = u.map(|u| u.min(BELOW_ONE));
        let (leaf, probability) = trees.draw(cell, &mut u, level.unwrap_or(trees.level));
        let [u, v] = u.map(|u| u.clamp(MARGIN, 1.0 - MARGIN));
        let [cos, sin] = self.azimuth(wi);
        let direction = turned(lookup.mesh().uniform_point(leaf, u, v), cos, sin);
        let pdf = probability / trees.solid_angle(leaf);
        let cosine = if trees.has_cosine { direction.cos_theta().abs() } else { 1.0 };
        Ok(Some(DirectionSample { direction, pdf, weight: trees.value(cell, leaf) * cosine / pdf }))
    }

    /// The trees, and the cell of `index` and `wi`.
    fn tree(&self, index: &[usize], wi: Option<Direction>) -> Result<(&Trees, usize), EvaluateError> {
        let Some(trees) = &self.trees else {
            return unfit(format!("this {} has no outgoing axis to sample", self.quantity()));
        };
        let entry = self.entry(index)?;
        let incoming = self.incoming_entry(wi)?;
        Ok((trees, entry * self.shape[0] + incoming))
    }
}

/// How many nodes of one octant lie above `level`.
fn first(level: u8) -> usize {
    ((1 << (2 * u32::from(level))) - 1) / 3
}

/// Fills the tree of one cell and returns the sum over its leaves.
fn fill(sums: &mut [f32], cell: &[f32], bases: usize, level: u8, measures: &[f64]) -> f64 {
    let leaves = bases * measures.len();
    let lambdas = cell.len() / leaves;
    let power = |(i, spectrum): (usize, &[f32])| mean(spectrum).max(0.0) * measures[i % measures.len()];
    let total: f64 = cell.chunks_exact(lambdas).enumerate().map(power).sum();
    if total == 0.0 {
        return 0.0;
    }
    let at = bases * first(level);
    for (leaf, sum) in cell.chunks_exact(lambdas).enumerate().zip(&mut sums[at..]) {
        *sum = (power(leaf) / total) as f32;
    }
    for level in (0..level).rev() {
        let (above, below) = sums.split_at_mut(bases * first(level + 1));
        for (parent, children) in above[bases * first(level)..].iter_mut().zip(below.chunks_exact(4)) {
            *parent = children[0] + children[1] + children[2] + children[3];
        }
    }
    total
}

/// The mean of the samples that are not masked; 0 where all are.
fn mean(spectrum: &[f32]) -> f64 {
    let (sum, count) = spectrum
        .iter()
        .filter(|sample| !sample.is_nan())
        .fold((0.0, 0_usize), |(sum, count), &sample| (sum + f64::from(sample), count + 1));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

fn four(sums: &[f32]) -> [f64; 4] {
    [sums[0], sums[1], sums[2], sums[3]].map(f64::from)
}

/// The sums of the upper and the lower bases of a sphere.
fn half_sums(sums: &[f32]) -> [f64; 2] {
    [four(sums).iter().sum(), four(&sums[4..]).iter().sum()]
}

/// Chooses one of two by weight, and rescales `u` over the choice. Never chooses one without weight.
fn halve(weights: [f64; 2], u: &mut f64) -> (usize, f64) {
    let p = share_of_half(weights, 0);
    let which = usize::from(*u >= p);
    let probability = share_of_half(weights, which);
    *u = if which == 0 { *u / p } else { (*u - p) / (1.0 - p) };
    *u = u.clamp(0.0, BELOW_ONE);
    (which, probability)
}

/// Chooses one of four: a pair by the first coordinate, one of the pair by the second.
fn choose(weights: [f64; 4], u: &mut [f64; 2]) -> (usize, f64) {
    let [a, b, c, d] = weights;
    let (pair, p) = halve([a + b, c + d], &mut u[0]);
    let (one, q) = halve(if pair == 0 { [a, b] } else { [c, d] }, &mut u[1]);
    (2 * pair + one, p * q)
}

fn share_of_half([a, b]: [f64; 2], which: usize) -> f64 {
    let total = a + b;
    if total == 0.0 {
        0.0
    } else if which == 0 {
        a / total
    } else {
        b / total
    }
}

/// The probability with which [`choose`] takes `which`.
fn share([a, b, c, d]: [f64; 4], which: usize) -> f64 {
    let pair = which / 2;
    share_of_half([a + b, c + d], pair) * share_of_half(if pair == 0 { [a, b] } else { [c, d] }, which % 2)
}
