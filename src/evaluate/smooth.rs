//! The smooth form: values at nodes over outgoing directions, for nodes over incoming directions.
//!
//! * Over **outgoing** directions: quadratic elements ([`super::elements`]) through values that have the cells' averages
//!   ([`super::reconstruct`]); of logarithms where data are positive, corrected for the average of an exponential being
//!   more than the exponential of an average.
//! * Over **incoming** directions: linear between three nodes, each of which is looked up where its own lobe has what is
//!   asked for ([`super::incoming::Alignment`]). The alignment is the one under which the function keeps its shape best from
//!   one measured incoming direction to the next.
//! * Cells that are zero or masked have no logarithm: the share of live cells around is interpolated, too.

use super::carried::known;
use super::elements::{Elements, NODES, Patches};
use super::incoming::{Alignment, Around, Nodes, Origin, carried, carried_to, carried_to_four};
use super::kernel::{BLOCK, Vectors, vector_of};
use super::lookup::MeshLookup;
use super::planes::{Cell, MOST_PLANES, Planes};
use super::reconstruct::{Cells, Weights, node_weights};
use crate::domain::vector::Vector;
use crate::domain::{Domain, wide};
use ::wide::f32x4;
use rayon::prelude::*;

/// Corrections for the average of an exponential.
const CORRECTIONS: usize = 2;
/// A correction of a logarithm is at most this large: beyond it cells are too steep to say.
const LARGEST_CORRECTION: f64 = 0.5;
/// Nodes at which alignments are compared, about.
const COMPARED: usize = 600;
/// Changes of shape below this are none.
const NO_CHANGE: f64 = 0.02;
/// Pairs of neighbouring incoming directions that are compared at most, about.
const MOST_PAIRS: usize = 256;
/// If carried directions agree this well, one of them serves for all.
const ALIKE: f64 = 2e-3;
/// Presence below this is none.
const NO_LIGHT: f32 = 1e-4;
/// The most numbers in tables.
pub(super) const MOST_VALUES: usize = 1 << 28;

/// A row of coefficients on the stack.
pub(super) type Row = [f32; MOST_PLANES];

/// The tables.
#[derive(Debug)]
pub(super) struct Smooth {
    elements: Elements,
    domain: Domain,
    has_cosine: bool,
    pub(super) nodes: Nodes,
    pub(super) alignment: Alignment,
    /// The alignments that competed, and how much the function changes under each.
    pub(super) changes: Vec<(Alignment, f64)>,
    /// The share of light that goes astray where an incoming direction is predicted from those around.
    pub(super) left_out: Option<f64>,
    width: usize,
    node_count: usize,
    /// The nodes' directions.
    origins: Vec<Origin>,
    /// `[index entry][incoming node][outgoing node][width]`.
    values: Vec<f32>,
    /// Where not all cells are live: `[index entry][incoming node][outgoing node]` of live among those not masked, and of
    /// those not masked among all.
    presence: Vec<[f32; 2]>,
}

/// A place: the nodes around its incoming direction, and its directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) around: Around,
    pub(super) wi: Vector,
    pub(super) wo: Vector,
}

/// The same for a block, and room for where it is looked up.
#[derive(Clone, Debug)]
pub(super) struct SeenBlock {
    nodes: [[u32; BLOCK]; 3],
    weights: [[f32; BLOCK]; 3],
    pub(super) wi: Vectors,
    pub(super) wo: Vectors,
    /// For each of the nodes.
    patches: [Patches<BLOCK>; 3],
}

impl SeenBlock {
    /// Anything.
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
        let around = Around { nodes: self.nodes_of(i), weights: self.weights.map(|weights| weights[i]), count: 3 };
        Seen { around, wi: vector_of(&self.wi, i), wo: vector_of(&self.wo, i) }
    }

    #[inline]
    fn nodes_of(&self, i: usize) -> [u32; 3] {
        [self.nodes[0][i], self.nodes[1][i], self.nodes[2][i]]
    }
}

/// What is interpolated at a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mixed {
    pub(super) row: Row,
    /// The share of light; NaN where all is masked.
    pub(super) presence: f32,
}

