//! Arithmetic written once for single numbers, in loops that vectorise, and for four numbers side by side.

#![allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]

use crate::numeric::exponential::{exp_estrin, exp_estrin_of_four};
use std::ops::{Add, Div, Mul, Sub};
use wide::f32x4;

/// Number type for interpolation: one f32, or four in SIMD lanes, so that one function serves both.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// Result type of comparisons: one mask bit or value for each lane.
    type Mask: Copy;

    fn of(x: f32) -> Self;
    fn less(self, other: Self) -> Self::Mask;
    fn at_most(self, other: Self) -> Self::Mask;
    /// Selects `a` in each SIMD lane in which the mask is set, else `b`.
    fn choose(mask: Self::Mask, a: Self, b: Self) -> Self;
    fn larger(self, other: Self) -> Self;
    fn smaller(self, other: Self) -> Self;
    fn size(self) -> Self;
    /// Square root, correctly rounded.
    fn root(self) -> Self;
    fn exp(self) -> Self;
    /// Returns true if every SIMD lane is finite.
    fn is_finite(self) -> bool;
    /// Reads one number of a slice into each SIMD lane, from position `at` of the slice on.
    fn read(from: &[f32], at: usize) -> Self;
    /// Writes the numbers in the first SIMD lanes to a slice, as many as the slice has room for.
    fn write_some(self, to: &mut [f32]);
    /// Writes the numbers of all SIMD lanes to a slice, from position `at` of the slice on.
    fn write(self, to: &mut [f32], at: usize);
    /// Writes the numbers of all SIMD lanes to a slice as integers, from position `at` of the slice on. The numbers
    /// must be integers of at least 0 and below 2²³.
    fn write_integer(self, to: &mut [u32], at: usize);
}

impl Number for f32 {
    type Mask = bool;

    #[inline(always)]
    fn of(x: f32) -> Self {
        x
    }

    #[inline(always)]
    fn less(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn choose(mask: bool, a: Self, b: Self) -> Self {
        if mask { a } else { b }
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn exp(self) -> Self {
        exp_estrin(self)
    }

    #[inline(always)]
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }

    #[inline(always)]
    fn read(from: &[f32], at: usize) -> Self {
        from[at]
    }

    #[inline(always)]
    fn write_some(self, to: &mut [f32]) {
        if let Some(to) = to.first_mut() {
            *to = self;
        }
    }

    #[inline(always)]
    fn write(self, to: &mut [f32], at: usize) {
        to[at] = self;
    }

    #[inline(always)]
    fn write_integer(self, to: &mut [u32], at: usize) {
        // 2²³: added to an integer, it leaves the integer in the low bits of the mantissa.
        const FIRST: f32 = 8_388_608.0;
        to[at] = (self + FIRST).to_bits() & (FIRST as u32 - 1);
    }
}

impl Number for f32x4 {
    type Mask = f32x4;

    #[inline(always)]
    fn of(x: f32) -> Self {
        Self::splat(x)
    }

    #[inline(always)]
    fn less(self, other: Self) -> Self {
        self.simd_lt(other)
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self {
        self.simd_le(other)
    }

    #[inline(always)]
    fn choose(mask: Self, a: Self, b: Self) -> Self {
        mask.bitselect(a, b)
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.fast_max(other)
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        self.fast_min(other)
    }

    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn exp(self) -> Self {
        exp_estrin_of_four(self)
    }

    #[inline(always)]
    fn is_finite(self) -> bool {
        self.abs().simd_lt(Self::splat(f32::INFINITY)).to_bitmask() == 15
    }

    #[inline(always)]
    fn read(from: &[f32], at: usize) -> Self {
        let mut four = [0.0; 4];
        four.copy_from_slice(&from[at..at + 4]);
        Self::new(four)
    }

    #[inline(always)]
    fn write_some(self, to: &mut [f32]) {
        let all = self.to_array();
        match <&mut [f32; 4]>::try_from(&mut *to) {
            Ok(whole) => *whole = all,
            Err(_) => to.iter_mut().zip(all).for_each(|(to, x)| *to = x),
        }
    }

    #[inline(always)]
    fn write(self, to: &mut [f32], at: usize) {
        to[at..at + 4].copy_from_slice(&self.to_array());
    }

    #[inline(always)]
    fn write_integer(self, to: &mut [u32], at: usize) {
        to[at..at + 4].copy_from_slice(&self.fast_trunc_int().to_array().map(|x| x as u32));
    }
}
