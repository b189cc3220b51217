//! Smooth form: values at nodes over outgoing directions, for nodes over incoming directions, and interpolation between
//! them.
//!
//! * Over **outgoing** directions: quadratic elements ([`super::elements`]) through values that have the cells'
//!   averages ([`super::reconstruct`]). They interpolate logarithms if data are positive, corrected because the average
//!   of an exponential exceeds the exponential of the average.
//! * Over **incoming** directions: linear between three nodes. Each node is looked up at the outgoing direction to
//!   which its lobe is aligned ([`super::incoming::Alignment`]). The alignment is the one under which the function
//!   keeps its shape best from one measured incoming direction to the next. `between` applies a cubic
//!   ([`crate::compress::Between`]).
//! * With a **divisor** the nodes hold quotients: the cells' averages are divided by those of the divisor
//!   (`cell_means`), and what is interpolated over both directions is multiplied by the divisor there. So the divisor
//!   gives its shape to lobes that are as narrow as a cell, or that move between incoming directions.
//! * Cells that are zero or masked have no logarithm: the share of live cells around is interpolated, too.

mod between;
mod cell_means;
mod course;
mod curved;
mod moving;
mod tables;
#[cfg(test)]
mod tests;

use super::carried::known;
use super::elements::{Elements, NODES, Patches};
use super::incoming::{Alignment, Around, Nodes, Origin, carried, carried_to, carried_to_four};
use super::kernel::{BLOCK, Vectors, vector_of};
use super::mixed::{MOST_PLANES, Mixed, Row};
use crate::compress::Between;
use crate::domain::Domain;
use crate::domain::vector::Vector;
use crate::numeric::wide;
use ::wide::f32x4;
use course::Course;

/// Tables for smooth interpolation of spectral coefficients over outgoing and incoming directions.
#[derive(Debug)]
pub(super) struct Smooth {
    elements: Elements,
    domain: Domain,
    has_cosine: bool,
    nodes: Nodes,
    alignment: Alignment,
    /// Candidate alignments of lobes. With each: standard deviation of ln(f₁ / f₂), where f₁ and f₂ are values of the
    /// material's function at aligned outgoing directions under neighbouring incoming directions. It is 0 if lobes keep
    /// their shape.
    changes: Vec<(Alignment, f64)>,
    /// Leave-one-out error: Σ |error| · cos θo over Σ value · cos θo, when each measured incoming direction is
    /// predicted from its neighbours.
    left_out: Option<f64>,
    width: usize,
    node_count: usize,
    /// Incoming directions at which values are tabulated, each with cosine and sine of its azimuth, which serve to move
    /// lobes from one incoming direction to another.
    origins: Vec<Origin>,
    /// Spectral coefficients `[combination of indices][incoming direction][outgoing direction][coefficient]` at the
    /// pairs of directions between which evaluation interpolates; of quotients if there is a divisor.
    values: Vec<f32>,
    /// Two fractions of the solid angle for each `[combination of indices][incoming direction][outgoing direction]`: of
    /// nonzero among the unmasked outgoing triangles that touch the direction, and of unmasked among all that touch it.
    /// Empty if no triangle is zero or masked.
    presence: Vec<[f32; 2]>,
    /// Interpolation between incoming directions with a divisor (model divided out before interpolation) or a cubic;
    /// `None` if it is linear in logarithms.
    course: Option<Box<Course>>,
}

/// Query prepared for smooth interpolation: its incoming and outgoing direction, and the interpolation nodes around the
/// incoming one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) around: Around,
    pub(super) wi: Vector,
    pub(super) wo: Vector,
}

/// Block of queries for smooth interpolation, with room for the nodes and weights found for each query.
#[derive(Clone, Debug)]
pub(super) struct SeenBlock {
    nodes: [[u32; BLOCK]; 3],
    weights: [[f32; BLOCK]; 3],
    pub(super) wi: Vectors,
    pub(super) wo: Vectors,
    /// Nodes and weights for interpolation at the outgoing direction of each query, in the table of each of up to three
    /// incoming directions around the queried one.
    patches: [Patches<BLOCK>; 3],
}