impl Mixed {
    /// No light.
    pub(super) const NOTHING: Self = Self { row: [0.0; MOST_PLANES], presence: 0.0 };

    /// Of a sum of rows that weigh `live` together, of `known` that are not masked. Weights of a fit may be negative, and
    /// what is left of them next to nothing.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the machine only where it is inlined")]
    fn settled(mut row: Row, live: f32, known: f32) -> Self {
        let mut presence = 0.0;
        if live > NO_LIGHT {
            let share = 1.0 / live;
            for value in &mut row {
                *value *= share;
            }
            presence = (live / known).clamp(0.0, 1.0);
        }
        Self { row, presence: if known > NO_LIGHT { presence } else { f32::NAN } }
    }
}

impl Smooth {
    /// Tables for the cells of `planes`: `[entry][incoming entry][cell]`; `None` if they would be too large.
    pub(super) fn new(
        planes: &Planes,
        cells: &Cells,
        lookup: &MeshLookup,
        mut nodes: Nodes,
        entries: usize,
        candidates: &[Alignment],
        has_cosine: bool,
    ) -> Option<Self> {
        let mesh = lookup.mesh();
        let elements = Elements::new(mesh);
        let (all, own) = nodes.counts();
        let outgoing = elements.len();
        let size = [entries, all, outgoing, planes.width].iter().try_fold(1_usize, |n, &k| n.checked_mul(k))?;
        if size > MOST_VALUES {
            return None;
        }
        let mut smooth = Self {
            elements,
            domain: mesh.domain(),
            has_cosine,
            alignment: Alignment::None,
            left_out: None,
            changes: Vec::new(),
            width: planes.width,
            node_count: 1,
            origins: Vec::new(),
            values: Vec::new(),
            presence: Vec::new(),
            nodes: Nodes::One,
        };
        let (tables, presence) = smooth.reconstruct(planes, cells, lookup, entries * own);
        smooth.values = tables;
        smooth.presence = presence;
        // So far every entry is a node of its own and nothing is between.
        let directions = elements.directions();
        let mut best = (f64::INFINITY, candidates.first().copied().unwrap_or_default());
        for &alignment in candidates {
            let change = smooth.change_between(planes, &nodes, own, entries, &directions, alignment);
            smooth.changes.push((alignment, change));
            if change < best.0 {
                best = (change, alignment);
            }
        }
        smooth.alignment = best.1;
        smooth.left_out = smooth.left_out(planes, &nodes, own, entries, &directions);
        let alike = smooth.left_out.is_some_and(|error| error < ALIKE);
        if alike && best.1 == Alignment::Rotation {
            nodes = Nodes::Same(nodes.direction(0));
            let cell = outgoing * smooth.width;
            smooth.values = smooth.values.chunks_exact(own * cell).flat_map(|c| &c[..cell]).copied().collect();
            smooth.presence =
                smooth.presence.chunks_exact(own * outgoing).flat_map(|c| &c[..outgoing]).copied().collect();
        }
        smooth.add_nodes_between(&nodes, entries, &directions);
        smooth.node_count = nodes.counts().0;
        smooth.origins = (0..smooth.node_count).map(|node| Origin::new(nodes.direction(node))).collect();
        smooth.nodes = nodes;
        Some(smooth)
    }

