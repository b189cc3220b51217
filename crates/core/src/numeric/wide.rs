//! Plain loops in the widest vectors that the processor has.
//!
//! The same operations in the same order on every machine, some of them at once: no sum is reordered and nothing is
//! contracted, so the bits do not depend on the processor.

/// Runs `work`, compiled for the instructions that this processor has; what it calls comes along if it is inlined.
///
/// Every version is compiled wherever this is called, so there are few: builds for tests are made more often than run for
/// long and do without AVX-512, and what SSE4.2 adds to the oldest processor is not used by these loops.
#[inline(always)]
#[allow(clippy::inline_always, reason = "what is not inlined is compiled for the oldest processor")]
pub fn wide<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        use fearless_simd::{Level, Simd};
        let level = Level::new();
        #[cfg(not(debug_assertions))]
        if let Some(avx512) = level.as_avx512() {
            return avx512.vectorize(work);
        }
        if let Some(avx2) = level.as_avx2() {
            return avx2.vectorize(work);
        }
    }
    // Elsewhere the least processor has the vectors that the compiler uses anyway.
    work()
}
