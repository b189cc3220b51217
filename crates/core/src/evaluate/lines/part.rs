//! Numbers with the share of light they represent, along cubics and straight lines, and their weighted sums.

use super::line::Along;
use super::sphere::Patch;
use crate::numeric::number::Number;

/// Overshoot allowed to a cubic between two samples, as a fraction of their range. Raising it permits narrower peaks
/// and more ringing.
const OVERSHOOT: f32 = 0.1;

/// Value or logarithm interpolated between samples, or four of them in SIMD lanes, with the interpolation weights of
/// the nonzero and of the unmasked samples, each from 0 to 1.
#[derive(Clone, Copy)]
pub(super) struct Part<T> {
    pub(super) number: T,
    pub(super) live: T,
    pub(super) known: T,
}

/// Sums over measured incoming directions, weighted for interpolation: of values or logarithms, of the weights of
/// nonzero samples, and of the weights of unmasked samples. Then, for linear interpolation, sums of samples and of the
/// weights of unmasked ones.
#[derive(Clone, Copy)]
pub(super) struct Sums<T> {
    pub(super) number: T,
    pub(super) live: T,
    pub(super) known: T,
    pub(super) straight: T,
    pub(super) straight_known: T,
    pub(super) total: f32,
    /// True if all samples that entered the weighted sums of an interpolation are known to be unmasked and, if
    /// logarithms are summed, nonzero.
    pub(super) is_whole: bool,
}

impl<T: Number> Sums<T> {
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        let zero = T::of(0.0);
        Self { number: zero, live: zero, known: zero, straight: zero, straight_known: zero, total: 0.0, is_whole: true }
    }

    /// Adds `number`, times its weight, to the sums of an interpolation between incoming directions. It is a value or
    /// logarithm under one of them, interpolated from samples none of which is masked or, for a logarithm, 0.
    #[inline(always)]
    pub(super) fn add_whole(&mut self, weight: T, number: T) {
        self.number = self.number + weight * number;
        self.live = self.live + weight;
        self.known = self.known + weight;
    }

    #[inline(always)]
    pub(super) fn add_part(&mut self, weight: T, part: Part<T>) {
        self.number = self.number + weight * part.live * part.number;
        self.live = self.live + weight * part.live;
        self.known = self.known + weight * part.known;
        self.is_whole = false;
    }
}

impl<T: Number> Part<T> {
    /// Result of interpolation between samples that are all masked: the value and the weights of nonzero and of
    /// unmasked samples are 0.
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        Self { number: T::of(0.0), live: T::of(0.0), known: T::of(0.0) }
    }

    /// Value of a single sample from its stored logarithm: minus infinity means no light, NaN means masked.
    #[inline(always)]
    pub(super) fn new(number: T) -> Self {
        let (zero, one, dark) = (T::of(0.0), T::of(1.0), T::of(f32::NEG_INFINITY));
        // Both comparisons are false for NaN, that is, masked.
        let (is_lit, is_known) = (dark.less(number), dark.at_most(number));
        Self {
            number: T::choose(is_lit, number, zero),
            live: T::choose(is_lit, one, zero),
            known: T::choose(is_known, one, zero),
        }
    }
}

/// Interpolates among 4 × 4 samples of which some have no light: along each row, then across the rows.
#[inline(never)]
pub(super) fn by_shares<T: Number>(numbers: &[[T; 4]; 4], patch: &Patch) -> Part<T> {
    let mut rows = [Part::nothing(); 4];
    for (r, row) in rows.iter_mut().enumerate() {
        let [a, b, c, d] = numbers[r];
        *row = mixed(&[Part::new(a), Part::new(b), Part::new(c), Part::new(d)], patch.along(r));
    }
    mixed(&rows, &patch.across)
}

/// Cubic through the middle two of four numbers. The result is limited to the range of these two, widened by
/// [`OVERSHOOT`].
#[inline(always)]
pub(super) fn cubic<T: Number>(&[before, low, high, after]: &[T; 4], along: &Along) -> T {
    let [a, b, c, d] = along.cubic;
    let sum = T::of(a) * before + T::of(b) * low + T::of(c) * high + T::of(d) * after;
    let room = T::of(OVERSHOOT) * (high - low).size();
    sum.larger(low.smaller(high) - room).smaller(low.larger(high) + room)
}

/// Linear interpolation between two numbers.
#[inline(always)]
pub(super) fn line<T: Number>(one: T, two: T, t: f32) -> T {
    T::of(1.0 - t) * one + T::of(t) * two
}

/// Interpolates between the middle two of four values: by a cubic through all four, or linearly if a sample from which
/// one of the four was computed is 0 or masked.
#[inline(always)]
fn mixed<T: Number>(parts: &[Part<T>; 4], along: &Along) -> Part<T> {
    let [before, one, two, after] = parts;
    let live = before.live.smaller(one.live).smaller(two.live).smaller(after.live);
    let is_lit = T::of(1.0).at_most(live);
    let line = straight(one, two, along.t);
    let curved = cubic(&[before.number, one.number, two.number, after.number], along);
    Part {
        number: T::choose(is_lit, curved, line.number),
        live: T::choose(is_lit, T::of(1.0), line.live),
        known: T::choose(is_lit, T::of(1.0), line.known),
    }
}

/// Linear interpolation between two values or logarithms. Each is also weighted by its fraction of nonzero samples, so
/// that samples of 0, which have no logarithm, do not count; the result is divided by the sum of weights.
#[inline(always)]
pub(super) fn straight<T: Number>(one: &Part<T>, two: &Part<T>, t: f32) -> Part<T> {
    let zero = T::of(0.0);
    let live = line(one.live, two.live, t);
    let sum = T::of(1.0 - t) * one.live * one.number + T::of(t) * two.live * two.number;
    Part { number: T::choose(zero.less(live), sum / live, zero), live, known: line(one.known, two.known, t) }
}
