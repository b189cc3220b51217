//! Motion of lobes with the incoming direction: change of shape under an alignment, and the leave-one-out error.

use super::Smooth;
use crate::domain::vector::Vector;
use crate::evaluate::change::change_of_shape;
use crate::evaluate::incoming::{Alignment, Nodes, carried};
use crate::evaluate::mixed::{Mixed, Mixture};
use crate::evaluate::planes::Planes;
use rayon::prelude::*;

/// Approximate number of outgoing directions at which lobes under neighbouring incoming directions are compared, to
/// choose the rule by which lobes move with the incoming direction. More make the choice more reliable and slower.
const COMPARED: usize = 600;

impl Smooth {
    /// Returns the standard deviation of ln(f₁ / f₂), averaged over pairs of neighbouring incoming directions. f₁ and
    /// f₂ are values of the material's function under the two, at outgoing directions aligned by `alignment`. The
    /// result is 0 if lobes keep their shape.
    pub(super) fn change_between(
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
        let compared: Vec<Vector> = directions.iter().step_by((directions.len() / COMPARED).max(1)).copied().collect();
        change_of_shape(
            (&pairs, entries),
            &compared,
            |entry, node, d| brightness(planes, &self.looked_up(entry * own + node, d)),
            |d| self.measure(d),
            |node, other, d| carried(alignment, self.domain, nodes.direction(node), nodes.direction(other), d),
        )
    }

    /// Sum over three wavelengths of the material's function at the sampled incoming direction `wi` and the outgoing
    /// direction `wo`; a measure of brightness.
    pub(in crate::evaluate) fn brightness(
        &self,
        planes: &Planes,
        (entry, incoming): (usize, usize),
        wi: Vector,
        wo: Vector,
    ) -> f64 {
        brightness(planes, &self.own(entry, incoming, wi, wo))
    }

    fn measure(&self, d: Vector) -> f64 {
        if self.has_cosine { d[2].abs() } else { 1.0 }
    }

    /// Leave-one-out error: Σ |error| · cos θo over Σ value · cos θo, when each sampled incoming direction is predicted
    /// from its neighbours.
    pub(super) fn left_out(
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
}

/// Sum of three samples (at a quarter, half and three quarters of the wavelengths) of a spectrum interpolated between
/// directions. It is multiplied by the fraction of the interpolation weight on directions with nonzero spectra; NaN if
/// masked.
fn brightness(planes: &Planes, mixed: &Mixed) -> f64 {
    let row = &mixed.row[..planes.count()];
    let sum: f32 = [1, 2, 3].iter().map(|quarter| planes.sample(row, quarter * (planes.lambdas() - 1) / 4)).sum();
    f64::from(mixed.presence * sum)
}