/// Incoming directions of a block of queries, prepared for queries: all x, all y, all z, then cosines and sines of all
/// azimuths.
type Origins = [[f32; BLOCK]; 5];

#[inline(always)]
fn write_origin(origins: &mut Origins, i: usize, Origin { direction: [x, y, z], azimuth: [cos, sin] }: Origin) {
    for (to, number) in origins.iter_mut().zip([x, y, z, cos, sin]) {
        to[i] = number;
    }
}

impl SeenBlock {
    /// Initial scratch space for a block of queries. In a block that is not full, the entries behind its last query are
    /// computed like the others, and the results are ignored.
    pub(super) const NOTHING: Self = Self {
        nodes: [[0; BLOCK]; 3],
        weights: [[0.0; BLOCK]; 3],
        wi: [[0.0; BLOCK]; 3],
        wo: [[0.0; BLOCK]; 3],
        patches: [const { Patches::NOWHERE }; 3],
    };

    #[inline]
    pub(super) fn set_around(&mut self, i: usize, around: &Around) {
        for k in 0..3 {
            (self.nodes[k][i], self.weights[k][i]) = (around.nodes[k], around.weights[k]);
        }
    }

    fn get(&self, i: usize) -> Seen {
        Seen { around: self.around(i), wi: vector_of(&self.wi, i), wo: vector_of(&self.wo, i) }
    }

    #[inline(always)]
    fn around(&self, i: usize) -> Around {
        Around { nodes: self.nodes_of(i), weights: self.weights.map(|weights| weights[i]), count: 3 }
    }

    /// Incoming directions prepared for queries: all x, all y, all z, then cosines and sines of all azimuths.
    #[inline(always)]
    fn origins(&self) -> Origins {
        let mut origins = [[0.0; BLOCK]; 5];
        for i in 0..BLOCK {
            write_origin(&mut origins, i, Origin::new(vector_of(&self.wi, i)));
        }
        origins
    }

    #[inline]
    fn nodes_of(&self, i: usize) -> [u32; 3] {
        [self.nodes[0][i], self.nodes[1][i], self.nodes[2][i]]
    }
}

impl Smooth {
    /// Returns the interpolation nodes over incoming directions.
    #[inline(always)]
    pub(super) fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    /// Interpolation that the file or the user specified for use between incoming directions.
    pub(super) fn between(&self) -> Between {
        self.course.as_ref().map_or_else(Between::default, |course| course.stated())
    }

    /// Returns the domain of the function's outgoing directions.
    pub(super) fn domain(&self) -> Domain {
        self.domain
    }

    /// Alignment of lobes for interpolation between incoming directions.
    #[inline]
    pub(super) fn alignment(&self) -> Alignment {
        self.alignment
    }

    /// Candidate alignments of lobes. With each: standard deviation of ln(f₁ / f₂), where f₁ and f₂ are values of the
    /// material's function at aligned outgoing directions under neighbouring incoming directions. It is 0 if lobes keep
    /// their shape.
    pub(super) fn changes(&self) -> &[(Alignment, f64)] {
        &self.changes
    }

    /// Leave-one-out error: Σ |error| · cos θo over Σ value · cos θo, when each measured incoming direction is
    /// predicted from its neighbours.
    pub(super) fn left_out_error(&self) -> Option<f64> {
        self.left_out
    }

    /// Spectral coefficients at an outgoing direction, interpolated in the table of one incoming node, with the
    /// fraction of the interpolation weight that lies on nonzero triangles. If samples are divided by a function before
    /// interpolation, the coefficients are those of the quotient.
    fn looked_up(&self, table: usize, d: Vector) -> Mixed {
        let mut patches = Patches::<1>::NOWHERE;
        self.elements.write(d.map(|x| x as f32), &mut patches, 0);
        self.gather(1, [table; 3], [&patches; 3], [0; 3], [1.0, 0.0, 0.0])
    }

    /// Spectral coefficients at `wo` under the sampled incoming direction number `incoming`, which is `wi`.
    pub(super) fn own(&self, entry: usize, incoming: usize, wi: Vector, wo: Vector) -> Mixed {
        let (node, there) = match self.nodes {
            Nodes::Same(to) => (0, carried(self.alignment, self.domain, wi, to, wo).0),
            _ => (incoming, wo),
        };
        self.multiplied(entry, node, there)
    }

