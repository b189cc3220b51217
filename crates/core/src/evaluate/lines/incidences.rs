//! Interpolation between incidences with a divisor or a cubic, and extrapolation past the last incidence.

use super::course::{Course, FoundBetween, Outer};
use super::part::Part;
use super::sphere::{Patch, Sphere};
use super::{AROUND, Found, Kind, Lines, Nodes};
use crate::compress::{Between, Divided};
use crate::domain::vector::Vector;
use crate::domain::{Direction, Domain};
use crate::evaluate::between::{Cubic, MOST_BEYOND, held};
use crate::evaluate::incoming::{Alignment, Origin};
use crate::evaluate::mixed::NO_LIGHT;
use crate::numeric::bracket::Bracket;
use crate::numeric::logarithm::ln_f32;
use crate::numeric::number::Number;

/// Lower bound on |cos θo|, by which the upper bound on values past the last measured polar angle of incidence is
/// divided.
const LEAST_COSINE: f32 = 1e-3;
/// Tolerance on the cosine within which a polar angle of incidence counts as equal to the last measured one.
const ROUNDING: f64 = 1e-9;

impl Lines {
    /// Sets the interpolation between incoming directions to `between`. Data with negative samples keep the default,
    /// which is linear.
    pub(in crate::evaluate) fn go(&mut self, entries: usize, between: &Between) {
        if between.is_default() || !self.values.is_logarithmic() {
            return;
        }
        let angles = match &self.incoming.0 {
            Kind::None => return,
            Kind::Elevations(angles, _) => angles,
            Kind::Grid(sphere) => sphere.grid().polar(),
        };
        let cubic = (between.cubic && angles.len() > 1).then(|| Cubic::new(angles));
        let last =
            angles.last().map(|angle| (libm::cos(angle.to_radians()), self.largest_at_last(entries, angles.len())));
        let course = Course { stated: *between, divided: Divided::by(between.divisor), cubic, last };
        self.course = Some(Box::new(course));
    }

    /// Interpolation that the file or the user specified for use between incoming directions.
    pub(in crate::evaluate) fn between(&self) -> Between {
        self.course.as_ref().map_or_else(Between::default, |course| course.stated)
    }

    /// Largest logarithms of f·cos θo at the last of `elevations` polar angles of incidence, for each combination of
    /// indices (positions on the axes before the directions) and each wavelength. Spectra start `stride` numbers apart,
    /// as in [`super::values::Values`].
    fn largest_at_last(&self, entries: usize, elevations: usize) -> Vec<f32> {
        let (lambdas, stride) = (self.values.lambdas(), self.values.stride());
        let mut largest = vec![f32::NEG_INFINITY; entries * stride];
        let Some(sphere) = &self.outgoing else { return largest };
        let columns = match &self.incoming.0 {
            Kind::Grid(sphere) => sphere.grid().len() / elevations,
            _ => 1,
        };
        for (entry, largest) in largest.chunks_exact_mut(stride).enumerate() {
            for node in (elevations - 1) * columns..elevations * columns {
                let table = entry * self.values.incoming() + node;
                for place in 0..sphere.grid().len() {
                    let height = sphere.grid().direction(place).cos_theta() as f32;
                    for (lambda, largest) in largest.iter_mut().take(lambdas).enumerate().filter(|_| height > 0.0) {
                        let number: f32 = self.values.numbers(table, place as u32, lambda);
                        *largest = largest.max(number + ln_f32(height));
                    }
                }
            }
        }
        largest
    }

