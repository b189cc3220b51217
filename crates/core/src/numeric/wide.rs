//! Plain loops compiled for the widest vectors of the processor.
//!
//! Operations and their order are the same on every machine, only some run in parallel. No sum is reordered or
//! contracted, so the bits do not depend on the processor.

/// Runs the function `work`, compiled for the instruction set of this processor, together with all functions inlined
/// into it.
///
/// Each call site compiles every version, so there are few versions. Test builds omit AVX-512, since they are compiled
/// often and rarely run for long. There is no SSE4.2 version, since these loops gain nothing from it.
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
    // On other architectures the compiler's default instruction set already includes these vectors.
    work()
}