    /// Returns the spectral coefficients at `wo` under the incoming interpolation node number `node`.
    pub(super) fn under(&self, entry: usize, node: usize, wo: Vector) -> Mixed {
        self.multiplied(entry, node, wo)
    }

    /// Spectral coefficients at an outgoing direction under one incoming node, multiplied by the divisor.
    fn multiplied(&self, entry: usize, node: usize, wo: Vector) -> Mixed {
        let mut mixed = self.looked_up(entry * self.node_count + node, wo);
        if let Some(course) = &self.course {
            course.multiply(&mut mixed, self.nodes.direction(node), wo);
        }
        mixed
    }

    /// Returns true if the interpolation patch around a direction has light at a corner, so that the function is
    /// positive inside the patch. Only for quantities without an incoming direction.
    pub(super) fn is_lit_around(&self, entry: usize, d: Vector) -> bool {
        let base = entry * self.node_count * self.elements.len();
        let patch = self.elements.at(d.map(|x| x as f32));
        self.presence.is_empty()
            || patch.nodes[..3].iter().any(|&node| {
                let [live, known] = self.presence[base + node as usize];
                live * known > 0.0
            })
    }

    /// Directions of the interpolation nodes over outgoing directions.
    pub(super) fn outgoing_nodes(&self) -> Vec<Vector> {
        self.elements.directions()
    }

    /// Spectral coefficients interpolated smoothly for a pair of directions. `entry` is the row-major position of the
    /// query's indices (positions on the axes before the directions).
    #[inline(always)]
    pub(super) fn at(&self, entry: usize, seen: &Seen) -> Mixed {
        match &self.course {
            None => self.straight(entry, seen),
            Some(course) => self.at_between(course, entry, seen),
        }
    }

    /// Spectral coefficients interpolated linearly between incoming directions; those of a quotient if there is a
    /// divisor.
    #[inline(always)]
    fn straight(&self, entry: usize, seen: &Seen) -> Mixed {
        let &Seen { around, wi, wo } = seen;
        let [a, b, c] = around.nodes;
        let mut patches = Patches::<4>::NOWHERE;
        let (there, worth) = if matches!(self.nodes, Nodes::One) {
            (wo.map(|x| f32x4::splat(x as f32)), f32x4::ONE)
        } else {
            let to = [a, b, c, c].map(|node| self.origins[node as usize]);
            carried_to_four(self.alignment, self.domain, Origin::new(wi), to, wo)
        };
        self.elements.write(there, &mut patches, 0);
        let [u, v, w] = around.weights;
        let weights = worth * f32x4::new([u, v, w, 0.0]);
        for shares in &mut patches.weights {
            *shares = (f32x4::new(*shares) * weights).to_array();
        }
        let [u, v, w, _] = weights.to_array();
        self.gather(around.count, self.tables(entry, [a, b, c]), [&patches; 3], [0, 1, 2], [u, v, w])
    }

    /// Writes the interpolated spectral coefficients of the first `to.len()` queries of a block. First it finds the
    /// interpolation nodes of all these queries, then it sums the coefficients at the nodes.
    pub(super) fn at_block(&self, entry: usize, seen: &mut SeenBlock, to: &mut [Mixed]) {
        let alignment = if matches!(self.nodes, Nodes::One) { Alignment::None } else { self.alignment };
        let is_whole = self.domain == Domain::Sphere;
        if is_whole && !matches!(alignment, Alignment::None | Alignment::Rotation) {
            // The alignment differs above and below the horizon.
            to.iter_mut().enumerate().for_each(|(i, to)| *to = self.at(entry, &seen.get(i)));
            return;
        }
        match &self.course {
            Some(course) if course.has_curve() => self.block_along_curve(alignment, course, entry, seen, to),
            _ => self.straight_block(alignment, entry, seen, to),
        }
        if let Some(course) = &self.course {
            wide(
                #[inline(always)]
                || self.multiply_block(course, entry, seen, to),
            );
        }
    }

