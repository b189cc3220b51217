//! Lines where a divisor or a cubic was chosen: what differs between incidences, and past the last of them.

use super::course::{Course, FoundBetween};
use super::{AROUND, Found, Kind, Lines, Nodes, Part};
use crate::compress::Between;
use crate::domain::vector::Vector;
use crate::domain::{Direction, Domain};
use crate::evaluate::between::{Cubic, Divided, FOUR, MOST_BEYOND, held};
use crate::evaluate::incoming::{Alignment, carried};
use crate::evaluate::mixed::NO_LIGHT;
use crate::numeric::logarithm::ln_f32;

/// Heights below this count as this where a value is held past the last incidence.
const LEAST_COSINE: f32 = 1e-3;
/// Heights this near to that of the last incidence are its own.
const ROUNDING: f64 = 1e-9;

impl Lines {
    /// Goes from one incidence to the next as `between` states; as files do that state nothing where samples are negative.
    pub(in crate::evaluate) fn go(&mut self, entries: usize, between: &Between) {
        if between.is_default() || !self.values.is_logarithmic() {
            return;
        }
        let cubic = match &self.incoming.0 {
            Kind::Elevations(angles) if between.cubic && angles.len() > 1 => Some(Cubic::new(angles)),
            _ => None,
        };
        let last = match &self.incoming.0 {
            Kind::Elevations(angles) => angles.len().checked_sub(1),
            _ => None,
        };
        let last = last.map(|node| (self.directions[node][2], self.largest_at(entries, node)));
        let course = Course { stated: *between, divided: Divided::by(between.divisor), cubic, last };
        self.course = Some(Box::new(course));
    }

    /// The interpolation between incidences that was stated.
    pub(in crate::evaluate) fn between(&self) -> Between {
        self.course.as_ref().map_or_else(Between::default, |course| course.stated)
    }

    /// The largest logarithms of f·cos θo at a place of the incoming directions, by index entry and wavelength.
    fn largest_at(&self, entries: usize, node: usize) -> Vec<f32> {
        let lambdas = self.values.lambdas();
        let mut largest = vec![f32::NEG_INFINITY; entries * lambdas];
        let Some(sphere) = &self.outgoing else { return largest };
        for (entry, largest) in largest.chunks_exact_mut(lambdas).enumerate() {
            let table = entry * self.values.incoming() + node;
            for place in 0..sphere.grid().len() {
                let height = sphere.grid().direction(place).cos_theta() as f32;
                for (lambda, largest) in largest.iter_mut().enumerate().filter(|_| height > 0.0) {
                    let [number] = self.values.numbers::<1>(table, place as u32, lambda);
                    *largest = largest.max(number + ln_f32(height));
                }
            }
        }
        largest
    }

    /// As [`Lines::smooth`] on the way of `course`.
    pub(super) fn smooth_between(&self, course: &Course, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        let Nodes { mut places, mut weights } = self.nodes(wi)?;
        let mut cubic = None;
        if let Some(own) = &course.cubic
            && weights[1] > 0.0
            && weights[1] < 1.0
        {
            let (four, cubic_weights) = own.around(places[0] as usize, weights[1] as f32);
            (places, weights) = (four, [0.0, weights[0], weights[1], 0.0]);
            cubic = Some((cubic_weights, 1.0));
        }
        let is_past = course.last.as_ref().is_some_and(|(height, _)| wi[2] < *height - ROUNDING);
        let base = entry * self.values.incoming();
        let mut found = Found::NOTHING;
        let mut divisors = [0.0; AROUND];
        let single = |d: Vector| d.map(|x| x as f32);
        for k in 0..AROUND {
            if weights[k] == 0.0 && cubic.is_none_or(|(weights, _): ([f32; FOUR], f32)| weights[k] == 0.0) {
                continue;
            }
            let to = self.directions[places[k] as usize];
            let (mut there, worth) = if weights[k] == 1.0 && !is_past || self.alignment == Alignment::None {
                (wo, 1.0)
            } else {
                carried(self.alignment, self.domain, wi, to, wo)
            };
            let patch = |d: Vector| self.outgoing.as_ref().and_then(|sphere| sphere.patch(Direction::from_unit(d)));
            found.patches[k] = patch(there);
            if is_past && found.patches[k].is_none() {
                // It alone counts: what the grid does not cover there is taken from where it is asked for.
                there = wo;
                found.patches[k] = patch(wo);
            }
            // A stated direction is the sample, whatever rounding made of it.
            let from = if weights[k] == 1.0 && !is_past { wi } else { to };
            divisors[k] = course.divided.one(single(from), single(there));
            if let Some((_, least)) = &mut cubic {
                *least = least.min(worth);
            }
            found.tables[k] = base + places[k] as usize;
            found.weights[k] = weights[k] as f32 * worth;
            found.count = k + 1;
        }
        let own = course.divided.one(single(wi), single(wo));
        let height = ln_f32((wo[2].abs() as f32).max(LEAST_COSINE));
        let is_held = is_past && self.domain == Domain::Hemisphere;
        let held = is_held.then_some((entry * self.values.lambdas(), height));
        found.between = Some(FoundBetween { divisors, own, cubic, held });
        Some(found)
    }

    /// `SIZE` samples from `lambda` on, of what was found on the way from one incidence to the next.
    pub(super) fn curved_between<const SIZE: usize>(
        &self,
        between: &FoundBetween,
        found: &Found,
        lambda: usize,
    ) -> [f32; SIZE] {
        let nothing = Part { number: [0.0; SIZE], live: [0.0; SIZE], known: [0.0; SIZE] };
        let (mut parts, mut total) = ([nothing; AROUND], 0.0);
        for k in 0..found.count {
            let is_cubic = between.cubic.is_some_and(|(weights, _)| weights[k] != 0.0);
            if found.weights[k] == 0.0 && !is_cubic {
                continue;
            }
            parts[k] = self.part(found, k, lambda);
            total += found.weights[k];
            for number in &mut parts[k].number {
                *number -= between.divisors[k];
            }
        }
        std::array::from_fn(|l| {
            let (mut sum, mut live, mut known) = (0.0, 0.0, 0.0);
            for (part, weight) in parts.iter().zip(found.weights) {
                sum += weight * part.live[l] * part.number[l];
                live += weight * part.live[l];
                known += weight * part.known[l];
            }
            if known <= NO_LIGHT * total {
                return f32::NAN;
            }
            if live <= NO_LIGHT * total {
                return 0.0;
            }
            let mut number = sum / live;
            if let Some((weights, worth)) = between.cubic
                && parts.iter().zip(weights).all(|(part, weight)| weight == 0.0 || part.live[l] == 1.0)
            {
                let cubic: f32 = parts.iter().zip(weights).map(|(part, weight)| weight * part.number[l]).sum();
                number += worth * (held(cubic, [parts[1].number[l], parts[2].number[l]]) - number);
            }
            number += between.own;
            if let (Some((first, height)), Some(course)) = (between.held, &self.course)
                && let Some((_, largest)) = &course.last
                && let Some(largest) = largest.get(first + lambda + l)
            {
                number = number.min(largest + ln_f32(MOST_BEYOND) - height);
            }
            let sample = self.values.sample(number);
            if live < known { sample * (live / known) } else { sample }
        })
    }
}
