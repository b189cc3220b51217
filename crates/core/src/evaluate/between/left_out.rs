//! Errors where each inner incidence is left out in turn and predicted from those around it.

use super::tables::{Others, Tables};
use super::{Divided, FOUR, held};
use crate::compress::Between;
use crate::domain::vector::Vector;
use crate::evaluate::incoming::{Alignment, carried};
use crate::numeric::exponential::exp_f64;
use rayon::prelude::*;

/// Index entries at which errors are measured, at most, and incidences.
const ENTRIES: usize = 4;
const INCIDENCES: usize = 96;
/// A relative error counts as this at most: a direction beside a lobe does not outweigh all others.
const MOST_ERROR: f64 = 50.0;

/// Errors of the incidences that were left out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    /// Root mean square of the relative error.
    pub(super) er_l2: f64,
    /// The same less what noise of the samples adds.
    pub(super) without_noise: f64,
    /// Largest share of the light of an incidence that is put elsewhere.
    pub(super) moved: f64,
}

/// Sums over the directions of one incidence.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    errors: f64,
    noise: f64,
    astray: f64,
    light: f64,
}

/// Light under one of the other incidences, where the one left out has it.
#[derive(Clone, Copy, Default)]
struct Other {
    to: [f32; 3],
    there: [f32; 3],
    worth: f32,
    logarithm: f32,
    is_live: bool,
}

/// The errors of each way from one incidence to the next, with noise of this relative standard deviation in each sample; `None`
/// where no incidence stands between others.
pub(super) fn left_out(tables: &Tables<'_>, alignment: Alignment, ways: &[Between], noise: f64) -> Option<Vec<Errors>> {
    let inner: Vec<(usize, Others)> =
        (0..tables.incidences().len()).filter_map(|node| Some((node, tables.others(node)?))).collect();
    let step = inner.len().div_ceil(INCIDENCES).max(1);
    let divisors: Vec<Divided> = ways.iter().map(|way| Divided::by(way.divisor)).collect();
    let left: Vec<(usize, &(usize, Others))> = (0..tables.entries().min(ENTRIES))
        .flat_map(|entry| inner.iter().step_by(step).map(move |inner| (entry, inner)))
        .collect();
    let sums: Vec<Vec<Sums>> = left
        .par_iter()
        .map(|&(entry, (node, others))| {
            let mut sums = vec![Sums::default(); ways.len()];
            for &wo in tables.outgoing() {
                let truth = tables.light(entry, *node, wo);
                if truth > 0.0 {
                    let predicting = Predicting::new(tables, alignment, (entry, *node), others, wo);
                    for ((sums, way), divided) in sums.iter_mut().zip(ways).zip(&divisors) {
                        if let Some((logarithm, squares)) = predicting.by(*divided, way.cubic) {
                            let ratio = exp_f64(f64::from(logarithm)) / truth;
                            let error = (ratio - 1.0).min(MOST_ERROR);
                            sums.count += 1.0;
                            sums.errors += error * error;
                            sums.noise += noise * noise * (1.0 + f64::from(squares));
                            sums.astray += error.abs() * truth * wo[2].abs();
                            sums.light += truth * wo[2].abs();
                        }
                    }
                }
            }
            sums
        })
        .collect();
    let of_way = |way: usize| {
        let (mut all, mut moved) = (Sums::default(), 0.0_f64);
        for sums in sums.iter().map(|sums| sums[way]).filter(|sums| sums.light > 0.0) {
            all.count += sums.count;
            all.errors += sums.errors;
            all.noise += sums.noise;
            moved = moved.max(sums.astray / sums.light);
        }
        let root = |errors: f64| (errors.max(0.0) / all.count).sqrt();
        let without_noise = root(all.errors - all.noise);
        (all.count > 0.0).then(|| Errors { er_l2: root(all.errors), without_noise, moved })
    };
    (0..ways.len()).map(of_way).collect()
}

/// What predicts the light of an incidence in one direction.
struct Predicting<'a> {
    others: &'a Others,
    wi: [f32; 3],
    wo: [f32; 3],
    linear: Vec<Other>,
    cubic: [Other; FOUR],
}

impl<'a> Predicting<'a> {
    fn new(
        tables: &Tables<'_>,
        alignment: Alignment,
        (entry, node): (usize, usize),
        others: &'a Others,
        wo: Vector,
    ) -> Self {
        let single = |d: Vector| d.map(|x| x as f32);
        let wi = tables.incidences()[node];
        let other = |other: usize| {
            let to = tables.incidences()[other];
            let (there, worth) = carried(alignment, tables.domain(), wi, to, wo);
            let light = tables.light(entry, other, there);
            let is_live = light > 0.0;
            let logarithm = if is_live { libm::log(light) as f32 } else { 0.0 };
            Other { to: single(to), there: single(there), worth, logarithm, is_live }
        };
        let linear = others.linear.iter().map(|&(node, _)| other(node)).collect();
        let cubic = others.cubic.map_or([Other::default(); FOUR], |(nodes, _)| nodes.map(|node| other(node as usize)));
        Self { others, wi: single(wi), wo: single(wo), linear, cubic }
    }

    /// The logarithm of the light that is predicted, and the sum of the squares of weights; `None` where nothing predicts it.
    fn by(&self, divided: Divided, cubic: bool) -> Option<(f32, f32)> {
        let rest = |other: &Other| other.logarithm - divided.one(other.to, other.there);
        let (mut sum, mut total, mut squares) = (0.0, 0.0, 0.0);
        for (other, (_, weight)) in self.linear.iter().zip(&self.others.linear).filter(|(other, _)| other.is_live) {
            let weight = weight * other.worth;
            sum += weight * rest(other);
            total += weight;
            squares += weight * weight;
        }
        if total < 1e-4 {
            return None;
        }
        let (mut logarithm, mut squares) = (sum / total, squares / (total * total));
        if let (true, Some((_, weights))) = (cubic, &self.others.cubic)
            && self.cubic.iter().zip(weights).all(|(other, weight)| *weight == 0.0 || other.is_live)
        {
            let used = || self.cubic.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
            let worth = used().map(|(other, _)| other.worth).fold(1.0, f32::min);
            let value: f32 = used().map(|(other, weight)| weight * rest(other)).sum();
            let cubic_squares: f32 = weights.iter().map(|weight| weight * weight).sum();
            logarithm += worth * (held(value, [rest(&self.cubic[1]), rest(&self.cubic[2])]) - logarithm);
            squares += worth * (cubic_squares - squares);
        }
        Some((logarithm + divided.one(self.wi, self.wo), squares))
    }
}