    /// Values at the outgoing nodes, for every incoming entry.
    fn reconstruct(
        &self,
        planes: &Planes,
        cells: &Cells,
        lookup: &MeshLookup,
        incoming: usize,
    ) -> (Vec<f32>, Vec<[f32; 2]>) {
        let leaves = lookup.mesh().len();
        let (width, used) = (self.width, planes.count);
        let whole = node_weights(cells, lookup, self.elements, None);
        let coupling = planes.coupling();
        let mut values = vec![0.0; incoming * self.elements.len() * width];
        let per_entry = self.elements.len() * width;
        values.par_chunks_mut(per_entry).enumerate().for_each(|(entry, table)| {
            let is_live = |cell: u32| planes.cell(entry * leaves + cell as usize) == Cell::Live;
            let all_live = (0..leaves as u32).all(is_live);
            let own = (!all_live).then(|| node_weights(cells, lookup, self.elements, Some(&is_live)));
            let weights = own.as_ref().unwrap_or(&whole);
            let mut averages: Vec<f32> =
                (0..leaves).flat_map(|cell| planes.row(entry * leaves + cell)).copied().collect();
            apply(weights, &averages, width, table);
            if !planes.logarithms {
                return;
            }
            let original = averages.clone();
            for _ in 0..CORRECTIONS {
                for cell in 0..leaves {
                    let own = cell * width..cell * width + used;
                    let excess = self.excess(&coupling, used, table, cells.points(cell));
                    for ((average, original), c) in averages[own.clone()].iter_mut().zip(&original[own]).zip(excess) {
                        *average = original - c as f32;
                    }
                }
                apply(weights, &averages, width, table);
            }
        });
        let presence = if planes.cells.is_empty() || planes.cells.iter().all(|&cell| cell == Cell::Live) {
            Vec::new()
        } else {
            self.presence_at_nodes(planes, lookup, cells, incoming)
        };
        (values, presence)
    }

    /// By how much the logarithm of a cell's average exceeds the average of its logarithm, to second order: half the
    /// variance over the cell.
    fn excess(&self, coupling: &[f64], planes: usize, table: &[f32], points: [Vector; 3]) -> [f64; MOST_PLANES] {
        let rows = points.map(|point| self.gathered(table, point));
        let mut products = [0.0; MOST_PLANES * MOST_PLANES];
        for row in rows {
            let apart: Row = std::array::from_fn(|k| row[k] - (rows[0][k] + rows[1][k] + rows[2][k]) / 3.0);
            for j in 0..planes {
                for k in 0..planes {
                    products[j * planes + k] += f64::from(apart[j]) * f64::from(apart[k]) / 3.0;
                }
            }
        }
        let mut excess = [0.0; MOST_PLANES];
        for (excess, coupling) in excess.iter_mut().zip(coupling.chunks_exact(planes * planes)) {
            let sum: f64 = coupling.iter().zip(&products).map(|(a, b)| a * b).sum();
            *excess = 0.5 * sum;
        }
        // The first plane is the mean logarithm times the root of the number of wavelengths: too steep a cell says little.
        let largest = LARGEST_CORRECTION / coupling[0].abs().max(1e-6);
        let share = (largest / excess[0].abs().max(largest)).min(1.0);
        excess.map(|e| e * share)
    }

    /// One table's row at a direction.
    fn gathered(&self, table: &[f32], d: Vector) -> Row {
        let patch = self.elements.at(d.map(|x| x as f32));
        let mut row = [0.0; MOST_PLANES];
        for (node, weight) in patch.nodes.iter().zip(patch.weights) {
            let values = &table[*node as usize * self.width..][..self.width];
            row.iter_mut().zip(values).for_each(|(sum, v)| *sum += weight * v);
        }
        row
    }

    /// Shares of live cells around every node, and of those not masked.
    fn presence_at_nodes(&self, planes: &Planes, lookup: &MeshLookup, cells: &Cells, incoming: usize) -> Vec<[f32; 2]> {
        let mesh = cells.mesh();
        let (leaves, areas) = (mesh.len(), mesh.solid_angles());
        let around: Vec<Weights> = self
            .elements
            .directions()
            .iter()
            .map(|&d| cells.touching(lookup, d).into_iter().map(|c| (c, areas[c as usize] as f32)).collect())
            .collect();
        let share = |entry: usize, around: &Weights| {
            let (mut live, mut known, mut all) = (0.0, 0.0, 0.0);
            for &(cell, area) in around {
                all += area;
                match planes.cell(entry * leaves + cell as usize) {
                    Cell::Live => {
                        live += area;
                        known += area;
                    }
                    Cell::Zero => known += area,
                    Cell::Masked => {}
                }
            }
            [if known > 0.0 { live / known } else { 0.0 }, known / all]
        };
        (0..incoming).into_par_iter().flat_map_iter(|entry| around.iter().map(move |a| share(entry, a))).collect()
    }

