//! The light that leaves each block of directions, at each wavelength: directional albedo, flux, or a phase function's integral.
//!
//! It is Σ sample · weight over the last triangle axis; the weight is the cell's solid angle, projected for quantities that go
//! with a cosine. A block is one entry of all axes before the triangles. Masked samples do not count.

use crate::domain::{Axis, Quantity, TriangleMesh};
use crate::numeric::wide;
use serde::Serialize;

/// How far the light of the decoded file is from that of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LightReport {
    /// The largest relative error over blocks and wavelengths that have light.
    pub largest: f64,
    /// Its root mean square.
    pub rms: f64,
    /// The largest light of a block in the measurement: an albedo above 1 is none.
    pub brightest: f64,
}

/// How the samples of a tensor add up.
pub(crate) struct Light {
    weights: Vec<f64>,
    inner: usize,
}

impl Light {
    /// `None` where there are no triangles.
    pub(crate) fn of(quantity: Quantity, axes: &[Axis]) -> Option<Self> {
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_)))?;
        let Axis::Triangles(mesh) = axes[at] else { return None };
        Some(Self { weights: weights(quantity, mesh), inner: axes[at + 1..].iter().map(Axis::len).product() })
    }

    /// Entries after the triangles.
    pub(crate) fn inner(&self) -> usize {
        self.inner
    }

    /// Sums of a tensor of `samples` samples.
    pub(crate) fn entries(&self, samples: usize) -> usize {
        samples / self.weights.len()
    }

    /// `[blocks, entries after the triangles]`
    pub(crate) fn sums(&self, samples: &[f32]) -> Vec<f64> {
        let block = self.weights.len() * self.inner;
        let mut sums = vec![0.0; samples.len() / self.weights.len()];
        wide(
            #[inline(always)]
            || {
                for (samples, sums) in samples.chunks_exact(block).zip(sums.chunks_exact_mut(self.inner)) {
                    for (row, weight) in samples.chunks_exact(self.inner).zip(&self.weights) {
                        for (sum, &s) in sums.iter_mut().zip(row) {
                            let more = *sum + weight * f64::from(s);
                            *sum = if s.is_nan() { *sum } else { more };
                        }
                    }
                }
            },
        );
        sums
    }

    /// Adds `step · k` to the logarithms of every block and entry.
    pub(crate) fn add(&self, step: f32, steps: &[i32], logs: &mut [f32]) {
        let block = self.weights.len() * self.inner;
        for (logs, steps) in logs.chunks_exact_mut(block).zip(steps.chunks_exact(self.inner)) {
            if steps.iter().all(|&k| k == 0) {
                continue;
            }
            for row in logs.chunks_exact_mut(self.inner) {
                for (log, &k) in row.iter_mut().zip(steps) {
                    *log += k as f32 * step;
                }
            }
        }
    }

    pub(crate) fn report(&self, original: &[f32], decoded: &[f32]) -> LightReport {
        let (wanted, found) = (self.sums(original), self.sums(decoded));
        let (mut largest, mut sum, mut count) = (0.0_f64, 0.0, 0_u64);
        for (&wanted, found) in wanted.iter().zip(found).filter(|(wanted, _)| **wanted > 0.0) {
            let error = (found / wanted - 1.0).abs();
            largest = largest.max(error);
            sum += error * error;
            count += 1;
        }
        let brightest = wanted.iter().fold(0.0_f64, |most, &light| most.max(light));
        LightReport { largest, rms: if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }, brightest }
    }

    /// The steps of the logarithm that take the light of `decoded` within `bound` of that of `original`; 0 where it is.
    pub(crate) fn steps(&self, bound: f64, step: f32, original: &[f32], decoded: &[f32]) -> Vec<i32> {
        let (wanted, found) = (self.sums(original), self.sums(decoded));
        wanted
            .iter()
            .zip(&found)
            .map(|(&wanted, &found)| {
                let ratio = wanted / found;
                let usable = wanted > 0.0 && found > 0.0 && ratio.is_finite();
                // Half of the bound is left to rounding and to what comes after.
                if !usable || (found / wanted - 1.0).abs() <= 0.9 * bound {
                    0
                } else {
                    libm::round(libm::log(ratio) / f64::from(step)).clamp(-1e6, 1e6) as i32
                }
            })
            .collect()
    }
}

/// What a cell counts for: its solid angle, projected for quantities that go with a cosine.
pub(crate) fn weights(quantity: Quantity, mesh: TriangleMesh) -> Vec<f64> {
    if quantity.has_cosine() {
        (0..mesh.len()).map(|cell| mesh.projected_solid_angle(cell)).collect()
    } else {
        mesh.solid_angles()
    }
}

/// The step of the logarithm for a bound of the light's relative error.
pub(crate) fn step_of(bound: f64) -> f32 {
    // Rounding to the nearest step leaves half a step.
    (1.6 * libm::log1p(bound)) as f32
}
