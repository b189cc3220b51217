//! Smooth form with a divisor or a curve between incidences, and its extrapolation past the last incidence.

use super::course::Course;
use super::{Seen, SeenBlock, Smooth};
use crate::domain::vector::Vector;
use crate::evaluate::between::{MOST_BEYOND, NO_WEIGHT};
use crate::evaluate::incoming::middles::Entries;
use crate::evaluate::incoming::{Nodes, carried};
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
        let factor = course.divisor(seen.wi, seen.wo);
        wide(
            #[inline(always)]
            || {
                let mut mixed =
                    if course.has_curve() { self.along_curve(course, entry, seen) } else { self.straight(entry, seen) };
                let factor = held_past_last(course, entry, seen, factor, &mixed.row[..self.width]);
                course.shift(&mut mixed.row, factor);
                mixed
            },
        )
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
