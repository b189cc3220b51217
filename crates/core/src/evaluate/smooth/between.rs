//! Smooth form with a divisor or a curve between incidences, and its extrapolation past the last incidence.

use super::course::{Course, Lanes, MOST_LANES};
use super::{Seen, SeenBlock, Smooth};
use crate::domain::vector::Vector;
use crate::evaluate::between::{FOUR, MOST_BEYOND, NO_WEIGHT, held, range};
use crate::evaluate::elements::{NODES, Patches};
use crate::evaluate::incoming::middles::Entries;
use crate::evaluate::incoming::{Nodes, Origin, carried, carried_to_four};
use crate::evaluate::mixed::{MOST_PLANES, Mixed, Mixture};
use crate::numeric::logarithm::ln_f32;
use crate::numeric::wide;

/// Lower bound on the divisor cos θo in the upper bound on values past the last measured polar angle of incidence.
const LEAST_COSINE: f32 = 1e-3;
/// Tolerance on the cosine within which a polar angle of incidence counts as equal to the last measured one.
const ROUNDING: f64 = 1e-9;

impl Smooth {
    /// Computes the upper bounds on values past the last measured polar angle of incidence.
    pub(super) fn hold_past_last(&mut self, course: &mut Course, entries: usize, directions: &[Vector]) {
        let Nodes::Elevations(_, elevations) = &self.nodes else { return };
        let (Some(last), node) = (elevations.last(), elevations.len() - 1) else { return };
        let wi = self.nodes.direction(node);
        // A divisor's lobe may be narrower than the distance between nodes.
        let mirrored = course.has_divisor().then_some([-wi[0], -wi[1], wi[2]]);
        let peaks = (0..entries).map(|entry| {
            let lights = directions.iter().copied().chain(mirrored).filter(|wo| wo[2] > 0.0).map(|wo| {
                let mut seen = self.under(entry, node, wo);
                course.multiply(&mut seen, wi, wo);
                let is_light = seen.presence > 0.0;
                if is_light { course.brightness(&seen.row) + ln_f32(wo[2] as f32) } else { f32::NEG_INFINITY }
            });
            lights.fold(f32::NEG_INFINITY, f32::max)
        });
        course.last = Some((last[2], peaks.collect()));
    }

    /// Returns the spectral coefficients at the outgoing direction `d` under the incoming direction `wi` of an
    /// interpolation node between sampled ones. They come from the tables of the sampled directions, the first of which
    /// has number `first`. A fit to these tables gives way to a mean of them if one of the fit's directions has no
    /// light, or if lobes moved to it reach the horizon.
    pub(super) fn made_between(
        &self,
        first: usize,
        nodes: &Nodes,
        [means, fit]: [&Entries; 2],
        wi: Vector,
        d: Vector,
    ) -> Mixed {
        let seen = |source: usize| {
            let to = nodes.direction(source);
            let (there, worth) = carried(self.alignment, self.domain, wi, to, d);
            (self.looked_up(first + source, there), worth)
        };
        let mut mean = Mixture::new();
        for &(source, weight) in means {
            let (seen, worth) = seen(source);
            mean.add(seen, weight * worth);
        }
        let mut mixed = mean.finish();
        let (mut row, mut total, mut least) = ([0.0_f32; MOST_PLANES], 0.0, 1.0_f32);
        for &(source, weight) in fit.iter().filter(|(_, weight)| weight.abs() > NO_WEIGHT) {
            let (seen, worth) = seen(source);
            least = least.min(worth).min(if seen.presence > 0.0 { seen.presence } else { 0.0 });
            total += weight;
            row.iter_mut().zip(seen.row).for_each(|(sum, value)| *sum += weight * value);
        }
        if least > 0.0 {
            for (value, fitted) in mixed.row.iter_mut().zip(row) {
                *value += least * (fitted / total - *value);
            }
        }
        mixed
    }

    /// Interpolates spectral coefficients for a pair of directions, as [`Smooth::at`] does. Interpolation between
    /// incoming directions uses a divisor (model divided out before interpolation) or a cubic or quadratic curve. Not
    /// inlined, because each kind of query would compile its eight versions again.
    #[inline(never)]
    pub(super) fn at_between(&self, course: &Course, entry: usize, seen: &Seen) -> Mixed {
        if !course.has_curve() {
            let factor = course.divisor(seen.wi, seen.wo);
            return wide(
                #[inline(always)]
                || {
                    let mut mixed = self.straight(entry, seen);
                    let factor = held_past_last(course, entry, seen, factor, &mixed.row[..self.width]);
                    course.shift(&mut mixed.row, factor);
                    mixed
                },
            );
        }
        wide(
            #[inline(always)]
            || match (self.width, course.is_wide()) {
                (4, false) => self.at_between_in::<4, 1>(course, entry, seen),
                (8, false) => self.at_between_in::<8, 1>(course, entry, seen),
                (12, false) => self.at_between_in::<12, 1>(course, entry, seen),
                (_, false) => self.at_between_in::<MOST_PLANES, 1>(course, entry, seen),
                (4, true) => self.at_between_in::<4, 2>(course, entry, seen),
                (8, true) => self.at_between_in::<8, 2>(course, entry, seen),
                (12, true) => self.at_between_in::<12, 2>(course, entry, seen),
                (_, true) => self.at_between_in::<MOST_PLANES, 2>(course, entry, seen),
            },
        )
    }

