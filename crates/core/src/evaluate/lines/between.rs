//! Values from the places around a direction: cubics of logarithms or straight lines, weighted by shares of light.

use super::part::{Part, Sums, by_shares, cubic, line, straight};
use super::sphere::Patch;
use super::{Found, Lines};
use crate::evaluate::mixed::NO_LIGHT;
use crate::numeric::number::Number;
use wide::f32x4;

/// Number of wavelengths interpolated together, one per SIMD lane.
const SIDE: usize = 4;

impl Lines {
    /// Writes the whole spectrum interpolated between the samples that `found` lists. Linear interpolation has the
    /// weight `straight`, 0..=1, in each value, and cubic interpolation of logarithms has the rest of the weight.
    #[inline]
    pub(super) fn spectrum_with(&self, straight: f32, found: &Found, out: &mut [f32]) {
        if let [out] = out {
            *out = self.samples::<f32>(straight, found, 0);
            return;
        }
        for (start, out) in (0..).step_by(SIDE).zip(out.chunks_mut(SIDE)) {
            self.samples::<f32x4>(straight, found, start).write_some(out);
        }
    }

    /// Interpolates between the samples that `found` lists, at one wavelength, or at four from index `lambda` on.
    /// Linear interpolation has the weight `share`, 0..=1, and cubic interpolation of logarithms has the rest of the
    /// weight.
    #[inline(always)]
    pub(super) fn samples<T: Number>(&self, share: f32, found: &Found, lambda: usize) -> T {
        match &found.between {
            None => self.mixed_samples(share, found, lambda),
            Some(_) if share == 1.0 => self.mixed_samples(share, found, lambda),
            Some(between) => {
                let curved: T = self.samples_between(between, found, lambda);
                if share == 0.0 {
                    return curved;
                }
                T::of(1.0 - share) * curved + T::of(share) * self.mixed_samples(1.0, found, lambda)
            }
        }
    }

    /// Interpolates the samples around a query, listed by `found`, linearly between incoming directions, at one
    /// wavelength or at four from number `lambda` on. Over outgoing directions, linear interpolation has the weight
    /// `share`, 0 to 1, and cubic interpolation of logarithms has the rest of the weight.
    #[inline(always)]
    fn mixed_samples<T: Number>(&self, share: f32, found: &Found, lambda: usize) -> T {
        let mut sums = Sums::nothing();
        for k in 0..found.count {
            let (table, weight) = (found.tables[k], found.weights[k]);
            self.add(&mut sums, share, (table, weight), found.patches[k].as_ref(), lambda);
        }
        self.settled(&sums, share)
    }

    /// Adds the samples under one measured incoming direction, interpolated over outgoing directions, to the weighted
    /// sums over incoming directions. The number of its table of samples and its interpolation weight are given.
    #[inline(always)]
    pub(super) fn add<T: Number>(
        &self,
        sums: &mut Sums<T>,
        share: f32,
        (table, weight): (usize, f32),
        patch: Option<&Patch>,
        lambda: usize,
    ) {
        sums.total += weight;
        let weight = T::of(weight);
        let Some(patch) = patch else {
            self.add_without_patch(sums, (table, weight), lambda);
            return;
        };
        if !self.values.is_logarithmic() {
            // Linear interpolation needs only the four samples around.
            let [a, b, c, d]: [T; 4] = self.middle(table, patch, lambda);
            let [one, two, t] = [patch.along(1).t, patch.along(2).t, patch.across.t];
            if self.values.is_whole() || (a + b + c + d).is_finite() {
                sums.add_whole(weight, line(line(a, b, one), line(c, d, two), t));
            } else {
                let [a, b, c, d] = [a, b, c, d].map(Part::new);
                sums.add_part(weight, straight(&straight(&a, &b, one), &straight(&c, &d, two), t));
            }
            return;
        }
        if share < 1.0 {
            match self.curved(table, patch, lambda) {
                Ok(number) => sums.add_whole(weight, number),
                Err(part) => sums.add_part(weight, part),
            }
        }
        if share > 0.0 {
            let zero = T::of(0.0);
            let numbers: [T; 4] = self.middle(table, patch, lambda);
            let t = [patch.along(1).t, patch.along(2).t];
            for (k, number) in numbers.into_iter().enumerate() {
                let along = if k % 2 == 0 { 1.0 - t[k / 2] } else { t[k / 2] };
                let part = weight * T::of(along * if k < 2 { 1.0 - patch.across.t } else { patch.across.t });
                let is_known = T::of(f32::NEG_INFINITY).at_most(number);
                sums.straight = sums.straight + T::choose(is_known, part * self.values.sample(number), zero);
                sums.straight_known = sums.straight_known + T::choose(is_known, part, zero);
            }
        }
    }

