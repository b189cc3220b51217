//! Chooses the alignment between stated incoming directions: the one under which the function keeps its shape best.

use super::{Kind, Lines};
use crate::domain::Direction;
use crate::domain::vector::Vector;
use crate::evaluate::change::change_of_shape;
use crate::evaluate::incoming::{Alignment, carried};

/// Approximate number of outgoing directions at which lobes under neighbouring incoming directions are compared, to
/// choose the rule by which lobes move with the incoming direction. More make the choice more reliable and slower.
const COMPARED: usize = 600;

impl Lines {
    /// Chooses the rule by which lobes move with the incoming direction: the candidate under which the function changes
    /// its shape least. `measure` gives the weight of an outgoing direction in that comparison.
    pub(in crate::evaluate) fn align(
        &mut self,
        entries: usize,
        candidates: &[Alignment],
        measure: impl Fn(Vector) -> f64 + Sync,
    ) {
        let directions = self.compared();
        let pairs = self.neighbours();
        let mut best = f64::INFINITY;
        for &alignment in candidates {
            let change = change_of_shape(
                (&pairs, entries),
                &directions,
                |entry, node, d| self.brightness(entry, node, d),
                &measure,
                |node, other, d| carried(alignment, self.domain, self.directions[node], self.directions[other], d),
            );
            self.changes.push((alignment, change));
            if change < best {
                (best, self.alignment) = (change, alignment);
            }
        }
    }

    /// Outgoing directions at which lobes under neighbouring incoming directions are compared: every n-th direction of
    /// the grid.
    fn compared(&self) -> Vec<Vector> {
        let Some(sphere) = &self.outgoing else { return Vec::new() };
        let step = (sphere.grid().len() / COMPARED).max(1);
        (0..sphere.grid().len()).step_by(step).map(|entry| sphere.grid().direction(entry).xyz()).collect()
    }

    /// Pairs of neighbouring measured incoming directions, by their numbers.
    fn neighbours(&self) -> Vec<(usize, usize)> {
        match &self.incoming.0 {
            Kind::None => Vec::new(),
            Kind::Elevations(values, _) => (1..values.len()).map(|node| (node - 1, node)).collect(),
            Kind::Grid(sphere) => {
                let [rows, columns] = sphere.grid().shape();
                let below = (0..(rows - 1) * columns).map(|node| (node, node + columns));
                let beside =
                    (0..rows * columns).filter(|node| node % columns + 1 < columns).map(|node| (node, node + 1));
                below.chain(beside).collect()
            }
        }
    }

    /// Sum over three wavelengths of the material's function at one measured incoming direction and the outgoing
    /// direction `d`; a measure of brightness.
    pub(in crate::evaluate) fn brightness(&self, entry: usize, node: usize, d: Vector) -> f64 {
        let found = self.under(entry, node, Direction::from_unit(d));
        let last = self.values.lambdas() - 1;
        let sum: f32 = [1, 2, 3].iter().map(|quarter| self.sample(&found, quarter * last / 4)).sum();
        f64::from(sum)
    }
}
