//! Numbers with the share of light they represent, along cubics and straight lines, and their weighted sums.

use super::line::Along;
use super::sphere::Patch;
use crate::evaluate::number::Number;

/// Overshoot allowed to a cubic between two entries, as a fraction of their range.
const OVERSHOOT: f32 = 0.1;

/// A number, or four side by side, with the share (0..=1) that has light and the share that is unmasked.
#[derive(Clone, Copy)]
pub(super) struct Part<T> {
    pub(super) number: T,
    pub(super) live: T,
    pub(super) known: T,
}

/// Weighted sums over incoming places: of numbers with light, of the light, of the unmasked share, and of linearly
/// interpolated samples with their unmasked share.
#[derive(Clone, Copy)]
pub(super) struct Sums<T> {
    pub(super) number: T,
    pub(super) live: T,
    pub(super) known: T,
    pub(super) straight: T,
    pub(super) straight_known: T,
    pub(super) total: f32,
    /// True if all parts so far have light.
    pub(super) is_whole: bool,
}

impl<T: Number> Sums<T> {
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        let zero = T::of(0.0);
        Self { number: zero, live: zero, known: zero, straight: zero, straight_known: zero, total: 0.0, is_whole: true }
    }

    /// Adds a number that fully has light.
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
    /// Fully masked part.
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        Self { number: T::of(0.0), live: T::of(0.0), known: T::of(0.0) }
    }

    /// Part from the number of one place: minus infinity has no light, NaN is masked.
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

/// Interpolates in a patch in which some places have no light: along each row, then across the rows.
#[inline(never)]
pub(super) fn by_shares<T: Number>(numbers: &[[T; 4]; 4], patch: &Patch) -> Part<T> {
    let mut rows = [Part::nothing(); 4];
    for (r, row) in rows.iter_mut().enumerate() {
        let [a, b, c, d] = numbers[r];
        *row = mixed(&[Part::new(a), Part::new(b), Part::new(c), Part::new(d)], patch.along(r));
    }
    mixed(&rows, &patch.across)
}

/// Cubic through the middle two of four numbers, limited to their range and [`OVERSHOOT`].
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

/// Interpolates four parts along a line: a cubic if all four have light, else linear.
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

/// Linear interpolation of two parts, weighted by their shares of light.
#[inline(always)]
pub(super) fn straight<T: Number>(one: &Part<T>, two: &Part<T>, t: f32) -> Part<T> {
    let zero = T::of(0.0);
    let live = line(one.live, two.live, t);
    let sum = T::of(1.0 - t) * one.live * one.number + T::of(t) * two.live * two.number;
    Part { number: T::choose(zero.less(live), sum / live, zero), live, known: line(one.known, two.known, t) }
}