    /// Writes the spectral coefficients of the first `to.len()` queries of a block, interpolated linearly between
    /// incoming directions; those of quotients if there is a divisor.
    #[inline(always)]
    fn straight_block(&self, alignment: Alignment, entry: usize, seen: &mut SeenBlock, to: &mut [Mixed]) {
        let count = if matches!(self.nodes, Nodes::One | Nodes::Same(_)) { 1 } else { 3 };
        wide(
            #[inline(always)]
            || {
                known(
                    alignment,
                    #[inline(always)]
                    |alignment| self.look_up_block(alignment, count, seen),
                );
                let SeenBlock { patches: [a, b, c], weights, .. } = &*seen;
                for (i, to) in to.iter_mut().enumerate() {
                    let tables = self.tables(entry, seen.nodes_of(i));
                    *to = self.gather(count, tables, [a, b, c], [i; 3], [weights[0][i], weights[1][i], weights[2][i]]);
                }
            },
        );
    }

    /// For each query of a block (batch evaluated together) and each of the `count` incoming nodes around it: moves the
    /// outgoing direction with the lobe to that node and writes the interpolation patch there. Multiplies the node's
    /// interpolation weight by the factor that the alignment of lobes gives.
    #[inline(always)]
    fn look_up_block(&self, alignment: Alignment, count: usize, seen: &mut SeenBlock) {
        let origins = seen.origins();
        let wo = seen.wo.map(|numbers| numbers.map(|x| x as f32));
        for ((patches, weights), nodes) in seen.patches.iter_mut().zip(&mut seen.weights).zip(&seen.nodes).take(count) {
            self.carry_block(
                alignment,
                [&origins, &self.origins_of(alignment, |i| nodes[i])],
                &wo,
                #[inline(always)]
                |i, there, worth| {
                    self.elements.write(there, patches, i);
                    weights[i] *= worth;
                    for shares in &mut patches.weights {
                        shares[i] *= weights[i];
                    }
                },
            );
        }
    }

    /// Incoming directions of one interpolation node for each query of a block, prepared for queries. Not set if lobes
    /// do not move.
    #[inline(always)]
    fn origins_of(&self, alignment: Alignment, node: impl Fn(usize) -> u32) -> Origins {
        let mut origins = [[0.0; BLOCK]; 5];
        if alignment != Alignment::None {
            for i in 0..BLOCK {
                write_origin(&mut origins, i, self.origins[node(i) as usize]);
            }
        }
        origins
    }

    /// Moves the outgoing directions of a block of queries with their lobes, from the incoming directions `from` to
    /// those of `to`. Calls `work` with the number of each query, the moved direction, and a factor on the
    /// interpolation weight of the incoming direction to which it moved.
    #[inline(always)]
    fn carry_block(
        &self,
        alignment: Alignment,
        [from, to]: [&Origins; 2],
        wo: &[[f32; BLOCK]; 3],
        mut work: impl FnMut(usize, [f32; 3], f32),
    ) {
        let is_free = self.domain == Domain::Sphere;
        for i in 0..BLOCK {
            let at = |of: &Origins| Origin { direction: [of[0][i], of[1][i], of[2][i]], azimuth: [of[3][i], of[4][i]] };
            let (there, worth) = carried_to(alignment, is_free, at(from), at(to), [wo[0][i], wo[1][i], wo[2][i]]);
            work(i, there, worth);
        }
    }

    /// Indices of the three tables of spectral coefficients over outgoing directions for three tabulated incoming
    /// directions `nodes`. `entry` is the row-major position of the query's indices (positions on the axes before the
    /// directions).
    #[inline]
    fn tables(&self, entry: usize, nodes: [u32; 3]) -> [usize; 3] {
        nodes.map(|node| entry * self.node_count + node as usize)
    }

    /// Spectral coefficients at a queried pair of directions, interpolated over outgoing directions in the tables of
    /// one or of three incoming directions around the queried one, then averaged with weights. `patches` hold the
    /// positions of the outgoing nodes in the tables, and their weights.
    #[inline(always)]
    fn gather<const N: usize>(
        &self,
        count: usize,
        tables: [usize; 3],
        patches: [&Patches<N>; 3],
        lanes: [usize; 3],
        weights: [f32; 3],
    ) -> Mixed {
        match (self.width, count) {
            (4, 1) => self.gather_in::<4, 1, N>(tables, patches, lanes, weights),
            (4, _) => self.gather_in::<4, 3, N>(tables, patches, lanes, weights),
            (8, 1) => self.gather_in::<8, 1, N>(tables, patches, lanes, weights),
            (8, _) => self.gather_in::<8, 3, N>(tables, patches, lanes, weights),
            (12, _) => self.gather_in::<12, 3, N>(tables, patches, lanes, weights),
            _ => self.gather_in::<MOST_PLANES, 3, N>(tables, patches, lanes, weights),
        }
    }

