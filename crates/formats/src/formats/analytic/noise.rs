//! Seeded measurement noise, bit-identical on every machine: PCG and Box–Muller on portable elementary functions.

use super::document::Noise;
use crate::numeric::random::open;
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// Stream of independent normal random numbers with mean 0 and variance 1 (Box & Muller 1958).
struct Normal {
    uniform: Pcg64,
    spare: Option<f64>,
}

impl Normal {
    fn new(seed: u64) -> Self {
        Self { uniform: Pcg64::seed_from_u64(seed), spare: None }
    }

    fn next(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * libm::log(open(&mut self.uniform))).sqrt();
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * open(&mut self.uniform));
        self.spare = Some(radius * sin);
        radius * cos
    }
}

/// Adds simulated noise to the samples in their order.
pub(super) fn disturb(samples: &mut [f32], noise: Noise) {
    let mut normal = Normal::new(noise.seed);
    for sample in samples {
        let mut value = f64::from(*sample);
        if noise.relative > 0.0 {
            value *= 1.0 + noise.relative * normal.next();
        }
        if noise.absolute > 0.0 {
            value += noise.absolute * normal.next();
        }
        *sample = value as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_moments_of_a_normal_distribution() {
        const N: usize = 200_000;
        for (noise, expected) in [
            (Noise { relative: 0.01, absolute: 0.0, seed: 7 }, 0.02),
            (Noise { relative: 0.0, absolute: 0.5, seed: 8 }, 0.5),
        ] {
            let mut samples = vec![2.0_f32; N];
            disturb(&mut samples, noise);
            let t: Vec<f64> = samples.iter().map(|&s| (f64::from(s) - 2.0) / expected).collect();
            let moment = |k: i32| t.iter().map(|t| t.powi(k)).sum::<f64>() / N as f64;
            // Five standard errors: √(1/N), √(2/N), √(15/N), √(96/N).
            let error = 5.0 / (N as f64).sqrt();
            assert!(moment(1).abs() < error, "{}", moment(1));
            assert!((moment(2) - 1.0).abs() < 1.5 * error, "{}", moment(2));
            assert!(moment(3).abs() < 4.0 * error && (moment(4) - 3.0).abs() < 10.0 * error);
            // Neighbours are uncorrelated.
            let product = t.array_windows().map(|[a, b]| a * b).sum::<f64>() / N as f64;
            assert!(product.abs() < error, "{product}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_noise() {
        let noisy = |seed| {
            let mut samples = vec![1.0_f32; 9];
            disturb(&mut samples, Noise { relative: 0.1, absolute: 0.0, seed });
            samples
        };
        assert_eq!(noisy(1), noisy(1));
        assert_ne!(noisy(1), noisy(2));
        // Identical on all machines and in all versions: a change here changes published digests.
        assert_eq!(noisy(1)[..2].iter().map(|s| s.to_bits()).collect::<Vec<_>>(), GOLDEN);
    }

    const GOLDEN: [u32; 2] = [1_065_845_864, 1_065_406_974];
}