    /// How much the shape of the function changes from one incoming direction to its neighbours, carried as `alignment`
    /// says: the standard deviation, by the square of the light, of the logarithm of the ratio. A lobe that stays where it is has a small one,
    /// however much its height changes; one that moves away from under itself has a large one.
    fn change_between(
        &self,
        planes: &Planes,
        nodes: &Nodes,
        own: usize,
        entries: usize,
        directions: &[Vector],
        alignment: Alignment,
    ) -> f64 {
        let pairs: Vec<(usize, usize)> =
            (0..own).flat_map(|node| nodes.neighbours(node).into_iter().map(move |other| (node, other))).collect();
        let stride = (directions.len() / COMPARED).max(1);
        let few = pairs.len().div_ceil(MOST_PAIRS).max(1);
        let sums: Vec<(f64, f64)> = pairs
            .par_iter()
            .step_by(few)
            .flat_map_iter(|&(node, other)| (0..entries).map(move |entry| (entry, node, other)))
            .map(|(entry, node, other)| {
                let (from, to) = (nodes.direction(node), nodes.direction(other));
                let (mut light, mut first, mut second) = (0.0, 0.0, 0.0);
                for d in directions.iter().step_by(stride) {
                    let (there, worth) = carried(alignment, self.domain, from, to, *d);
                    let here = brightness(planes, &self.looked_up(entry * own + node, *d));
                    let there = brightness(planes, &self.looked_up(entry * own + other, there));
                    if here > 0.0 && there > 0.0 && worth > 0.5 {
                        // By the square of the light: lobes decide, not what lies around them.
                        let weight = here * here * self.measure(*d);
                        let ratio = libm::log(here / there);
                        light += weight;
                        first += weight * ratio;
                        second += weight * ratio * ratio;
                    }
                }
                let deviation = (second / light - (first / light).powi(2)).max(0.0).sqrt();
                if light > 0.0 { (libm::log(deviation + NO_CHANGE), 1.0) } else { (0.0, 0.0) }
            })
            .collect();
        // The geometric mean, or pairs at grazing incidence, where the height of lobes changes most, would have all the say.
        let (logarithms, count) = sums.iter().fold((0.0, 0.0), |sum: (f64, f64), s| (sum.0 + s.0, sum.1 + s.1));
        if count > 0.0 { libm::exp(logarithms / count) - NO_CHANGE } else { 0.0 }
    }

    fn measure(&self, d: Vector) -> f64 {
        if self.has_cosine { d[2].abs() } else { 1.0 }
    }

    /// The share of the light of entries that those around put elsewhere.
    fn left_out(
        &self,
        planes: &Planes,
        nodes: &Nodes,
        own: usize,
        entries: usize,
        directions: &[Vector],
    ) -> Option<f64> {
        let stride = (own * directions.len() / COMPARED).clamp(1, 97);
        let pairs: Vec<(usize, usize)> = (0..own)
            .filter(|&node| nodes.others(node).is_some())
            .flat_map(|node| (node % stride..directions.len()).step_by(stride).map(move |d| (node, d)))
            .collect();
        let step = pairs.len().div_ceil(64 * COMPARED).max(1);
        let sums: Vec<(f64, f64)> = pairs
            .par_iter()
            .step_by(step)
            .flat_map_iter(|&(node, d)| (0..entries).map(move |entry| (entry, node, d)))
            .map(|(entry, node, d)| {
                let wi = nodes.direction(node);
                let mut mix = Mixture::new();
                for (other, weight) in nodes.others(node).unwrap_or_default() {
                    let (there, worth) =
                        carried(self.alignment, self.domain, wi, nodes.direction(other), directions[d]);
                    mix.add(self.looked_up(entry * own + other, there), weight * worth);
                }
                let found = brightness(planes, &self.looked_up(entry * own + node, directions[d]));
                let predicted = brightness(planes, &mix.finish());
                let measure = self.measure(directions[d]);
                if found.is_nan() || predicted.is_nan() {
                    (0.0, 0.0)
                } else {
                    ((found - predicted).abs() * measure, found.abs() * measure)
                }
            })
            .collect();
        let (astray, light) = sums.iter().fold((0.0, 0.0), |sum: (f64, f64), s| (sum.0 + s.0, sum.1 + s.1));
        (light > 0.0).then(|| astray / light)
    }

