//! Leave-one-out errors: each inner incidence is predicted from those around it.

use super::cubic::{NO_WEIGHT, held, range};
use super::tables::{Others, Tables};
use crate::compress::Between;
use crate::compress::Divided;
use crate::domain::vector::Vector;
use crate::evaluate::incoming::{Alignment, carried};
use crate::numeric::exponential::exp_f64;
use rayon::prelude::*;

/// Maximum number of combinations of indices (positions on the axes before the directions) and of incoming directions
/// at which leave-one-out errors are measured. More give more reliable errors and take longer.
const ENTRIES: usize = 4;
const INCIDENCES: usize = 96;
/// Upper bound on the relative error with which one outgoing direction enters leave-one-out errors, so that directions
/// beside a lobe do not outweigh all others.
const MOST_ERROR: f64 = 50.0;

/// Leave-one-out errors of interpolation: each measured incoming direction is predicted from the others.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    /// Root mean square of the relative error, er(L2).
    pub(super) er_l2: f64,
    /// Root mean square of the relative error, er(L2), after the expected contribution of the samples' noise is
    /// subtracted.
    pub(super) without_noise: f64,
    /// Largest ratio, over incoming directions, of the prediction's error to the measured light, both summed over
    /// outgoing directions: Σ |error| · |cos θo| over Σ value · |cos θo|.
    pub(super) moved: f64,
}

/// Sums over outgoing directions under one incoming direction whose values are predicted from the others: number of
/// directions, squared relative error, its expected part due to noise in the samples, absolute error times |cos θo|,
/// and value times |cos θo|.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: f64,
    errors: f64,
    noise: f64,
    astray: f64,
    light: f64,
}

/// Value of the function under one of the measured incoming directions from which values under a left-out one are
/// predicted (leave-one-out test). It is taken at `there`: the outgoing direction of the predicted value, moved with
/// lobes that follow the incoming direction.
struct Other {
    to: [f32; 3],
    there: [f32; 3],
    worth: f32,
    logarithm: f32,
    is_live: bool,
    /// Weights of one measured incoming direction in three predictions of values under a left-out one (leave-one-out
    /// test): in a mean with nonnegative weights, then in linear and in cubic interpolation.
    mean: f32,
    curves: [f32; 2],
}

/// Measures the leave-one-out errors of each interpolation in `ways`. `noise` is the relative standard deviation of
/// each sample. `None` if no measured incoming direction lies between others.
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

/// Prediction of the light under a left-out incoming direction, in one outgoing direction, from the other incoming
/// directions.
struct Predicting {
    wi: [f32; 3],
    wo: [f32; 3],
    others: Vec<Other>,
    has_curves: [bool; 2],
}

impl Predicting {
    fn new(
        tables: &Tables<'_>,
        alignment: Alignment,
        (entry, node): (usize, usize),
        others: &Others,
        wo: Vector,
    ) -> Self {
        let single = |d: Vector| d.map(|x| x as f32);
        let wi = tables.incidences()[node];
        let curves = [others.linear.as_deref(), others.cubic.as_deref()];
        let mut entries: Vec<usize> =
            curves.into_iter().flatten().chain([&*others.mean]).flatten().map(|e| e.0).collect();
        entries.sort_unstable();
        entries.dedup();
        let weight = |of: &[(usize, f32)], other: usize| of.iter().find(|(k, _)| *k == other).map_or(0.0, |(_, w)| *w);
        let all = entries.into_iter().map(|other| {
            let to = tables.incidences()[other];
            let (there, worth) = carried(alignment, tables.domain(), wi, to, wo);
            let light = tables.light(entry, other, there);
            let is_live = light > 0.0;
            Other {
                to: single(to),
                there: single(there),
                worth,
                logarithm: if is_live { libm::log(light) as f32 } else { 0.0 },
                is_live,
                mean: weight(&others.mean, other),
                curves: curves.map(|curve| weight(curve.unwrap_or_default(), other)),
            }
        });
        let has_curves = curves.map(|curve| curve.is_some());
        Self { wi: single(wi), wo: single(wo), others: all.collect(), has_curves }
    }

    /// Predicts the light under a left-out incoming direction from other ones. Returns its natural logarithm and the
    /// sum of the squares of the other directions' weights (which sum to 1); `None` if no other direction has light.
    fn by(&self, divided: Divided, cubic: bool) -> Option<(f32, f32)> {
        let rest = |other: &Other| other.logarithm - divided.one(other.to, other.there);
        let (mut sum, mut total, mut squares) = (0.0, 0.0, 0.0);
        for other in self.others.iter().filter(|other| other.is_live && other.mean > 0.0) {
            let weight = other.mean * other.worth;
            sum += weight * rest(other);
            total += weight;
            squares += weight * weight;
        }
        if total < 1e-4 {
            return None;
        }
        let (mut logarithm, mut squares) = (sum / total, squares / (total * total));
        let curve = usize::from(cubic);
        let used = || self.others.iter().filter(|other| other.curves[curve].abs() > NO_WEIGHT);
        if self.has_curves[curve] && used().all(|other| other.is_live) {
            let worth = used().map(|other| other.worth).fold(1.0, f32::min);
            let (mut value, mut total, mut of_squares) = (0.0, 0.0, 0.0);
            for other in used() {
                value += other.curves[curve] * rest(other);
                total += other.curves[curve];
                of_squares += other.curves[curve] * other.curves[curve];
            }
            let mixed = self.others.iter().filter(|other| other.is_live && other.mean > 0.0);
            // Fits between triangles are not clamped.
            let is_held = !self.has_curves[0];
            let value = if is_held { held(value / total, range(mixed.map(rest))) } else { value / total };
            logarithm += worth * (value - logarithm);
            squares += worth * (of_squares / (total * total) - squares);
        }
        Some((logarithm + divided.one(self.wi, self.wo), squares))
    }
}
