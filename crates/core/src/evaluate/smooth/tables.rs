//! Construction of the tables of the smooth form: node values that have the averages of cells, and nodes between
//! incoming directions.

use super::Smooth;
use super::cell_means::CellMeans;
use super::course::Course;
use crate::compress::{Between, Divisor};
use crate::domain::vector::Vector;
use crate::evaluate::elements::Elements;
use crate::evaluate::incoming::{Alignment, Nodes, Origin, carried};
use crate::evaluate::lookup::MeshLookup;
use crate::evaluate::mixed::{MOST_PLANES, Mixed, Mixture, Row};
use crate::evaluate::planes::{Cell, Planes};
use crate::evaluate::reconstruct::{Cells, Weights, node_weights};
use rayon::prelude::*;

/// Number of passes that correct the logarithms tabulated at interpolation nodes, so that the exponential of the
/// interpolated logarithms has the measured averages over triangles. More passes are more exact.
const CORRECTIONS: usize = 2;
/// Upper bound on the correction for the difference between the logarithm of a triangle's average value and the
/// triangle's average logarithm (mean over wavelengths). Larger corrections come from triangles in which the function
/// is too steep for the second-order estimate.
const LARGEST_CORRECTION: f64 = 0.5;
/// Leave-one-out error below which the tables of a single incoming direction, rotated with `wi`, serve for all incoming
/// directions.
const ALIKE: f64 = 2e-3;
/// Maximum number of spectral coefficients in all tables for smooth interpolation; beyond it there is no smooth
/// interpolation by coefficients.
const MOST_VALUES: usize = 1 << 28;

impl Smooth {
    /// Builds the tables for smooth interpolation from the spectral coefficients of all triangles, `[combination of
    /// indices][incoming][outgoing triangle]`. `None` if the tables would be too large.
    pub(in crate::evaluate) fn new(
        planes: &Planes,
        cells: &Cells,
        lookup: &MeshLookup,
        mut nodes: Nodes,
        entries: usize,
        (candidates, between): (&[Alignment], &Between),
        has_cosine: bool,
    ) -> Option<Self> {
        let mesh = lookup.mesh();
        let elements = Elements::new(mesh, lookup.is_parted());
        let (all, own) = nodes.counts();
        let outgoing = elements.len();
        let size = [entries, all, outgoing, planes.width()].iter().try_fold(1_usize, |n, &k| n.checked_mul(k))?;
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
            width: planes.width(),
            node_count: 1,
            origins: Vec::new(),
            values: Vec::new(),
            presence: Vec::new(),
            nodes: Nodes::One,
            course: None,
        };
        smooth.values = smooth.reconstruct(planes, cells, lookup, entries * own, None);
        if planes.cells().iter().any(|&cell| cell != Cell::Live) {
            smooth.presence = smooth.presence_at_nodes(planes, lookup, cells, entries * own);
        }
        // At this point every entry is a node of its own and there are no derived nodes.
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
        let alike = between.divisor == Divisor::None && smooth.left_out.is_some_and(|error| error < ALIKE);
        if alike && best.1 == Alignment::Rotation {
            nodes = Nodes::Same(nodes.direction(0));
            let cell = outgoing * smooth.width;
            smooth.values = smooth.values.chunks_exact(own * cell).flat_map(|c| &c[..cell]).copied().collect();
            smooth.presence =
                smooth.presence.chunks_exact(own * outgoing).flat_map(|c| &c[..outgoing]).copied().collect();
        }
        if between.cubic {
            nodes.add_middles();
        }
        let mut course = Course::new(between, planes, &nodes);
        if let Some(course) = course.as_ref().filter(|course| course.has_divisor()) {
            let incoming: Vec<Vector> = (0..own).map(|node| nodes.direction(node)).collect();
            let means = CellMeans::new(course, &incoming, cells);
            smooth.values = smooth.reconstruct(planes, cells, lookup, entries * own, Some(&means));
        }
        smooth.add_nodes_between(&nodes, entries, &directions, course.as_ref());
        smooth.node_count = nodes.counts().0;
        smooth.origins = (0..smooth.node_count).map(|node| Origin::new(nodes.direction(node))).collect();
        smooth.nodes = nodes;
        if let Some(course) = &mut course {
            smooth.hold_past_last(course, entries, &directions);
        }
        smooth.course = course.map(Box::new);
        Some(smooth)
    }

    /// Returns the spectral coefficients at the interpolation nodes over outgoing directions, for every sampled
    /// incoming direction; with `divisor` those of the quotients by its means over the cells.
    fn reconstruct(
        &self,
        planes: &Planes,
        cells: &Cells,
        lookup: &MeshLookup,
        incoming: usize,
        divisor: Option<&CellMeans<'_>>,
    ) -> Vec<f32> {
        let leaves = lookup.mesh().len();
        let (width, used) = (self.width, planes.count());
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
            if let Some(means) = divisor {
                means.divide(entry, &mut averages, width);
            }
            apply(weights, &averages, width, table);
            if !planes.has_logarithms() {
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
        values
    }

    /// Excess of the logarithm of a triangle's average over the average of the logarithm, to second order: half the
    /// variance over the triangle.
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
        // The first plane is the mean logarithm times the square root of the number of wavelengths. It limits the
        // correction in steep cells.
        let largest = LARGEST_CORRECTION / coupling[0].abs().max(1e-6);
        let share = (largest / excess[0].abs().max(largest)).min(1.0);
        excess.map(|e| e * share)
    }

    /// Spectral coefficients interpolated at an outgoing direction in the table of one incoming direction.
    fn gathered(&self, table: &[f32], d: Vector) -> Row {
        let patch = self.elements.at(d.map(|x| x as f32));
        let mut row = [0.0; MOST_PLANES];
        for (node, weight) in patch.nodes.iter().zip(patch.weights) {
            let values = &table[*node as usize * self.width..][..self.width];
            row.iter_mut().zip(values).for_each(|(sum, v)| *sum += weight * v);
        }
        row
    }

    /// Two fractions of the solid angle for every outgoing direction at which values are tabulated: of nonzero among
    /// the unmasked triangles that touch it, and of unmasked among all triangles that touch it.
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

    /// Appends tables of spectral coefficients over outgoing directions for the interpolation nodes that lie between
    /// sampled incoming directions. They are computed from the tables of the sampled directions around.
    fn add_nodes_between(&mut self, nodes: &Nodes, entries: usize, directions: &[Vector], course: Option<&Course>) {
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
                let (means, sources) = (nodes.mean_sources(node), nodes.sources(node));
                directions
                    .iter()
                    .map(|&d| {
                        if course.is_some() {
                            return self.made_between(entry * own, nodes, [&means, &sources], wi, d);
                        }
                        let mut mix = Mixture::new();
                        for &(source, weight) in &sources {
                            let (there, worth) = carried(self.alignment, self.domain, wi, nodes.direction(source), d);
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
}

/// Writes the spectral coefficients at interpolation nodes, as weighted sums of triangle averages
/// `[triangle][coefficient]`.
fn apply(weights: &[Weights], averages: &[f32], width: usize, table: &mut [f32]) {
    for (weights, row) in weights.iter().zip(table.chunks_exact_mut(width)) {
        row.fill(0.0);
        for &(cell, weight) in weights {
            let values = &averages[cell as usize * width..][..width];
            row.iter_mut().zip(values).for_each(|(sum, v)| *sum += weight * v);
        }
    }
}