    /// Finds the samples that determine the smoothly interpolated value for a pair of directions, as [`Lines::smooth`]
    /// does. Interpolation between incoming directions uses a divisor (model divided out before interpolation) or a
    /// cubic.
    pub(super) fn smooth_between(&self, course: &Course, entry: usize, wi: Vector, wo: Vector) -> Option<Found> {
        let Nodes { mut places, mut weights } = self.nodes(wi)?;
        let is_single = weights.contains(&1.0);
        let (mut cubic, mut outer) = (None, None);
        match (&course.cubic, &self.incoming.0) {
            (Some(own), Kind::Grid(sphere)) if !is_single => {
                (cubic, outer) = rows(own, sphere, wi, places).unzip();
            }
            (Some(own), _) if !is_single => {
                let (four, cubic_weights) = own.around(places[0] as usize, weights[1] as f32);
                (places, weights) = (four, [0.0, weights[0], weights[1], 0.0]);
                cubic = Some(cubic_weights);
            }
            _ => {}
        }
        let is_past = course.last.as_ref().is_some_and(|(height, _)| wi[2] < *height - ROUNDING);
        let mut least = 1.0_f32;
        let mut found = Found::NOTHING;
        let mut divisors = [0.0; AROUND];
        for k in 0..AROUND {
            if weights[k] == 0.0 && cubic.is_none_or(|weights: [f32; AROUND]| weights[k] == 0.0) {
                continue;
            }
            let stays = weights[k] == 1.0 && !is_past;
            let worth;
            (found.patches[k], divisors[k], worth) = self.seen_under(course, places[k], (wi, wo), stays, is_past);
            least = least.min(worth);
            found.tables[k] = entry * self.values.incoming() + places[k] as usize;
            found.weights[k] = weights[k] as f32 * worth;
            found.count = k + 1;
        }
        let outer = outer.map(|(places, weights)| {
            let mut outer = Outer { tables: [0; AROUND], patches: [None; AROUND], divisors: [0.0; AROUND], weights };
            for k in (0..AROUND).filter(|&k| weights[k] != 0.0) {
                let worth;
                (outer.patches[k], outer.divisors[k], worth) =
                    self.seen_under(course, places[k], (wi, wo), false, false);
                least = least.min(worth);
                outer.tables[k] = entry * self.values.incoming() + places[k] as usize;
            }
            Box::new(outer)
        });
        let single = |d: Vector| d.map(|x| x as f32);
        let own = course.divided.one(single(wi), single(wo));
        let height = ln_f32((wo[2].abs() as f32).max(LEAST_COSINE));
        let is_held = is_past && self.domain == Domain::Hemisphere;
        let held = is_held.then_some((entry * self.values.stride(), height));
        let cubic = cubic.map(|weights| (weights, least));
        found.between = Some(FoundBetween { divisors, own, cubic, outer, held });
        Some(found)
    }

    /// Looks up an outgoing direction in the data under one measured incoming direction. Returns the samples around it,
    /// the logarithm of the divisor (model divided out before interpolation), and a factor on the interpolation weight.
    /// The factor falls to nearly 0 where lobes, following the incoming direction, reach the horizon.
    ///
    /// `stays` is true if the queried incoming direction is this measured one; the outgoing direction is then not
    /// moved.
    fn seen_under(
        &self,
        course: &Course,
        place: u32,
        (wi, wo): (Vector, Vector),
        stays: bool,
        is_past: bool,
    ) -> (Option<Patch>, f32, f32) {
        let to = self.directions[place as usize];
        let (mut there, worth) = if stays || self.alignment == Alignment::None {
            (wo, 1.0)
        } else {
            self.carried(&Origin::new(wi), place, wo)
        };
        let patch = |d: Vector| self.outgoing.as_ref().and_then(|sphere| sphere.patch(d));
        let mut found = patch(there);
        if is_past && found.is_none() {
            // The last incidence alone counts: outside its grid, the value is taken at the queried direction.
            (there, found) = (wo, patch(wo));
        }
        // A stated direction gives the sample, free of rounding.
        let from = if stays { wi } else { to };
        let single = |d: Vector| d.map(|x| x as f32);
        (found, course.divided.one(single(from), single(there)), worth)
    }