    /// Interpolates the logarithm of the measured function by cubics over outgoing directions, under one incoming
    /// direction. If surrounding samples are 0 or masked, returns `Err`: the logarithm with the interpolation weights
    /// of the nonzero and of the unmasked samples.
    #[inline(always)]
    fn curved<T: Number>(&self, table: usize, patch: &Patch, lambda: usize) -> Result<T, Part<T>> {
        let mut numbers = [[T::of(0.0); 4]; 4];
        let mut sum = T::of(0.0);
        for (r, row) in numbers.iter_mut().enumerate() {
            for (column, number) in row.iter_mut().enumerate() {
                *number = self.values.numbers(table, patch.place(r, column), lambda);
                sum = sum + *number;
            }
        }
        // Logarithms are far from overflow: only an infinite or NaN one makes the sum non-finite.
        if !self.values.is_whole() && !sum.is_finite() {
            return Err(by_shares(&numbers, patch));
        }
        let mut rows = [T::of(0.0); 4];
        for (r, row) in rows.iter_mut().enumerate() {
            *row = cubic(&numbers[r], patch.along(r));
        }
        Ok(cubic(&rows, &patch.across))
    }

    /// Logarithm of the function under one measured incoming direction, interpolated over outgoing directions, with the
    /// interpolation weights (0 to 1) of the nonzero and of the unmasked samples around the outgoing direction.
    #[inline(always)]
    pub(super) fn part<T: Number>(&self, table: usize, patch: Option<&Patch>, lambda: usize) -> Part<T> {
        let (zero, one) = (T::of(0.0), T::of(1.0));
        match (patch, &self.outgoing) {
            (Some(patch), _) => self
                .curved(table, patch, lambda)
                .map_or_else(|part| part, |number| Part { number, live: one, known: one }),
            (None, None) => Part::new(self.values.numbers(table, 0, lambda)),
            (None, Some(sphere)) => {
                Part { number: zero, live: zero, known: if sphere.outside().is_nan() { zero } else { one } }
            }
        }
    }

    /// Adds the value under one measured incoming direction to the weighted sums over incoming directions, if the data
    /// have no outgoing axis or the outgoing direction lies outside their grid.
    fn add_without_patch<T: Number>(&self, sums: &mut Sums<T>, (table, weight): (usize, T), lambda: usize) {
        let zero = T::of(0.0);
        if let Some(sphere) = &self.outgoing {
            let known = T::of(if sphere.outside().is_nan() { 0.0 } else { 1.0 });
            let live = if self.values.is_logarithmic() { zero } else { known };
            sums.add_part(weight, Part { number: zero, live, known });
            sums.straight_known = sums.straight_known + weight * known;
        } else {
            let part = Part::new(self.values.numbers(table, 0, lambda));
            sums.add_part(weight, part);
            sums.straight = sums.straight + weight * part.live * self.values.sample(part.number);
            sums.straight_known = sums.straight_known + weight * part.known;
        }
    }

    /// Reads the stored values (samples or their logarithms) at the four grid directions that enclose an outgoing
    /// direction, row by row. These four are in the middle of the 4 × 4 samples in `patch`.
    #[inline(always)]
    fn middle<T: Number>(&self, table: usize, patch: &Patch, lambda: usize) -> [T; 4] {
        let number = |r: usize, column: usize| self.values.numbers::<T>(table, patch.place(r, column), lambda);
        [number(1, 1), number(1, 2), number(2, 1), number(2, 2)]
    }

    /// Interpolated sample, computed from sums over incoming directions: of values or their logarithms, and of the
    /// interpolation weights of nonzero and of unmasked samples. It is NaN if all samples are masked.
    #[inline(always)]
    pub(super) fn settled<T: Number>(&self, sums: &Sums<T>, share: f32) -> T {
        let least = T::of(NO_LIGHT * sums.total);
        let nothing = T::of(f32::NAN);
        let on_lines = || {
            let known = sums.straight_known;
            T::choose(known.at_most(least), nothing, sums.straight / known)
        };
        let is_mixed = self.values.is_logarithmic() && share > 0.0;
        if is_mixed && share == 1.0 {
            return on_lines();
        }
        let mut sample = self.values.sample(sums.number / sums.live);
        if !sums.is_whole {
            let (live, known) = (sums.live, sums.known);
            sample = T::choose(live.less(known), sample * (live / known), sample);
            sample = T::choose(known.at_most(least), nothing, T::choose(live.at_most(least), T::of(0.0), sample));
        }
        if is_mixed { T::of(1.0 - share) * sample + T::of(share) * on_lines() } else { sample }
    }
}