    /// Tables of the nodes that are no entries, from those of the entries around.
    fn add_nodes_between(&mut self, nodes: &Nodes, entries: usize, directions: &[Vector]) {
        let (all, own) = nodes.counts();
        if all == own {
            return;
        }
        let outgoing = self.elements.len();
        let between: Vec<(usize, usize)> = (0..entries).flat_map(|entry| (own..all).map(move |n| (entry, n))).collect();
        let made: Vec<Vec<Mixed>> = between
            .par_iter()
            .map(|&(entry, node)| {
                let wi = nodes.direction(node);
                let sources = nodes.sources(node);
                directions
                    .iter()
                    .map(|&d| {
                        let mut mix = Mixture::new();
                        for &(source, weight) in &sources {
                            let to = nodes.direction(source);
                            let (there, worth) = carried(self.alignment, self.domain, wi, to, d);
                            mix.add(self.looked_up(entry * own + source, there), weight * worth);
                        }
                        mix.finish()
                    })
                    .collect()
            })
            .collect();
        let (width, has_presence) = (self.width, !self.presence.is_empty());
        let mut values = Vec::with_capacity(entries * all * outgoing * width);
        let mut presence = Vec::new();
        for entry in 0..entries {
            values.extend_from_slice(&self.values[entry * own * outgoing * width..][..own * outgoing * width]);
            if has_presence {
                presence.extend_from_slice(&self.presence[entry * own * outgoing..][..own * outgoing]);
            }
            for mixed in made[entry * (all - own)..][..all - own].iter().flatten() {
                values.extend_from_slice(&mixed.row[..width]);
                if has_presence {
                    presence.push(if mixed.presence.is_nan() { [0.0, 0.0] } else { [mixed.presence, 1.0] });
                }
            }
        }
        self.values = values;
        self.presence = presence;
    }

    /// The row of one table at a direction, with its presence.
    fn looked_up(&self, table: usize, d: Vector) -> Mixed {
        let mut patches = Patches::<1>::NOWHERE;
        self.elements.write(d.map(|x| x as f32), &mut patches, 0);
        self.gather(1, [table; 3], [&patches; 3], [0; 3], [1.0, 0.0, 0.0])
    }

    /// What stands in the table of one entry of the incoming axis, whose direction is `wi`.
    pub(super) fn own(&self, entry: usize, incoming: usize, wi: Vector, wo: Vector) -> Mixed {
        let (node, there) = match self.nodes {
            Nodes::Same(to) => (0, carried(self.alignment, self.domain, wi, to, wo).0),
            _ => (incoming, wo),
        };
        self.looked_up(entry * self.node_count + node, there)
    }