    /// Interpolates samples between incoming directions with a divisor (model divided out before interpolation), a
    /// cubic or both, at one wavelength or at four from number `lambda` on.
    pub(super) fn samples_between<T: Number>(&self, between: &FoundBetween, found: &Found, lambda: usize) -> T {
        let part = |table: usize, patch: &Option<Patch>, divisor: f32| {
            let part: Part<T> = self.part(table, patch.as_ref(), lambda);
            Part { number: part.number - T::of(divisor), ..part }
        };
        let (zero, mut total) = (T::of(0.0), 0.0);
        let (mut sum, mut live, mut known) = (zero, zero, zero);
        let mut range = [T::of(f32::INFINITY), T::of(f32::NEG_INFINITY)];
        let mut cubic = (zero, T::of(between.cubic.map_or(0.0, |(_, worth)| worth)));
        let add = |cubic: &mut (T, T), part: &Part<T>, weight: f32| {
            cubic.0 = cubic.0 + T::of(weight) * part.number;
            // Falls back to linear interpolation where a place loses weight or has no light.
            cubic.1 = cubic.1.smaller(part.live);
        };
        for k in 0..found.count {
            let weight = found.weights[k];
            let in_cubic = between.cubic.map_or(0.0, |(weights, _)| weights[k]);
            if weight == 0.0 && in_cubic == 0.0 {
                continue;
            }
            let part = part(found.tables[k], &found.patches[k], between.divisors[k]);
            if weight != 0.0 {
                total += weight;
                let weight = T::of(weight);
                sum = sum + weight * part.live * part.number;
                live = live + weight * part.live;
                known = known + weight * part.known;
                range = [range[0].smaller(part.number), range[1].larger(part.number)];
            }
            if in_cubic != 0.0 {
                add(&mut cubic, &part, in_cubic);
            }
        }
        if let Some(Outer { tables, patches, divisors, weights }) = between.outer.as_deref() {
            for k in (0..AROUND).filter(|&k| weights[k] != 0.0) {
                add(&mut cubic, &part(tables[k], &patches[k], divisors[k]), weights[k]);
            }
        }
        let mut number = sum / live;
        if between.cubic.is_some() {
            let (cubic, worth) = cubic;
            number = T::choose(zero.less(worth), number + worth * (held(cubic, range) - number), number);
        }
        number = number + T::of(between.own);
        if let (Some((first, height)), Some(course)) = (between.held, &self.course)
            && let Some((_, largest)) = &course.last
        {
            let largest = T::read(largest, first + lambda);
            number = number.smaller(largest + T::of(ln_f32(MOST_BEYOND) - height));
        }
        let sample = self.values.sample(number);
        let sample = T::choose(live.less(known), sample * (live / known), sample);
        let least = T::of(NO_LIGHT * total);
        let lit = T::choose(live.at_most(least), zero, sample);
        T::choose(known.at_most(least), T::of(f32::NAN), lit)
    }
}

/// Indices of measured incoming directions, with the weight of each in an interpolation.
type Weighed = ([u32; AROUND], [f32; AROUND]);

/// Weights for interpolation on a grid of incoming directions, cubic in the polar angle and linear in azimuth. Returns
/// the weights of the four grid directions around `wi`, then four more directions at the next smaller and the next
/// larger polar angle, with weights. `None` if `wi` lies exactly at a polar angle of the grid, which needs no cubic.
fn rows(own: &Cubic, sphere: &Sphere, wi: Vector, around: [u32; AROUND]) -> Option<([f32; AROUND], Weighed)> {
    let direction = Direction::from_unit(wi);
    let [polar, _] = sphere.grid().angles(direction)?;
    let bracket = Bracket::held(sphere.grid().polar(), polar).snapped(f64::from(f32::EPSILON));
    if bracket.t == 0.0 || bracket.t == 1.0 {
        return None;
    }
    let patch = sphere.patch(wi)?;
    let (_, of_rows) = own.around(bracket.below, bracket.t as f32);
    let weight = |row: usize, column: usize| {
        let along = patch.along(row).t;
        of_rows[row] * if column == 1 { 1.0 - along } else { along }
    };
    let mut weights = std::array::from_fn(|k| weight(1 + k / 2, 1 + k % 2));
    // Merges repeated places, as `around` does.
    for k in 0..AROUND {
        for other in k + 1..AROUND {
            if around[other] == around[k] {
                weights[k] += std::mem::take(&mut weights[other]);
            }
        }
    }
    let outer = |k: usize| (3 * (k / 2), 1 + k % 2);
    let places = std::array::from_fn(|k| patch.place(outer(k).0, outer(k).1));
    Some((weights, (places, std::array::from_fn(|k| weight(outer(k).0, outer(k).1)))))
}
