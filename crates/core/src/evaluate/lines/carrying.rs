//! Chooses the alignment between stated incoming directions: the one under which the function keeps its shape best.

use super::{Kind, Lines};
use crate::domain::Direction;
use crate::domain::vector::Vector;
use crate::evaluate::change::change_of_shape;
use crate::evaluate::incoming::{Alignment, carried};

/// Approximate number of outgoing directions at which incoming ones are compared.
const COMPARED: usize = 600;

impl Lines {
    /// Chooses the alignment among candidates. `measure` is the weight of an outgoing direction.
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

    /// Outgoing directions of the grid, evenly thinned out.
    fn compared(&self) -> Vec<Vector> {
        let Some(sphere) = &self.outgoing else { return Vec::new() };
        let step = (sphere.grid().len() / COMPARED).max(1);
        (0..sphere.grid().len()).step_by(step).map(|entry| sphere.grid().direction(entry).xyz()).collect()
    }

    /// Neighbouring pairs of stated incoming directions.
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

    /// Mean of three wavelengths under one incoming direction.
    pub(in crate::evaluate) fn brightness(&self, entry: usize, node: usize, d: Vector) -> f64 {
        let found = self.under(entry, node, Direction::from_unit(d));
        let last = self.values.lambdas() - 1;
        let sum: f32 = [1, 2, 3].iter().map(|quarter| self.sample(&found, quarter * last / 4)).sum();
        f64::from(sum)
    }
}
