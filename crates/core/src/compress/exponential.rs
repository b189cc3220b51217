//! Conversion of logarithms to samples: corrections, and the decoder's exponential.

use crate::numeric::exponential::exp_f64;
use crate::numeric::wide;
use rayon::prelude::*;

/// Adds the correction `steps[i]` · `step` to the logarithm of each sample i.
pub(crate) fn add_corrections(step: f32, steps: &[i32], logs: &mut [f32]) {
    logs.par_chunks_mut(1 << 14).zip(steps.par_chunks(1 << 14)).for_each(|(logs, steps)| {
        for (log, &k) in logs.iter_mut().zip(steps) {
            *log += k as f32 * step;
        }
    });
}

/// Replaces natural logarithms by the magnitudes they stand for.
pub(crate) fn exponentiate(logs: &mut [f32]) {
    logs.par_chunks_mut(1 << 14).for_each(|chunk| {
        wide(
            #[inline(always)]
            || chunk.iter_mut().for_each(|value| *value = exp_f64(f64::from(*value)) as f32),
        );
    });
}
