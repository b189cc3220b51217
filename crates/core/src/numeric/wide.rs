//! Plain loops in the widest vectors that the processor has.
//!
//! The same operations in the same order on every machine, some of them at once: no sum is reordered and nothing is
//! contracted, so the bits do not depend on the processor.

use fearless_simd::{Level, Simd, dispatch};

/// Runs `work`, compiled for the instructions that this processor has; what it calls comes along if it is inlined.
#[inline(always)]
#[allow(clippy::inline_always, reason = "what is not inlined is compiled for the oldest processor")]
pub fn wide<R>(work: impl FnOnce() -> R) -> R {
    dispatch!(Level::new(), simd => simd.vectorize(work))
}