    /// Interpolates spectral coefficients for a pair of directions, as [`Smooth::at_between`] does, compiled for
    /// `WIDTH` coefficients and for `GROUPS` (1 or 2) groups of four interpolation nodes over incoming directions.
    #[inline(always)]
    fn at_between_in<const WIDTH: usize, const GROUPS: usize>(
        &self,
        course: &Course,
        entry: usize,
        seen: &Seen,
    ) -> Mixed {
        let &Seen { around, wi, wo } = seen;
        let Lanes { nodes, linear, curve } = course.lanes(&self.nodes, &around);
        let origin = Origin::new(wi);
        let is_used = |k: usize| linear[k] > 0.0 || curve.is_some_and(|weights| weights[k] != 0.0);
        let mut rows = [[0.0_f32; WIDTH]; MOST_LANES];
        let (mut shares, mut worths) = ([1.0_f32; MOST_LANES], [0.0_f32; MOST_LANES]);
        let (mut live, mut known) = (0.0, 0.0);
        for group in 0..GROUPS {
            let nodes_here: [u32; FOUR] = std::array::from_fn(|k| nodes[group * FOUR + k]);
            let to = nodes_here.map(|node| self.origins[node as usize]);
            let (there, worth) = carried_to_four(self.alignment, self.domain, origin, to, wo);
            let mut patches = Patches::<FOUR>::NOWHERE;
            self.elements.write(there, &mut patches, 0);
            let worth = worth.to_array();
            for (lane, k) in (group * FOUR..).take(FOUR).enumerate().filter(|(_, k)| is_used(*k)) {
                worths[k] = worth[lane];
                let base = (entry * self.node_count + nodes[k] as usize) * self.elements.len();
                let mut known_share = 1.0;
                if !self.presence.is_empty() {
                    (shares[k], known_share) = self.presence_in(base, &patches, lane);
                }
                rows[k] = self.row_in::<WIDTH>(base, &patches, lane);
                let weight = linear[k] * worths[k];
                if known_share > 0.0 {
                    known += weight;
                    live += weight * shares[k];
                } else {
                    shares[k] = 0.0;
                }
            }
        }
        let lanes = 0..GROUPS * FOUR;
        let mut row = [0.0; MOST_PLANES];
        for k in lanes.clone() {
            let weight = linear[k] * worths[k] * shares[k];
            row.iter_mut().zip(rows[k]).for_each(|(sum, value)| *sum += weight * value);
        }
        // Weights are small where all nodes lose weight: the threshold of a negligible one scales with them.
        let scale = 1.0 / lanes.clone().map(|k| linear[k] * worths[k]).sum::<f32>();
        for value in &mut row {
            *value *= scale;
        }
        let mut mixed = Mixed::settled(row, live * scale, known * scale);
        if let Some(weights) = curve {
            // Falls back to linear interpolation where a node loses weight or has no light.
            let used = lanes.clone().filter(|&k| weights[k] != 0.0);
            let worth = used.fold(1.0_f32, |least, k| least.min(worths[k]).min(shares[k]));
            for (plane, value) in mixed.row.iter_mut().enumerate().take(WIDTH) {
                let sum: f32 = lanes.clone().map(|k| weights[k] * rows[k][plane]).sum();
                let mixed = lanes.clone().filter(|&k| linear[k] > 0.0);
                *value += worth * (held(sum, range(mixed.map(|k| rows[k][plane]))) - *value);
            }
        }
        let factor = course.divided.one(origin.direction, wo.map(|x| x as f32));
        let factor = held_past_last(course, entry, seen, factor, &mixed.row[..WIDTH]);
        course.shift(&mut mixed.row, factor);
        mixed
    }

    /// Multiplies the interpolated coefficients of a block of queries by the divisor (model divided out before
    /// interpolation).
    #[inline(always)]
    pub(super) fn multiply_block(&self, course: &Course, entry: usize, seen: &SeenBlock, to: &mut [Mixed]) {
        let single = [&seen.wi, &seen.wo].map(|of| of.map(|numbers| numbers.map(|x| x as f32)));
        let [wi, wo] = single.each_ref();
        let factors = course.divisors(wi.each_ref(), wo.each_ref());
        for (i, to) in to.iter_mut().enumerate() {
            let factor = held_past_last(course, entry, &seen.get(i), factors[i], &to.row[..self.width]);
            course.shift(&mut to.row, factor);
        }
    }

    /// Spectral coefficients at one outgoing direction, interpolated in the table of one incoming direction. SIMD lane
    /// number `lane` of `patches` holds the six nodes around the outgoing direction and their weights.
    #[inline(always)]
    fn row_in<const WIDTH: usize>(&self, base: usize, patches: &Patches<FOUR>, lane: usize) -> [f32; WIDTH] {
        let table = self.values.as_chunks::<WIDTH>().0;
        let mut row = [0.0; WIDTH];
        for node in 0..NODES {
            let weight = patches.weights[node][lane];
            let values = &table[base + patches.nodes[node][lane] as usize];
            row.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
        }
        row
    }
}

/// Logarithm of a factor on the spectrum that `row` represents: past the last measured polar angle of incidence an
/// upper bound holds, elsewhere it is the given one.
#[inline(always)]
fn held_past_last(course: &Course, entry: usize, &Seen { wi, wo, .. }: &Seen, factor: f32, row: &[f32]) -> f32 {
    match &course.last {
        Some((height, peaks)) if wi[2] < *height - ROUNDING && peaks[entry].is_finite() => {
            let most = peaks[entry] + ln_f32(MOST_BEYOND) - ln_f32((wo[2] as f32).max(LEAST_COSINE));
            factor.min(most - course.brightness(row))
        }
        _ => factor,
    }
}