    /// Weighted mean of the spectral coefficients interpolated over outgoing directions in `COUNT` tables, one for each
    /// incoming interpolation node; compiled for `WIDTH` coefficients. Unused tables have weight 0. The weights in
    /// `patches` already include those of the tables.
    #[inline(always)]
    fn gather_in<const WIDTH: usize, const COUNT: usize, const N: usize>(
        &self,
        tables: [usize; 3],
        patches: [&Patches<N>; 3],
        lanes: [usize; 3],
        weights: [f32; 3],
    ) -> Mixed {
        let bases: [usize; COUNT] = std::array::from_fn(|k| tables[k] * self.elements.len());
        if self.presence.is_empty() {
            let row = self.summed::<WIDTH, COUNT>(bases, |node, k| {
                (patches[k].nodes[node][lanes[k]], patches[k].weights[node][lanes[k]])
            });
            let live: f32 = weights[..COUNT].iter().sum();
            return Mixed::settled(row, live, live);
        }
        let (mut parts, mut live, mut known) = ([0.0; COUNT], 0.0, 0.0);
        for k in 0..COUNT {
            let (share, known_share) = self.presence_in(bases[k], patches[k], lanes[k]);
            if known_share > 0.0 {
                parts[k] = share;
                known += weights[k];
                live += weights[k] * share;
            }
        }
        let row = self.summed::<WIDTH, COUNT>(bases, |node, k| {
            (patches[k].nodes[node][lanes[k]], patches[k].weights[node][lanes[k]] * parts[k])
        });
        Mixed::settled(row, live, known)
    }

    /// Weighted sum of the spectral coefficients at six outgoing directions in each of `COUNT` tables, one table for
    /// each incoming direction around a queried one. `of(n, k)` returns the position of outgoing direction `n` in table
    /// `k`, and its weight.
    #[inline(always)]
    fn summed<const WIDTH: usize, const COUNT: usize>(
        &self,
        bases: [usize; COUNT],
        of: impl Fn(usize, usize) -> (u32, f32),
    ) -> Row {
        let rows = self.values.as_chunks::<WIDTH>().0;
        let mut sums = [[0.0; WIDTH]; COUNT];
        for node in 0..NODES {
            for k in 0..COUNT {
                let (place, factor) = of(node, k);
                for (sum, v) in sums[k].iter_mut().zip(&rows[bases[k] + place as usize]) {
                    *sum += factor * v;
                }
            }
        }
        let mut row = [0.0; MOST_PLANES];
        for sums in sums {
            row.iter_mut().zip(sums).for_each(|(row, sum)| *row += sum);
        }
        row
    }

    /// Fraction of nonzero triangles among the unmasked ones around an outgoing direction, and fraction of unmasked
    /// triangles among all. Both are interpolated between the corners of the patch around the direction, in the table
    /// of one incoming direction that starts at `base`.
    fn presence_in<const N: usize>(&self, base: usize, patches: &Patches<N>, lane: usize) -> (f32, f32) {
        let (mut live, mut known) = (0.0, 0.0);
        for (nodes, corners) in patches.nodes.iter().zip(&patches.corners) {
            let [share, known_share] = self.presence[base + nodes[lane] as usize];
            live += corners[lane] * share * known_share;
            known += corners[lane] * known_share;
        }
        (if known > 0.0 { live / known } else { 0.0 }, known)
    }

    pub(super) fn memory(&self) -> usize {
        let course = self.course.as_ref().map_or(0, |course| course.memory());
        size_of_val(&*self.values)
            + size_of_val(&*self.presence)
            + size_of_val(&*self.origins)
            + self.nodes.memory()
            + course
    }
}
