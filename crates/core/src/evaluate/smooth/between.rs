//! The smooth form where a divisor or a cubic was chosen: what differs between incidences, and past the last of them.

use super::course::{Course, Divisors};
use super::{Seen, SeenBlock, Smooth};
use crate::domain::vector::Vector;
use crate::evaluate::between::{FOUR, MOST_BEYOND, held};
use crate::evaluate::elements::{NODES, Patches};
use crate::evaluate::incoming::{Nodes, Origin, carried_to_four};
use crate::evaluate::mixed::{MOST_PLANES, Mixed};
use crate::numeric::logarithm::ln_f32;
use wide::f32x4;

/// Heights below this count as this where a value is held past the last incidence.
const LEAST_COSINE: f32 = 1e-3;
/// Heights this near to that of the last incidence are its own.
const ROUNDING: f64 = 1e-9;

impl Smooth {
    /// Finds what values past the last elevation are held by.
    pub(super) fn hold_past_last(&mut self, course: &mut Course, entries: usize, directions: &[Vector]) {
        let Nodes::Elevations(_, elevations) = &self.nodes else { return };
        let (Some(last), node) = (elevations.last(), elevations.len() - 1) else { return };
        let peaks = (0..entries).map(|entry| {
            let lights = directions.iter().filter(|wo| wo[2] > 0.0).map(|&wo| {
                let seen = self.under(entry, node, wo);
                let is_light = seen.presence > 0.0;
                if is_light { course.brightness(&seen.row) + ln_f32(wo[2] as f32) } else { f32::NEG_INFINITY }
            });
            lights.fold(f32::NEG_INFINITY, f32::max)
        });
        course.last = Some((last[2], peaks.collect()));
    }

    /// As [`Smooth::at`] on the way of `course`.
    #[inline(always)]
    pub(super) fn at_between(&self, course: &Course, entry: usize, seen: &Seen) -> Mixed {
        match self.width {
            4 => self.at_between_in::<4>(course, entry, seen),
            8 => self.at_between_in::<8>(course, entry, seen),
            12 => self.at_between_in::<12>(course, entry, seen),
            _ => self.at_between_in::<MOST_PLANES>(course, entry, seen),
        }
    }

    #[inline(always)]
    fn at_between_in<const WIDTH: usize>(&self, course: &Course, entry: usize, seen: &Seen) -> Mixed {
        let &Seen { around, wi, wo } = seen;
        let lanes = course.lanes(&around);
        let origin = Origin::new(wi);
        let to = lanes.nodes.map(|node| self.origins[node as usize]);
        let (there, worths) = carried_to_four(self.alignment, self.domain, origin, to, wo);
        let mut patches = Patches::<FOUR>::NOWHERE;
        self.elements.write(there, &mut patches, 0);
        let from = [0, 1, 2].map(|axis| f32x4::new(to.map(|to| to.direction[axis])));
        let divisors = course.divided.four(from, there).to_array();
        let worths = worths.to_array();

        let is_used = |k: usize| lanes.linear[k] > 0.0 || lanes.cubic.is_some_and(|weights| weights[k] != 0.0);
        let mut rows = [[0.0_f32; WIDTH]; FOUR];
        let (mut shares, mut live, mut known, mut all_live) = ([1.0_f32; FOUR], 0.0, 0.0, true);
        for k in (0..FOUR).filter(|&k| is_used(k)) {
            let table = entry * self.node_count + lanes.nodes[k] as usize;
            let base = table * self.elements.len();
            let mut known_share = 1.0;
            if !self.presence.is_empty() {
                (shares[k], known_share) = self.presence_in(base, &patches, k);
                all_live &= shares[k] == 1.0 && known_share > 0.0;
            }
            rows[k] = self.row_in::<WIDTH>(base, &patches, k);
            for (value, constant) in rows[k].iter_mut().zip(course.constant) {
                *value -= divisors[k] * constant;
            }
            let weight = lanes.linear[k] * worths[k];
            if known_share > 0.0 {
                known += weight;
                live += weight * shares[k];
            } else {
                shares[k] = 0.0;
            }
        }
        let mut row = [0.0; MOST_PLANES];
        for k in 0..FOUR {
            let weight = lanes.linear[k] * worths[k] * shares[k];
            row.iter_mut().zip(rows[k]).for_each(|(sum, value)| *sum += weight * value);
        }
        // Weights are small where all nodes fade: the scale of what counts as none goes with them.
        let scale = 1.0 / (0..FOUR).map(|k| lanes.linear[k] * worths[k]).sum::<f32>();
        for value in &mut row {
            *value *= scale;
        }
        let mut mixed = Mixed::settled(row, live * scale, known * scale);
        if let Some(weights) = lanes.cubic.filter(|_| all_live) {
            let worth = worths.iter().zip(weights).filter(|(_, weight)| *weight != 0.0).map(|(worth, _)| *worth);
            let worth = worth.fold(1.0, f32::min);
            for (plane, value) in mixed.row.iter_mut().enumerate().take(WIDTH) {
                let sum: f32 = (0..FOUR).map(|k| weights[k] * rows[k][plane]).sum();
                *value += worth * (held(sum, [rows[1][plane], rows[2][plane]]) - *value);
            }
        }
        let mut own = course.divided.one(origin.direction, wo.map(|x| x as f32));
        let past = course.last.as_ref().filter(|(height, _)| wi[2] < *height - ROUNDING);
        if let Some(peak) = past.map(|(_, peaks)| peaks[entry]).filter(|peak| peak.is_finite()) {
            let most = peak + ln_f32(MOST_BEYOND) - ln_f32((wo[2] as f32).max(LEAST_COSINE));
            own = own.min(most - course.brightness(&mixed.row[..WIDTH]));
        }
        course.shift(&mut mixed.row, own);
        mixed
    }

    /// Multiplies what was mixed at the places of a block; those past the last incidence are looked up again by themselves.
    pub(super) fn multiply_block(
        &self,
        course: &Course,
        entry: usize,
        divisors: &Divisors,
        seen: &SeenBlock,
        to: &mut [Mixed],
    ) {
        for (i, to) in to.iter_mut().enumerate() {
            let Seen { wi, wo, .. } = seen.get(i);
            if course.last.as_ref().is_some_and(|(height, _)| wi[2] < *height - ROUNDING) {
                *to = self.at_between(course, entry, &seen.get(i));
            } else {
                let own = course.divided.one(wi.map(|x| x as f32), wo.map(|x| x as f32));
                course.shift(&mut to.row, own - divisors.mean(i));
            }
        }
    }

    /// The row of a table in one lane of patches.
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