    /// What stands at a place, in index entry `entry`.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the machine only where it is inlined")]
    pub(super) fn at(&self, entry: usize, seen: &Seen) -> Mixed {
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

    /// What stands at the first places of a block, as many as `to` has: first they are all looked up, then gathered.
    pub(super) fn at_block(&self, entry: usize, seen: &mut SeenBlock, to: &mut [Mixed]) {
        let alignment = if matches!(self.nodes, Nodes::One) { Alignment::None } else { self.alignment };
        let is_whole = self.domain == Domain::Sphere;
        if is_whole && !matches!(alignment, Alignment::None | Alignment::Rotation) {
            // Above and below the horizon there are different ways.
            to.iter_mut().enumerate().for_each(|(i, to)| *to = self.at(entry, &seen.get(i)));
            return;
        }
        let count = if matches!(self.nodes, Nodes::One | Nodes::Same(_)) { 1 } else { 3 };
        wide(
            #[inline(always)]
            || {
                known(
                    alignment,
                    #[inline(always)]
                    |alignment| self.look_up_block(alignment, is_whole, count, seen),
                );
                let SeenBlock { patches: [a, b, c], weights, .. } = &*seen;
                for (i, to) in to.iter_mut().enumerate() {
                    let tables = self.tables(entry, seen.nodes_of(i));
                    *to = self.gather(count, tables, [a, b, c], [i; 3], [weights[0][i], weights[1][i], weights[2][i]]);
                }
            },
        );
    }

    /// Writes the patches in which places are seen under `count` nodes around, and multiplies weights with their worth.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the machine only where it is inlined")]
    fn look_up_block(&self, alignment: Alignment, is_free: bool, count: usize, seen: &mut SeenBlock) {
        let mut origins = [[0.0; BLOCK]; 5];
        for i in 0..BLOCK {
            let Origin { direction: [x, y, z], azimuth: [cos, sin] } = Origin::new(vector_of(&seen.wi, i));
            for (to, number) in origins.iter_mut().zip([x, y, z, cos, sin]) {
                to[i] = number;
            }
        }
        let wo = seen.wo.map(|numbers| numbers.map(|x| x as f32));
        for ((patches, weights), nodes) in seen.patches.iter_mut().zip(&mut seen.weights).zip(&seen.nodes).take(count) {
            let mut to = [[0.0; BLOCK]; 5];
            if alignment != Alignment::None {
                for i in 0..BLOCK {
                    let Origin { direction: [x, y, z], azimuth: [cos, sin] } = self.origins[nodes[i] as usize];
                    for (to, number) in to.iter_mut().zip([x, y, z, cos, sin]) {
                        to[i] = number;
                    }
                }
            }
            for i in 0..BLOCK {
                let at = |of: &[[f32; BLOCK]; 5]| Origin {
                    direction: [of[0][i], of[1][i], of[2][i]],
                    azimuth: [of[3][i], of[4][i]],
                };
                let (there, worth) =
                    carried_to(alignment, is_free, at(&origins), at(&to), [wo[0][i], wo[1][i], wo[2][i]]);
                self.elements.write(there, patches, i);
                weights[i] *= worth;
                for shares in &mut patches.weights {
                    shares[i] *= weights[i];
                }
            }
        }
    }

    /// The tables of nodes.
    #[inline]
    fn tables(&self, entry: usize, nodes: [u32; 3]) -> [usize; 3] {
        nodes.map(|node| entry * self.node_count + node as usize)
    }

    /// What stands in one table or three, in the patches of these lanes.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the machine only where it is inlined")]
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

    /// Tables beyond those that there are have no weight. Those of patches are multiplied with those of tables already.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the machine only where it is inlined")]
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

    /// The sum of rows: of each node of each patch the place in its table, and its factor.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the machine only where it is inlined")]
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

    /// The share of light in a patch of the table at `base`, and the share that is known.
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
        size_of_val(&*self.values) + size_of_val(&*self.presence) + size_of_val(&*self.origins) + self.nodes.memory()
    }
}

/// Rows mixed by weight and presence; masked ones left out. Weights of a fit may be negative.
struct Mixture {
    row: Row,
    live: f32,
    known: f32,
}

impl Mixture {
    fn new() -> Self {
        Self { row: [0.0; MOST_PLANES], live: 0.0, known: 0.0 }
    }

    fn add(&mut self, mixed: Mixed, weight: f32) {
        if mixed.presence.is_nan() {
            return;
        }
        self.known += weight;
        if mixed.presence > 0.0 {
            let part = weight * mixed.presence;
            self.live += part;
            self.row.iter_mut().zip(mixed.row).for_each(|(sum, v)| *sum += part * v);
        }
    }

    fn finish(self) -> Mixed {
        Mixed::settled(self.row, self.live, self.known)
    }
}

/// The mean of three wavelengths.
fn brightness(planes: &Planes, mixed: &Mixed) -> f64 {
    let row = &mixed.row[..planes.count];
    let sum: f32 = [1, 2, 3].iter().map(|quarter| planes.sample(row, quarter * (planes.lambdas - 1) / 4)).sum();
    f64::from(mixed.presence * sum)
}

/// Node values from averages `[cell][width]`.
fn apply(weights: &[Weights], averages: &[f32], width: usize, table: &mut [f32]) {
    for (weights, row) in weights.iter().zip(table.chunks_exact_mut(width)) {
        row.fill(0.0);
        for &(cell, weight) in weights {
            let values = &averages[cell as usize * width..][..width];
            row.iter_mut().zip(values).for_each(|(sum, v)| *sum += weight * v);
        }
    }
}
